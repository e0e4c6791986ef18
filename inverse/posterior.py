"""The posterior of the limb: a density over the few parameters of the air, which all photographs share.

The nuisances of the photographs are at their best under each limb, found by a few steps with the slopes at the optimum.
That is their marginal but for a determinant, which changed by less than 1 in the log over several posteriors. To first
order about the optimum alone it would not do: tone curve, colour matrix and exposure bend together, and an interval
three times too narrow was seen. A sampler then sees only the atmosphere.
"""

from collections.abc import Iterator

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.linalg import cho_factor, cho_solve

from inverse.likelihood import LIMB, Likelihood
from inverse.likelihood import misfit as misfit_of
from inverse.limb_light import Shadow
from inverse.map_estimate import Optimum
from inverse.observed import Observed

BATCH = 16  # points handed over at once: one compiled shape serves whole and half ensembles
TOGETHER = 8  # of them worked out side by side: more needs memory and is no faster on a few cores
STEPS = 4  # of the nuisances after the linear guess
SHORTER = 0.3  # a step that made things worse, when it is tried again


class LimbPosterior:
    """Log posterior of the limb up to a constant, the nuisances at their best.

    - `evaluated`, `not_finite`: at how many points it was asked for, and at how many it was not a finite number.
    """

    def __init__(self, likelihood: Likelihood, optimum: Optimum):
        self.likelihood, self.optimum = likelihood, optimum
        self.evaluated = self.not_finite = 0
        self.information = cho_factor(optimum.information[LIMB:, LIMB:])
        slopes = []
        for number, (_, by) in enumerate(likelihood.misfits_and_slopes(optimum.z)):
            everywhere = np.zeros((len(by), optimum.z.size))
            everywhere[:, likelihood.columns(number)] = likelihood.errors[number].whitener(by)
            slopes.append(everywhere[:, LIMB:])
        self.slopes = np.concatenate(slopes)

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Log densities (draw,) of points (draw, parameter); -inf where not finite."""
        value = log_density(z, np.concatenate([np.sum(part**2, axis=1) for part in self._parts(z)])[: len(z)])
        self._count(value)
        return value

    def misfits(self, z: np.ndarray) -> np.ndarray:
        """Whitened misfits and the nuisances (draw, datum), whose squares make the `log_density`."""
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
            yield self._best(part)

    def _best(self, limbs: np.ndarray) -> np.ndarray:
        """Misfits with the nuisances at their best: steps are taken from the best so far, shorter after a bad one."""
        entries, count = _entries(self.likelihood.shadow, jnp.asarray(limbs)), self.slopes.shape[1]
        best = self._rows(entries, self.optimum.nuisances(limbs))
        least, share = _squares(best), np.ones(len(limbs))
        for _ in range(STEPS):
            known = np.where(np.isfinite(best), best, 0.0)
            step = cho_solve(self.information, (known[:, :-count] @ self.slopes + known[:, -count:]).T).T
            rows = self._rows(entries, best[:, -count:] - share[:, None] * step)
            better = _squares(rows) < least
            best[better], least[better] = rows[better], _squares(rows)[better]
            share = np.where(better, 1.0, SHORTER * share)
        return best

    def _rows(self, entries, nuisances: np.ndarray) -> np.ndarray:
        """Whitened misfits with these nuisances, and the nuisances (draw, datum)."""
        each = [
            errors.whitener(np.asarray(_misfits(model, observed, self.likelihood.shadow, entries, places)).T).T
            for model, observed, errors, places in zip(
                self.likelihood.models, self.likelihood.observed, self.likelihood.errors,
                (jnp.asarray(nuisances[:, place - LIMB]) for place in self.likelihood.places), strict=True,
            )
        ]  # fmt: skip
        return np.concatenate([*each, nuisances], axis=1)


def log_density(z: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Log densities of the posterior (draw,), up to a constant; -inf where not finite.

    - `z`: (draw, parameter); `squares`: sums of the squared whitened misfits there (draw,).
    """
    value = -0.5 * (squares + np.sum(z**2, axis=1))
    return np.where(np.isfinite(value), value, -np.inf)


def _squares(rows: np.ndarray) -> np.ndarray:
    """Sums of squares (draw,); infinite where not finite."""
    squares = np.sum(rows**2, axis=1)
    return np.where(np.isfinite(squares), squares, np.inf)


@eqx.filter_jit
def _misfits(
    model, observed: Observed, shadow: Shadow, entries: Float[Array, "draw offset 2 channel"],
    nuisances: Float[Array, "draw nuisance"],
) -> Float[Array, "draw datum"]:  # fmt: skip
    """Misfits of one photograph for many tables of the shadow, given by their entries, each with its nuisances."""

    def one(item):
        log_light, nuisance = item
        return misfit_of(model, observed, shadow.table(log_light), nuisance)

    return jax.lax.map(one, (entries, nuisances), batch_size=TOGETHER)


@eqx.filter_jit
def _entries(shadow: Shadow, limb: Float[Array, "draw parameter"]):
    """Entries of the shadow's tables (draw, offset, 2, channel)."""
    return jax.lax.map(lambda z: shadow(z).log_light, limb, batch_size=TOGETHER)
