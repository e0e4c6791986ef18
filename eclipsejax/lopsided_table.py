"""The table of a shadow that is not the same all around, because the air differs along the limb.

The light at an angle from the axis is the sum over the sectors of the limb (`limb_sectors`) of the light that each
one's air would give all around, times the share of it that comes through the sector. The first is the table of the
symmetric shadow, with all its fine structure; the share is smooth, and the same for all sectors but for their air and
their place: it is worked out at few offsets and at one distance, against the azimuth between sector and point.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.arc import sector_moments
from eclipsejax.constants import ATMOSPHERE_TOP, EARTH_RADIUS
from eclipsejax.flattened_table import FlattenedTable, flattened_table
from eclipsejax.limb_sectors import is_lopsided, limb_axes
from eclipsejax.limb_table import limb_table, ray_breaks
from eclipsejax.scattered import arc_shares, ring_arcs
from eclipsejax.shadow_table import Places, ShadowTable, Tabulator, cubic_weights
from eclipsejax.sky_cells import SkyCells
from eclipsejax.sky_flux import branches, cell_flux
from eclipsejax.sunlight import light_above, whole_sun

_OFFSETS = 64  # at which shares are worked out
_ANGLES = 64  # of a table, at least
_ARC_ORDER = 6
_DIRECT_ORDER = 20


class LopsidedTable(eqx.Module):
    """Light in the Earth's shadow in some channels, by position angle too."""

    table: ShadowTable
    """With the tables of all angles one behind the other."""
    angles: int = eqx.field(static=True)
    """Their number, equally spaced from north."""

    def at(self, places: Places) -> Float[Array, "... channel"]:
        """Channel values at places that are known, with their position angle."""
        assert places.angle is not None
        turn = jnp.mod(places.angle / (2.0 * jnp.pi), 1.0) * self.angles
        first = jnp.floor(turn)
        count = self.table.grid.count
        log = 0.0
        for k, weight in enumerate(cubic_weights(turn - first)):
            row = jnp.mod(first.astype(int) + k - 1, self.angles) * count
            log = log + weight[..., None] * self.table.log_at(places, row)
        return jnp.exp(log)


def scene_table(tabulator: Tabulator, atmosphere) -> ShadowTable | FlattenedTable | LopsidedTable:
    """The table of a scene's shadow, by position angle too where the atmosphere or the Earth's shape asks for it."""
    if not is_lopsided(atmosphere):
        return tabulator(atmosphere) if tabulator.flattening is None else flattened_table(tabulator, atmosphere)
    return lopsided_table(tabulator, atmosphere)


def lopsided_table(tabulator: Tabulator, atmosphere) -> LopsidedTable:
    """The table for an atmosphere with a limb axis.

    Beside its sectors' own error, 1e-3 of the light in the median, and up to 2 % where a sector of thick dust leaves
    a tenth of it (tests/test_lopsided_table.py). Takes a hundred times as long as the symmetric table.
    """
    grid, operator, weights = tabulator.grid, tabulator.operator, tabulator.weights
    places, axes = limb_axes(atmosphere)
    step = max(2, 2 * -(-_ANGLES // (2 * places)))  # angles from one sector to the next; even, so that pi is a lag
    angles = places * step
    index = np.linspace(1.0, grid.count - 2.0, _OFFSETS)
    share = _shares(grid, operator, weights, atmosphere, index, places, angles)

    # From few offsets to all, and from lags to the angles of points.
    fine = np.clip((np.arange(grid.count) - index[0]) / (index[1] - index[0]), 0.0, _OFFSETS - 1.0)
    left = np.minimum(fine.astype(int), _OFFSETS - 2)
    part = jnp.asarray(fine - left)[:, None]
    share = share[:, :, left] * (1.0 - part) + share[:, :, left + 1] * part  # (place, lag, offset, channel)
    lag = np.abs(step * np.arange(places)[:, None] - np.arange(angles))
    share = share[np.arange(places)[:, None], np.minimum(lag, angles - lag)]  # (place, angle, offset, channel)

    light = jax.vmap(operator, in_axes=(axes,))(atmosphere) @ weights  # (place, distance, offset, channel)
    light = jnp.einsum("pdoc,paoc->aodc", light, share)
    if tabulator.scatterers is not None:
        light += _glow(tabulator, atmosphere, places, angles)
    light = light.reshape(angles * grid.count, *light.shape[2:])
    return LopsidedTable(grid.filled(jnp.broadcast_to(light, (angles * grid.count, 2, light.shape[-1]))), angles)


def _glow(tabulator, atmosphere, places, angles):
    """Light that the limb scatters, (angle, offset, distance, channel)."""
    arcs = jax.vmap(lambda air: ring_arcs(air, *tabulator.glowing()), in_axes=(limb_axes(atmosphere)[1],))(atmosphere)
    arcs = arcs @ tabulator.weights  # (place, distance, offset, azimuth, channel)
    share = arc_shares((2.0 * np.pi / angles) * np.arange(angles), places)
    return jnp.einsum("pdokc,akp->aodc", arcs, share)


def _shares(grid, operator, weights, atmosphere, index, places, angles):
    """Share of the light of one air that comes through its sector, (place, lag, offset, channel)."""
    distance, sun_distance = jnp.mean(operator.views.distance), operator.sun_distance
    radius = jnp.arcsin(grid.sun_radius / sun_distance)
    offset = grid.offsets_at(distance, index)
    counts, wavelength, darkening = operator.counts, operator.wavelength, operator.darkening
    cells = SkyCells.around(offset, radius, counts.cells)
    half_width = 2.0 * np.pi / places
    lags = jnp.asarray(2.0 * np.pi / angles * np.arange(angles // 2 + 1))

    def of_lags(offset):
        """Arcs on the cells, and the light above the air [-]: (lag, ...)."""

        def one(lag):
            arcs = lambda circle: sector_moments(offset, circle, radius, _ARC_ORDER, apart=lag, half_width=half_width)
            sky = offset, distance, sun_distance, radius
            direct = lambda a: light_above(EARTH_RADIUS + ATMOSPHERE_TOP, *sky, a, order=_DIRECT_ORDER, arcs=arcs)
            return cells.arcs(offset, radius, counts.arc, counts.fit, arcs), jax.vmap(direct)(darkening)

        return jax.vmap(one)(lags)

    arcs, direct = jax.lax.map(of_lags, offset)  # (offset, lag, ...); each needs much room on the way
    arcs = jnp.stack([arcs, arcs[:, ::-1]])  # light that has crossed the axis comes through the limb opposite

    def of_air(air):
        table, coefficients = limb_table(air, wavelength, counts, breaks=ray_breaks(air))
        rays = branches(table, coefficients, distance, sun_distance)
        return jax.vmap(lambda one: cell_flux(one, air.limb_transmission, cells, counts.piece))(rays)

    flux = jax.vmap(of_air, in_axes=(limb_axes(atmosphere)[1],))(
        atmosphere
    )  # (place, wavelength, side, cell, function)
    light = jnp.einsum("pwsck,solckm->pwolm", flux, arcs)
    light = jnp.einsum("pwolm,wm->plow", light, darkening) + jnp.swapaxes(direct, 0, 1)
    whole = jax.vmap(lambda a: whole_sun(distance, sun_distance, radius, a, _DIRECT_ORDER))(darkening)
    light = (light / whole) @ weights
    lag = np.arange(places) * (angles // places)
    total = jnp.sum(light[:, np.minimum(lag, angles - lag)], axis=1, keepdims=True)
    return light / jnp.where(total > 0.0, total, 1.0)
