"""The most probable limb and nuisances: Gauss and Newton within a trust region, and Laplace's covariance there.

Each step sums what the photographs say into one small set of normal equations, whatever their number and size. An
optimiser that traces its function would compile all photographs together, half a minute for one and anew for every
other number of them; SciPy's is called with numbers.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from inverse.gaussian import Gaussian
from inverse.likelihood import LIMB, Likelihood

MOST_STEPS = 160
ANEW = 40  # steps after which the region of trust begins anew: along a bent valley it shrinks, and never grows again
COST_CHANGE = 5e-6  # relative change of the cost at which a descent ends
CLOSE = 1e-4  # the same, where ends are compared
STEP = 1e-4  # smallest change of z, relative to its length


@dataclass(frozen=True)
class Optimum:
    """The end of one descent, or the best of those from several starts.

    - `z`: (parameter,).
    - `cost`: minus twice the log posterior, up to a constant.
    - `converged`: whether the solver says so.
    - `steps`: taken.
    - `information`: half the second derivatives of `cost` at `z`, after Gauss and Newton (parameter, parameter).
    - `costs`: minus twice the log posterior at the ends of all starts, each end once, with the same errors.
    - `not_finite`: points tried, on all descents, at which the cost was no finite number: no descent goes there.
    - `rivals`: other ends, far from this one, which may hold a share of the posterior (`inverse.optimum`).
    - `ridge`: the best points with other clouds and dust (`inverse.ridge`).
    """

    z: np.ndarray
    cost: float
    converged: bool
    steps: int
    information: np.ndarray
    costs: tuple[float, ...]
    not_finite: int = 0
    rivals: tuple["Optimum", ...] = ()
    ridge: tuple["Optimum", ...] = ()

    @property
    def log_mass(self) -> float:
        """Log of what of the posterior is here, after Laplace, up to a constant."""
        return -0.5 * (self.cost + float(np.linalg.slogdet(self.information)[1]))

    @property
    def limb(self) -> Gaussian:
        """Laplace's Gaussian of the limb."""
        return Gaussian.about(self.z[:LIMB], self.covariance[:LIMB, :LIMB])

    @property
    def covariance(self) -> np.ndarray:
        """Laplace: the inverse of the information, whose eigenvalues the prior keeps at 1 or above."""
        value, vector = np.linalg.eigh(self.information)
        return (vector / np.maximum(value, 1.0)) @ vector.T

    def nuisances(self, limb: np.ndarray) -> np.ndarray:
        """The best ones under limbs (..., parameter) near that of the optimum, to first order (..., nuisance)."""
        moved = np.linalg.solve(self.information[LIMB:, LIMB:], self.information[LIMB:, :LIMB])
        return self.z[LIMB:] - (limb - self.z[:LIMB]) @ moved.T


@dataclass(frozen=True)
class Quadratic:
    """The cost about a point: cost + 2 gradient dz + dz information dz."""

    cost: float
    gradient: np.ndarray
    information: np.ndarray


def quadratic(likelihood: Likelihood, z: np.ndarray) -> Quadratic:
    """Minus twice the log posterior about z."""
    found = [np.column_stack([slopes, misfit]) for misfit, slopes in likelihood.misfits_and_slopes(z)]
    columns = [np.append(likelihood.columns(number), z.size) for number in range(len(found))]
    products = likelihood.whitener.products(found, columns, z.size + 1)
    return Quadratic(float(z @ z + products[-1, -1]), z + products[:-1, -1], np.eye(z.size) + products[:-1, :-1])


def descend(
    likelihood: Likelihood, start: np.ndarray, change: float = COST_CHANGE, free: np.ndarray | None = None
) -> Optimum:
    """Descend from a start; to an infinite cost where it is not a finite number there.

    - `start`: z (parameter,).
    - `change`: of the cost, relative to it, at which this ends.
    - `free`: numbers of the parameters that move; all by default.
    """
    free = np.arange(start.size) if free is None else free
    lost = 0

    def whole(x):
        z = start.astype(float)
        z[free] = x
        return z

    @lru_cache(maxsize=2)
    def at(x):
        return quadratic(likelihood, whole(np.frombuffer(x)))

    def jacobian(x):
        return np.linalg.cholesky(at(x.tobytes()).information[np.ix_(free, free)]).T

    def residual(x):
        nonlocal lost
        # Any root of the normal equations has their steps; the last row makes up the rest of the cost.
        here = at(x.tobytes())
        if not (np.isfinite(here.cost) and np.isfinite(here.information).all()):
            lost += 1
            return np.full(x.size + 1, np.inf)
        row = np.linalg.solve(jacobian(x).T, here.gradient[free])
        return np.append(row, np.sqrt(max(here.cost - row @ row, 0.0)))

    x, steps, converged = start[free].astype(float), 0, False
    if not np.isfinite(residual(x)).all():
        return Optimum(start, np.inf, False, 0, np.eye(start.size), (), lost)
    while steps < MOST_STEPS and not converged:
        found = least_squares(
            residual, x, lambda x: np.vstack([jacobian(x), np.zeros(x.size)]),  # pyright: ignore[reportArgumentType]
            ftol=change, xtol=STEP, gtol=1e-12, max_nfev=ANEW,
        )  # fmt: skip
        x, steps, converged = found.x, steps + int(found.nfev), found.status > 0
    here = at(x.tobytes())
    return Optimum(whole(x), here.cost, converged, steps, here.information, (), lost)
