"""Laplace's Gaussian corrected by importance weights: an answer in seconds, where its own diagnostic allows it.

Pareto-smoothed importance sampling, Vehtari, Simpson, Gelman, Yao & Gabry 2024: the largest weights are replaced by
the quantiles of a generalised Pareto distribution, whose shape k-hat tells whether the Gaussian's tails suffice.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from inverse.diagnostics import LEAST_SAMPLES, arviz
from inverse.gaussian import Gaussian

LARGEST_K = 0.7
DRAWS, MOST_DRAWS = 2000, 8000
ALIKE = 0.98  # effective share of draws above which weights are as good as equal


@dataclass(frozen=True)
class Importance:
    """A posterior by importance sampling.

    - `z`: draws from the posterior (draw, parameter), resampled in proportion to the weights: some occur many times.
    - `log_posterior`: (draw,).
    - `k_hat`: shape of the tail of the weights; infinite where the density was nowhere above zero.
    - `effective_samples`: 1 / sum of squared weights.
    """

    z: np.ndarray
    log_posterior: np.ndarray
    k_hat: float
    effective_samples: float

    @property
    def trusted(self) -> bool:
        """Whether the weights are well-behaved and the draws enough."""
        return self.k_hat < LARGEST_K and self.effective_samples >= LEAST_SAMPLES


def importance(
    density: Callable[[np.ndarray], np.ndarray], centre: np.ndarray, covariance: np.ndarray, *, seed: int
) -> Importance:
    """Sample a density through the Gaussian about its optimum; once more with more draws, where they would suffice.

    - `density`: log densities (draw,) of points (draw, parameter).
    """
    random, proposal = np.random.default_rng(seed), Gaussian.about(centre, covariance)
    normal, value = np.zeros((0, len(centre))), np.zeros(0)

    def more(count):
        fresh = random.standard_normal((count, len(centre)))
        return np.concatenate([normal, fresh]), np.concatenate([value, density(proposal.at(fresh))])

    normal, value = more(DRAWS)
    weight, k_hat = _weights(value + 0.5 * np.sum(normal**2, axis=1))
    share = 1.0 / np.sum(weight**2) / DRAWS
    wanted = int(1.2 * LEAST_SAMPLES / share)
    if k_hat < LARGEST_K and DRAWS < wanted <= MOST_DRAWS:
        normal, value = more(wanted - DRAWS)
        weight, k_hat = _weights(value + 0.5 * np.sum(normal**2, axis=1))
    return _resampled(proposal.at(normal), value, weight, k_hat, random)


def weighed(z: np.ndarray, log_posterior: np.ndarray, log_proposal: np.ndarray, random) -> Importance:
    """Draws of a chain on another density, weighed by the posterior.

    - `z`: (draw, parameter); `log_posterior`, `log_proposal`: (draw,).
    - `random`: NumPy's generator.
    """
    weight, k_hat = _weights(log_posterior - log_proposal)
    if 1.0 / np.sum(weight**2) > ALIKE * len(weight):
        k_hat = min(k_hat, 0.0)  # a tail of rounding errors has any shape
    return _resampled(z, log_posterior, weight, k_hat, random)


def _resampled(z, value, weight, k_hat, random) -> Importance:
    # Systematic resampling: less noise than independent picks.
    place = (np.arange(len(weight)) + random.uniform()) / len(weight)
    chosen = np.minimum(np.searchsorted(np.cumsum(weight), place), len(weight) - 1)
    chosen = random.permutation(chosen)
    return Importance(z[chosen], value[chosen], k_hat, float(1.0 / np.sum(weight**2)))


def _weights(log_ratio: np.ndarray) -> tuple[np.ndarray, float]:
    """Smoothed weights, sum 1, and k-hat."""
    if not np.isfinite(log_ratio).any():
        return np.full(len(log_ratio), 1.0 / len(log_ratio)), np.inf
    smoothed, k_hat = arviz().psislw(log_ratio)
    weight = np.exp(np.asarray(smoothed))
    return weight / weight.sum(), float(k_hat)
