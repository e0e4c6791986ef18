"""Grazing rays at Chebyshev nodes of tangent height, and any ray between them by interpolation.

Bending and optical depth are smooth between two breaks of the atmosphere but for a square-root cusp just below the
upper one, so they are interpolated in u = sqrt((upper - z) / (upper - lower)), in which the error falls
exponentially with the number of nodes. The rays depend on wavelength through the refractivity of standard air
alone: a few values of it serve all wavelengths.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.limb import medium, ray_sums
from eclipsejax.sunlight import sky_angle


class Rays(eqx.Module):
    """Interpolated rays of one panel, any shape."""

    tangent_height: Float[Array, "..."]
    impact: Float[Array, "..."]
    impact_slope: Float[Array, "..."]  # |da/du|
    bending: Float[Array, "..."]
    columns: Float[Array, "... constituent"]


class LimbTable(eqx.Module):
    """Chebyshev coefficients of the rays; leading axes (wavelength, panel) peel off under `vmap`.

    - `lower`, `upper`: tangent heights at the panel's ends [m].
    - `lift`: coefficients of a - r_t [m]; `bending` [rad]; `columns`: of each constituent's profile along the ray.
    """

    lower: Float[Array, "..."]
    upper: Float[Array, "..."]
    lift: Float[Array, "... node"]
    bending: Float[Array, "... node"]
    columns: Float[Array, "... node constituent"]

    def at(self, u: Float[Array, "..."]) -> Rays:
        """The rays at u (one panel)."""
        basis = chebyshev(u, self.lift.shape[-1])
        height = self.upper - self.lower
        tangent_height = self.upper - height * u**2
        impact = EARTH_RADIUS + tangent_height + basis @ self.lift
        impact_slope = jnp.abs(basis @ chebyshev_derivative(self.lift) - 2.0 * height * u)
        return Rays(tangent_height, impact, impact_slope, basis @ self.bending, basis @ self.columns)

    def sky_angle(self, u, distance, sun_distance, derivatives: int = 0):
        """psi (one panel) and, for Newton's sake, its first derivatives by u, to 2e-4."""
        basis = chebyshev(u, self.lift.shape[-1])
        height = self.upper - self.lower
        impact = EARTH_RADIUS + self.upper - height * u**2 + basis @ self.lift
        values = [sky_angle(impact, distance, sun_distance) - basis @ self.bending]
        reach = 1.0 / distance + 1.0 / sun_distance
        coefficients = reach * self.lift - self.bending
        for polynomial in (-2.0 * u, jnp.full_like(u, -2.0))[:derivatives]:
            coefficients = chebyshev_derivative(coefficients)
            values.append(basis @ coefficients + reach * height * polynomial)
        return values

    def pieces(self, distance, sun_distance, edges):
        """Start and stop, in u, of the stretches on which psi lies between neighbouring `edges` (ascending).

        psi falls with u, but for a hook just below some breaks, where it first rises, by up to 0.3' (left uncut,
        that stretch would cost 5 % of the light where an edge crosses it). Found without derivative: where the
        nodes lie does not change the integral, and at the edges the integrand is zero or continuous.
        """
        frozen, distance, sun_distance, edges = jax.lax.stop_gradient((self, distance, sun_distance, edges))

        def psi(u, derivatives=0):
            return frozen.sky_angle(u, distance, sun_distance, derivatives)

        grid = np.linspace(0.0, 1.0, 2 * self.lift.shape[-1])
        summit = jnp.asarray(grid)[jnp.argmax(psi(jnp.asarray(grid))[0])]

        def climb(_, u):
            _, slope, curvature = psi(u, 2)
            return jnp.clip(u - slope / jnp.where(curvature != 0.0, curvature, jnp.inf), 0.0, 1.0)

        summit = jnp.where(summit > 0.0, jax.lax.fori_loop(0, 4, climb, summit), summit)

        def cuts(start, stop):
            """Where a monotone stretch passes each edge, clipped to its ends, in the order of the edges."""
            x = start + (stop - start) * grid
            along = psi(x)[0]
            rising = along[-1] >= along[0]
            below = jnp.sum((along < edges[:, None]) == rising, axis=1)
            left = jnp.clip(below - 1, 0, grid.size - 2)
            rise = along[left + 1] - along[left]
            guess = x[left] + (x[left + 1] - x[left]) * (edges - along[left]) / jnp.where(rise != 0.0, rise, jnp.inf)

            def newton(_, u):
                value, slope = psi(u, 1)
                return jnp.clip(u - (value - edges) / jnp.where(slope != 0.0, slope, jnp.inf), start, stop)

            roots = jax.lax.fori_loop(0, 3, newton, jnp.clip(guess, start, stop))
            lowest, highest = jnp.where(rising, start, stop), jnp.where(rising, stop, start)
            low, high = jnp.minimum(along[0], along[-1]), jnp.maximum(along[0], along[-1])
            return jnp.where(edges <= low, lowest, jnp.where(edges >= high, highest, roots))

        # The stretch that rises, from 0 to the summit, and the one that falls, on to 1.
        rising, falling = jax.vmap(cuts)(
            jnp.stack([jnp.zeros_like(summit), summit]), jnp.stack([summit, jnp.ones_like(summit)])
        )
        start = jnp.concatenate([rising[:-1], falling[1:]])
        stop = jnp.concatenate([rising[1:], falling[:-1]])
        return jax.lax.stop_gradient((start, jnp.maximum(start, stop)))


@eqx.filter_jit
def grazing_rays(
    atmosphere, tangent_height, wavelength, *, order: int = 12, dispersion: int = 4
) -> tuple[Float[Array, "tangent wavelength"], Float[Array, "tangent wavelength"]]:
    """Bending angles [rad] and optical depths [-] of many rays at many wavelengths.

    As `limb.bending_angle` and `limb.optical_depth`, to 1e-10 with the defaults, for a twentieth of the work: the
    rays are traced at a few refractivities and interpolated between. Needs an atmosphere in product form, as the
    package's own is.

    - `tangent_height`: (tangent,) [m].
    - `wavelength`: (wavelength,) [nm].
    - `order`: Gauss-Legendre nodes a panel.
    - `dispersion`: refractivities.
    """
    refractivities, mixture = _dispersion_nodes(atmosphere, wavelength, dispersion)
    breaks = ray_breaks(atmosphere)

    crossed = np.indices((tangent_height.size, breaks.size - 1)).reshape(2, -1)  # whatever their order, every panel

    def trace(refractivity):
        return ray_sums(scaled(atmosphere, refractivity), breaks, tangent_height, crossed, order)

    _, bending, columns = (jnp.tensordot(mixture, values, axes=1) for values in jax.vmap(trace)(refractivities))
    coefficients = jax.vmap(atmosphere.coefficients)(wavelength)
    return bending.T, jnp.einsum("wzc,wc->zw", columns, coefficients)


def ray_breaks(atmosphere):
    """The breaks that matter along a ray [m]: of an atmosphere that does not tell them apart, all."""
    return atmosphere.ray_breaks if hasattr(atmosphere, "ray_breaks") else atmosphere.breaks


def scaled(atmosphere, refractivity):
    """The profile function of `ray_sums` for air of this refractivity at 15 C and 1 atm."""

    def profile(z):
        density_ratio, absorbers = atmosphere.profiles(z)
        return refractivity * density_ratio, absorbers

    return profile


def limb_table(atmosphere, wavelength: Float[Array, " wavelength"], counts, breaks=None):
    """Trace the rays of an atmosphere for all wavelengths [nm].

    Returns the `LimbTable`, with wavelength as its leading axis, and the coefficients (wavelength, constituent)
    that turn columns into optical depth. (Interpolating the irradiance instead, between a few refractivities, would
    save most of the work in `shadow`; caustics make that wrong by up to 6 %.)

    - `counts`: a `shadow.Quadrature` or `shadow_operator.Counts`; `ray`, `table` and `dispersion` are used.
    - `breaks`: ends of the panels [m]; those of the atmosphere by default.
    """
    breaks = atmosphere.breaks if breaks is None else breaks
    lower, upper = breaks[:-1], breaks[1:]
    u, to_coefficients = chebyshev_nodes(counts.table)
    tangent_height = (upper - (upper - lower) * u[:, None] ** 2).T  # (panel, node)

    # A ray of a panel crosses that and those above it.
    panels = breaks.size - 1
    crossing = np.repeat(np.arange(panels), counts.table)
    crossed = np.nonzero(crossing[:, None] <= np.arange(panels))

    def trace(profile):
        values = ray_sums(profile, breaks, tangent_height.reshape(-1), crossed, counts.ray)
        return jax.tree.map(lambda value: value.reshape(*tangent_height.shape, *value.shape[1:]), values)

    if hasattr(atmosphere, "profiles"):
        refractivities, mixture = _dispersion_nodes(atmosphere, wavelength, counts.dispersion)

        traced = jax.vmap(lambda refractivity: trace(scaled(atmosphere, refractivity)))(refractivities)
        traced = jax.tree.map(lambda values: jnp.tensordot(mixture, values, axes=1), traced)
        coefficients = jax.vmap(atmosphere.coefficients)(wavelength)
    else:
        traced = jax.vmap(lambda w: trace(medium(atmosphere, w)))(wavelength)
        coefficients = jnp.ones((wavelength.size, 1))

    lift, bending, columns = traced
    wavelengths, panels, _ = lift.shape
    table = LimbTable(
        jnp.broadcast_to(lower, (wavelengths, panels)),
        jnp.broadcast_to(upper, (wavelengths, panels)),
        lift @ to_coefficients.T,
        bending @ to_coefficients.T,
        jnp.einsum("kn,wpnc->wpkc", to_coefficients, columns),
    )
    return table, coefficients


def _dispersion_nodes(atmosphere, wavelength, count):
    """Refractivities that span those of the wavelengths, and the Lagrange weights (wavelength, node) between them."""
    refractivity = jax.vmap(atmosphere.dispersion)(wavelength)
    low, high = jnp.min(refractivity), jnp.max(refractivity)
    # A relative 1e-4 at least, so that one wavelength alone, or none that refracts, divides by no zero.
    half = jnp.maximum(0.5 * (high - low), 0.5e-4 * high + 1e-12)
    nodes = 0.5 * (high + low) + half * jnp.cos(np.pi * (np.arange(count) + 0.5) / count)
    distinct = ~np.eye(count, dtype=bool)
    gaps = jnp.where(distinct, nodes[:, None] - nodes[None, :], 1.0)
    ratios = (refractivity[:, None, None] - nodes) / gaps
    return nodes, jnp.prod(jnp.where(distinct, ratios, 1.0), axis=2)


def chebyshev(u, count):
    """Chebyshev polynomials of 2u - 1 in a new last axis."""
    x = 2.0 * u - 1.0
    t = [jnp.ones_like(x), x]
    for _ in range(count - 2):
        t.append(2.0 * x * t[-1] - t[-2])
    return jnp.stack(t, axis=-1)


def chebyshev_derivative(coefficients):
    """Chebyshev coefficients (last axis) of the derivative by u."""
    count = coefficients.shape[-1]
    matrix = np.zeros((count, count))
    for k in range(1, count):
        row = np.polynomial.chebyshev.chebder(np.eye(count)[k])
        matrix[k, : row.size] = row
    return 2.0 * coefficients @ jnp.asarray(matrix, dtype=float)


def chebyshev_nodes(count):
    """Nodes u on [0, 1] and the matrix from values at them to Chebyshev coefficients."""
    angle = np.pi * (np.arange(count) + 0.5) / count
    matrix = np.cos(np.outer(np.arange(count), angle)) * (2.0 / count)
    matrix[0] *= 0.5
    return jnp.asarray(0.5 * (1.0 + np.cos(angle)), dtype=float), jnp.asarray(matrix, dtype=float)
