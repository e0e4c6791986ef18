"""The posterior of the limb: a density over the few parameters that are not nearly linear.

The nuisances of the photographs are marginalised to first order about the optimum: with G their whitened slopes there
and b the whitened misfits less what the nuisances at the optimum did, the log density is

    -1/2 b (1 + G G')^-1 b

A sampler then sees only the atmosphere, and the geometry of the photographs stands still.
"""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from inverse.likelihood import LIMB, Likelihood
from inverse.limb_light import Shadow
from inverse.map_estimate import Optimum
from inverse.noise import whitener
from inverse.observed import Observed
from inverse.photo_model import PhotoModel, ProfileModel, log_value, seen

BATCH = 16  # points handed over at once: one compiled shape serves whole and half ensembles
TOGETHER = 8  # of them worked out side by side: more needs memory and is no faster on a few cores


class LimbPosterior:
    """Log posterior of the limb up to a constant, the nuisances marginalised about an optimum.

    - `evaluated`, `not_finite`: at how many points it was asked for, and at how many it was not a finite number.
    """

    def __init__(self, likelihood: Likelihood, optimum: Optimum):
        self.likelihood = likelihood
        self.evaluated = self.not_finite = 0
        count = len(likelihood.parameters) - LIMB
        slopes, self.shifts = [], []
        for number, (_, by) in enumerate(likelihood.misfits_and_slopes(optimum.z)):
            place = likelihood.places[number]
            by = likelihood.errors[number].whitener(by[:, LIMB:])
            everywhere = np.zeros((len(by), count))
            everywhere[:, place - LIMB] = by
            slopes.append(everywhere)
            self.shifts.append(by @ optimum.z[place])
        stacked = np.concatenate(slopes)
        self.nuisances = whitener(np.ones(len(stacked)), stacked)
        self.stills = [Still.of(likelihood, n, optimum.z[place]) for n, place in enumerate(likelihood.places)]

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Log densities (draw,) of points (draw, parameter); -inf where not finite."""
        value = log_density(z, np.concatenate([np.sum(part**2, axis=1) for part in self._parts(z)])[: len(z)])
        self._count(value)
        return value

    def misfits(self, z: np.ndarray) -> np.ndarray:
        """Whitened misfits (draw, datum), whose squares make the `log_density`."""
        found = np.concatenate(list(self._parts(z)))[: len(z)]
        self._count(np.sum(found, axis=1))
        return found

    def _count(self, values: np.ndarray) -> None:
        self.evaluated += values.size
        self.not_finite += int(np.sum(~np.isfinite(values)))

    def _parts(self, z: np.ndarray) -> Iterator[np.ndarray]:
        """Misfits, `BATCH` points at a time, the last ones repeated."""
        padded = np.concatenate([z, np.repeat(z[-1:], -len(z) % BATCH, axis=0)])
        for part in np.split(padded, len(padded) // BATCH):
            entries = _entries(self.likelihood.shadow, jnp.asarray(part))
            each = [
                errors.whitener(np.asarray(still(self.likelihood.shadow, entries)).T) - shift[:, None]
                for still, errors, shift in zip(self.stills, self.likelihood.errors, self.shifts, strict=True)
            ]
            yield self.nuisances(np.concatenate(each)).T


def log_density(z: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Log densities of the posterior (draw,), up to a constant; -inf where not finite.

    - `z`: (draw, parameter); `squares`: sums of the squared whitened misfits there (draw,).
    """
    value = -0.5 * (squares + np.sum(z**2, axis=1))
    return np.where(np.isfinite(value), value, -np.inf)


class Still(eqx.Module):
    """A photograph whose nuisances stand still: misfits for many tables of the shadow."""

    model: PhotoModel | ProfileModel
    seen: Any
    observed: Observed
    nuisance: Float[Array, " nuisance"]

    @classmethod
    def of(cls, likelihood: Likelihood, number: int, nuisance: np.ndarray) -> "Still":
        """A photograph of a likelihood, at these nuisances."""
        model, z = likelihood.models[number], jnp.asarray(nuisance)
        return cls(model, seen(model, z), likelihood.observed[number], z)

    @eqx.filter_jit
    def __call__(self, shadow: Shadow, entries: Float[Array, "draw offset 2 channel"]) -> Float[Array, "draw datum"]:
        """Misfits for many tables of the shadow, given by their entries."""

        def misfit(log_light):
            signal = self.model.signal(shadow.table(log_light), self.seen, self.nuisance)
            return self.observed.misfit(log_value(self.model, signal).ravel())

        return jax.lax.map(misfit, entries, batch_size=TOGETHER)


@eqx.filter_jit
def _entries(shadow: Shadow, limb: Float[Array, "draw parameter"]):
    """Entries of the shadow's tables (draw, offset, 2, channel)."""
    return jax.lax.map(lambda z: shadow(z).log_light, limb, batch_size=TOGETHER)
