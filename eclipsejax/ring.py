"""Light that the ring of grazing rays and the clear sky above it bring to one point, at one wavelength.

The integral of `shadow` over tangent height; what the Sun covers of each circle of the sky is handed in, so that
rings of which only a sector counts are summed as well.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.limb import clustered
from eclipsejax.limb_table import LimbTable
from eclipsejax.sunlight import light_above, sky_angle, solid_angle

# The least offset [rad]: on the axis itself the arcs would be a step at the Sun's edge, whose derivative the frozen
# nodes cannot see. The irradiance there changes by 1e-12.
AXIS = 1e-9


class LimbRays(NamedTuple):
    """Rays at one wavelength."""

    table: LimbTable
    coefficients: Float[Array, " constituent"]  # turn columns into optical depth
    limb_transmission: Callable


class Sky(NamedTuple):
    """Where the Sun stands in the sky of a point."""

    offset: Float[Array, ""]  # of its centre, at the Earth's, from the direction opposite to the point [rad]
    distance: Float[Array, ""]  # of the point [m]
    sun_distance: Float[Array, ""]  # [m]
    radius: Float[Array, ""]  # of the Sun, seen from the Earth [rad]


def ring_light(rays: LimbRays, sky: Sky, darkening, arcs, top, order: int) -> Float[Array, ""]:
    """Light of the ring with the brightness of the Sun's centre as unit [sr].

    - `darkening`: A_k of the Sun's I(mu)/I(1) = sum A_k mu^k.
    - `arcs`: from the sky angle psi (...) [rad] to the moments of the arcs inside the Sun (..., 6).
    - `top`: impact parameter of the ray along the top of the atmosphere [m].
    - `order`: nodes on each piece of the integral over tangent height.
    """
    offset, distance, sun_distance, radius = sky
    edges = jnp.stack([-(offset + radius), -jnp.abs(offset - radius), jnp.abs(offset - radius), offset + radius])
    node, weight = clustered(order)

    def panel(panel):
        """Contribution of the rays of one panel of tangent heights."""
        start, stop = panel.pieces(distance, sun_distance, edges)
        u = start[:, None] + (stop - start)[:, None] * node
        ray = panel.at(u)
        transmission = jnp.exp(-ray.columns @ rays.coefficients) * rays.limb_transmission(ray.tangent_height)
        psi = sky_angle(ray.impact, distance, sun_distance) - ray.bending
        light = transmission * (arcs(psi) @ darkening)
        measure = solid_angle(ray.impact, distance) * ray.impact_slope * (stop - start)[:, None] * weight
        return jnp.sum(measure * light)

    refracted = jnp.sum(jax.vmap(panel)(rays.table))
    return refracted + light_above(top, offset, distance, sun_distance, radius, darkening, order=order, arcs=arcs)
