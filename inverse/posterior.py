"""The posterior of the limb: a density over the few parameters that are not nearly linear.

The nuisances of the photographs are marginalised to first order about the optimum: with G their whitened slopes there
and b the whitened misfits less what the nuisances at the optimum did, the log density is

    -1/2 (b b - b G (1 + G G)^-1 G b)

A sampler then sees only the atmosphere, and the geometry of the photographs stands still.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from inverse.likelihood import LIMB, Likelihood
from inverse.limb_light import Shadow
from inverse.map_estimate import Optimum
from inverse.photo_model import PhotoModel, ProfileModel

BATCH = 16  # points handed over at once: one compiled shape serves whole and half ensembles
TOGETHER = 8  # of them worked out side by side: more needs memory and is no faster on a few cores

Density = Callable[[np.ndarray], np.ndarray]


def limb_posterior(likelihood: Likelihood, optimum: Optimum) -> Density:
    """Log posterior up to a constant (draw,) of points z of the limb (draw, parameter); -inf where not finite."""
    count = len(likelihood.parameters) - LIMB
    slopes = likelihood.misfits_and_slopes(optimum.z)
    information = np.eye(count)
    whitened, stills = [], []
    for number, (_, by) in enumerate(slopes):
        place = likelihood.places[number]
        white = likelihood.errors[number].whitener
        by = white(by[:, LIMB:])
        information[np.ix_(place - LIMB, place - LIMB)] += by.T @ by
        whitened.append((white, by, by @ optimum.z[place], place - LIMB))
        stills.append(Still.of(likelihood, number, optimum.z[place]))
    factor = np.linalg.cholesky(information)

    def density(z: np.ndarray) -> np.ndarray:
        entries = _entries(likelihood.shadow, jnp.asarray(z))
        value = -0.5 * np.sum(z**2, axis=1)
        along = np.zeros((count, len(z)))
        for still, (white, by, shift, place) in zip(stills, whitened, strict=True):
            b = white(np.asarray(still(likelihood.shadow, entries)).T) - shift[:, None]
            value -= 0.5 * np.sum(b**2, axis=0)
            np.add.at(along, place, by.T @ b)
        value += 0.5 * np.sum(np.linalg.solve(factor, along) ** 2, axis=0)
        return np.where(np.isfinite(value), value, -np.inf)

    return batched(density)


class Still(eqx.Module):
    """A photograph whose nuisances stand still: misfits for many tables of the shadow."""

    model: PhotoModel | ProfileModel
    seen: Any
    data: Float[Array, " datum"]
    usable: Float[Array, " datum"]
    nuisance: Float[Array, " nuisance"]

    @classmethod
    def of(cls, likelihood: Likelihood, number: int, nuisance: np.ndarray) -> "Still":
        """A photograph of a likelihood, at these nuisances."""
        model, z = likelihood.models[number], jnp.asarray(nuisance)
        return cls(model, _seen(model, z), likelihood.data[number], likelihood.usable[number], z)

    @eqx.filter_jit
    def __call__(self, shadow: Shadow, entries: Float[Array, "draw offset 2 channel"]) -> Float[Array, "draw datum"]:
        """Misfits for many tables of the shadow, given by their entries."""

        def misfit(log_light):
            values = self.model.signal(shadow.table(log_light), self.seen, self.nuisance) + self.model.floor
            return self.usable * (self.data - jnp.log(values).ravel())

        return jax.lax.map(misfit, entries, batch_size=TOGETHER)


@eqx.filter_jit
def _seen(model, nuisance):
    return model.seen(nuisance)


@eqx.filter_jit
def _entries(shadow: Shadow, limb: Float[Array, "draw parameter"]):
    """Entries of the shadow's tables (draw, offset, 2, channel)."""
    return jax.lax.map(lambda z: shadow(z).log_light, limb, batch_size=TOGETHER)


def batched(density: Density) -> Density:
    """The same density, called with no other number of points than `BATCH`."""

    def value(z: np.ndarray) -> np.ndarray:
        padded = np.concatenate([z, np.repeat(z[-1:], -len(z) % BATCH, axis=0)])
        return np.concatenate([density(part) for part in np.split(padded, len(padded) // BATCH)])[: len(z)]

    return value
