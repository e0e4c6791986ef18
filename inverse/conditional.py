"""The nuisances under a given limb: for drawing whole models from a chain that holds limbs only."""

import numpy as np

from inverse.likelihood import LIMB, Likelihood
from inverse.map_estimate import Optimum, quadratic

STEPS = 2  # of Gauss and Newton after the linear guess, each shortened until it helps
SHARES = (1.0, 0.5, 0.2)


def with_nuisances(likelihood: Likelihood, optimum: Optimum, limb: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """All parameters: this limb, and a draw of the nuisances from Laplace's Gaussian about their best values under it.

    - `limb`: (parameter,); `normal`: standard normal deviates (nuisance,).
    """
    z = np.concatenate([limb, optimum.nuisances(limb)])
    here = quadratic(likelihood, z)
    for _ in range(STEPS):
        step = np.linalg.solve(here.information[LIMB:, LIMB:], here.gradient[LIMB:])
        for share in SHARES:
            trial = np.concatenate([limb, z[LIMB:] - share * step])
            there = quadratic(likelihood, trial)
            if there.cost < here.cost:
                z, here = trial, there
                break
    factor = np.linalg.cholesky(here.information[LIMB:, LIMB:])
    return np.concatenate([limb, z[LIMB:] + np.linalg.solve(factor.T, normal)])
