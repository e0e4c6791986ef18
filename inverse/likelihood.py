"""How badly a limb and its photographs' nuisances miss what was photographed.

Everything that JAX compiles here is of one photograph, or of the limb alone, so that the number of photographs in a
fit compiles nothing anew. What photographs share (the limb, a camera's tone curve, its clock) they share by having
the same place in the vector z.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.shadow_table import ShadowTable
from inverse import prior
from inverse.joint_whitener import JointWhitener, joint_whitener
from inverse.limb_light import Shadow, shadow_light, shadow_slopes
from inverse.noise import Bending, Errors, Sources
from inverse.observed import Observed
from inverse.photo_model import developed, log_value, of_the_view, seen_and_slopes, signal

LIMB = len(prior.ATMOSPHERE)
NODE, WEIGHT = np.polynomial.hermite_e.hermegauss(7)  # of errors of the light, in their standard deviations
WEIGHT = WEIGHT / WEIGHT.sum()
LEAST_SIZE = 1e-4  # of them: a derivative
CENTRING = 6  # rounds: the tone curve makes it a little more than one


@dataclass(frozen=True)
class Likelihood:
    """Cells of one or more photographs of one eclipse, under one limb.

    - `models`: a `PhotoModel` or `ProfileModel` each.
    - `observed`: log values above the floor (cell x 3,) each.
    - `sources`: where their errors come from; `errors`: what these make of the log values, the same for every z.
    - `places`: of each photograph's nuisances in z, (nuisance,) each.
    - `carried_at`: z of the limb and the cameras that the errors are those of; None for `inverse.assumed_camera`.
    - `carried_with`: amplitudes (photograph, 3) of the errors whose mean effect they have.
    """

    shadow: Shadow
    models: tuple
    observed: tuple[Observed, ...]
    sources: tuple[Sources, ...]
    errors: tuple[Errors, ...]
    places: tuple[np.ndarray, ...]
    carried_at: np.ndarray | None = None
    carried_with: np.ndarray | None = None

    @cached_property
    def parameters(self) -> tuple[prior.Parameter, ...]:
        """All free quantities, in the order of the vector z."""
        found = dict(enumerate(prior.ATMOSPHERE))
        for model, place in zip(self.models, self.places, strict=True):
            found.update(zip(place.tolist(), model.parameters, strict=True))
        return tuple(found[index] for index in range(len(found)))

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Name of each quantity: a nuisance has the number of its photograph, or of the first and the last of it."""
        owners = [[number for number, place in enumerate(self.places, 1) if index in place]
                  for index in range(len(self.parameters))]  # fmt: skip
        return tuple(
            parameter.name if index < LIMB
            else f"{own[0]}{f'-{own[-1]}' if len(own) > 1 else ''}.{parameter.name}"
            for index, (parameter, own) in enumerate(zip(self.parameters, owners, strict=True))
        )  # fmt: skip

    @cached_property
    def whitener(self) -> JointWhitener:
        """Multiplies misfits of all photographs by the inverse root of the covariance of their errors."""
        return joint_whitener(self.errors)

    def columns(self, number: int) -> np.ndarray:
        """Where the limb and the nuisances of a photograph are in z."""
        return np.concatenate([np.arange(LIMB), self.places[number]])

    def misfits(self, z: np.ndarray) -> list[np.ndarray]:
        """Data minus model of each photograph, in log value."""
        return [misfit for misfit, _ in self.misfits_and_slopes(z)]

    def misfits_and_slopes(self, z: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """The same with their derivatives by `columns` (datum, parameter)."""
        light, slopes = shadow_slopes(self.shadow, jnp.asarray(z[:LIMB]))
        each = zip(self.models, self.observed, self.places, strict=True)
        found = [
            misfit_and_slopes(model, observed, self.shadow, light, slopes, jnp.asarray(z[place]))
            for model, observed, place in each
        ]
        return [(np.asarray(value), np.asarray(by)) for value, by in found]

    def carried(self, z: np.ndarray, amplitudes: np.ndarray | None = None) -> "Likelihood":
        """The same with errors as large as the cameras at z make those of the light there.

        Not of the light that the values tell of: where an error has made a cell too dark, near black, its value
        answers less to the light than it should, the error would pass for small and the cell for sure. In photographs
        drawn with errors it made intervals up to twice too narrow. Nor of the light without errors alone: where these
        are large, a dark cell is as likely one that answers more, or less (`response`).

        - `amplitudes`: smooth, chromatic and uneven ones of these errors (photograph, 3); by default those there are.
        """
        if amplitudes is None:
            amplitudes = np.array([one.sizes[1:] for one in self.errors])
        table = shadow_light(self.shadow, jnp.asarray(z[:LIMB]))
        errors = []
        for sources, size, model, place in zip(self.sources, amplitudes, self.models, self.places, strict=True):
            known = (jnp.asarray(each) for each in sources.sizes(*size))
            value, by, *bending = map(np.asarray, response(model, table, jnp.asarray(z[place]), *known))
            errors.append(sources.errors(value, by, Bending(*bending), *size[:2]))
        return replace(self.with_errors(errors), carried_at=z, carried_with=amplitudes)

    def with_errors(self, errors: Sequence[Errors]) -> "Likelihood":
        """The same with other errors, of measurements and at limits."""
        observed = [one.with_error(each.whole, each.excess) for one, each in zip(self.observed, errors, strict=True)]
        return replace(self, errors=tuple(errors), observed=tuple(observed))

    def centred(self, groups: Sequence[Sequence[int]]) -> "Likelihood":
        """The same with gains centred: medians of model and data agree at the prior's centre.

        - `groups`: photographs whose gains move together, since their exposures are known relative to each other.
        """
        table = shadow_light(self.shadow, jnp.zeros(LIMB))
        models = list(self.models)
        for group in groups:
            for _ in range(CENTRING):
                missing = np.concatenate([self._missing(models[number], number, table) for number in group])
                for number in group:
                    gain = models[number].gain + np.median(missing)
                    models[number] = eqx.tree_at(lambda model: model.gain, models[number], gain)
        return replace(self, models=tuple(models))

    def _missing(self, model, number: int, table: ShadowTable) -> np.ndarray:
        predicted = log_value(model, signal(model, table, jnp.zeros(len(model.parameters))))
        observed = self.observed[number]
        return np.asarray(observed.value - predicted.ravel())[np.asarray(observed.measured) > 0]


def misfit_of(model, observed: Observed, table: ShadowTable, shown, nuisance) -> Float[Array, " datum"]:
    """Data minus model of one photograph, as `Observed.misfit`; `shown`: of the Moon, by its `seen`."""
    return observed.misfit(log_value(model, model.signal(table, shown, nuisance)).ravel())


@eqx.filter_jit
def response(model, table: ShadowTable, z: Float[Array, " parameter"], together, apart):
    """Decoded values (cell, 3) [full scale], and what errors of the light make of their logs, averaged over these.

    By Hermite's polynomials of the errors: the change by the log light of each channel (cell, value, light), and the
    fields of `noise.Bending`. Where a camera cuts off blue, the light as it is would tell of no change at all, and one
    that errs by a few per cent of much.

    - `together`, `apart`: standard deviations of errors of log light, of all channels and of each (cell,).
    """
    nuisance = prior.values(model.parameters, z)
    light = model.light(table, model.seen(z), nuisance)

    def log(light):
        return log_value(model, developed(model, light, nuisance))

    def along(channels, size):
        size = jnp.maximum(size, LEAST_SIZE)[:, None]
        logs = jax.lax.map(lambda node: log(light * jnp.exp(node * size * channels)), jnp.asarray(NODE))
        mean, first, second = (jnp.tensordot(WEIGHT * by, logs, axes=1) for by in (1.0, NODE, NODE**2 - 1.0))
        rest = jnp.tensordot(WEIGHT, (logs - mean) ** 2, axes=1) - first**2
        return mean - log(light), first / size, rest, second

    excess, alike, bent, second = along(jnp.ones(3), together)
    more, each, kinked, _ = jax.vmap(lambda channel: along(channel, apart))(jnp.eye(3))
    root = lambda variance: jnp.sqrt(jnp.maximum(variance, 0.0))
    bending = alike, jnp.sign(second) * root(bent), root(kinked.sum(axis=0)), excess + more.sum(axis=0)
    return developed(model, light, nuisance), jnp.moveaxis(each, 0, -1), *bending


@eqx.filter_jit
def misfit_and_slopes(model, observed: Observed, shadow: Shadow, light, slopes, nuisance):
    """`misfit_of` (datum,) and its derivatives by the limb and the nuisances (datum, parameter).

    - `light`, `slopes`: of the shadow's table, as `limb_light.shadow_slopes` gives them.
    """

    shown, moved = seen_and_slopes(model, nuisance)

    def value(light, shown, nuisance):
        return misfit_of(model, observed, shadow.table(light), shown, nuisance)

    missed, along = jax.linearize(value, light, shown, nuisance)
    dark, still, same = jnp.zeros_like(light), jax.tree.map(jnp.zeros_like, shown), jnp.zeros_like(nuisance)
    view = of_the_view(model)
    moves = jax.tree.map(lambda by: jnp.zeros((nuisance.size, *by.shape[1:])).at[view].set(by), moved)
    by_limb = jax.vmap(lambda slope: along(slope, still, same), out_axes=1)(slopes)
    by_nuisance = jax.vmap(lambda move, unit: along(dark, move, unit), out_axes=1)(moves, jnp.eye(nuisance.size))
    return missed, jnp.concatenate([by_limb, by_nuisance], axis=1)


def places(shared: Sequence[dict[str, object]], models: Sequence) -> tuple[np.ndarray, ...]:
    """Where in z the nuisances of each photograph are: two that give a name the same key share that nuisance.

    - `shared`: for each photograph, keys by the names of its nuisances; one that has none there is its own.
    """
    known: dict[tuple, int] = {}
    found = []
    for number, (keys, model) in enumerate(zip(shared, models, strict=True)):
        names = [parameter.name for parameter in model.parameters]
        whose = [(name, keys[name]) if name in keys else (name, "photograph", number) for name in names]
        found.append(np.array([known.setdefault(key, LIMB + len(known)) for key in whose]))
    return tuple(found)
