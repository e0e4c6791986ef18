"""The most probable limb: Levenberg-Marquardt from several starts, and Laplace's covariance there."""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

MAX_STEPS = 120
# Change of z (the prior's standard deviation is 1) and of the residuals at which a descent ends.
RELATIVE, ABSOLUTE = 1e-4, 1e-3


@dataclass(frozen=True)
class Optimum:
    """The end of one or the best of several descents.

    - `z`: (parameter,).
    - `cost`: minus twice the log posterior, up to a constant.
    - `converged`: whether the solver says so.
    - `steps`: taken.
    - `jacobian`: of the residuals at `z` (residual, parameter), prior rows last.
    - `costs`: of all starts.
    """

    z: np.ndarray
    cost: float
    converged: bool
    steps: int
    jacobian: np.ndarray
    costs: tuple[float, ...]

    @property
    def covariance(self) -> np.ndarray:
        """Laplace: (J' J)^-1 of the whitened residuals with the prior among them, by SVD."""
        _, singular, right = np.linalg.svd(self.jacobian, full_matrices=False)
        return (right.T / singular**2) @ right


@eqx.filter_custom_jvp
def _residuals(z, likelihood):
    return likelihood.residuals(z)


@_residuals.def_jvp
def _residuals_jvp(primals, tangents):
    """The solver applies the Jacobian in many places: so the model is traced and compiled once, not in each."""
    (z, likelihood), (z_dot, _) = primals, tangents
    along = lambda direction: jax.jvp(likelihood.residuals, (z,), (direction,))
    value, jacobian = jax.vmap(along, out_axes=(None, -1))(jnp.eye(z.size))
    return value, jacobian @ z_dot


@eqx.filter_jit
def _descend(likelihood, start):
    solver = optx.LevenbergMarquardt(rtol=RELATIVE, atol=ABSOLUTE)
    solution = optx.least_squares(_residuals, solver, start, args=likelihood, max_steps=MAX_STEPS, throw=False)
    # What the solver knows of its last point: compiling the model once more costs as much as all its steps.
    last = solution.state.f_info
    successful = solution.result == optx.RESULTS.successful
    cost = jnp.sum(last.residual**2)
    return solution.value, cost, successful, solution.stats["num_steps"], last.jac.as_matrix()


def maximum(likelihood, starts, report=lambda done: None) -> Optimum:
    """Descend from each start and keep the best.

    - `starts`: vectors z (start, parameter).
    - `report`: called with the number of starts done.
    """
    best, costs = None, []
    for number, start in enumerate(starts, 1):
        z, cost, converged, steps, jacobian = _descend(likelihood, jnp.asarray(start))
        costs.append(float(cost))
        if np.isfinite(cost) and (best is None or cost < best[1]):
            best = np.asarray(z), float(cost), bool(converged), int(steps), np.asarray(jacobian)
        report(number)
    if best is None:
        raise FloatingPointError("no start gave a finite posterior")
    return Optimum(*best, tuple(costs))
