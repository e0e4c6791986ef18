"""Nuisances at their best, guessed for a limb from others for which they are known.

They bend with the limb: the line through an optimum's misses squares by 280 in the median of one posterior's draws,
and what this module makes of 1000 other draws by 1, of 2000 by 0.2. Four of five steps of their search are so saved,
and fewer searches end beside the best.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RBFInterpolator

FEWEST, MOST = 300, 2000  # points that a guess is made from, the latest; more than a quadric in 9 dimensions needs
NEAR = 100.0  # in cost above the least: others tell of other nuisances
# A quadric and splines of fifth order, which have no length of their own. Smoothed, since searches end a little off:
# from 0.1 to 10 it changes little.
KERNEL, DEGREE, SMOOTHING = "quintic", 2, 1.0


@dataclass(frozen=True)
class Known:
    """Limbs, with the best nuisances that were found for each.

    - `limbs`: (point, parameter); `nuisances`: (point, nuisance); `cost`: as of `Optimum` (point,).
    """

    limbs: np.ndarray
    nuisances: np.ndarray
    cost: np.ndarray

    @classmethod
    def nothing(cls, limb: int, nuisances: int) -> "Known":
        """No limb, of so many parameters, with so many nuisances."""
        return cls(np.zeros((0, limb)), np.zeros((0, nuisances)), np.zeros(0))

    def with_more(self, limbs: np.ndarray, nuisances: np.ndarray, cost: np.ndarray) -> "Known":
        """The same with other points, of which only those count that may be of use."""
        cost = np.where(np.isfinite(cost), cost, np.inf)
        pairs = zip((self.limbs, self.nuisances, self.cost), (limbs, nuisances, cost), strict=True)
        limbs, nuisances, cost = (np.concatenate(pair) for pair in pairs)
        near = np.flatnonzero(cost < np.min(cost, initial=np.inf) + NEAR)[-MOST:]
        return Known(limbs[near], nuisances[near], cost[near])

    @cached_property
    def guess(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """Nuisances (draw, nuisance) for limbs (draw, parameter); None if too little is known."""
        if len(self.limbs) < FEWEST:
            return None
        centre = self.limbs.mean(axis=0)
        whiten = np.linalg.inv(np.linalg.cholesky(np.cov(self.limbs.T))).T
        through = RBFInterpolator(
            (self.limbs - centre) @ whiten, self.nuisances, kernel=KERNEL, degree=DEGREE, smoothing=SMOOTHING
        )
        return lambda limbs: through((limbs - centre) @ whiten)
