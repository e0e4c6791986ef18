"""Flux of the grazing rays on cells of sky angle: the half of the shadow's integral that knows the air.

In every panel of tangent heights psi, optical depth and solid angle are polynomials in u (`limb_table`). A panel has
two branches on which psi is monotone: it falls with u, but for a hook just below some breaks, where it first rises
by up to 0.3'. Each branch is cut where it enters another cell; between two cuts everything is smooth, and a few nodes,
clustered at the ends for the sake of the square roots, give the moments of the flux. The pieces of all branches stand
in one list, from the top of the air down, so that their number is that of the cells, not that of the cells times the
panels.
"""

from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Bool, Float, Int

from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.limb import clustered
from eclipsejax.limb_table import LimbTable, chebyshev, chebyshev_derivative, chebyshev_nodes
from eclipsejax.sky_cells import SkyCells, functions
from eclipsejax.sunlight import sky_angle, solid_angle
from eclipsejax.traced import derivative_only

_GRID = 24  # points on which a branch is searched for a cut
_NEWTON = 2
_TOGETHER = 10  # coefficients of a series that are gathered at once, at most: all those of tolerances from 1e-3 up
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


def _of_rows(coefficients, panel):
    """The coefficients of each row, one degree after the other.

    Many of them one by one, so that they need not all be in memory at once: six derivatives at a tolerance of 1e-4 then
    take half the time. Few of them together: that compiles faster, and takes as long.
    """
    together = coefficients.shape[-1] <= _TOGETHER
    return coefficients.T[:, panel] if together else [one[panel] for one in coefficients.T]


@partial(jax.jit, inline=True)  # traced once for each shape, which takes long enough
def _series(coefficients, panel, u):
    x = 2.0 * u - 1.0
    before, last = jnp.ones_like(x), x
    first, second, *terms = _of_rows(coefficients, panel)
    total = first + second * x
    for term in terms:
        before, last = last, 2.0 * x * last - before
        total = total + term * last
    return total


@partial(jax.jit, inline=True)
def _series_slope(coefficients, panel, u):
    """Derivative by u, T_k' = k U_(k-1), from the very coefficients of the series: they are gathered already."""
    x = 2.0 * u - 1.0
    before, last = jnp.ones_like(x), 2.0 * x
    _, first, second, *terms = _of_rows(coefficients, panel)
    total = 2.0 * first + 4.0 * second * last
    for degree, term in enumerate(terms, start=3):
        before, last = last, 2.0 * x * last - before
        total = total + 2.0 * degree * term * last
    return total


@jax.custom_jvp
def series(coefficients: Float[Array, "panel coefficient"], panel, u: Float[Array, "... row"]) -> Array:
    """Chebyshev series of u on [0, 1], that of a panel for each row; term by term, so that no basis is kept in memory.

    Rows stand last: the processor takes several at once. Its slope by u is worked out once for all parameters that
    move u.

    - `panel`: the panel of each row.
    """
    return _series(coefficients, panel, u)


@partial(series.defjvp, symbolic_zeros=True)
def _(primals, tangents):
    coefficients, panel, u = primals
    changed, _, moved = tangents
    total = jnp.zeros_like(u)
    if not isinstance(changed, SymbolicZero):
        total = total + _series(changed, panel, u)
    if not isinstance(moved, SymbolicZero):
        total = total + _series_slope(coefficients, panel, u) * moved
    return _series(coefficients, panel, u), total


def cell_flux(rays: Branches, limb_transmission, cells: SkyCells, order: int) -> Float[Array, "side cell function"]:
    """Moments of the flux of one wavelength with the functions of each cell, for either side: that of rays from the
    limb on the point's own side of the axis (psi > 0), and of rays that have crossed the axis.

    - `order`: nodes on a piece.
    """
    piece = _pieces(rays.psi, cells)
    node, weight = clustered(order)
    u = piece.start + (piece.stop - piece.start) * node[:, None]
    # One after the other, for derivatives' sake: what dims light but does not bend it has those of the depth alone.
    psi, depth, angle = (series(one, piece.panel, u) for one in (rays.psi, rays.depth, rays.solid_angle))
    height = (rays.upper - rays.lower)[piece.panel]
    clear = limb_transmission(rays.upper[piece.panel] - height * u**2)
    flux = jnp.exp(-depth) * clear * angle * jnp.abs(piece.stop - piece.start) * weight[:, None]

    lower, upper = (cells.edges[jnp.clip(piece.cell + side, 0, cells.count)] for side in (0, 1))
    within = (jnp.abs(psi) - lower) / jnp.where(upper > lower, upper - lower, 1.0)
    basis = functions(jnp.clip(within, 1e-12, 1.0 - 1e-12))
    moments = jnp.stack([jnp.sum(flux * basis[..., k], axis=0) for k in range(basis.shape[-1])], axis=-1)
    seen = piece.counts & (piece.cell >= 0) & (piece.cell < cells.count)
    moments = jnp.where(seen[:, None], moments, 0.0)
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
    moving, psi = psi, jax.lax.stop_gradient(psi)
    slope = chebyshev_derivative(psi)

    # Branches from the top of the air down, each from its highest psi to its lowest.
    panel = np.repeat(np.arange(panels)[::-1], len(_FALLS))
    begin, end = (jnp.asarray(np.tile(shares, panels)) for shares in ((0.0, *_FALLS[:-1]), (0.0, *_FALLS[1:])))
    summit = _summits(psi, slope)[panel]
    start = summit + (1.0 - summit) * begin
    stop = jnp.where(end > 0.0, summit + (1.0 - summit) * end, 0.0)
    u_line = start + (stop - start) * np.linspace(0.0, 1.0, _GRID)[:, None]
    psi_line = series(psi, panel, u_line)

    # The list of pieces: how many each branch has, then branch and cell of each.
    first, last = (_signed_cell(psi_line[side], cells) for side in (0, -1))
    number = first - last + 1
    ends = jnp.cumsum(number)
    piece = jnp.arange(2 * count + 2 * panel.size)
    branch = _first(lambda branch: ends[branch] > piece, jnp.zeros_like(piece), panel.size - 1)
    rank = piece - (ends - number)[branch]
    cell = first[branch] - rank
    here = jnp.asarray(panel)[branch]

    # A piece ends where psi passes the lower edge of its cell (of -|psi|, the upper), if its branch gets there.
    edge = jnp.where(cell > 0, 1.0, -1.0) * cells.edges[jnp.clip(jnp.maximum(cell - 1, -cell), 0, count)]
    cut = _crossing(psi, here, branch, psi_line, u_line, edge)
    # The derivative of the cut, by the implicit function theorem.
    steep = _series_slope(psi, here, cut)
    cut = cut - derivative_only(series(moving, here, cut) / jnp.where(jnp.abs(steep) > 1e-6, steep, jnp.inf))
    cut = jnp.where(edge > psi_line[-1, branch], cut, stop[branch])
    before = jnp.where(rank == 0, start[branch], jnp.roll(cut, 1))
    return _Pieces(here, before, cut, jnp.abs(cell) - 1, cell < 0, piece < ends[-1])


def _crossing(psi, panel, branch, psi_line, u_line, edge):
    """u at which each falling psi(u) passes an edge: between two points of its line, then by Newton's steps."""
    after = _first(lambda point: psi_line[point, branch] <= edge, jnp.ones_like(branch), _GRID - 1)
    (u0, u1), (psi0, psi1) = ([line[point, branch] for point in (after - 1, after)] for line in (u_line, psi_line))
    rise = psi1 - psi0
    u = u0 + (u1 - u0) * jnp.clip((edge - psi0) / jnp.where(rise != 0.0, rise, jnp.inf), 0.0, 1.0)
    for _ in range(_NEWTON):
        there, steep = series(psi, panel, u), _series_slope(psi, panel, u)
        step = (there - edge) / jnp.where(steep != 0.0, steep, jnp.inf)
        u = jnp.clip(u - step, jnp.minimum(u0, u1), jnp.maximum(u0, u1))
    return u


def _first(holds, least: Int[Array, "..."], most: int) -> Int[Array, "..."]:
    """The first number, from `least` to `most`, from which on something holds; `most` if it never does.

    By halving: to try every number of them takes three times as long.
    """
    low, high = least, jnp.full_like(least, most)
    for _ in range(most.bit_length()):
        middle = (low + high) // 2
        here = holds(middle)
        low, high = jnp.where(here, low, jnp.minimum(middle + 1, high)), jnp.where(here, middle, high)
    return low


def _signed_cell(psi, cells):
    """1, 2, ... for the cells of positive psi, -1, -2, ... of negative; 0 between them; count + 1 beyond."""
    return (jnp.sign(psi) * jnp.clip(cells.index(psi) + 1, 0, cells.count + 1)).astype(int)


def _summits(psi, slope):
    """u of the largest psi of each panel: 0, or the end of the hook."""
    panel, curvature = np.arange(len(psi)), chebyshev_derivative(slope)
    grid = jnp.asarray(np.linspace(0.0, 1.0, _GRID))
    u = grid[jnp.argmax(psi @ chebyshev(grid, psi.shape[-1]).T, axis=1)]
    hooked = u > 0.0

    for _ in range(4):  # no loop of JAX's: XLA would keep two, of a value and of its derivatives
        steep, curved = series(slope, panel, u), series(curvature, panel, u)
        u = jnp.clip(u - steep / jnp.where(curved != 0.0, curved, jnp.inf), 0.0, 1.0)
    return jnp.where(hooked, u, 0.0)
