"""Flux of the grazing rays on cells of sky angle: the half of the shadow's integral that knows the air.

In every panel of tangent heights psi, optical depth and solid angle are polynomials in u (`limb_table`). A panel has
two branches on which psi is monotone: it falls with u, but for a hook just below some breaks, where it first rises
by up to 0.3'. Each branch is cut where it enters another cell; between two cuts everything is smooth, and a few nodes,
clustered at the ends for the sake of the square roots, give the moments of the flux. The pieces of all branches stand
in one list, from the top of the air down, so that their number is that of the cells, not that of the cells times the
panels.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.limb import clustered
from eclipsejax.limb_table import LimbTable, chebyshev, chebyshev_derivative, chebyshev_nodes
from eclipsejax.sky_cells import SkyCells, functions
from eclipsejax.sunlight import sky_angle, solid_angle

_GRID = 24  # points on which a branch is searched for a cut
_NEWTON = 2
# The falling branch is cut here: light that thick dust lets pass just below its top is exp(-c u) with c up to 100.
_FALLS = (0.0, 0.06, 0.2, 1.0)


class Branches(eqx.Module):
    """Polynomials of u on every panel, for one wavelength and distance; leading axes (wavelength, panel)."""

    psi: Float[Array, "... node"]
    """[rad]"""
    depth: Float[Array, "... node"]
    solid_angle: Float[Array, "... node"]
    """Of the rays by u, divided by their azimuth [1]."""
    lower: Float[Array, "..."]
    """Tangent heights at the ends of the panel [m]."""
    upper: Float[Array, "..."]


def branches(table: LimbTable, coefficients, distance, sun_distance) -> Branches:
    """From the rays of a limb to what a point at a distance [m] sees of them.

    - `table`, `coefficients`: as `limb_table.limb_table` returns them.
    """
    u, to_coefficients = chebyshev_nodes(table.lift.shape[-1])
    basis = chebyshev(u, u.size)  # (node, coefficient)
    height = (table.upper - table.lower)[..., None]
    impact = EARTH_RADIUS + table.upper[..., None] - height * u**2 + table.lift @ basis.T
    slope = 2.0 * height * u - chebyshev_derivative(table.lift) @ basis.T
    psi = sky_angle(impact, distance, sun_distance) - table.bending @ basis.T
    return Branches(
        psi=psi @ to_coefficients.T,
        depth=jnp.einsum("wpkc,wc->wpk", table.columns, coefficients),
        solid_angle=(solid_angle(impact, distance) * slope) @ to_coefficients.T,
        lower=table.lower,
        upper=table.upper,
    )


def series(coefficients: Float[Array, "... row coefficient"], u: Float[Array, "row ..."]) -> Array:
    """Chebyshev series of u on [0, 1], one for each row, (..., *u.shape); term by term, so that no basis is kept in
    memory. Several series of the same u are worked out for little more than one."""
    x = 2.0 * u - 1.0
    *sets, count = coefficients.shape
    terms = jnp.moveaxis(coefficients, -1, 0).reshape(count, *sets, *[1] * (u.ndim - 1))
    before, last = jnp.ones_like(x), x
    total = terms[0] + terms[1] * x
    for term in terms[2:]:
        before, last = last, 2.0 * x * last - before
        total = total + term * last
    return total


def cell_flux(rays: Branches, limb_transmission, cells: SkyCells, order: int) -> Float[Array, "side cell function"]:
    """Moments of the flux of one wavelength with the functions of each cell, for either side: that of rays from the
    limb on the point's own side of the axis (psi > 0), and of rays that have crossed the axis.

    - `order`: nodes on a piece.
    """
    piece = _pieces(rays.psi, cells)
    node, weight = clustered(order)
    u = piece.start[:, None] + (piece.stop - piece.start)[:, None] * node
    height = (rays.upper - rays.lower)[piece.panel][:, None]
    clear = limb_transmission(rays.upper[piece.panel][:, None] - height * u**2)
    along = jnp.stack([rays.psi, rays.depth, rays.solid_angle])
    psi, depth, angle = series(along[:, piece.panel], u)
    flux = jnp.exp(-depth) * clear * angle * jnp.abs(piece.stop - piece.start)[:, None] * weight

    lower, upper = (cells.edges[jnp.clip(piece.cell + side, 0, cells.count)] for side in (0, 1))
    within = (jnp.abs(psi) - lower[:, None]) / jnp.where(upper > lower, upper - lower, 1.0)[:, None]
    basis = functions(jnp.clip(within, 1e-12, 1.0 - 1e-12))
    seen = piece.counts & (piece.cell >= 0) & (piece.cell < cells.count)
    moments = jnp.where(seen[:, None], jnp.einsum("pn,pnk->pk", flux, basis), 0.0)
    # Rays whose angle is NaN lie in no cell, and would pass for darkness.
    moments = jnp.where(jnp.isfinite(jnp.sum(rays.psi)), moments, jnp.nan)
    place = piece.crossed.astype(int), jnp.clip(piece.cell, 0, cells.count - 1)
    return jnp.zeros((2, cells.count, basis.shape[-1])).at[place].add(moments)


class _Pieces(NamedTuple):
    """Stretches of a panel on which |psi| stays in one cell; as many as there can be, of which some do not count."""

    panel: Int[Array, " piece"]
    start: Float[Array, " piece"]  # [u]
    stop: Float[Array, " piece"]  # [u]
    cell: Int[Array, " piece"]
    crossed: Bool[Array, " piece"]  # psi < 0
    counts: Bool[Array, " piece"]


def _pieces(psi: Float[Array, "panel node"], cells: SkyCells) -> _Pieces:
    """Cut every branch of psi(u) at the edges of the cells."""
    panels, count = psi.shape[0], cells.count
    slope = chebyshev_derivative(psi)
    frozen_psi, frozen_slope = jax.lax.stop_gradient((psi, slope))

    # Branches from the top of the air down, each from its highest psi to its lowest.
    panel = np.repeat(np.arange(panels)[::-1], len(_FALLS))
    begin, end = (jnp.asarray(np.tile(shares, panels)) for shares in ((0.0, *_FALLS[:-1]), (0.0, *_FALLS[1:])))
    summit = _summits(frozen_psi, frozen_slope)[panel]
    start = summit + (1.0 - summit) * begin
    stop = jnp.where(end > 0.0, summit + (1.0 - summit) * end, 0.0)
    u_line = start[:, None] + (stop - start)[:, None] * np.linspace(0.0, 1.0, _GRID)
    psi_line = series(frozen_psi[panel], u_line)

    # The list of pieces: how many each branch has, then branch and cell of each.
    first, last = (_signed_cell(psi_line[:, side], cells) for side in (0, -1))
    number = first - last + 1
    ends = jnp.cumsum(number)
    piece = jnp.arange(2 * count + 2 * panel.size)
    branch = jnp.minimum(jnp.sum(piece[:, None] >= ends, axis=1), panel.size - 1)
    rank = piece - (ends - number)[branch]
    cell = first[branch] - rank
    here = jnp.asarray(panel)[branch]

    # A piece ends where psi passes the lower edge of its cell (of -|psi|, the upper), if its branch gets there.
    edge = jnp.where(cell > 0, 1.0, -1.0) * cells.edges[jnp.clip(jnp.maximum(cell - 1, -cell), 0, count)]
    cut = _crossing(jnp.stack([frozen_psi, frozen_slope])[:, here], psi_line[branch], u_line[branch], edge)
    # One more step of Newton's, which does not move the cut but carries its derivative (implicit function theorem).
    there, steep = series(jnp.stack([psi, frozen_slope])[:, here], cut)
    moved = (there - edge) / jnp.where(jnp.abs(steep) > 1e-6, steep, jnp.inf)
    cut = cut - (moved - jax.lax.stop_gradient(moved))
    cut = jnp.where(edge > psi_line[branch, -1], cut, stop[branch])
    before = jnp.where(rank == 0, start[branch], jnp.roll(cut, 1))
    return _Pieces(here, before, cut, jnp.abs(cell) - 1, cell < 0, piece < ends[-1])


def _crossing(psi_and_slope, psi_line, u_line, edge):
    """u at which each falling psi(u) passes an edge: between two points of its line, then by Newton's steps."""
    above = jnp.clip(jnp.sum(psi_line > edge[:, None], axis=1), 1, _GRID - 1)[:, None]
    (u0, u1), (psi0, psi1) = (
        [jnp.take_along_axis(line, index, axis=1)[:, 0] for index in (above - 1, above)] for line in (u_line, psi_line)
    )
    rise = psi1 - psi0
    u = u0 + (u1 - u0) * jnp.clip((edge - psi0) / jnp.where(rise != 0.0, rise, jnp.inf), 0.0, 1.0)
    for _ in range(_NEWTON):
        there, steep = series(psi_and_slope, u)
        step = (there - edge) / jnp.where(steep != 0.0, steep, jnp.inf)
        u = jnp.clip(u - step, jnp.minimum(u0, u1), jnp.maximum(u0, u1))
    return jax.lax.stop_gradient(u)


def _signed_cell(psi, cells):
    """1, 2, ... for the cells of positive psi, -1, -2, ... of negative; 0 between them; count + 1 beyond."""
    return (jnp.sign(psi) * jnp.clip(cells.index(psi) + 1, 0, cells.count + 1)).astype(int)


def _summits(psi, slope):
    """u of the largest psi of each panel: 0, or the end of the hook."""
    slopes = jnp.stack([slope, chebyshev_derivative(slope)])
    grid = jnp.asarray(np.linspace(0.0, 1.0, _GRID))
    u = grid[jnp.argmax(psi @ chebyshev(grid, psi.shape[-1]).T, axis=1)]
    hooked = u > 0.0
    for _ in range(4):
        steep, curved = series(slopes, u)
        u = jnp.clip(u - steep / jnp.where(curved != 0.0, curved, jnp.inf), 0.0, 1.0)
    return jnp.where(hooked, u, 0.0)
