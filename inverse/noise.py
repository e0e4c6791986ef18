"""How far a cell may lie from a right model, and how the errors of neighbours hang together.

No model of the limb is right to better than some 10 %, smoothly over the disc: clouds differ along it, the map's
contrast with them. Treated as independent, such errors make intervals nine times too narrow. So the covariance of
the log residuals is

    D (noise and independent error of each cell) + G (smooth errors, common and by channel) + J J' (linearised
    nuisances)

with G and J of low rank: C^(-1/2) costs two thin matrix products.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

INDEPENDENT = 0.05  # relative error of one cell: craters and the map's own errors
SKY = 0.3  # relative error of the sky's brightness beside the Moon: glare is modelled coarsely
COMMON = 0.10  # amplitude of the smooth error common to the channels
CHROMATIC = 0.04  # amplitude of that of each channel
LENGTH = 0.35  # of the disc's radius, about 6 arcmin


class Whitener(eqx.Module):
    """Multiplies residuals by C^(-1/2), C = diag(sigma^2) + L L'."""

    sigma: Float[Array, " datum"]
    basis: Float[Array, "datum rank"]
    """Orthonormal."""
    shrink: Float[Array, " rank"]
    """1 / sqrt(1 + eigenvalue) - 1."""

    def __call__(self, residual: Float[Array, " datum"]) -> Float[Array, " datum"]:
        scaled = residual / self.sigma
        return scaled + self.basis @ ((scaled @ self.basis) * self.shrink)


def whitener(sigma: np.ndarray, low_rank: np.ndarray) -> Whitener:
    """From the standard deviations (datum,) and L (datum, rank)."""
    scaled = low_rank / sigma[:, None]
    # The eigenvectors of the small L'L: an SVD of the tall matrix costs ten times as much.
    eigenvalue, vector = np.linalg.eigh(scaled.T @ scaled)
    kept = eigenvalue > 1e-9 * eigenvalue.max()
    basis = np.where(kept, scaled @ vector / np.sqrt(np.where(kept, eigenvalue, 1.0)), 0.0)
    shrink = np.where(kept, 1.0 / np.sqrt(1.0 + np.where(kept, eigenvalue, 0.0)) - 1.0, 0.0)
    return Whitener(jnp.asarray(sigma), jnp.asarray(basis), jnp.asarray(shrink))


def smooth_modes(position: np.ndarray, length: float = LENGTH, variance: float = 0.99) -> np.ndarray:
    """L of a unit squared-exponential covariance over positions (cell, dimension): (cell, mode).

    Through inducing points half a length apart (Nystroem), which keep all that is smooth, then truncated.

    - `length`: correlation length, in the unit of the positions.
    - `variance`: share kept by the truncation.
    """
    lines = [np.arange(low - 0.5 * length, high + length, 0.6 * length)
             for low, high in zip(position.min(axis=0), position.max(axis=0), strict=True)]  # fmt: skip
    inducing = np.stack([axis.ravel() for axis in np.meshgrid(*lines)], axis=1)

    def covariance(a, b):
        return np.exp(-0.5 * np.sum((a[:, None] - b[None]) ** 2, axis=-1) / length**2)

    factor = np.linalg.cholesky(covariance(inducing, inducing) + 1e-6 * np.eye(len(inducing)))
    low_rank = np.linalg.solve(factor, covariance(inducing, position)).T
    values, vectors = np.linalg.eigh(low_rank.T @ low_rank)
    values, vectors = values[::-1], vectors[:, ::-1]
    kept = int(np.searchsorted(np.cumsum(values) / values.sum(), variance)) + 1
    return low_rank @ vectors[:, :kept]


def smooth_errors(modes: np.ndarray, on_disc: np.ndarray) -> np.ndarray:
    """L of the smooth errors of (cell, channel) residuals in row-major order: common, then by channel.

    - `modes`: (disc cell, mode).
    - `on_disc`: (cell,); sky cells have no such error.
    """
    cells, rank = on_disc.size, modes.shape[1]
    common = np.zeros((cells, 3, rank))
    common[on_disc] = COMMON * modes[:, None, :]
    blocks = [common.reshape(3 * cells, rank)]
    for channel in range(3):
        block = np.zeros((cells, 3, rank))
        block[on_disc, channel] = CHROMATIC * modes
        blocks.append(block.reshape(3 * cells, rank))
    return np.concatenate(blocks, axis=1)
