"""A grazing ray: impact parameter, bending angle and optical depth from its tangent height.

In a spherical atmosphere a = n r sin(angle) is constant along a ray (Bouguer), so with x = n r and a = x at the
tangent point

    bending = -2 a int (dn/dr)/n dr / sqrt(x^2 - a^2),        optical depth = 2 int k x dr / sqrt(x^2 - a^2)

(Born & Wolf, *Principles of Optics*, section 3.2). The integral is split at the breaks of the profile, and s, nearly
sqrt(x - a), is the variable in every panel: x is smooth in a panel, so the integrand is smooth in s however close
the tangent point lies below a break (with s = sqrt(z - z_t) instead, a ray a centimetre below one is wrong by
2e-6). Heights are measured from the tangent point, never as differences of radii.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.atmosphere import refractivity
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.traced import safe_sqrt

DEFAULT_ORDER = 12  # Gauss-Legendre nodes a panel
LEAST_SHARE = 0.05  # x - a by s^2, which is nearly 1 elsewhere: less in a duct alone, where there is no ray


def grazing_ray(profile, breaks, tangent_height, *, order=DEFAULT_ORDER):
    """(bending angle [rad], columns) of the ray with one tangent height in one medium.

    - `profile`: function of the altitude [m] that returns (refractivity [-], array of extinctions); each
      extinction is integrated along the ray into a column.
    - `breaks`: altitudes between which the profile is smooth, ascending [m]; the last is the top.
    - `tangent_height`: [m].
    - `order`: Gauss-Legendre nodes a panel.
    """
    panel = np.arange(breaks.size - 1)
    _, bending, columns = ray_sums(profile, breaks, tangent_height[None], (0 * panel, panel), order)
    return bending[0], columns[0]


def ray_sums(profile, breaks, tangent_height: Float[Array, " ray"], crossed, order: int):
    """(Impact parameter less `EARTH_RADIUS` and tangent height [m], bending angle [rad], columns) of many rays.

    - `profile`, `breaks`, `order`: as `grazing_ray` takes them.
    - `crossed`: numbers of rays, ascending, and of the panels each crosses, as NumPy's arrays (pair,); a panel that
      lies below its ray adds nothing.
    """
    node, weight = gauss_legendre(order)

    def refraction(altitude):
        """Refractivity, its slope [1/m] and the extinctions at altitudes of any shape."""

        def one(z):
            (n1, absorbers), (slope, _) = jax.jvp(profile, (z,), (jnp.ones_like(z),))
            return n1, slope, absorbers

        # Not flattened: XLA moves such reshapes to and fro by who wants what, and would trace the rays twice.
        for _ in range(altitude.ndim):
            one = jax.vmap(one)
        return one(altitude)

    # One call for tangent points, both ends of every panel and, for the slopes there, points just inside (a break
    # itself belongs to the panel above it): each further call would be compiled anew.
    inset = jax.lax.stop_gradient(1e-6 * jnp.diff(breaks))
    points = tangent_height, breaks, breaks[:-1] + 1e-3 * inset, breaks[1:] - inset
    n1, slope, _ = refraction(jnp.concatenate(points))
    cuts = np.cumsum([part.size for part in points])[:-1]
    (n1_grazed, n1_break, *_), (slope_grazed, _, slope_lower, slope_upper) = jnp.split(n1, cuts), jnp.split(slope, cuts)
    lift = (EARTH_RADIUS + tangent_height) * n1_grazed
    impact = EARTH_RADIUS + tangent_height + lift

    # What follows is of pairs of a ray and a panel (pair, 1), by heights above the ray's lowest point.
    ray, panel = (numbers[:, None] for numbers in crossed)
    lowest, n1_lowest = tangent_height[ray], n1_grazed[ray]

    def excess(height, n1):
        """x - a."""
        return height * (1.0 + n1) + (EARTH_RADIUS + lowest) * (n1 - n1_lowest)

    def excess_slope(height, n1, slope):
        return 1.0 + n1 + (EARTH_RADIUS + lowest + height) * slope

    # The ends of a panel, or of what lies above the ray of the panel where it turns. Those below it have no width;
    # their square roots must not be differentiated.
    turns = lowest >= breaks[panel]
    y0, y1 = jnp.where(turns, 0.0, breaks[panel] - lowest), jnp.maximum(breaks[panel + 1] - lowest, 0.0)
    n1_first, n1_last = jnp.where(turns, n1_lowest, n1_break[panel]), n1_break[panel + 1]
    x0, x1 = jnp.where(turns, 0.0, excess(y0, n1_first)), jnp.where(y1 > 0.0, excess(y1, n1_last), 0.0)
    steep0 = excess_slope(y0, n1_first, jnp.where(turns, slope_grazed[ray], slope_lower[panel]))
    steep1 = excess_slope(y1, n1_last, slope_upper[panel])
    s0, s1 = safe_sqrt(x0), safe_sqrt(x1)

    # The variable of the integral is s, and the altitude a polynomial of s^2 that makes x - a nearly that: how nearly,
    # the integrand knows (`share`). To seek the altitude that makes it so would take two more profiles a node.
    s = s0 + (s1 - s0) * node
    height, rise = _hermite(s**2, x0, x1, y0, y1, steep0, steep1)
    n1, slope, absorbers = refraction(lowest + height)
    x = excess(height, n1)
    # Near the lowest point, within 4 mm (80 m in single precision), the polynomial is better than what rounding leaves
    # of x - a.
    rounding = jnp.finfo(s.dtype).eps * (EARTH_RADIUS + lowest) * n1_lowest
    known = (x1 > x0) & (s**4 > 1e4 * rounding * (x1 - x0))
    share = jnp.maximum(jnp.where(known, x, 1.0) / jnp.where(known, s**2, 1.0), LEAST_SHARE)
    # Not divided by a root: XLA makes that this product where only one wants the root, and the rays of a value and of
    # its derivatives, no longer the same to it, would all be traced twice.
    common = 4.0 * (s1 - s0) * weight * rise * jax.lax.rsqrt(share * (2.0 * impact[ray] + x))
    path = common * (EARTH_RADIUS + lowest + height) * (1.0 + n1)
    parts = jnp.sum(common * slope / (1.0 + n1), axis=1), jnp.einsum("pn,pnc->pc", path, absorbers)
    whole = lambda part: jax.ops.segment_sum(part, crossed[0], tangent_height.size, indices_are_sorted=True)
    bends, columns = map(whole, parts)
    return lift, -impact * bends, columns


def _hermite(x, x0, x1, y0, y1, steep0, steep1):
    """Cubic through (x0, y0) and (x1, y1), where dx/dy is `steep0` and `steep1`, and its slope."""
    width = jnp.where(x1 > x0, x1 - x0, 1.0)
    t, rise = (x - x0) / width, y1 - y0
    low, high = width / steep0 - rise, width / steep1 - rise
    bend, tilt = t * (1.0 - t), (1.0 - t) * low - t * high
    return y0 + t * rise + bend * tilt, (rise + (1.0 - 2.0 * t) * tilt - bend * (low + high)) / width


def gauss_legendre(order, xp=jnp):
    """Nodes and weights on [0, 1]; `xp` is JAX's or plain NumPy."""
    node, weight = np.polynomial.legendre.leggauss(order)
    return xp.asarray(0.5 * (node + 1.0), dtype=float), xp.asarray(0.5 * weight, dtype=float)


def clustered(order, xp=jnp):
    """Gauss-Legendre nodes on [0, 1] under x = (1 - cos(pi t)) / 2: square roots at either end become smooth.

    Worked out on the host; `xp` is what the arrays are to be, JAX's or plain NumPy's.
    """
    t, weight = gauss_legendre(order, np)
    node, weight = 0.5 * (1.0 - np.cos(np.pi * t)), 0.5 * np.pi * np.sin(np.pi * t) * weight
    return xp.asarray(node, dtype=float), xp.asarray(weight, dtype=float)


def medium(atmosphere, wavelength):
    """The profile function of `grazing_ray` for one wavelength [nm]: (refractivity, [extinction])."""
    return lambda z: (atmosphere.refractivity(z, wavelength), atmosphere.extinction(z, wavelength)[None])


def impact_parameter(atmosphere, tangent_height, wavelength) -> Float[Array, "..."]:
    """Bouguer's invariant of a ray, n(r_t) r_t [m].

    Tangent height [m] and wavelength [nm] broadcast.
    """
    tangent_height = jnp.asarray(tangent_height, dtype=float)
    return (1.0 + refractivity(atmosphere, tangent_height, wavelength)) * (EARTH_RADIUS + tangent_height)


def bending_angle(atmosphere, tangent_height, wavelength, *, order: int = DEFAULT_ORDER) -> Float[Array, "..."]:
    """Angle by which the air turns a grazing ray towards the Earth, along its whole path [rad].

    Tangent height [m] and wavelength [nm] broadcast. Auer & Standish (2000), AJ 119, 2472, with s = sqrt(n r - a).

    - `order`: Gauss-Legendre nodes between two breaks of the profile.
    """
    tangent_height, wavelength = _real(tangent_height, wavelength)
    return _grazing(atmosphere, tangent_height, wavelength, order)[0]


def optical_depth(atmosphere, tangent_height, wavelength, *, order: int = DEFAULT_ORDER) -> Float[Array, "..."]:
    """Optical depth of a grazing ray along its whole refracted path [-]; clouds are not in it.

    Tangent height [m] and wavelength [nm] broadcast.

    - `order`: Gauss-Legendre nodes between two breaks of the profile.
    """
    tangent_height, wavelength = _real(tangent_height, wavelength)
    return _grazing(atmosphere, tangent_height, wavelength, order)[1]


def _real(*arguments):
    return [jnp.asarray(argument, dtype=float) for argument in arguments]


@eqx.filter_jit
def _grazing(atmosphere, tangent_height, wavelength, order):
    """Bending angle and optical depth."""

    def one(tangent_height, wavelength):
        profile = medium(atmosphere, wavelength)
        bending, columns = grazing_ray(profile, atmosphere.breaks, tangent_height, order=order)
        return bending, columns[0]

    return jnp.vectorize(one)(tangent_height, wavelength)
