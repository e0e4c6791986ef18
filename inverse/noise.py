"""How far a cell may lie from a right model, and how the errors of neighbours hang together.

No model of the limb is right to better than some 10 %, smoothly over the disc: clouds differ along it, the map's
contrast with them. Treated as independent, such errors make intervals nine times too narrow. So the covariance of
the log residuals is

    s^2 D (noise and independent error of each cell) + a^2 A A' (smooth errors common to the channels) + c^2 C C' (of
    each channel)

with A and C of low rank: a multiplication by its inverse root costs two thin matrix products. How large s, a and c
are, the photograph says itself (`inverse.noise_fit`).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import eigh

INDEPENDENT = 0.05  # relative error of one cell: craters and the map's own errors
SKY = 0.3  # relative error of the sky's brightness beside the Moon, all over it: glare is modelled coarsely
COMMON = 0.10  # amplitude of the smooth error common to the channels
CHROMATIC = 0.04  # amplitude of that of each channel
LENGTH = 0.35  # of the disc's radius, about 6 arcmin
RADIAL = 1e-3  # rad: 3.4 arcmin
MODES = 50  # common to the channels, and as many for each


@dataclass(frozen=True)
class Errors:
    """Errors of the log values of one photograph.

    - `sigma`: root of D (datum,).
    - `modes`: A and C side by side (datum, mode); `common`: how many of them are A's.
    - `independent`, `smooth`, `chromatic`: s, a, c.
    - `outlying`: by what D is larger where a cell belongs to no model: a star, a hot pixel (datum,).
    """

    sigma: np.ndarray
    modes: np.ndarray
    common: int
    independent: float = 1.0
    smooth: float = COMMON
    chromatic: float = CHROMATIC
    outlying: np.ndarray | float = 1.0

    @property
    def scale(self) -> np.ndarray:
        """Standard deviation of the independent errors (datum,)."""
        return self.independent * self.sigma * np.sqrt(self.outlying)

    @property
    def amplitudes(self) -> np.ndarray:
        """Of each mode (mode,)."""
        return np.where(np.arange(self.modes.shape[1]) < self.common, self.smooth, self.chromatic)

    @cached_property
    def whitener(self) -> "Whitener":
        """Multiplies by the inverse root of the covariance."""
        return whitener(self.scale, self.modes * self.amplitudes)

    @property
    def log_determinant(self) -> float:
        """Of the covariance."""
        return 2.0 * float(np.log(self.scale).sum() - np.log1p(self.whitener.shrink).sum())

    def without_smooth(self) -> "Errors":
        """The same variance of every datum, all of it independent: what is usually assumed, and wrong."""
        variance = self.scale**2 + np.sum((self.modes * self.amplitudes) ** 2, axis=1)
        return replace(self, sigma=np.sqrt(variance), independent=1.0, outlying=1.0, smooth=1e-9, chromatic=1e-9)


@dataclass(frozen=True)
class Whitener:
    """Multiplies residuals by C^(-1/2), C = diag(sigma^2) + L L'.

    - `sigma`: (datum,); `basis`: orthonormal (datum, rank); `shrink`: 1 / sqrt(1 + eigenvalue) - 1 (rank,).
    """

    sigma: np.ndarray
    basis: np.ndarray
    shrink: np.ndarray

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Of residuals (datum,) or of many side by side (datum, column)."""
        scaled = (residual.T / self.sigma).T
        return scaled + self.basis @ ((self.basis.T @ scaled).T * self.shrink).T


def whitener(sigma: np.ndarray, low_rank: np.ndarray) -> Whitener:
    """From the standard deviations (datum,) and L (datum, rank)."""
    scaled = low_rank / sigma[:, None]
    # The eigenvectors of the small L'L: an SVD of the tall matrix costs ten times as much.
    eigenvalue, vector = np.linalg.eigh(scaled.T @ scaled)
    kept = eigenvalue > 1e-9 * max(eigenvalue.max(), 1e-300)
    basis = np.where(kept, scaled @ vector / np.sqrt(np.where(kept, eigenvalue, 1.0)), 0.0)
    shrink = np.where(kept, 1.0 / np.sqrt(1.0 + np.where(kept, eigenvalue, 0.0)) - 1.0, 0.0)
    return Whitener(sigma, basis, shrink)


def smooth_modes(position: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """L of the covariance of smooth errors, of variance 1 (cell, mode).

    Half of it exp(-distance / LENGTH) over the disc: rough at every scale, as the misfits of real photographs are.
    Half of it exp(-difference / RADIAL) of the offsets from the shadow's axis: limbs that differ from one another, as
    the Earth's do, wash out every sharp feature that a symmetric one has. The `MODES` with the largest variance; what
    is left of it is independent from cell to cell, and the amplitude of independent errors is fitted.

    - `position`: on the disc, in its radii (cell, 2); `offset`: (cell,) [rad].
    """
    apart = np.linalg.norm(position[:, None] - position, axis=-1)
    farther = np.abs(offset[:, None] - offset)
    covariance = 0.5 * np.exp(-apart / LENGTH) + 0.5 * np.exp(-farther / RADIAL)
    last = len(position) - 1
    # Of the mean over the disc it says nothing: the exposure is free to meet it, and else meets it no more.
    covariance = covariance - covariance.mean(axis=0) - covariance.mean(axis=1)[:, None] + covariance.mean()
    values, vectors = eigh(covariance, subset_by_index=(max(0, last + 1 - MODES), last))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def sky_modes(position: np.ndarray) -> np.ndarray:
    """Errors of the sky's brightness, in units of `COMMON` (cell, mode): as a whole, to either side, by the distance.

    Hundreds of cells of the sky would else know the glare to a hundredth, and what it takes from the disc's contrast.

    - `position`: (cell, 2) [radii of the disc].
    """
    distance = np.linalg.norm(position, axis=1)
    modes = np.stack([np.ones(len(position)), *position.T / distance.max(initial=1.0), distance - 1.3], axis=1)
    return SKY / COMMON * modes


def modes_of(position: np.ndarray, offset: np.ndarray, on_disc: np.ndarray) -> np.ndarray:
    """Modes of the disc's cells and of the sky's side by side (cell, mode).

    - `position`: (cell, 2) [radii of the disc]; `offset`: from the shadow's axis (cell,) [rad]; `on_disc`: (cell,).
    """
    disc, sky = smooth_modes(position[on_disc], offset[on_disc]), sky_modes(position[~on_disc])
    modes = np.zeros((on_disc.size, disc.shape[1] + sky.shape[1]))
    modes[on_disc, : disc.shape[1]] = disc
    modes[~on_disc, disc.shape[1] :] = sky
    return modes


@dataclass(frozen=True)
class Sources:
    """Where the errors of (cell, channel) log values come from.

    - `noise`: of the pixels, in log value (cell, 3); where not usable, what misfits are divided by there.
    - `light`: relative error of each cell's light in each channel (cell,).
    - `smooth`: modes of `smooth_modes` and of `sky_modes` (cell, mode).
    - `usable`: (cell, 3).
    """

    noise: np.ndarray
    light: np.ndarray
    smooth: np.ndarray
    usable: np.ndarray

    def errors(self, response: np.ndarray) -> Errors:
        """Errors of the light, as a camera makes errors of its values of them.

        The map and the limb err in light; a camera's matrix takes most of the red from the green and the blue of a
        deep red Moon, and makes their errors several times as large.

        - `response`: change of each log value by the log light of each channel (cell, value, light).
        """
        response = np.where(self.usable[..., None], response, 0.0)
        rank = self.smooth.shape[1]
        blocks = [
            (by[..., None] * self.smooth[:, None]).reshape(-1, rank)
            for by in (response.sum(axis=2), *np.moveaxis(response, 2, 0))
        ]
        sigma = np.sqrt(self.noise**2 + np.square(self.light[:, None]) * np.square(response).sum(axis=2))
        return Errors(sigma.ravel(), np.concatenate(blocks, axis=1), rank)
