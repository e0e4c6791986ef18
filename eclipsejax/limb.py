"""A grazing ray: impact parameter, bending angle and optical depth from its tangent height.

In a spherical atmosphere a = n r sin(angle) is constant along a ray (Bouguer), so with x = n r and a = x at the
tangent point

    bending = -2 a int (dn/dr)/n dr / sqrt(x^2 - a^2),        optical depth = 2 int k x dr / sqrt(x^2 - a^2)

(Born & Wolf, *Principles of Optics*, section 3.2). The integral is split at the breaks of the profile, and s =
sqrt(x - a) is the variable in every panel: x is smooth in a panel, so the integrand is smooth in s however close
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


def grazing_ray(profile, breaks, tangent_height, *, order=DEFAULT_ORDER, newton_steps=2):
    """(bending angle [rad], columns) of the ray with one tangent height in one medium.

    - `profile`: function of the altitude [m] that returns (refractivity [-], array of extinctions); each
      extinction is integrated along the ray into a column.
    - `breaks`: altitudes between which the profile is smooth, ascending [m]; the last is the top.
    - `tangent_height`: [m].
    - `order`: Gauss-Legendre nodes a panel.
    - `newton_steps`: steps for the altitude of a node; one leaves some 1e-8 of the panel's contribution.
    """
    node, weight = gauss_legendre(order)

    def refraction(altitude):
        """Refractivity, its slope [1/m] and the extinctions at altitudes of any shape."""

        def one(z):
            (n1, absorbers), (slope, _) = jax.jvp(profile, (z,), (jnp.ones_like(z),))
            return n1, slope, absorbers

        n1, slope, absorbers = jax.vmap(one)(altitude.reshape(-1))
        return n1.reshape(altitude.shape), slope.reshape(altitude.shape), absorbers

    # One call for the tangent point, both ends of every panel and, for the slopes there, points just inside (a break
    # itself belongs to the panel above it): each further call would be compiled anew.
    lower = jnp.maximum(breaks[:-1], tangent_height)
    upper = jnp.maximum(breaks[1:], tangent_height)
    inset = jax.lax.stop_gradient(1e-6 * (upper - lower))
    points = jnp.stack([lower, upper, lower + 1e-3 * inset, upper - inset, jnp.full_like(lower, tangent_height)])
    n1, gradient, _ = refraction(points)
    tangent_refractivity = n1[4, 0]
    radius = EARTH_RADIUS + tangent_height
    impact = radius * (1.0 + tangent_refractivity)

    def excess(altitude, n1):
        """x - a, by heights above the tangent point."""
        return (altitude - tangent_height) * (1.0 + n1) + radius * (n1 - tangent_refractivity)

    def excess_slope(altitude, n1, gradient):
        return 1.0 + n1 + (EARTH_RADIUS + altitude) * gradient

    ends = excess(points[:2], n1[:2])
    # Panels that lie below the tangent point have no width; their square roots must not be differentiated.
    s_lower, s_upper = jnp.where(points[:2] > tangent_height, safe_sqrt(ends), 0.0)
    s = s_lower[:, None] + (s_upper - s_lower)[:, None] * node
    ds = (s_upper - s_lower)[:, None] * weight

    # Altitude of each node: Newton from Hermite's inverse interpolation through the ends of the panel. The start
    # carries no derivative; one last step with frozen slope carries the exact one (implicit function theorem).
    slopes = excess_slope(points[2:4], n1[2:4], gradient[2:4])
    frozen = (s**2, ends[:, :, None], points[:2, :, None], slopes[:, :, None])
    target, (x0, x1), (y0, y1), (first, last) = jax.lax.stop_gradient(frozen)
    altitude = _hermite(target, x0, x1, y0, y1, 1.0 / first, 1.0 / last)
    for _ in range(newton_steps - 1):
        n1, gradient, _ = refraction(altitude)
        step = (excess(altitude, n1) - target) / excess_slope(altitude, n1, gradient)
        altitude = jax.lax.stop_gradient(jnp.clip(altitude - step, y0, y1))
    n1, gradient, _ = refraction(altitude)
    slope = jax.lax.stop_gradient(excess_slope(altitude, n1, gradient))
    altitude = altitude - (excess(altitude, n1) - s**2) / slope

    n1, gradient, absorbers = refraction(altitude)
    common = 4.0 * ds / (excess_slope(altitude, n1, gradient) * jnp.sqrt(2.0 * impact + s**2))
    bending = -impact * jnp.sum(common * gradient / (1.0 + n1))
    path = common * (EARTH_RADIUS + altitude) * (1.0 + n1)
    return bending, path.reshape(-1) @ absorbers


def _hermite(x, x0, x1, y0, y1, first, last):
    """Cubic through (x0, y0) and (x1, y1) with these slopes."""
    width = jnp.where(x1 > x0, x1 - x0, 1.0)
    t = (x - x0) / width
    rise = y1 - y0
    bend = t * (1.0 - t)
    return y0 + t * rise + bend * ((1.0 - t) * (width * first - rise) - t * (width * last - rise))


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
