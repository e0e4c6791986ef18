"""A Gaussian corrected by importance weights: an answer in a minute, where its own diagnostic allows it.

Pareto-smoothed importance sampling, Vehtari, Simpson, Gelman, Yao & Gabry 2024: the largest weights are replaced by
the quantiles of a generalised Pareto distribution, whose shape k-hat tells whether the Gaussian's tails suffice.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from inverse.diagnostics import LEAST_SAMPLES, arviz
from inverse.gaussian import Gaussian

LARGEST_K = 0.7
DRAWS, ROUNDS = 2000, 4
FREEDOM, WIDER = 8.0, 1.1  # of proposals after the first: Student's degrees of freedom, and a margin of the variance
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
    """Sample a density through the Gaussian about its optimum, and where that does not do, through what it shows.

    Adaptive importance sampling (Cappe et al. 2008): mean and covariance of the weighed draws make the next proposal, a
    Student distribution, whose tails are the heavier ones. Stops where the weights can be trusted.

    - `density`: log densities (draw,) of points (draw, parameter).
    """
    random, proposal, freedom = np.random.default_rng(seed), Gaussian.about(centre, covariance), np.inf
    best: Importance | None = None
    for _ in range(ROUNDS):
        normal = random.standard_normal((DRAWS, len(centre)))
        if np.isfinite(freedom):
            normal = normal / np.sqrt(random.chisquare(freedom, DRAWS) / freedom)[:, None]
        z = proposal.at(normal)
        value = density(z)
        weight, k_hat = _weights(value - _log_proposal(normal, freedom))
        found = _resampled(z, value, weight, k_hat, random)
        if found.trusted:
            return found
        if best is None or found.effective_samples > best.effective_samples:
            best = found
        if not np.isfinite(k_hat):
            break
        mean = weight @ z
        spread = (z - mean).T @ (weight[:, None] * (z - mean))
        # Few draws that count know few directions: the rest is as wide as it was.
        known = min(1.0, found.effective_samples / (20.0 * len(centre)))
        spread = known * spread + (1.0 - known) * proposal.factor @ proposal.factor.T
        proposal, freedom = Gaussian.about(mean, WIDER * spread), FREEDOM
    assert best is not None
    return best


def _log_proposal(deviates: np.ndarray, freedom: float) -> np.ndarray:
    """Log density (draw,) of deviates (draw, parameter), up to a constant: normal, or Student's."""
    squares = np.sum(deviates**2, axis=1)
    if not np.isfinite(freedom):
        return -0.5 * squares
    return -0.5 * (freedom + deviates.shape[1]) * np.log1p(squares / freedom)


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
    with np.errstate(over="ignore"):  # tails that no proposal covers have any shape
        smoothed, k_hat = arviz().psislw(log_ratio)
    weight = np.exp(np.asarray(smoothed))
    return weight / weight.sum(), float(k_hat)
