"""Sunlight that no air has touched: the whole Sun, and what of it passes above the atmosphere.

A ray of impact parameter a reaches a point at distance D under the angle beta = asin(a / D) from the Earth's
centre, and comes, traced back without bending, from asin(a / D) + asin(a / D_s) in the Sun's sky.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.limb import clustered
from eclipsejax.traced import safe_sqrt


def sky_angle(impact, distance, sun_distance, xp=jnp):
    """Where a straight ray comes from: angle from the direction opposite to the point [rad].

    - `xp`: JAX's or plain NumPy.
    """
    return xp.arcsin(impact / distance) + xp.arcsin(impact / sun_distance)


def umbra_edge(distance, sun_distance, sun_radius, xp=jnp):
    """Angle from the axis at which a solid Earth just covers a Sun of a radius [m]: the edge of the umbra [rad].

    - `xp`: JAX's or plain NumPy.
    """
    return sky_angle(EARTH_RADIUS, distance, sun_distance, xp) - xp.arcsin(sun_radius / sun_distance)


def solid_angle(impact, distance):
    """sin(beta) d(beta)/da, the solid angle of a ring of rays by impact parameter and azimuth [1/m]."""
    sine = impact / distance
    return sine / (distance * jnp.sqrt(1.0 - sine**2))


def impact_at(psi, distance, sun_distance):
    """Inverse of `sky_angle`, better than 1e-12 by two Newton steps [m]."""
    reach = 1.0 / distance + 1.0 / sun_distance
    impact = psi / reach
    for _ in range(2):
        impact = impact - (sky_angle(impact, distance, sun_distance) - psi) / reach
    return impact


def whole_sun(
    distance: Float[Array, ""],
    sun_distance: Float[Array, ""],
    radius: Float[Array, ""],
    darkening,
    order: int,
    offset: Float[Array, ""] | float = 0.0,
) -> Float[Array, ""]:
    """Light of the whole Sun at a point, with the brightness of its centre as unit [sr].

    Integrated as on the axis; off it the Sun is nearer by a little, 1e-6 of the light at the edge of the penumbra.

    - `radius`: of the Sun, seen from the Earth [rad].
    - `darkening`: A_k of I(mu)/I(1) = sum A_k mu^k.
    - `offset`: of the Sun's centre from the direction opposite to the point [rad].
    """
    node, weight = clustered(order)
    edge = impact_at(radius, distance, sun_distance)
    theta = sky_angle(edge * node, distance, sun_distance)
    mu = safe_sqrt(1.0 - (jnp.sin(theta) / jnp.sin(radius)) ** 2)
    ring = 2.0 * jnp.pi * jnp.polyval(darkening[::-1], mu)
    nearer = 1.0 + 4.0 * distance * sun_distance * (jnp.sin(0.5 * offset) / (distance + sun_distance)) ** 2
    return nearer * jnp.sum(solid_angle(edge * node, distance) * ring * edge * weight)


def light_above(top, offset, distance, sun_distance, radius, darkening, *, order: int, arcs) -> Float[Array, ""]:
    """Light of the part of the Sun seen above impact parameter `top` [m], in the unit of `whole_sun` [sr].

    - `offset`: of the Sun's centre from the direction opposite to the point [rad].
    - `arcs`: from radii of circles of the sky (...) [rad] to the moments of their arcs inside the Sun (..., 6), as
      `arc.arc_moments`.
    """
    node, weight = clustered(order)
    edges = jnp.stack([jnp.abs(offset - radius), offset + radius])
    visible = jnp.maximum(edges, sky_angle(top, distance, sun_distance))
    cuts = jnp.concatenate([jnp.atleast_1d(top), impact_at(visible, distance, sun_distance)])
    impact = cuts[:-1, None] + jnp.diff(cuts)[:, None] * node
    light = arcs(sky_angle(impact, distance, sun_distance)) @ darkening
    return jnp.sum(solid_angle(impact, distance) * jnp.diff(cuts)[:, None] * weight * light)
