"""Which further photograph of the eclipse would tell most: Fisher information over its times and exposures.

It is one that the same camera might take, its shutter known against that of the photograph there is. The model at the
optimum says what it would show, and the fit's errors how well; those of limb and map it has in common with the
photographs that there are (`inverse.shared_errors`), so that one more of the same minute is hardly more than the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from eclipsejax.almanac import nearest_eclipse
from eclipsejax.calendar import read_clock
from eclipsejax.ephemeris import Geometry, geometry, moon_altitude
from inverse.blocked import Blocks, Information, Placed, blocked
from inverse.clock_search import later, seconds_since
from inverse.evidence import Evidence
from inverse.likelihood import LIMB, Likelihood
from inverse.limb_light import Shadow, shadow_of, shadow_slopes
from inverse.map_estimate import Optimum
from inverse.same_camera import SameCamera
from inverse.threads import side_by_side

TIMES = 17  # from the Moon's first contact with the penumbra to its last
HEIGHT = np.radians(5.0)  # of the Moon, at least
BLOCKS, FEW = 6, 7  # blocks along a radius, where there are no more photographs than that
DUST = 0  # its place among the parameters of the limb
HARDLY = 0.9  # of the dust's standard deviation: a photograph that leaves more is not worth naming


@dataclass(frozen=True)
class Further:
    """One further photograph, and what would be left of the uncertainties after it.

    - `utc`: when; `stops`: its exposure against that of the photograph there is, in powers of two.
    - `remains`: standard deviations of the limb's parameters z, in units of those that there are (parameter,).
    - `bits`: that it tells of the limb, nuisances marginalised.
    """

    utc: str
    stops: float
    remains: np.ndarray
    bits: float


def further_photographs(evidence: Sequence[Evidence], likelihood: Likelihood, optimum: Optimum) -> list[Further]:
    """What further photographs of the same eclipse would tell, by time and exposure; none where there are but profiles.

    By the camera of the first photograph, from its place.
    """
    several = [number for number, item in enumerate(evidence) if item.cells is not None]
    wheres = moments(evidence[several[0]]) if several else []
    if not wheres:
        return []
    camera = SameCamera(evidence[several[0]], likelihood, optimum, several[0], blocks_of(len(several)))
    # One table for all: of two, with errors of their own, the difference would pass for knowledge.
    times = [*wheres, *(evidence[number].where for number in several)]
    shadow = shadow_of(times, response=likelihood.shadow.response)
    light = shadow_slopes(shadow, jnp.asarray(optimum.z[:LIMB]))
    known = known_information(likelihood, optimum, several, camera, shadow, light)
    before = np.linalg.inv(known.matrix)[:LIMB, :LIMB]

    def at(where: Geometry) -> list[Further]:
        found = []
        for stops, one in camera.photographs(where, shadow, *light):
            after = np.linalg.inv(known.with_further(one, camera.columns))[:LIMB, :LIMB]
            bits = 0.5 * (np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1]) / np.log(2.0)
            found.append(Further(where.utc, stops, np.sqrt(np.diag(after) / np.diag(before)), float(bits)))
        return found

    return sum(side_by_side(at, wheres, compiled=False), start=[])


def known_information(
    likelihood: Likelihood, optimum: Optimum, several: Sequence[int], camera: SameCamera, shadow: Shadow, light
) -> Information:
    """What photographs of these numbers tell, by blocks; `light`: of `limb_light.shadow_slopes`."""
    found = []
    for number in several:
        model, z = likelihood.models[number], jnp.asarray(optimum.z[likelihood.places[number]])
        errors = likelihood.sources[number], likelihood.errors[number]
        placed = Placed.of(Blocks(model, blocks_of(len(several))), model)
        found.append(blocked(model, *errors, z, placed, shadow, *light))
    return Information(found, [likelihood.columns(number) for number in several], camera.count)


def blocks_of(count: int) -> int:
    """How many along a radius, for so many photographs."""
    return round(BLOCKS * min(1.0, np.sqrt(FEW / count)))


def moments(item: Evidence) -> list[Geometry]:
    """The eclipse at `TIMES`, as far as the Moon is up."""
    contacts = nearest_eclipse(item.where.utc).contacts
    first, last = (read_clock(contacts[name]) for name in ("P1", "P4"))
    times = [later(first, seconds, 0) for seconds in np.linspace(0.0, seconds_since(last, first), TIMES).tolist()]
    wheres = [geometry(utc, *(item.site or ())) for utc in times]
    return [where for where in wheres if float(moon_altitude(where)) > HEIGHT]


def advice(evidence: Sequence[Evidence], likelihood: Likelihood, optimum: Optimum) -> dict[str, Any] | None:
    """For `Fit.diagnostics`: by time the exposure that tells most of the dust, and of all what tells most bits."""
    found = further_photographs(evidence, likelihood, optimum)
    if not found:
        return None

    def told(one: Further) -> dict[str, Any]:
        remains = dict(zip(likelihood.labels, one.remains.tolist(), strict=False))
        return {"utc": one.utc, "stops": one.stops, "remains": remains, "bits": one.bits}

    times = dict.fromkeys(one.utc for one in found)
    each = [min((one for one in found if one.utc == utc), key=lambda one: one.remains[DUST]) for utc in times]
    return {
        "camera_of": next(item.name for item in evidence if item.cells is not None),
        "best_for_dust": [told(one) for one in each],
        "most_bits": told(max(found, key=lambda one: one.bits)),
    }


def in_words(advice: Mapping[str, Any]) -> str:
    """The advice in two sentences."""
    dust = lambda one: next(iter(one["remains"].values()))
    best, most, name = min(advice["best_for_dust"], key=dust), advice["most_bits"], advice["camera_of"]
    if dust(best) > HARDLY:
        first = f"No one further photograph by the camera of {name} would tell much more of the dust."
    else:
        first = (
            f"One further photograph by the camera of {name} would tell most of the dust at {_when(best)}: the "
            f"standard deviation of its logarithm would fall to {dust(best):.0%} of what it is."
        )
    return f"{first} Of the whole limb most, {most['bits']:.1f} bits, would be told at {_when(most)}."


def _when(one: Mapping[str, Any]) -> str:
    stops = one["stops"]
    exposed = "exposed alike" if stops == 0 else f"exposed {abs(stops):g} stops {'more' if stops > 0 else 'less'}"
    return f"{one['utc']}, {exposed}"
