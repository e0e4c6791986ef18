"""Flux of the grazing rays on cells of sky angle: the half of the shadow's integral that knows the air.

In every panel of tangent heights psi, optical depth and solid angle are polynomials in u (`limb_table`). A panel has
two branches on which psi is monotone: it falls with u, but for a hook just below some breaks, where it first rises
by up to 0.3'. Each branch is cut where it enters another cell; between two cuts everything is smooth, and two or
three Gauss nodes give the moments of the flux. The pieces of all branches stand in one list, from the top of the
air down, so that their number is that of the cells, not that of the cells times the panels.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.limb_table import LimbTable, chebyshev, chebyshev_derivative, chebyshev_nodes
from eclipsejax.sky_cells import SkyCells, functions
from eclipsejax.sunlight import clustered, sky_angle, solid_angle

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


def series(coefficients: Float[Array, "row coefficient"], u: Float[Array, "row ..."]) -> Float[Array, "row ..."]:
    """Chebyshev series of u on [0, 1], one for each row."""
    x = 2.0 * u - 1.0
    terms = coefficients.T.reshape(coefficients.shape[1], -1, *[1] * (u.ndim - 1))
    before, last = jnp.ones_like(x), x
    total = terms[0] + terms[1] * x
    for term in terms[2:]:
        before, last = last, 2.0 * x * last - before
        total = total + term * last
    return total


def cell_flux(rays: Branches, limb_transmission, cells: SkyCells, order: int) -> Float[Array, "cell function"]:
    """Moments of the flux of one wavelength with the functions of each cell.

    Pieces deeper than the list is long are left out: it reaches below any ray through air 1.3 times as dense as ours.

    - `order`: Gauss nodes on a piece.
    """
    panels, count = rays.psi.shape[0], cells.count
    slope = chebyshev_derivative(rays.psi)
    summit = _summits(rays.psi, slope)
    # Branches from the top of the air down, each from its highest psi to its lowest.
    panel = np.repeat(np.arange(panels)[::-1], len(_FALLS))
    begin, end = (jnp.asarray(np.tile(shares, panels)) for shares in ((0.0, *_FALLS[:-1]), (0.0, *_FALLS[1:])))
    top = summit[panel]
    start = top + (1.0 - top) * begin
    stop = jnp.where(end > 0.0, top + (1.0 - top) * end, 0.0)
    line = np.linspace(0.0, 1.0, _GRID)
    frozen_psi, frozen_slope = jax.lax.stop_gradient((rays.psi, slope))
    grid = start[:, None] + (stop - start)[:, None] * line
    psi_grid = series(frozen_psi[panel], grid)  # (branch, grid), falling along the grid

    first, last = (_signed_cell(psi_grid[:, end], cells) for end in (0, -1))
    number = first - last + 1
    ends = jnp.cumsum(number)

    piece = np.arange(int(1.6 * count) + 2 * panel.size)
    branch = jnp.minimum(jnp.sum(piece[:, None] >= ends, axis=1), panel.size - 1)
    within = piece - (ends - number)[branch]
    cell = first[branch] - within
    # Lower and upper edge of the cell of |psi|; the lower one of psi, which the branch passes last.
    lower, upper = (cells.edges[jnp.clip(jnp.abs(cell) - side, 0, count)] for side in (1, 0))
    edge = jnp.where(cell > 0, lower, -upper)
    here = jnp.asarray(panel)[branch]

    # Where the branch passes the lower edge of the cell: by the grid, then Newton, then one step that carries the
    # derivative (implicit function theorem).
    psi_line, u_line = psi_grid[branch], grid[branch]
    above = jnp.clip(jnp.sum(psi_line > edge[:, None], axis=1), 1, _GRID - 1)
    take = lambda lines, index: jnp.take_along_axis(lines, index[:, None], axis=1)[:, 0]
    u0, u1 = take(u_line, above - 1), take(u_line, above)
    psi0, psi1 = take(psi_line, above - 1), take(psi_line, above)
    rise = psi1 - psi0
    cut = u0 + (u1 - u0) * jnp.clip((edge - psi0) / jnp.where(rise != 0.0, rise, jnp.inf), 0.0, 1.0)
    own_psi, own_slope = frozen_psi[here], frozen_slope[here]
    for _ in range(_NEWTON):
        steep = series(own_slope, cut)
        step = (series(own_psi, cut) - edge) / jnp.where(steep != 0.0, steep, jnp.inf)
        cut = jnp.clip(cut - step, jnp.minimum(u0, u1), jnp.maximum(u0, u1))
    cut, edge_frozen = jax.lax.stop_gradient((cut, edge))
    steep = series(own_slope, cut)
    carried = (series(rays.psi[here], cut) - edge_frozen) / jnp.where(jnp.abs(steep) > 1e-6, steep, jnp.inf)
    cut = cut - (carried - jax.lax.stop_gradient(carried))
    cut = jnp.where(edge > psi_line[:, -1], cut, stop[branch])
    begin = jnp.where(within == 0, start[branch], jnp.concatenate([cut[:1], cut[:-1]]))

    node, weight = clustered(order)
    u = begin[:, None] + (cut - begin)[:, None] * node
    psi = series(rays.psi[here], u)
    height = (rays.upper - rays.lower)[here][:, None]
    clear = limb_transmission(rays.upper[here][:, None] - height * u**2)
    light = jnp.exp(-series(rays.depth[here], u)) * clear * series(rays.solid_angle[here], u)
    flux = light * jnp.abs(cut - begin)[:, None] * weight
    within = (jnp.abs(psi) - lower[:, None]) / jnp.where(upper > lower, upper - lower, 1.0)[:, None]
    basis = functions(jnp.clip(within, 1e-12, 1.0 - 1e-12))
    moments = jnp.einsum("pn,pnk->pk", flux, basis)
    target = jnp.abs(cell) - 1
    seen = (piece < ends[-1]) & (target >= 0) & (target < count)
    moments = jnp.where(seen[:, None], moments, 0.0)
    return jnp.zeros((count, basis.shape[-1])).at[jnp.clip(target, 0, count - 1)].add(moments)


def _signed_cell(psi, cells):
    """1, 2, ... for the cells of positive psi, -1, -2, ... of negative; 0 between them; count + 1 beyond."""
    return (jnp.sign(psi) * jnp.clip(cells.index(psi) + 1, 0, cells.count + 1)).astype(int)


def _summits(psi, slope):
    """u of the largest psi of each panel: 0, or the end of the hook."""
    psi, slope = jax.lax.stop_gradient((psi, slope))
    bend = chebyshev_derivative(slope)
    grid = jnp.asarray(np.linspace(0.0, 1.0, _GRID))
    u = grid[jnp.argmax(psi @ chebyshev(grid, psi.shape[-1]).T, axis=1)]
    hooked = u > 0.0
    for _ in range(4):
        curved = series(bend, u)
        u = jnp.clip(u - series(slope, u) / jnp.where(curved != 0.0, curved, jnp.inf), 0.0, 1.0)
    return jnp.where(hooked, u, 0.0)
