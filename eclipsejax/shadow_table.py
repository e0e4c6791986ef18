"""The shadow as a table, from which a picture takes each pixel's light.

Irradiance varies fastest just inside the umbra's edge, where the last of the Sun sets behind the stratosphere, and has
kinks all over the umbra, where the Sun's edge passes a caustic. Both move with the distance of the surface point as the
umbra's edge does. So the table runs uniformly in

    t = (offset - edge(D)) / SPACING + asinh((offset - edge(D) - STEEPEST) / WIDTH)

at the nearest and farthest distance of the lunar surface, or at one between; its entries are logs of irradiance already
weighted with the camera's responses. Between entries: cubic in t, linear in D.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from eclipsejax.constants import MOON_RADIUS
from eclipsejax.errors import InputError
from eclipsejax.limb_sectors import is_lopsided
from eclipsejax.limb_shape import LimbShape
from eclipsejax.scattered import ring_glow
from eclipsejax.scatterers import Scatterers
from eclipsejax.shadow_operator import ShadowOperator, shadow_operator
from eclipsejax.sun import Sun
from eclipsejax.sunlight import umbra_edge
from eclipsejax.traced import real

SPACING, STEEPEST, WIDTH = 8.3e-4, -6e-4, 1e-4  # rad; the least errors of 128 to 384 entries among 12 trials
FAINTEST = 1e-30  # of sunlight: keeps the log of opaque air finite
_TORN = 20.0  # between neighbouring logs: the edge of a shadow without light


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

    def offsets_at(self, distance, entry=None) -> Float[Array, " offset"]:
        """Angles from the axis of the entries, for points at a distance from the Earth's centre [rad].

        - `entry`: numbers of entries, not necessarily whole; all by default.
        """
        return jnp.abs(self.from_axis(distance, entry))

    def from_axis(self, distance, entry=None) -> Float[Array, " offset"]:
        """The same as `offsets_at`, ascending: negative for entries beyond the axis [rad]."""
        from_edge = from_edge_at(self.start + self.step * (jnp.arange(self.count) if entry is None else entry))
        return from_edge + umbra_edge(distance, self.sun_distance, self.sun_radius)

    def places(self, offset: Float[Array, "..."], distance: Float[Array, "..."], angle=None) -> "Places":
        """Where angles from the axis [rad] and distances from the Earth's centre [m] are in a table.

        - `angle`: position angle about the axis, for tables that need it [rad].
        """
        t = variable(offset - umbra_edge(distance, self.sun_distance, self.sun_radius))
        near, far = self.distances
        position = jnp.clip((t - self.start) / self.step, 1.0, self.count - 2.0)
        return Places(position, (distance - near) / (far - near), angle)

    def filled(self, light: Float[Array, "offset side channel"]) -> "ShadowTable":
        """The table with these channel values."""
        return ShadowTable(self, jnp.log(jnp.maximum(light, FAINTEST)))


class Places(NamedTuple):
    """Where points are in a table: in units of its entries, between its two distances, and about the axis [rad]."""

    position: Float[Array, "..."]
    fraction: Float[Array, "..."]
    angle: Float[Array, "..."] | None = None


class ShadowTable(eqx.Module):
    """Light in the Earth's shadow in some channels."""

    grid: TableGrid
    log_light: Float[Array, "offset side channel"]
    """Log of channel values, with those of full sunlight as unit, at the nearest and the farthest distance, or at one
    between that serves for both."""

    def __call__(self, offset: Float[Array, "..."], distance: Float[Array, "..."]) -> Float[Array, "... channel"]:
        """Channel values at angles from the axis [rad] and distances from the Earth's centre [m]."""
        return self.at(self.grid.places(offset, distance))

    def at(self, places: Places) -> Float[Array, "... channel"]:
        """Channel values at places that are known."""
        return jnp.exp(self.log_at(places))

    def log_at(self, places: Places, row: Int[Array, "..."] | int = 0) -> Float[Array, "... channel"]:
        """Logs of channel values.

        - `row`: where the table starts, of several that stand one behind the other.
        """
        position, fraction, _ = places
        first = jnp.clip(jnp.floor(position).astype(int) - 1, 0, self.grid.count - 4)
        x = position - first - 1.0
        weights = cubic_weights(x)

        def along(entries):
            """Between four neighbours: cubic, but straight beside total darkness, where a cubic would jut out."""
            cubic = sum(w * entry for w, entry in zip(weights, entries, strict=True))
            torn = jnp.minimum(entries[0], entries[3]) < jnp.maximum(entries[1], entries[2]) - _TORN
            return jnp.where(torn, entries[1] + jnp.clip(x, 0.0, 1.0) * (entries[2] - entries[1]), cubic)

        def channel(table):
            near, *far = (along([table[row + first + k, side] for k in range(4)]) for side in range(table.shape[1]))
            return near + fraction * (far[0] - near) if far else near

        # One entry after the other, not in blocks: the compiler then makes one loop over the pixels, without copies.
        return jnp.stack([channel(self.log_light[..., i]) for i in range(self.log_light.shape[-1])], axis=-1)


def cubic_weights(x: Float[Array, "..."]) -> tuple[Float[Array, "..."], ...]:
    """Lagrange's weights at x of four neighbours at -1, 0, 1, 2."""
    return (
        -x * (x - 1.0) * (x - 2.0) / 6.0,
        (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0,
        -(x + 1.0) * x * (x - 2.0) / 2.0,
        (x + 1.0) * x * (x - 1.0) / 6.0,
    )


def variable(from_edge):
    """t at an offset from the umbra's edge [rad]."""
    return from_edge / SPACING + jnp.arcsinh((from_edge - STEEPEST) / WIDTH)


def from_edge_at(t):
    """Offset from the umbra's edge [rad] at t: halving, then a step of Newton's, which carries the derivatives."""
    still = jax.lax.stop_gradient(t)

    def halve(_, ends):
        low, high = ends
        middle = 0.5 * (low + high)
        above = variable(middle) > still
        return jnp.where(above, low, middle), jnp.where(above, middle, high)

    # asinh lies between -12 and 12 within 8 rad of the edge, so |t| * SPACING is never off by more than 12 SPACING.
    around = still * SPACING
    low, _ = jax.lax.fori_loop(0, 40, halve, (around - 12.0 * SPACING, around + 12.0 * SPACING))
    slope = 1.0 / SPACING + 1.0 / jnp.sqrt((low - STEEPEST) ** 2 + WIDTH**2)
    return low - (variable(low) - t) / slope


class Flattening(NamedTuple):
    """What `flattened_table` needs of a scene."""

    shape: LimbShape
    sun: Sun
    wavelength: Float[Array, " wavelength"]  # at which the light's swing about its mean is worked out [nm]
    weights: Float[Array, "wavelength channel"]


class Tabulator(eqx.Module):
    """Makes the table of a scene for any atmosphere."""

    grid: TableGrid
    operator: ShadowOperator
    weights: Float[Array, "wavelength channel"]
    scatterers: Scatterers | None = None
    """Of the light that the limb scatters into the shadow; None leaves it out."""
    flattening: Flattening | None = None
    """Of the Earth; None for a sphere. The tabulator itself gives the mean over the angles about the axis."""

    def __call__(self, atmosphere, rays=None) -> ShadowTable:
        """The table of the shadow over the Moon's disc, of an atmosphere that is the same all around.

        - `rays`: as by `operator.rays`, where they are known.
        """
        if is_lopsided(atmosphere):
            raise InputError("This wants an atmosphere that is the same all around: give one without a limb axis.")
        operator = self.operator
        light = operator.light(atmosphere, operator.rays(atmosphere) if rays is None else rays)
        if self.scatterers is not None:
            light += ring_glow(atmosphere, *self.glowing())
        light = light @ self.weights  # (distance, offset, channel)
        return self.grid.filled(jnp.moveaxis(light, 0, 1))

    def glowing(self):
        """Arguments of `scattered.ring_arcs`, but for the atmosphere, for the entries: (distance, offset)."""
        operator, distance = self.operator, self.operator.views.distance
        offset = jax.vmap(self.grid.offsets_at)(distance)
        distance = jnp.broadcast_to(distance[:, None], offset.shape)
        sun = operator.sun_distance, self.grid.sun_radius / operator.sun_distance
        return self.scatterers, offset, distance, *sun, operator.darkening, operator.wavelength


def tabulator(
    sun,
    moon_distance,
    sun_distance,
    offsets,
    wavelength,
    weights,
    *,
    tolerance: float,
    count: int,
    deep: bool = True,
    scatterers: Scatterers | None = None,
    flattening: Flattening | None = None,
) -> Tabulator:
    """What of a table does not depend on the atmosphere.

    - `moon_distance`, `sun_distance`: of the bodies' centres from the Earth's [m].
    - `offsets`: smallest and largest angle from the axis that will be asked for [rad].
    - `wavelength`, `weights`: (wavelength,) [nm] and (wavelength, channel): a channel's value is the weighted sum of
      the irradiances at the wavelengths.
    - `tolerance`: of the entries.
    - `count`: offsets in the table.
    - `deep`: tabulate the nearest and the farthest distance of the lunar surface; else one between, and leave the
      Moon's depth to the table's variable, the offset from the umbra's edge: 1.4 % rms, 5 % at most
      (tests/test_likelihood.py).
    - `scatterers`: adds the light that the limb scatters into the shadow; None leaves it out.
    - `flattening`: of the Earth; None is the sphere of `EARTH_RADIUS`.
    """
    grid = table_grid(sun, moon_distance, sun_distance, offsets, count)
    distances = grid.distances if deep else grid.distances[1:] - 0.6 * MOON_RADIUS
    offset = jax.vmap(grid.offsets_at)(distances)
    ground = None if flattening is None else flattening.shape.rounded()
    operator = shadow_operator(sun, offset, distances, sun_distance, wavelength, tolerance=tolerance, ground=ground)
    return Tabulator(grid, operator, weights, scatterers, flattening)


def table_grid(sun, moon_distance, sun_distance, offsets, count: int) -> TableGrid:
    """Entries over the Moon's disc; the arguments are those of `tabulator`."""
    distances = moon_distance + jnp.asarray([-1.0, 0.0]) * MOON_RADIUS
    # The umbra is widest at the nearest distance, so that the axis is farthest inside there.
    t = variable(jnp.asarray(offsets) - umbra_edge(distances, sun_distance, sun.radius))
    step = (t[1] - t[0]) / (count - 3)  # one node beyond either end, for the cubic
    return TableGrid(t[0] - step, step, distances, real(sun_distance), sun.radius, count)
