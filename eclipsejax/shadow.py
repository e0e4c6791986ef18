"""Sunlight inside the Earth's shadow: every grazing ray that brings part of the Sun's disc to one point.

A ray of impact parameter a reaches a point at distance D under the angle asin(a / D) from the Earth's centre;
traced back it comes from the Sun's sky at the angle (at the Earth's centre, from the direction opposite to the
point)

    psi(a) = asin(a / D) + asin(a / D_s) - bending(a).

The Sun's centre stands at the angle `offset` from that direction. Radiance is conserved along a ray, so the
irradiance is

    E = int sin(beta) (d beta / d a) T(a) [ 2 int I(mu) dphi over the arc of the circle |psi(a)| inside the Sun ] da,

divided by the same for the whole Sun. The integral runs over the tangent height, never over psi, which is not
monotone. It is split at the breaks of the atmosphere and where the circle touches the Sun's edge; both ends of each
piece are square-root singular, and the nodes cluster there like those of a Chebyshev rule.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.arc import arc_moments
from eclipsejax.constants import ASTRONOMICAL_UNIT, ATMOSPHERE_TOP, EARTH_RADIUS, MOON_MEAN_DISTANCE
from eclipsejax.errors import InputError
from eclipsejax.limb_sectors import irradiance_by_sectors, is_lopsided
from eclipsejax.limb_shape import LimbShape
from eclipsejax.limb_table import limb_table
from eclipsejax.ring import AXIS, LimbRays, Sky, ring_light
from eclipsejax.sun import Sun
from eclipsejax.sunlight import sky_angle, whole_sun
from eclipsejax.tolerance import reached
from eclipsejax.traced import real


class Quadrature(NamedTuple):
    """Node counts that together meet a tolerance."""

    ray: int  # Gauss-Legendre nodes a panel along a ray
    table: int  # Chebyshev nodes a panel of tangent heights
    dispersion: int  # refractivities at which rays are traced, for all wavelengths
    shadow: int  # nodes on each piece of the integral over tangent height
    arc: int  # nodes on the arc inside the Sun
    sector: int  # nodes on each piece of an arc where the limb changes with azimuth


# Measured against brute-force integration (tests/test_shadow.py): 390-770 nm, offsets 0-1.4 degrees, light down to
# 1e-18. Largest relative errors 4e-3, 6e-4, 4e-5 and 6e-7; no worse over 60 random atmospheres.
QUADRATURES = {
    1e-2: Quadrature(ray=5, table=9, dispersion=2, shadow=10, arc=3, sector=4),
    1e-3: Quadrature(ray=6, table=11, dispersion=3, shadow=12, arc=4, sector=4),
    1e-4: Quadrature(ray=8, table=13, dispersion=3, shadow=14, arc=5, sector=6),
    1e-6: Quadrature(ray=12, table=18, dispersion=4, shadow=28, arc=10, sector=10),
}


def quadrature_for(tolerance: float) -> Quadrature:
    """The cheapest node counts that meet a relative tolerance."""
    return QUADRATURES[reached(QUADRATURES, tolerance)]


def shadow_irradiance(
    atmosphere,
    offset,
    wavelength,
    *,
    sun: Sun | None = None,
    moon_distance=MOON_MEAN_DISTANCE,
    sun_distance=ASTRONOMICAL_UNIT,
    position_angle=None,
    shape: LimbShape | None = None,
    tolerance: float = 1e-3,
) -> Float[Array, "offset wavelength"]:
    """Fraction of unobstructed sunlight [-] at angles from the axis of the Earth's shadow.

    Direct light only: refracted and dimmed, not scattered. Exactly 1 outside the penumbra. Without the cosine of the
    receiving surface.

    - `atmosphere`: with a leading limb axis (`limb_sectors.along_limb`) it differs along the limb.
    - `offset`: angle at the Earth's centre between the point and the shadow's axis, shape (offset,) [rad].
    - `wavelength`: shape (wavelength,) [nm].
    - `moon_distance`: distance of the point itself from the Earth's centre, scalar or shape (offset,) [m].
    - `sun_distance`: from the Earth's centre [m].
    - `position_angle`: of the point about the axis, from celestial north through east, scalar or shape (offset,) [rad].
      The limb on the same side lights it with rays that have not crossed the axis. Only a limb that is not the same
      all around needs it.
    - `shape`: the flattened Earth; None is the sphere of `EARTH_RADIUS`.
    - `tolerance`: largest relative error wanted; one of the measured settings of `QUADRATURES` that meets it is taken.
    """
    sun = Sun() if sun is None else sun
    offset, wavelength = jnp.atleast_1d(real(offset)), jnp.atleast_1d(real(wavelength))
    moon_distance, counts = jnp.broadcast_to(real(moon_distance), offset.shape), quadrature_for(tolerance)
    if not is_lopsided(atmosphere, shape):
        return _shadow(atmosphere, sun, offset, wavelength, moon_distance, real(sun_distance), counts)
    if position_angle is None:
        raise InputError("This shadow is not the same all around: give `position_angle` [rad] for each offset.")
    position_angle = jnp.broadcast_to(real(position_angle), offset.shape)
    return irradiance_by_sectors(
        atmosphere, shape, sun, offset, position_angle, wavelength, moon_distance, real(sun_distance), counts
    )


@eqx.filter_jit
def _shadow(atmosphere, sun, offset, wavelength, distance, sun_distance, counts):
    table, coefficients = limb_table(atmosphere, wavelength, counts)
    darkening = jax.vmap(sun.limb_darkening_coefficients)(wavelength)
    radius = jnp.arcsin(sun.radius / sun_distance)
    top = EARTH_RADIUS + ATMOSPHERE_TOP

    def one(offset, distance):
        outside = offset - radius >= sky_angle(top, distance, sun_distance)
        # Far outside, integrals that do not count would have gradients that are not finite.
        offset = jnp.sqrt(jnp.where(outside, 0.0, offset) ** 2 + AXIS**2)
        sky = Sky(offset, distance, sun_distance, radius)
        arcs = lambda psi: arc_moments(offset, jnp.abs(psi), radius, counts.arc)

        def by_wavelength(table, coefficients, darkening):
            rays = LimbRays(table, coefficients, atmosphere.limb_transmission)
            light = ring_light(rays, sky, darkening, arcs, top, counts.shadow)
            return light / whole_sun(distance, sun_distance, radius, darkening, counts.shadow, offset)

        return jnp.where(outside, 1.0, jax.vmap(by_wavelength)(table, coefficients, darkening))

    return jax.vmap(one)(offset, distance)
