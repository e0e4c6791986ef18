"""The shadow as a fixed operator: what depends on the Sun and the offsets alone is worked out once.

The arc A of a circle of radius |psi| inside the Sun depends on offset, |psi| and the Sun, not on the air. With its
primitive P(psi) = int A d psi in a table, the rays between two neighbouring tangent heights, over which the flux
per unit of psi is nearly constant, contribute

    (flux / delta psi) (P(psi + delta psi) - P(psi)),

second order in the stretch, with the square-root edges of A exact and none of the root finding of `shadow`. It serves
where one scene is computed for many atmospheres: a fit.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.arc import arc_moments
from eclipsejax.constants import ATMOSPHERE_TOP, EARTH_RADIUS
from eclipsejax.limb_table import limb_table
from eclipsejax.sun import Sun
from eclipsejax.sunlight import light_above, whole_sun
from eclipsejax.traced import real

LOWEST_ANGLE = -0.012  # rad; psi of a ray at the ground at perigee, in air twice as dense as ours
_ARC_ORDER = 8
_DIRECT_ORDER = 20
_SUBSTEPS = 8  # midpoints of the primitive's integral between two entries of its table


class RayCounts(NamedTuple):
    """Node counts of the rays, and of the stretches between them."""

    ray: int = 5
    table: int = 7
    dispersion: int = 2
    stretches: tuple[int, ...] = (48, 48, 24, 16, 12, 12, 12, 24)  # a panel, from the ground up; the last for all above


class ShadowOperator(eqx.Module):
    """Maps an atmosphere to irradiance at fixed offsets, distances and wavelengths."""

    wavelength: Float[Array, " wavelength"]
    """[nm]"""
    distance: Float[Array, " offset"]
    """Of the points from the Earth's centre [m]."""
    sun_distance: Float[Array, ""]
    """[m]"""
    primitive: Float[Array, "wavelength offset angle"]
    """P on a uniform grid of psi, divided by the light of the whole Sun [m^2]."""
    arc: Float[Array, "wavelength offset angle"]
    """Its slope A [m^2/rad]."""
    direct: Float[Array, "offset wavelength"]
    """Light that passes above the air [-]."""
    step: Float[Array, ""]
    """Of the grid of psi [rad]."""
    counts: RayCounts = eqx.field(static=True)

    def __call__(self, atmosphere) -> Float[Array, "offset wavelength"]:
        """Fraction of unobstructed sunlight, as by `shadow.shadow_irradiance`."""
        breaks = getattr(atmosphere, "dense_breaks", atmosphere.breaks)
        table, coefficients = limb_table(atmosphere, self.wavelength, self.counts, breaks=breaks)
        panel, u, lower, upper = _stretches(self.counts.stretches, breaks.size - 1)

        def rays_at(panel, u):
            chosen = jax.tree.map(lambda leaf: leaf[:, panel], table)
            return jax.vmap(jax.vmap(lambda panel, u: panel.at(u)), in_axes=(0, None))(chosen, jnp.asarray(u))

        ends = rays_at(panel, u)  # (wavelength, edge)
        rays = rays_at(panel[lower], 0.5 * (u[lower] + u[upper]))  # (wavelength, stretch)
        depth = jnp.einsum("wsc,wc->ws", rays.columns, coefficients)
        light = jnp.exp(-depth) * atmosphere.limb_transmission(rays.tangent_height)
        weight = light * rays.impact * rays.impact_slope * (u[upper] - u[lower])

        def one(primitive, arc, distance, impact, bending, weight, rays_impact):
            """One wavelength, one offset."""
            psi = jnp.arcsin(impact / distance) + jnp.arcsin(impact / self.sun_distance) - bending
            total = self._interpolate(primitive, arc, psi)
            width = psi[upper] - psi[lower]
            steep = jnp.abs(width) > 1e-9  # a stretch that straddles a turning point of psi is worth nothing
            mean = jnp.where(steep, (total[upper] - total[lower]) / jnp.where(steep, width, 1.0), 0.0)
            return jnp.sum(weight * mean / jnp.sqrt(1.0 - (rays_impact / distance) ** 2))

        by_offset = jax.vmap(one, in_axes=(0, 0, 0, None, None, None, None))
        by_wavelength = jax.vmap(by_offset, in_axes=(0, 0, None, 0, 0, 0, 0), out_axes=1)
        refracted = by_wavelength(
            self.primitive, self.arc, self.distance, ends.impact, ends.bending, weight, rays.impact
        )
        return refracted + self.direct

    def _interpolate(self, primitive, arc, psi):
        """P(psi): cubic through values and slopes."""
        position = jnp.clip((psi - LOWEST_ANGLE) / self.step, 0.0, primitive.size - 1.000001)
        index = position.astype(int)
        t = position - index
        rise = primitive[index + 1] - primitive[index]
        first, last = self.step * arc[index] - rise, self.step * arc[index + 1] - rise
        return primitive[index] + t * rise + t * (1.0 - t) * (first * (1.0 - t) - last * t)


def shadow_operator(
    sun: Sun, offset, distance, sun_distance, wavelength, *, counts: RayCounts | None = None, angles: int = 1024
) -> ShadowOperator:
    """Work out the operator; no atmosphere is needed.

    - `offset`, `distance`: of the points from the axis [rad] and from the Earth's centre [m], shape (offset,).
    - `sun_distance`: [m].
    - `wavelength`: (wavelength,) [nm].
    - `counts`: of the rays; the default keeps 2e-3 of the irradiance (tests/test_shadow_operator.py).
    - `angles`: entries of the table of P.
    """
    radius = jnp.arcsin(sun.radius / sun_distance)
    darkening = jax.vmap(sun.limb_darkening_coefficients)(wavelength)  # (wavelength, 6)
    highest = jnp.max(offset) + radius + 1e-4
    step = (highest - LOWEST_ANGLE) / (angles - 1)
    grid = LOWEST_ANGLE + step * jnp.arange(angles)
    middles = grid[:-1, None] + step * (jnp.arange(_SUBSTEPS) + 0.5) / _SUBSTEPS

    def arcs(offset, psi):
        return arc_moments(offset, jnp.abs(psi), radius, _ARC_ORDER) @ darkening.T

    def tables(offset):
        """P and A, (wavelength, angle)."""
        steps = jnp.mean(arcs(offset, middles), axis=1) * step
        primitive = jnp.concatenate([jnp.zeros((1, steps.shape[1])), jnp.cumsum(steps, axis=0)])
        return primitive.T, arcs(offset, grid).T

    def direct_and_whole(offset, distance, darkening):
        direct = light_above(
            jnp.asarray(EARTH_RADIUS + ATMOSPHERE_TOP),
            offset,
            distance,
            sun_distance,
            radius,
            darkening,
            order=_DIRECT_ORDER,
            arc_order=_ARC_ORDER,
        )
        return direct, whole_sun(distance, sun_distance, radius, darkening, _DIRECT_ORDER)

    primitive, arc = jax.lax.map(tables, offset)  # one after the other: a table needs 8 times its size on the way
    by_wavelength = jax.vmap(direct_and_whole, in_axes=(None, None, 0))
    direct, whole = jax.vmap(by_wavelength, in_axes=(0, 0, None))(offset, distance, darkening)
    scale = (1.0 / (whole * distance[:, None] ** 2)).T[..., None]
    return ShadowOperator(
        wavelength=wavelength,
        distance=distance,
        sun_distance=real(sun_distance),
        primitive=jnp.moveaxis(primitive, 1, 0) * scale,
        arc=jnp.moveaxis(arc, 1, 0) * scale,
        direct=direct / whole,
        step=step,
        counts=RayCounts() if counts is None else counts,
    )


def _stretches(counts, panels):
    """Panel and u of every edge between stretches, and the first and last edge of every stretch."""
    counts = [counts[min(panel, len(counts) - 1)] for panel in range(panels)]
    panel = np.concatenate([np.full(n + 1, index) for index, n in enumerate(counts)])
    u = np.concatenate([np.linspace(0.0, 1.0, n + 1) for n in counts])
    lower = np.flatnonzero(np.diff(panel) == 0)
    return panel, u, lower, lower + 1
