"""A Gaussian as what makes it of standard normal deviates, which samplers draw from and measure in."""

from dataclasses import dataclass

import numpy as np

LEAST_VARIANCE = 1e-12  # added: rounding may leave a covariance a little short of positive


@dataclass(frozen=True)
class Gaussian:
    """z = centre + factor deviates.

    - `centre`: (parameter,); `factor`: the lower root of the covariance (parameter, parameter).
    """

    centre: np.ndarray
    factor: np.ndarray

    @classmethod
    def about(cls, centre: np.ndarray, covariance: np.ndarray) -> "Gaussian":
        """Of this covariance (parameter, parameter)."""
        return cls(centre, np.linalg.cholesky(covariance + LEAST_VARIANCE * np.eye(len(centre))))

    def at(self, deviates: np.ndarray) -> np.ndarray:
        """Points (draw, parameter) of deviates (draw, parameter)."""
        return self.centre + deviates @ self.factor.T

    def log_density(self, z: np.ndarray) -> np.ndarray:
        """(draw,) of points (draw, parameter), up to a constant of their number of parameters."""
        return -0.5 * np.sum(self.deviates(z) ** 2, axis=1) - np.sum(np.log(np.diag(self.factor)))

    def deviates(self, z: np.ndarray) -> np.ndarray:
        """Deviates (draw, parameter) of points (draw, parameter)."""
        return np.linalg.solve(self.factor, (z - self.centre).T).T
