"""The nuisances of each photograph under a given limb: for drawing whole models from a chain that holds limbs only."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from inverse.likelihood import Likelihood

STEPS = 6  # of Gauss and Newton, each shortened until it helps: exposure times tone curve is far from linear
SHARES = (1.0, 0.3, 0.1, 0.0)


@eqx.filter_jit
def with_nuisances(
    likelihood: Likelihood,
    limb: Float[Array, " parameter"],
    start: Float[Array, " nuisance"],
    normal: Float[Array, " nuisance"],
) -> Float[Array, " all"]:
    """All parameters: this limb, and a draw of the nuisances from Laplace's Gaussian about their best values under it.

    - `start`: nuisances to begin with.
    - `normal`: standard normal deviates.
    """
    table = likelihood.shadow(limb)
    found, begin = [limb], 0
    for model, data, usable, w in zip(
        likelihood.models, likelihood.data, likelihood.usable, likelihood.whiteners, strict=True
    ):
        here = slice(begin, begin + len(model.parameters))

        def residuals(nuisance, model=model, data=data, usable=usable, w=w):
            return jnp.concatenate([w(usable * (data - model(table, nuisance).ravel())), nuisance])

        def step(_, state, residuals=residuals):
            nuisance, _ = state
            design = jax.jacfwd(residuals)(nuisance)
            factor = jnp.linalg.cholesky(design.T @ design)
            full = jax.scipy.linalg.cho_solve((factor, True), design.T @ residuals(nuisance))
            trials = nuisance - jnp.asarray(SHARES)[:, None] * full
            costs = jnp.sum(jax.vmap(residuals)(trials) ** 2, axis=1)
            return trials[jnp.nanargmin(costs)], factor

        size = len(model.parameters)
        best, factor = jax.lax.fori_loop(0, STEPS, step, (start[here], jnp.eye(size)))
        found.append(best + jax.scipy.linalg.solve_triangular(factor.T, normal[here]))
        begin += size
    return jnp.concatenate(found)
