"""The posterior of the limb: a density over the few parameters that are not nearly linear.

The nuisances of each photograph are marginalised to first order about the optimum: with J their Jacobian, J J'
joins the covariance of the residuals. A sampler then sees only the atmosphere.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from inverse.likelihood import Likelihood, shadow_light
from inverse.map_estimate import Optimum
from inverse.noise import Whitener, whitener

BATCH = 16  # points handed over at once: one compiled shape serves whole and half ensembles
TOGETHER = 8  # of them worked out side by side: more needs memory and is no faster on a few cores


class LimbPosterior(eqx.Module):
    """Log posterior of the atmosphere with the nuisances of the photographs marginalised."""

    likelihood: Likelihood
    nuisances: Float[Array, " nuisance"]
    """At the optimum."""
    shift: tuple[Float[Array, " datum"], ...]
    """J times the nuisances at the optimum: their prior is centred on zero."""
    whiteners: tuple[Whitener, ...]

    def __call__(self, limb: Float[Array, " parameter"]) -> Float[Array, ""]:
        """Log posterior up to a constant; -inf where it is not finite."""
        misfits = self.likelihood.misfits(jnp.concatenate([limb, self.nuisances]))
        squares = [
            jnp.sum(w(misfit + shift) ** 2)
            for w, misfit, shift in zip(self.whiteners, misfits, self.shift, strict=True)
        ]
        value = -0.5 * (sum(squares) + jnp.sum(limb**2))
        return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def limb_posterior(likelihood: Likelihood, optimum: Optimum, low_rank: list[np.ndarray]) -> LimbPosterior:
    """Marginalise the nuisances about the optimum.

    - `low_rank`: the smooth errors L of each photograph (datum, mode), as given to `noise.whitener`.
    """
    limb, *nuisances = likelihood.split(jnp.asarray(optimum.z))
    table = shadow_light(likelihood.shadow, limb)
    whiteners, shifts = [], []
    for i, (model, nuisance, old) in enumerate(zip(likelihood.models, nuisances, likelihood.whiteners, strict=True)):
        slope = np.asarray(likelihood.usable[i])[:, None] * np.asarray(_slopes(model, table, nuisance))
        whiteners.append(whitener(np.asarray(old.sigma), np.concatenate([low_rank[i], slope], axis=1)))
        shifts.append(jnp.asarray(slope @ np.asarray(nuisance)))
    return LimbPosterior(likelihood, jnp.concatenate(nuisances), tuple(shifts), tuple(whiteners))


@eqx.filter_jit
def _slopes(model, table, nuisance):
    """Derivatives of a photograph's log values by its nuisances (datum, nuisance)."""
    return jax.jacfwd(lambda nuisance: model(table, nuisance).ravel())(nuisance)


def batched(posterior) -> Callable[[np.ndarray], np.ndarray]:
    """A compiled function from points (draw, parameter) to log densities (draw,), in NumPy.

    - `posterior`: a module that maps (parameter,) to a log density.
    """

    def density(z):
        padded = np.concatenate([z, np.repeat(z[-1:], -len(z) % BATCH, axis=0)])
        parts = [np.asarray(_batch(posterior, jnp.asarray(part))) for part in np.split(padded, len(padded) // BATCH)]
        return np.concatenate(parts)[: len(z)]

    return density


@eqx.filter_jit
def _batch(posterior, z: Float[Array, "draw parameter"]) -> Float[Array, " draw"]:
    return jax.lax.map(posterior, z, batch_size=TOGETHER)
