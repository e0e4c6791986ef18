"""A Gaussian corrected by importance weights: an answer in a minute, where its own diagnostic allows it.

Pareto-smoothed importance sampling, Vehtari, Simpson, Gelman, Yao & Gabry 2024: the largest weights are replaced by
the quantiles of a generalised Pareto distribution, whose shape k-hat tells whether the Gaussian's tails suffice.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from inverse.diagnostics import LEAST_SAMPLES, arviz
from inverse.gaussian import Gaussian
from inverse.mixture import about, fitted, tempered

LARGEST_K = 0.7
DRAWS = 1000  # of each proposal that another one learns from
ENOUGH = 500.0  # effective ones of them, from which the last proposal is made
LAST = 3000  # draws of that one, which alone are weighed
HEAVY = 0.01  # of all weights together: where one draw has more, it stands for a place that the last proposal missed
# Draws at most: 10,000 left one posterior in 48 to ensembles, which a ridge of two peaks holds up for 40 minutes.
MOST = 20_000
ALIKE = 0.98  # effective share of draws above which weights are as good as equal


@dataclass(frozen=True)
class Importance:
    """A posterior by importance sampling.

    - `z`: draws from the posterior (draw, parameter), resampled in proportion to the weights: some occur many times.
    - `log_posterior`: (draw,).
    - `k_hat`: shape of the tail of the weights; infinite where the density was nowhere above zero.
    - `effective_samples`: 1 / sum of squared weights.
    - `heaviest`: of the weights.
    """

    z: np.ndarray
    log_posterior: np.ndarray
    k_hat: float
    effective_samples: float
    heaviest: float

    @property
    def trusted(self) -> bool:
        """Whether the weights are well-behaved and the draws enough."""
        return self.k_hat < LARGEST_K and self.effective_samples >= LEAST_SAMPLES


def importance(
    density: Callable[[np.ndarray], np.ndarray],
    gaussians: Sequence[Gaussian],
    *,
    seed: int,
    learn: Callable[[np.ndarray], Callable[[np.ndarray], np.ndarray]] | None = None,
    report: Callable[[int, int], None] = lambda done, most: None,
) -> Importance:
    """Sample a density through the Gaussians about its optima, and where they do not do, through what they show.

    Adaptive multiple importance sampling (Cornuet et al. 2012): the weighted draws so far make the next proposal, a
    mixture (`inverse.mixture`), which follows a bent posterior, or one of two peaks, where a Gaussian does not. Draws
    are then weighed as if they came from all proposals together. Where these weights can be trusted, fresh draws of one
    more proposal are the answer, and only they: those that proposals learnt from, and that told when to stop, miss what
    they happened not to meet, and held standard deviations of a bent density for 9 % smaller than they are. Where one
    of them is heavy there is a last proposal more, once, which has learnt from it. Where no last draws can be trusted,
    all that were learnt from are returned, trusted or not.

    - `density`: log densities (draw,) of points (draw, parameter).
    - `gaussians`: of Laplace, one for each optimum.
    - `learn`: makes `density` another one, of nearly the same draws: called once, before the last proposal, with draws
      of the density so far, it returns what log densities have more from then on, a function of points.
    - `report`: called with the number of draws so far and the most there can be.
    """
    random = np.random.default_rng(seed)
    proposals, counts = [about(gaussians)], [DRAWS]
    z = proposals[0].draw(DRAWS, random)
    value = density(z)
    report(len(z), MOST)
    mended = False
    while True:
        each = np.array([proposal.log_density(z) for proposal in proposals])
        log_ratio = value - logsumexp(each, axis=0, b=np.array(counts)[:, None] / len(z))
        found = _resampled(z, value, *_weights(log_ratio), random)
        if not np.isfinite(found.k_hat):
            return found
        exhausted = len(z) + LAST >= MOST
        last = exhausted or (found.trusted and found.effective_samples > ENOUGH)
        if last and learn is not None:
            more, learn = learn(found.z)(z), None
            value, log_ratio = value + more, log_ratio + more
            found = _resampled(z, value, *_weights(log_ratio), random)
        proposals.append(fitted(z, tempered(log_ratio), gaussians, random))
        counts.append(LAST if last else DRAWS)
        fresh = proposals[-1].draw(counts[-1], random)
        fresh_value = density(fresh)
        report(len(z) + len(fresh), MOST)
        if last:
            alone = weighed(fresh, fresh_value, proposals[-1].log_density(fresh), random)
            if exhausted or (alone.trusted and (mended or alone.heaviest < HEAVY)):
                return alone if alone.trusted else found
            mended = alone.trusted
        z, value = np.concatenate([z, fresh]), np.concatenate([value, fresh_value])


def weighed(z: np.ndarray, log_posterior: np.ndarray, log_proposal: np.ndarray, random) -> Importance:
    """Draws of one proposal, weighed by the posterior.

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
    return Importance(z[chosen], value[chosen], k_hat, float(1.0 / np.sum(weight**2)), float(weight.max()))


def _weights(log_ratio: np.ndarray) -> tuple[np.ndarray, float]:
    """Smoothed weights, sum 1, and k-hat."""
    if not np.isfinite(log_ratio).any():
        return np.full(len(log_ratio), 1.0 / len(log_ratio)), np.inf
    with np.errstate(over="ignore"):  # tails that no proposal covers have any shape
        smoothed, k_hat = arviz().psislw(log_ratio)
    weight = np.exp(np.asarray(smoothed))
    return weight / weight.sum(), float(k_hat)
