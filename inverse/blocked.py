"""A photograph by blocks of its cells: few data, whose errors have whole kernels for a covariance, not modes.

Means over blocks tell nearly what all cells do, as errors of limb and map hardly change within one: standard deviations
of the limb are those of a fit to 12 %, but that of the temperature, which is seen in fine patterns, to 40 %, and what a
second photograph leaves of the ozone's, seen in what is nearly black, to 35 % (`tests/test_further.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.linalg import block_diag

from inverse import noise
from inverse.error_modes import centred
from inverse.likelihood import misfit_and_slopes, response
from inverse.limb_light import Shadow
from inverse.observed import observed
from inverse.photo_model import PhotoModel
from inverse.shared_errors import SHARED, Kernel, Places, covariance, places_of, unevenness

EVERY = 3  # cells of a block, one stands for in the covariance of its light with others


class Blocks:
    """Which cells of a photograph are in which block of the disc; the sky is the last block, as a whole.

    - `members`: 1 or 0 (block, cell).
    - `seen`: cells that stand for their blocks (cell,); `weights`: of those in the mean of each of the disc's.
    """

    def __init__(self, model: PhotoModel, along_radius: int):
        on_disc = np.asarray(model.on_disc) > 0
        square = np.floor(along_radius * np.stack([model.cells.right, model.cells.up], axis=1))
        square[~on_disc] = square.max() + 1.0
        which = np.unique(square, axis=0, return_inverse=True)[1].ravel()
        self.members = (which == np.arange(which.max() + 1)[:, None]).astype(float)
        rank = np.sum(np.cumsum(self.members, axis=1) * self.members, axis=0) - 1.0
        self.seen = np.flatnonzero(on_disc & (rank % EVERY == 0.0))
        seen = self.members[:-1, self.seen]
        self.weights = seen / seen.sum(axis=1)[:, None]

    def means(self, values: np.ndarray, usable: np.ndarray) -> np.ndarray:
        """Of usable values (cell, channel, column) in each block (block, channel, column); 0 where there are none."""
        total = np.tensordot(self.members, values * usable[..., None], axes=1)
        return total / np.maximum(self.members @ usable, 1.0)[..., None]

    def covariances(self, cells: np.ndarray, usable: np.ndarray) -> np.ndarray:
        """Of those means, where each cell has a covariance by itself (cell, channel, channel)."""
        total = np.tensordot(self.members, cells * usable[:, :, None] * usable[:, None], axes=1)
        count = np.maximum(self.members @ usable, 1.0)
        return total / (count[:, :, None] * count[:, None])


@dataclass(frozen=True, eq=False)
class Placed:
    """Blocks of the disc, where it is at some time; `places`: of the cells that stand for them."""

    blocks: Blocks
    places: Places

    @classmethod
    def of(cls, blocks: Blocks, model: PhotoModel) -> "Placed":
        """As the model has it."""
        places, seen = places_of(model), blocks.seen
        return cls(blocks, Places(places.disc[seen], places.shadow[seen], places.on_disc[seen]))


@lru_cache(maxsize=512)  # exposures of one time have the same, with each of some dozen photographs
def _between(kernel: Kernel, one: Placed, other: Placed) -> np.ndarray:
    """A covariance of cells, of the means over blocks of two photographs (block, block)."""
    return one.blocks.weights @ centred(kernel(one.places, other.places)) @ other.blocks.weights.T


@dataclass(frozen=True)
class Blocked:
    """Means of the log values of one photograph, over blocks and for each channel.

    - `slopes`: of misfits by limb and nuisances (datum, parameter).
    - `by_light`: of the means by those of the log light, of all channels together, then of each (datum, 4 x block).
    - `alone`: covariance of their own errors, which are not of limb or map (datum, datum).
    - `sizes`: amplitudes of the smooth, chromatic and uneven errors of the light.
    - `placed`: its blocks.
    """

    slopes: np.ndarray
    by_light: np.ndarray
    alone: np.ndarray
    sizes: np.ndarray
    placed: Placed

    @property
    def covariance(self) -> np.ndarray:
        """Of all errors (datum, datum)."""
        return self._of_light(self, 1.0) + self.alone

    def covariance_with(self, other: "Blocked") -> np.ndarray:
        """With the data of another photograph (datum, datum)."""
        return self._of_light(other, SHARED)

    def _of_light(self, other: "Blocked", shared: float) -> np.ndarray:
        smooth, chromatic, uneven = self.sizes * other.sizes
        over_disc = shared * _between(covariance, self.placed, other.placed)
        broad = uneven * _between(unevenness, self.placed, other.placed)
        apart = chromatic * over_disc + noise.COLOURED**2 * broad
        return self.by_light @ block_diag(smooth * over_disc + broad, apart, apart, apart) @ other.by_light.T


def blocked(
    model: PhotoModel, sources: noise.Sources, sizes: noise.Errors, z: Float[Array, " nuisance"], placed: Placed,
    shadow: Shadow, light, slopes,
) -> Blocked:  # fmt: skip
    """A photograph by blocks, as the model has it.

    - `sources`: of its errors; only those of the pixels, of each cell and near black are looked at.
    - `sizes`: errors whose `sizes` those of the light have.
    - `light`, `slopes`: of the shadow's table, as `limb_light.shadow_slopes` gives them.
    """
    cells, blocks = len(sources.on_disc), placed.blocks
    amplitudes = (jnp.asarray(size) for size in sources.sizes(*sizes.sizes[1:]))
    value, by_light, *bending = map(np.asarray, response(model, shadow.table(light), z, *amplitudes))
    position = np.stack([model.cells.right, model.cells.up], axis=1)
    sky = noise.sky_modes(position) * ~sources.on_disc[:, None]
    rest = replace(sources, smooth=sky, left=np.zeros(cells), broad=np.zeros((cells, 0)), shared=0)
    errors = rest.errors(value, by_light, noise.Bending(*bending))
    errors = replace(errors, independent=sizes.independent, smooth=sizes.smooth, chromatic=sizes.chromatic)
    measured = observed(np.zeros(value.shape), np.ones(value.shape), np.zeros(value.shape), errors.whole)
    _, by = misfit_and_slopes(model, measured, shadow, light, slopes, z)

    usable = sources.usable.astype(float)
    shown = (blocks.members @ usable).ravel() > 0.0
    means = lambda values: blocks.means(values.reshape(*value.shape, -1), usable)
    answer = means(np.concatenate([bending[0][..., None], by_light], axis=2))
    by_block = answer[..., None] * np.eye(len(answer))[:, None, None, :-1]
    modes = means(errors.modes * errors.amplitudes).reshape(shown.size, -1)
    alone = block_diag(*blocks.covariances(sizes.independent**2 * errors.cells, usable)) + modes @ modes.T
    return Blocked(
        means(np.asarray(by)).reshape(shown.size, -1)[shown], by_block.reshape(shown.size, -1)[shown],
        alone[np.ix_(shown, shown)], sizes.sizes[1:], placed,
    )  # fmt: skip


class Information:
    """What photographs by blocks tell of parameters, beside the prior, and what one more tells.

    - `count`: of all parameters.
    """

    def __init__(self, photographs: Sequence[Blocked], columns: Sequence[np.ndarray], count: int):
        self.photographs = photographs
        self.slopes = np.concatenate([_spread(*item, count) for item in zip(photographs, columns, strict=True)])
        rows = [[one.covariance if one is other else one.covariance_with(other) for other in photographs]
                for one in photographs]  # fmt: skip
        self.inverse = np.linalg.inv(np.block(rows))
        self.matrix = np.eye(count) + self.slopes.T @ self.inverse @ self.slopes

    def with_further(self, one: Blocked, columns: np.ndarray) -> np.ndarray:
        """On all parameters with a further photograph (parameter, parameter)."""
        shared = np.concatenate([other.covariance_with(one) for other in self.photographs])
        known = shared.T @ self.inverse
        slopes = _spread(one, columns, len(self.matrix)) - known @ self.slopes
        return self.matrix + slopes.T @ np.linalg.solve(one.covariance - known @ shared, slopes)


def _spread(one: Blocked, columns: np.ndarray, count: int) -> np.ndarray:
    """Slopes by all parameters (datum, parameter)."""
    everywhere = np.zeros((len(one.slopes), count))
    everywhere[:, columns] = one.slopes
    return everywhere
