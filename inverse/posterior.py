"""The posterior of the limb: an ensemble sampler over the few parameters that are not nearly linear.

The nuisances of each photograph are marginalised to first order about the optimum: with J their Jacobian, J J'
joins the covariance of the residuals. The sampler then sees only the atmosphere.
"""

from dataclasses import dataclass

import emcee
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from inverse.likelihood import Likelihood, shadow_light
from inverse.map_estimate import Optimum
from inverse.noise import Whitener, whitener

# Differential evolution; never emcee 3.1.6's snooker move, whose samples are up to 40 % too narrow.
MOVES = ((emcee.moves.DEMove, {}, 0.9), (emcee.moves.DEMove, {"gamma0": 1.0}, 0.1))
WALKERS = 32
CHECK_EVERY = 100  # steps
TIMES_AUTOCORRELATION = 50
LARGEST_CHANGE = 0.05  # of the autocorrelation time since the last check


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


@dataclass(frozen=True)
class Chain:
    """What the sampler left, burn-in removed.

    - `z`: (step, walker, parameter).
    - `log_posterior`: (step, walker).
    - `autocorrelation_time`: (parameter,) [steps].
    - `converged`: whether the stopping rule was met.
    - `acceptance`: fraction of accepted moves.
    """

    z: np.ndarray
    log_posterior: np.ndarray
    autocorrelation_time: np.ndarray
    converged: bool
    acceptance: float

    @property
    def effective_samples(self) -> np.ndarray:
        """Independent samples the chain is worth (parameter,)."""
        return self.z.shape[0] * self.z.shape[1] / self.autocorrelation_time


def sample(posterior, centre, covariance, *, steps: int, seed: int, report=lambda done, of: None) -> Chain:
    """Sample with an ensemble of `WALKERS`, until the chain is long enough or `steps` are done.

    - `posterior`: maps (parameter,) to a log density.
    - `centre`, `covariance`: of the Gaussian that the walkers start from.
    - `steps`: at most, burn-in included.
    - `report`: called with steps done and steps at most.
    """
    arrays, static = eqx.partition(posterior, eqx.is_array)

    @jax.jit
    def batch(arrays, z):
        density = eqx.combine(arrays, static)
        return jax.lax.map(density, z, batch_size=WALKERS // 4)

    def log_density(z):
        # emcee asks for all walkers once and for half of them ever after: one compiled shape serves both.
        half = WALKERS // 2
        padded = np.concatenate([z, np.repeat(z[-1:], -len(z) % half, axis=0)])
        parts = [np.asarray(batch(arrays, part)) for part in np.split(padded, len(padded) // half)]
        return np.concatenate(parts)[: len(z)]

    random = np.random.default_rng(seed)
    size = len(centre)
    factor = np.linalg.cholesky(covariance + 1e-12 * np.eye(size))
    start = centre + random.standard_normal((WALKERS, size)) @ factor.T
    moves = [(move(**options), weight) for move, options, weight in MOVES]
    sampler = emcee.EnsembleSampler(WALKERS, size, log_density, moves=moves, vectorize=True)
    sampler._random.seed(seed)  # emcee has no argument for it and copies NumPy's global state

    old, converged = np.full(size, np.inf), False
    for state in sampler.sample(start, iterations=steps):
        del state
        done = sampler.iteration
        if done % 10 == 0:
            report(done, steps)
        if done % CHECK_EVERY == 0:
            time = sampler.get_autocorr_time(tol=0)
            converged = bool(
                np.all(done > TIMES_AUTOCORRELATION * time) and np.all(np.abs(time - old) < LARGEST_CHANGE * time)
            )
            old = time
            if converged:
                break
    with np.errstate(invalid="ignore"):  # a chain of one step has no variance
        time = sampler.get_autocorr_time(tol=0)
    burn = (
        int(min(2 * np.nanmax(time), sampler.iteration // 2)) if np.all(np.isfinite(time)) else sampler.iteration // 2
    )
    return Chain(
        np.asarray(sampler.get_chain(discard=burn)),
        np.asarray(sampler.get_log_prob(discard=burn)),
        np.where(np.isfinite(time), time, sampler.iteration),
        converged,
        float(np.mean(sampler.acceptance_fraction)),
    )
