"""Where the umbra seems to end: the size of the Earth's shadow as observers who time craters see it.

The light falls smoothly through the edge of the umbra. The eye judges ratios of brightness, so the edge is taken where
the logarithm of the luminance is steepest; the luminance itself is steepest far out in the penumbra.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS, MOON_MEAN_DISTANCE
from eclipsejax.moon import Moon
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.sun import Sun
from eclipsejax.sunlight import umbra_edge
from eclipsejax.traced import real
from eclipsejax.wavelengths import binned_weights

# Offsets searched, from inside to outside the edge of an airless Earth's umbra [rad]: steps of 2 km.
INSIDE, OUTSIDE, COUNT = 2.5e-4, 7.5e-4, 193
WAVELENGTHS = 20


@eqx.filter_jit
def umbra_radius(
    atmosphere, *, sun: Sun | None = None, moon_distance=MOON_MEAN_DISTANCE, sun_distance=ASTRONOMICAL_UNIT
) -> Float[Array, ""]:
    """Angle from the axis, at the Earth's centre, at which the log of the luminance rises fastest [rad].

    Good to 1 km on the Moon. NaN where the rise has no summit within 100 km inside and 290 km outside of the umbra of
    an airless Earth: without air, or under dust so thick that the shadow has no such edge.

    - `moon_distance`, `sun_distance`: of the lunar surface and of the Sun from the Earth's centre [m].
    """
    sun = Sun() if sun is None else sun
    distance, sun_distance = real(moon_distance), real(sun_distance)
    wavelength, weights = binned_weights(sun, Moon(), "xyz", WAVELENGTHS)
    start = umbra_edge(distance, sun_distance, sun.radius) - INSIDE
    step = (INSIDE + OUTSIDE) / (COUNT - 1)
    offset = start + step * jnp.arange(COUNT)
    operator = shadow_operator(sun, offset[None], distance[None], sun_distance, wavelength, tolerance=1e-4)
    luminance = operator(atmosphere)[0] @ weights[:, 1]
    rise = jnp.diff(jnp.log(luminance))
    summit = jnp.argmax(rise)
    inner, middle, outer = (rise[jnp.clip(summit + k, 0, COUNT - 2)] for k in (-1, 0, 1))
    curvature = inner - 2.0 * middle + outer
    shift = 0.5 * (inner - outer) / jnp.where(curvature < 0.0, curvature, -1.0)
    inside = (summit > 0) & (summit < COUNT - 2) & (curvature < 0.0)
    return jnp.where(inside, start + step * (summit + 0.5 + shift), jnp.nan)


def umbra_enlargement(
    atmosphere, *, sun: Sun | None = None, moon_distance=MOON_MEAN_DISTANCE, sun_distance=ASTRONOMICAL_UNIT
) -> Float[Array, ""]:
    """By how much larger an airless Earth would have to be to cast an umbra of this `umbra_radius` [m].

    Crater timings give 87 km (Herald & Sinnott 2014; H. Vital for 2008-02-21: 87 +- 3 km).
    """
    where = {"moon_distance": moon_distance, "sun_distance": sun_distance}
    sun = Sun() if sun is None else sun
    beyond = umbra_radius(atmosphere, sun=sun, **where) - umbra_edge(
        real(moon_distance), real(sun_distance), sun.radius
    )
    # The edge moves by the parallax of Moon and Sun: d(edge) / d(radius of the Earth).
    reach = 1.0 / jnp.sqrt(real(moon_distance) ** 2 - EARTH_RADIUS**2) + 1.0 / real(sun_distance)
    return beyond / reach
