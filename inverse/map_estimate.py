"""The most probable limb and nuisances: Gauss and Newton within a trust region, and Laplace's covariance there.

Each step sums what the photographs say into one small set of normal equations, whatever their number and size. An
optimiser that traces its function would compile all photographs together, half a minute for one and anew for every
other number of them; SciPy's is called with numbers.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from inverse.likelihood import Likelihood

MOST_STEPS = 150
# Relative change of the cost at which a descent ends: where starts are compared, and where the best one goes on.
ROUGH, COST_CHANGE = 1e-3, 5e-6
STEP = 1e-4  # smallest change of z, relative to its length


@dataclass(frozen=True)
class Optimum:
    """The end of one or the best of several descents.

    - `z`: (parameter,).
    - `cost`: minus twice the log posterior, up to a constant.
    - `converged`: whether the solver says so.
    - `steps`: taken.
    - `information`: half the second derivatives of `cost` at `z`, after Gauss and Newton (parameter, parameter).
    - `costs`: of all starts.
    - `not_finite`: points tried, on all descents, at which the cost was no finite number: no descent goes there.
    """

    z: np.ndarray
    cost: float
    converged: bool
    steps: int
    information: np.ndarray
    costs: tuple[float, ...]
    not_finite: int = 0

    @property
    def covariance(self) -> np.ndarray:
        """Laplace: the inverse of the information, whose eigenvalues the prior keeps at 1 or above."""
        value, vector = np.linalg.eigh(self.information)
        return (vector / np.maximum(value, 1.0)) @ vector.T


@dataclass(frozen=True)
class Quadratic:
    """The cost about a point: cost + 2 gradient dz + dz information dz."""

    cost: float
    gradient: np.ndarray
    information: np.ndarray


def quadratic(likelihood: Likelihood, z: np.ndarray) -> Quadratic:
    """Minus twice the log posterior about z."""
    cost, gradient, information = float(z @ z), z.copy(), np.eye(z.size)
    for number, (misfit, slopes) in enumerate(likelihood.misfits_and_slopes(z)):
        white = likelihood.errors[number].whitener
        misfit, slopes = white(misfit), white(slopes)
        columns = likelihood.columns(number)
        cost += float(misfit @ misfit)
        gradient[columns] += slopes.T @ misfit
        information[np.ix_(columns, columns)] += slopes.T @ slopes
    return Quadratic(cost, gradient, information)


def maximum(
    likelihood: Likelihood, starts: Sequence[np.ndarray], report: Callable[[int], None] = lambda done: None
) -> Optimum:
    """Descend from each start, a little way where there are several, and on from the best.

    - `starts`: vectors z (parameter,).
    - `report`: called with the number of starts done.
    """
    best, costs, lost = None, [], 0
    for number, start in enumerate(starts, 1):
        found = _descend(likelihood, np.asarray(start, dtype=float), COST_CHANGE if len(starts) == 1 else ROUGH)
        costs.append(found.cost)
        lost += found.not_finite
        if np.isfinite(found.cost) and (best is None or found.cost < best.cost):
            best = found
        report(number)
    if best is None:
        raise FloatingPointError("no start gave a finite posterior")
    if len(starts) > 1:
        best = _descend(likelihood, best.z, COST_CHANGE)
        lost += best.not_finite
    return replace(best, costs=tuple(costs), not_finite=lost)


def _descend(likelihood: Likelihood, start: np.ndarray, change: float) -> Optimum:
    at = lru_cache(maxsize=2)(lambda z: quadratic(likelihood, np.frombuffer(z)))
    lost = 0

    def jacobian(z):
        return np.linalg.cholesky(at(z.tobytes()).information).T

    def residual(z):
        nonlocal lost
        # Any root of the normal equations has their steps; the last row makes up the rest of the cost.
        here = at(z.tobytes())
        if not (np.isfinite(here.cost) and np.isfinite(here.information).all()):
            lost += 1
            return np.full(z.size + 1, np.inf)
        row = np.linalg.solve(jacobian(z).T, here.gradient)
        return np.append(row, np.sqrt(max(here.cost - row @ row, 0.0)))

    if not np.isfinite(residual(start)).all():
        return Optimum(start, np.inf, False, 0, np.eye(start.size), (), lost)
    found = least_squares(
        residual, start, lambda z: np.vstack([jacobian(z), np.zeros(z.size)]),  # pyright: ignore[reportArgumentType]
        ftol=change, xtol=STEP, gtol=1e-12, max_nfev=MOST_STEPS,
    )  # fmt: skip
    here = at(found.x.tobytes())
    return Optimum(found.x, here.cost, found.status > 0, int(found.nfev), here.information, (), lost)
