"""The shadow as a table, from which a picture takes each pixel's light.

Irradiance varies fast about the umbra's edge and slowly elsewhere, and the edge moves with the distance of the
surface point. So the table runs in t = asinh((offset - edge(D)) / width), uniformly, at the nearest and farthest
distance of the lunar surface; its entries are logs of irradiance already weighted with the camera's responses.
Between entries: cubic in t, linear in D.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.constants import EARTH_RADIUS, MOON_RADIUS
from eclipsejax.shadow import rays_irradiance, trace_limb
from eclipsejax.traced import real

WIDTH = 1.2e-3  # rad; the grid is finest within this of the umbra's edge
FAINTEST = 1e-30  # of sunlight: keeps the log of opaque air finite


class TableGrid(eqx.Module):
    """Where a table of the shadow has its entries."""

    start: Float[Array, ""]
    """First t."""
    step: Float[Array, ""]
    """Spacing in t."""
    distances: Float[Array, "2"]
    """Of the two tables from the Earth's centre [m]."""
    sun_distance: Float[Array, ""]
    """[m]"""
    sun_radius: Float[Array, ""]
    """[m]"""
    count: int = eqx.field(static=True)
    """Entries in t."""

    def offsets_at(self, distance) -> Float[Array, " offset"]:
        """Angles from the axis of the entries, for points at a distance from the Earth's centre [rad]."""
        from_edge = WIDTH * jnp.sinh(self.start + self.step * jnp.arange(self.count))
        return jnp.abs(from_edge + umbra_edge(distance, self.sun_distance, self.sun_radius))

    def filled(self, light: Float[Array, "offset 2 channel"]) -> "ShadowTable":
        """The table with these channel values."""
        return ShadowTable(self, jnp.log(jnp.maximum(light, FAINTEST)))


class ShadowTable(eqx.Module):
    """Light in the Earth's shadow in some channels."""

    grid: TableGrid
    log_light: Float[Array, "offset 2 channel"]
    """Log of channel values, with those of full sunlight as unit."""

    def __call__(self, offset: Float[Array, "..."], distance: Float[Array, "..."]) -> Float[Array, "... channel"]:
        """Channel values at angles from the axis [rad] and distances from the Earth's centre [m]."""
        grid = self.grid
        t = jnp.arcsinh((offset - umbra_edge(distance, grid.sun_distance, grid.sun_radius)) / WIDTH)
        position = jnp.clip((t - grid.start) / grid.step, 1.0, grid.count - 2.0)
        first = jnp.clip(jnp.floor(position).astype(int) - 1, 0, grid.count - 4)
        x = position - first - 1.0
        # Cubic Lagrange through four neighbours at -1, 0, 1, 2.
        weights = jnp.stack(
            [
                -x * (x - 1.0) * (x - 2.0) / 6.0,
                (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0,
                -(x + 1.0) * x * (x - 2.0) / 2.0,
                (x + 1.0) * x * (x - 1.0) / 6.0,
            ],
            axis=-1,
        )
        near, far = grid.distances
        fraction = ((distance - near) / (far - near))[..., None]
        neighbours = self.log_light[first[..., None] + jnp.arange(4)]  # (..., 4, 2, channel)
        both = jnp.einsum("...n,...ndc->...dc", weights, neighbours)
        return jnp.exp(both[..., 0, :] * (1.0 - fraction) + both[..., 1, :] * fraction)


def umbra_edge(distance, sun_distance, sun_radius):
    """Angle from the axis at which a solid Earth just covers the Sun [rad]."""
    return (
        jnp.arcsin(EARTH_RADIUS / distance)
        + jnp.arcsin(EARTH_RADIUS / sun_distance)
        - jnp.arcsin(sun_radius / sun_distance)
    )


def shadow_table(
    atmosphere, sun, moon_distance, sun_distance, offsets, wavelength, weights, *, quadrature, count: int
) -> ShadowTable:
    """Table of the shadow over the Moon's disc.

    - `moon_distance`, `sun_distance`: of the bodies' centres from the Earth's [m].
    - `offsets`: smallest and largest angle from the axis that will be asked for [rad].
    - `wavelength`, `weights`: (wavelength,) [nm] and (wavelength, channel): a channel's value is the weighted sum of
      the irradiances at the wavelengths.
    - `quadrature`: a `shadow.Quadrature`.
    - `count`: offsets in the table.
    """
    grid = table_grid(sun, moon_distance, sun_distance, offsets, count)
    rays = trace_limb(atmosphere, wavelength, quadrature)

    def at_distance(distance):
        offset = grid.offsets_at(distance)
        irradiance = rays_irradiance(rays, offset, jnp.full(offset.shape, distance), sun_distance, sun, wavelength)
        return irradiance @ weights

    return grid.filled(jax.vmap(at_distance, out_axes=1)(grid.distances))


def table_grid(sun, moon_distance, sun_distance, offsets, count: int) -> TableGrid:
    """Entries over the Moon's disc; the arguments are those of `shadow_table`."""
    distances = moon_distance + jnp.asarray([-1.0, 0.0]) * MOON_RADIUS
    edge = umbra_edge(moon_distance, sun_distance, sun.radius)
    t = jnp.arcsinh((jnp.asarray(offsets) - edge) / WIDTH)
    step = (t[1] - t[0]) / (count - 3)  # one node beyond either end, for the cubic
    return TableGrid(t[0] - step, step, distances, real(sun_distance), sun.radius, count)
