"""How far a cell may lie from a right model, and how the errors of neighbours hang together.

No model of the limb is right to better than some 10 %, smoothly over the disc: clouds differ along it, the map's
contrast with them. Treated as independent, such errors make intervals nine times too narrow. So the covariance of
the log residuals is

    s^2 D (noise and errors of each cell by itself) + a^2 A A' (smooth errors common to the channels) + c^2 C C' (of
    each channel) + u^2 U U' (of a limb that is uneven, broad) + B B' (of values near black, and what bends there)

with D of a block for the three values of each cell, the others of low rank: a multiplication by its inverse root costs
two thin matrix products. How large s, a, c and u are, the photograph says itself (`inverse.noise_fit`).

What bends has a mean, too, its excess: errors lift values near black by up to four of their own errors, if the camera's
matrix and black are what they are thought to be. Taken for granted, that ruled out the true limbs of two in 60 drawn
photographs (log posteriors 16 and 146 below the best; 11 and 10 now), and so it is in B for each channel as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from inverse.error_modes import black_modes, smooth_modes
from inverse.whitener import Alone, Whitener, whitener

# Relative errors of the light of one cell, alike in all channels (craters, the map's own errors) and in each. Local
# misfits of photographs of 2015 and 2022 are 1.6-3.5 % and 0.6-2.4 % (python -m benchmarks.local_errors).
RELIEF, TINT = 0.035, 0.012
# Relative errors of the sky's brightness beside the Moon, all over it, since glare is modelled coarsely, and of the
# colours of each of its cells: JPEG rounds those of a flat sky alike over dozens of cells, so that they do not average.
SKY, SKY_TINT = 0.3, 0.1
COMMON = 0.10  # amplitude of the smooth error common to the channels
CHROMATIC = 0.04  # amplitude of that of each channel
# Amplitude of the light's differences from one side of the shadow to another: in the dozen photographs of 2015, 2022
# and 2025 that show enough of the umbra 5 to 60 %, half of them below 11 %.
UNEVEN = 0.1
COLOURED = 0.3  # how far they differ between the channels, in units of their amplitude
BLACK = 1e-3  # full scale: some three codes of a black pixel in an 8-bit file
BLACK_LINEAR = 1e-4  # of the brightest value: some two counts of 14 bits, as well as sensors know their black


@dataclass(frozen=True)
class Errors:
    """Errors of the log values of one photograph.

    - `cells`: D, a covariance for the values of each cell (cell, value, value).
    - `modes`: A, C, U and B side by side (datum, mode); `common`, `broad`, `black`: how many are A's, U's, and B's.
    - `excess`: mean of the errors (datum,): of a value that bends with the light, large ones do not average out.
    - `independent`, `smooth`, `chromatic`, `uneven`: s, a, c, u.
    - `outlying`: by what D is larger where a value belongs to no model: a star, a hot pixel (datum,).
    - `shared`: how many of A's modes, the last ones, it has in common with other photographs of a series, and as many
      of each channel's (`inverse.shared_errors`); where there are any, all of U's as well.
    - `variances`: of every datum, one of which no more than a limit is known included, by what makes them: D, A, C and
      U, of amplitude 1 (kind, datum).
    """

    cells: np.ndarray
    modes: np.ndarray
    common: int
    broad: int = 0
    black: int = 0
    independent: float = 1.0
    smooth: float = COMMON
    chromatic: float = CHROMATIC
    uneven: float = UNEVEN
    outlying: np.ndarray | float = 1.0
    shared: int = 0
    variances: np.ndarray = field(default_factory=lambda: np.zeros((4, 1)))
    excess: np.ndarray | float = 0.0

    @cached_property
    def sigma(self) -> np.ndarray:
        """Roots of the diagonal of D (datum,)."""
        return np.sqrt(np.diagonal(self.cells, axis1=1, axis2=2)).ravel()

    @property
    def scale(self) -> np.ndarray:
        """Standard deviation of the errors of each cell by itself (datum,)."""
        return self.independent * self.sigma * np.sqrt(self.outlying)

    @property
    def sizes(self) -> np.ndarray:
        """s, a, c and u."""
        return np.array([self.independent, self.smooth, self.chromatic, self.uneven])

    @property
    def whole(self) -> np.ndarray:
        """Standard deviation of all errors of each datum together, limits included (datum,)."""
        return np.sqrt(self.sizes**2 @ self.variances)

    @property
    def amplitudes(self) -> np.ndarray:
        """Of each mode (mode,)."""
        return np.append(1.0, self.sizes[1:])[self.kinds]

    @property
    def kinds(self) -> np.ndarray:
        """1 for the modes of A, 2 for C's, 3 for U's, 0 for B's (mode,)."""
        rest = self.modes.shape[1] - self.common - self.broad - self.black
        return np.repeat([1, 2, 3, 0], [self.common, rest, self.broad, self.black])

    @cached_property
    def alone(self) -> Alone:
        """Multiplies by the inverse root of s^2 D."""
        wide = (self.independent * np.sqrt(self.outlying) * np.ones(self.sigma.size)).reshape(len(self.cells), -1)
        return Alone(np.linalg.inv(np.linalg.cholesky(wide[:, :, None] * self.cells * wide[:, None])))

    @cached_property
    def whitener(self) -> Whitener:
        """Multiplies by the inverse root of the covariance."""
        return whitener(self.alone, self.modes * self.amplitudes)

    @property
    def is_shared(self) -> np.ndarray:
        """Whether each mode is one of those that are shared (mode,)."""
        if self.shared == 0:
            return np.zeros(self.kinds.size, dtype=bool)
        last = np.arange(self.kinds.size) % self.common >= self.common - self.shared
        return (self.kinds == 3) | ((self.kinds > 0) & last)

    @cached_property
    def shared_modes(self) -> np.ndarray:
        """Of their standard deviations (datum, mode)."""
        return (self.modes * self.amplitudes)[:, self.is_shared]

    @cached_property
    def own_whitener(self) -> Whitener:
        """The `whitener` of what is not shared."""
        if self.shared == 0:
            return self.whitener
        return whitener(self.alone, (self.modes * self.amplitudes)[:, ~self.is_shared])

    def without_smooth(self) -> "Errors":
        """The same variance of every datum, all of it independent: what is usually assumed, and wrong."""
        variance = (self.scale**2 + np.sum((self.modes * self.amplitudes) ** 2, axis=1)).reshape(len(self.cells), -1)
        cells = variance[:, :, None] * np.eye(variance.shape[1])
        none = np.zeros((variance.size, 1))
        return replace(
            self, cells=cells, modes=none, common=1, broad=0, black=0, independent=1.0, outlying=1.0, shared=0
        )


def sky_modes(position: np.ndarray) -> np.ndarray:
    """Errors of the sky's brightness, in units of `COMMON` (cell, mode): as a whole, to either side, by the distance.

    Hundreds of cells of the sky would else know the glare to a hundredth, and what it takes from the disc's contrast.

    - `position`: (cell, 2) [radii of the disc].
    """
    distance = np.linalg.norm(position, axis=1)
    modes = np.stack([np.ones(len(position)), *position.T / distance.max(initial=1.0), distance - 1.3], axis=1)
    return SKY / COMMON * modes


def modes_of(
    position: np.ndarray, offset: np.ndarray, on_disc: np.ndarray, shared: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Modes of the disc's cells, of the sky's, and those that are shared, side by side (cell, mode).

    And the variance of smooth errors that they leave out (cell,).

    - `position`: (cell, 2) [radii of the disc]; `offset`: from the shadow's axis (cell,) [rad]; `on_disc`: (cell,).
    - `shared`: with other photographs (cell, mode).
    """
    known = None if shared is None else shared[on_disc]
    disc, rest = smooth_modes(position[on_disc], offset[on_disc], known)
    sky, left = sky_modes(position[~on_disc]), np.zeros(on_disc.size)
    left[on_disc] = rest
    modes = np.zeros((on_disc.size, disc.shape[1] + sky.shape[1]))
    modes[on_disc, : disc.shape[1]] = disc
    modes[~on_disc, disc.shape[1] :] = sky
    return (modes if shared is None else np.concatenate([modes, shared], axis=1)), left


def black_error(value: np.ndarray, usable: np.ndarray, tone_curve: str) -> float:
    """Standard deviation of values near black [full scale].

    - `value`, `usable`: (cell, 3); `tone_curve`: "linear", or that of a picture.
    """
    return BLACK_LINEAR * float(np.max(value, where=usable, initial=0.0)) if tone_curve == "linear" else BLACK


class Bending(NamedTuple):
    """How log values bend with errors of the light (cell, value) each, averaged over these.

    - `alike`: change by the log light of all channels together.
    - `together`, `apart`: standard deviations of what no straight line has, for errors of all channels and of each.
    - `excess`: mean above what there is without errors.
    """

    alike: np.ndarray
    together: np.ndarray
    apart: np.ndarray
    excess: np.ndarray


@dataclass(frozen=True)
class Sources:
    """Where the errors of (cell, channel) log values come from.

    - `noise`: of the pixels, in log value (cell, 3); where not usable, what misfits are divided by there.
    - `relief`: relative error of each cell's light, alike in all channels (cell,).
    - `smooth`, `left`: of `modes_of` (cell, mode), (cell,).
    - `broad`, `bent`: of `error_modes.broad_modes` and of its `bent_modes` (cell, mode).
    - `floor`: of the log values; `black`: of `black_error` [full scale].
    - `usable`: (cell, 3); `on_disc`: (cell,).
    - `shared`: how many of `smooth`, the last ones, are shared with other photographs.
    """

    noise: np.ndarray
    relief: np.ndarray
    smooth: np.ndarray
    left: np.ndarray
    broad: np.ndarray
    bent: np.ndarray
    floor: float
    black: float
    usable: np.ndarray
    on_disc: np.ndarray
    shared: int = 0

    @property
    def tint(self) -> np.ndarray:
        """Relative error of each cell's light in each channel (cell,)."""
        return np.where(self.on_disc, TINT, SKY_TINT)

    def sizes(self, smooth: float, chromatic: float, uneven: float) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations of errors of the light of these amplitudes, of all channels and of each (cell,)."""
        each, broad = (np.sum(modes**2, axis=1) * self.on_disc for modes in (self.smooth, self.broad))
        of_colour = (COLOURED * uneven) ** 2 * broad + chromatic**2 * each + TINT**2
        return np.sqrt(uneven**2 * broad + smooth**2 * each), np.sqrt(of_colour)

    def errors(
        self,
        value: np.ndarray,
        response: np.ndarray,
        bending: Bending | None = None,
        smooth: float = COMMON,
        chromatic: float = CHROMATIC,
    ) -> Errors:
        """Errors of the light, as a camera makes errors of its values of them, and those of values near black.

        The map and the limb err in light; a camera's matrix takes most of the red from the green and the blue of a
        deep red Moon, and makes the errors of their colour several times as large.

        - `value`: decoded (cell, 3) [full scale].
        - `response`: change of each log value by the log light of each channel (cell, value, light).
        - `bending`: what is no straight line in that; by default nothing.
        - `smooth`, `chromatic`: amplitudes of what modes leave out of the smooth errors.
        """
        variances = self._variances(value, response)
        response = np.where(self.usable[..., None], response, 0.0)
        alike = response.sum(axis=2) if bending is None else bending.alike * self.usable
        by_channel = np.moveaxis(response, 2, 0)
        over_disc = _of_values([alike, *by_channel], self.smooth)
        broad = _of_values([alike, *(COLOURED * by_channel)], self.broad)
        # What the modes leave of the smooth errors' variance is as good as independent from cell to cell.
        relief = np.sqrt(self.relief**2 + smooth**2 * self.left)[:, None] * alike
        tint = (self.tint**2 + chromatic**2 * self.left)[:, None, None]
        cells = relief[:, :, None] * relief[:, None] + tint * response @ np.swapaxes(response, 1, 2)
        cells = cells + np.square(self.noise)[:, :, None] * np.eye(self.noise.shape[1])
        fixed = black_modes(value, self.floor, self.usable, self.black)
        if bending is not None:
            bent = _of_values([bending.together * self.usable, bending.apart * self.usable], self.bent)
            # An excess is as large as the camera's matrix and black have it, and so known to no better than itself.
            unsure = (bending.excess * self.usable)[:, :, None] * np.eye(self.noise.shape[1])
            fixed = np.concatenate([fixed, unsure.reshape(len(bent), -1), bent], axis=1)
        modes, counts = np.concatenate([over_disc, broad, fixed], axis=1), (broad.shape[1], fixed.shape[1])
        return Errors(
            cells, modes, self.smooth.shape[1], *counts, shared=self.shared, variances=variances,
            excess=0.0 if bending is None else bending.excess.ravel(),
        )  # fmt: skip

    def _variances(self, value: np.ndarray, response: np.ndarray) -> np.ndarray:
        """`Errors.variances`."""
        alike, each = np.square(response.sum(axis=2)), np.square(response).sum(axis=2)
        black = self.black / (np.maximum(value, 0.0) + self.floor)
        alone = self.relief[:, None] ** 2 * alike + self.tint[:, None] ** 2 * each + black**2
        on_disc = self.on_disc[:, None]
        kinds = [alone, on_disc * alike, on_disc * each, on_disc * (alike + COLOURED**2 * each)]
        return np.stack(kinds).reshape(len(kinds), -1)


def _of_values(responses: Sequence[np.ndarray], modes: np.ndarray) -> np.ndarray:
    """Modes of values, side by side (datum, mode), of those of the light (cell, mode) by responses (cell, value)."""
    blocks = [by[..., None] * modes[:, None] for by in responses]
    return np.concatenate(blocks, axis=2).reshape(modes.shape[0] * responses[0].shape[1], -1)
