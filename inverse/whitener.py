"""Multiplication by the inverse root of a covariance: a block for the values of each cell, and a matrix of low rank."""

from dataclasses import dataclass

import numpy as np

LEAST = 1e-4  # variance of errors in common, of those alone, below which it is left out: a sixth of the modes


@dataclass(frozen=True)
class Alone:
    """Multiplies the values of each cell by a matrix of its own: `roots` (cell, value, value)."""

    roots: np.ndarray

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Of residuals (datum,) or of many side by side (datum, column)."""
        return (self.roots @ residual.reshape(*self.roots.shape[:2], -1)).reshape(residual.shape)

    def transposed(self, white: np.ndarray) -> np.ndarray:
        """The same by the transposed matrices."""
        return Alone(np.swapaxes(self.roots, 1, 2))(white)


@dataclass(frozen=True)
class Whitener:
    """Multiplies residuals by C^(-1/2), C = D + L L'.

    - `alone`: by D^(-1/2); `basis`: orthonormal (datum, rank); `shrink`: 1 / sqrt(1 + eigenvalue) - 1 (rank,).
    """

    alone: Alone
    basis: np.ndarray
    shrink: np.ndarray

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Of residuals (datum,) or of many side by side (datum, column)."""
        scaled = self.alone(residual)
        return scaled + (((scaled.T @ self.basis) * self.shrink) @ self.basis.T).T

    def products(self, columns: np.ndarray) -> np.ndarray:
        """Of columns (datum, column) with each other, C^(-1) between them: half the work of multiplying them first."""
        scaled = self.alone(columns)
        along = self.basis.T @ scaled
        return scaled.T @ scaled + along.T @ ((np.square(1.0 + self.shrink) - 1.0)[:, None] * along)


def whitener(alone: Alone, low_rank: np.ndarray) -> Whitener:
    """From the inverse root of D and L (datum, rank)."""
    basis, shrink = shrinking(alone(low_rank))
    return Whitener(alone, np.asfortranarray(basis), shrink)  # columns in a row each: products of few rows take half


def shrinking(low_rank: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`basis` and `shrink` of `Whitener`, of 1 + L L', from L (datum, rank)."""
    # The eigenvectors of the small L'L: an SVD of the tall matrix costs ten times as much.
    eigenvalue, vector = np.linalg.eigh(low_rank.T @ low_rank)
    kept = eigenvalue > max(LEAST, 1e-9 * eigenvalue.max(initial=0.0))
    basis = low_rank @ (vector[:, kept] / np.sqrt(eigenvalue[kept]))
    return basis, 1.0 / np.sqrt(1.0 + eigenvalue[kept]) - 1.0
