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

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.arc import arc_moments
from eclipsejax.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS, MOON_MEAN_DISTANCE
from eclipsejax.limb_table import LimbTable, limb_table
from eclipsejax.sun import Sun
from eclipsejax.sunlight import clustered, light_above, sky_angle, solid_angle, whole_sun
from eclipsejax.tolerance import reached
from eclipsejax.traced import real


class Quadrature(NamedTuple):
    """Node counts that together meet a tolerance."""

    ray: int  # Gauss-Legendre nodes a panel along a ray
    table: int  # Chebyshev nodes a panel of tangent heights
    dispersion: int  # refractivities at which rays are traced, for all wavelengths
    shadow: int  # nodes on each piece of the integral over tangent height
    arc: int  # nodes on the arc inside the Sun


# Measured against brute-force integration (tests/test_shadow.py): 390-770 nm, offsets 0-1.4 degrees, light down to
# 1e-18. Largest relative errors 4e-3, 6e-4, 4e-5 and 6e-7; no worse over 60 random atmospheres.
QUADRATURES = {
    1e-2: Quadrature(ray=5, table=9, dispersion=2, shadow=10, arc=3),
    1e-3: Quadrature(ray=6, table=11, dispersion=3, shadow=12, arc=4),
    1e-4: Quadrature(ray=8, table=13, dispersion=3, shadow=14, arc=5),
    1e-6: Quadrature(ray=12, table=18, dispersion=4, shadow=28, arc=10),
}

# The least offset [rad]: on the axis itself the arcs would be a step at the Sun's edge, whose derivative the frozen
# nodes cannot see. The irradiance there changes by 1e-12.
AXIS = 1e-9


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
    tolerance: float = 1e-3,
) -> Float[Array, "offset wavelength"]:
    """Fraction of unobstructed sunlight [-] at angles from the axis of the Earth's shadow.

    Direct light only: refracted and dimmed, not scattered. Exactly 1 outside the penumbra. Without the cosine of the
    receiving surface.

    - `offset`: angle at the Earth's centre between the point and the shadow's axis, shape (offset,) [rad].
    - `wavelength`: shape (wavelength,) [nm].
    - `moon_distance`: distance of the point itself from the Earth's centre, scalar or shape (offset,) [m].
    - `sun_distance`: from the Earth's centre [m].
    - `position_angle`: of the point about the axis; the atmosphere is spherically symmetric, so it changes nothing yet.
    - `tolerance`: largest relative error wanted; one of the measured settings of `QUADRATURES` that meets it is taken.
    """
    del position_angle
    return _shadow(
        atmosphere,
        Sun() if sun is None else sun,
        jnp.atleast_1d(real(offset)),
        jnp.atleast_1d(real(wavelength)),
        real(moon_distance),
        real(sun_distance),
        quadrature_for(tolerance),
    )


@eqx.filter_jit
def _shadow(atmosphere, sun, offset, wavelength, distance, sun_distance, counts):
    rays = trace_limb(atmosphere, wavelength, counts)
    return rays_irradiance(rays, offset, jnp.broadcast_to(distance, offset.shape), sun_distance, sun, wavelength)


class TracedLimb(NamedTuple):
    """Rays of an atmosphere, traced once for any number of offsets and distances."""

    table: LimbTable  # leading axis: wavelength
    coefficients: Float[Array, "wavelength constituent"]  # turn columns into optical depth
    limb_transmission: Callable
    counts: Quadrature


def trace_limb(atmosphere, wavelength, counts: Quadrature) -> TracedLimb:
    """Trace the rays of an atmosphere for all wavelengths [nm]."""
    table, coefficients = limb_table(atmosphere, wavelength, counts)
    return TracedLimb(table, coefficients, atmosphere.limb_transmission, counts)


def rays_irradiance(
    rays: TracedLimb, offset, distance, sun_distance, sun: Sun, wavelength
) -> Float[Array, "offset wavelength"]:
    """`shadow_irradiance` with the rays already traced."""
    darkening = jax.vmap(sun.limb_darkening_coefficients)(wavelength)

    def one(offset, distance):
        by_wavelength = jax.vmap(
            lambda table, coefficients, darkening: _irradiance(
                table, coefficients, rays, offset, distance, sun_distance, sun, darkening
            )
        )
        return by_wavelength(rays.table, rays.coefficients, darkening)

    return jax.vmap(one)(offset, distance)


def _irradiance(table, coefficients, rays, offset, distance, sun_distance, sun, darkening):
    """One offset, one wavelength."""
    counts = rays.counts
    radius = jnp.arcsin(sun.radius / sun_distance)
    top = EARTH_RADIUS + table.upper[-1]
    outside = offset - radius >= sky_angle(top, distance, sun_distance)
    # Far outside, integrals that do not count would have gradients that are not finite.
    offset = jnp.sqrt(jnp.where(outside, 0.0, offset) ** 2 + AXIS**2)
    edges = jnp.stack([-(offset + radius), -jnp.abs(offset - radius), jnp.abs(offset - radius), offset + radius])
    node, weight = clustered(counts.shadow)

    def panel(panel):
        """Contribution of the rays of one panel of tangent heights."""
        start, stop = panel.pieces(distance, sun_distance, edges)
        u = start[:, None] + (stop - start)[:, None] * node
        ray = panel.at(u)
        transmission = jnp.exp(-ray.columns @ coefficients) * rays.limb_transmission(ray.tangent_height)
        psi = sky_angle(ray.impact, distance, sun_distance) - ray.bending
        light = transmission * (arc_moments(offset, jnp.abs(psi), radius, counts.arc) @ darkening)
        measure = solid_angle(ray.impact, distance) * ray.impact_slope * (stop - start)[:, None] * weight
        return jnp.sum(measure * light)

    refracted = jnp.sum(jax.vmap(panel)(table))
    direct = light_above(
        top, offset, distance, sun_distance, radius, darkening, order=counts.shadow, arc_order=counts.arc
    )
    whole = whole_sun(distance, sun_distance, radius, darkening, counts.shadow, offset)
    return jnp.where(outside, 1.0, (refracted + direct) / whole)
