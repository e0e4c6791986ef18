"""Whether intervals hold the truth as often as they say: coverage, and ranks of the truth among posterior draws.

Ranks of truths drawn from the prior are uniform if the posterior is right (Talts et al. 2018, arXiv 1804.06788). Bands
are those that a right posterior stays within with 95 %, over all that is tested at once.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.stats import binom

LEVELS = (0.68, 0.95)
CONFIDENCE = 0.95
GRID = 100  # points that the distribution of ranks is looked at
SIMULATIONS = 4000


@dataclass(frozen=True)
class Coverage:
    """How often intervals of one level held the truth.

    - `share`: that did; `low`, `high`: band of a right posterior.
    """

    level: float
    share: float
    low: float
    high: float

    @property
    def inside(self) -> bool:
        """Whether the share is within the band."""
        return self.low <= self.share <= self.high


def coverage(ranks: np.ndarray, level: float, tests: int) -> Coverage:
    """Coverage of central intervals of a level.

    - `ranks`: share of the posterior's draws below the truth (photograph,).
    - `tests`: how many bands must hold at once (Bonferroni).
    """
    count = len(ranks)
    inside = np.abs(ranks - 0.5) <= 0.5 * level
    tail = 0.5 * (1.0 - CONFIDENCE) / tests
    low, high = binom.ppf([tail, 1.0 - tail], count, level) / count
    return Coverage(level, float(inside.mean()), float(low), float(high))


def smallest_tail(ranks: np.ndarray) -> np.ndarray:
    """How improbable the least probable value of the ranks' distribution function is (sample,).

    The smallest two-sided binomial tail over a grid of ranks (Sailynoja, Buerkner & Vehtari 2022, Stat. Comput. 32:32).

    - `ranks`: (sample, photograph).
    """
    grid = np.arange(1, GRID) / GRID
    count = ranks.shape[1]
    number = np.arange(count + 1)
    below_or_at = binom.cdf(number, count, grid[:, None])
    at_or_above = binom.sf(number - 1, count, grid[:, None])
    tail = np.minimum(below_or_at, at_or_above)
    below = np.stack([(ranks <= point).sum(axis=1) for point in grid])
    return 2.0 * np.take_along_axis(tail, below, axis=1).min(axis=0)


@cache
def least_tail(count: int, tests: int, seed: int = 0) -> float:
    """The limit of `smallest_tail` for so many photographs, by simulation; `tests`: as of `coverage`."""
    uniform = np.random.default_rng(seed).uniform(size=(SIMULATIONS, count))
    return float(np.quantile(smallest_tail(uniform), (1.0 - CONFIDENCE) / tests))
