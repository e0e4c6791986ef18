"""How brightly the limb shines by light that its air scatters, against the depression of the Sun there.

Light from the Sun turns by a degree where it is scattered into the umbra, and both its ways through the air, in and
out, graze. Seen from a scattering point at altitude z both are rays of one family: through z with the depression e
below the horizontal (e > 0 passes its lowest point, e < 0 rises at once), transmission T(z, e), and direction
omega(z, e) = e + refraction in space. The two directions must add up to the Sun's depression sigma at the limb, so

    G(sigma) = int s(z) r^2 [ int de_1 int de_2 cos(e_1) cos(e_2) T T delta(omega_1 + omega_2 - sigma) ] dz

with s the scattering coefficient towards the Moon [1/(m sr)]. The integrand has no singularity: what n r sin(e) de
takes from the rays at their tangent points, the length of the path gives back. It includes refraction of both ways
and the spreading of the light by it.

The ways are summed over shells in which refractivity and extinctions are linear: along a ray y = sqrt(x^2 - a^2), with
x = n r and Bouguer's a, is the path's length but for dx/dr, and shells are differences of y.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.constants import ATMOSPHERE_TOP, EARTH_RADIUS
from eclipsejax.limb import gauss_legendre, medium
from eclipsejax.limb_table import ray_breaks, scaled
from eclipsejax.scatterers import Scatterers
from eclipsejax.traced import safe_sqrt


class Counts(NamedTuple):
    """Node counts of `limb_brightness`."""

    shell: float = 1.0  # spacing of the levels below 40 km [km]; four times that above
    altitude: int = 8  # scattering points in each of three panels
    ray: int = 40  # directions below the horizontal at a scattering point, and as many above
    way: int = 10  # directions of the way out at which the two ways are paired


COUNTS = Counts()
HIGHEST = 75e3  # m; the air above scatters 1e-3 of the light


class Ways(NamedTuple):
    """Rays through scattering points, from the steepest up to the one that touches the ground."""

    depression: Float[Array, "point ray"]  # e [rad]
    refraction: Float[Array, "point ray"]  # omega - e [rad]
    columns: Float[Array, "point ray constituent"]
    lowest: Float[Array, "point ray"]  # altitude [m]


def ways(profile, breaks, altitude: Float[Array, " point"], counts: Counts) -> Ways:
    """Trace the rays through points at these altitudes [m].

    - `profile`, `breaks`: as in `limb.grazing_ray`.
    """
    # No level on a round altitude: one on a break would take the derivative by that break.
    low, high = np.arange(0.437, 40.0, counts.shell), np.arange(40.437, ATMOSPHERE_TOP / 1e3, 4.0 * counts.shell)
    regular = np.concatenate([low, high, [ATMOSPHERE_TOP / 1e3]])
    level = jnp.sort(jnp.concatenate([jnp.asarray(1e3 * regular), breaks]))
    thickness = jnp.diff(level)
    middle = 0.5 * (level[1:] + level[:-1])
    # Two points inside each shell, so that a profile may jump at its ends.
    inside = middle + thickness * jnp.asarray([[-0.5], [0.5]]) / np.sqrt(3.0)

    # Rays equally spaced in q, with z - q^2 the altitude of the tangent point: nearly so in e, down to the ground.
    q = altitude[:, None] ** 0.5 * jnp.asarray(np.linspace(0.0, 1.0, counts.ray))
    tangent = jnp.clip(altitude[:, None] - q**2, 0.0)

    # One call for all altitudes: each further one would be compiled anew.
    n1, absorbers = jax.vmap(profile)(jnp.concatenate([z.reshape(-1) for z in (level, altitude, tangent, inside)]))
    ends = np.cumsum([level.size, altitude.size, tangent.size])
    n_level, n_point, n_tangent = (n1[a:b] for a, b in zip([0, *ends[:2]], ends, strict=True))

    def lifted(z, n1):
        """n r - EARTH_RADIUS, from heights [m]."""
        return z + (EARTH_RADIUS + z) * n1

    x_level, x_point = lifted(level, n_level), lifted(altitude, n_point)
    impact = lifted(tangent, n_tangent.reshape(tangent.shape))
    absorbers = absorbers[ends[2] :].reshape(2, middle.size, -1)
    wide = jnp.where(thickness > 0.0, thickness, 1.0)
    stretch = jnp.where(thickness > 0.0, jnp.diff(x_level) / wide, 1.0)  # dx/dr
    mean = jnp.mean(absorbers, axis=0)
    slope = (absorbers[1] - absorbers[0]) * np.sqrt(3.0) / wide[:, None]
    turn = -jnp.diff(n_level) / (stretch * wide)

    def along(x):
        """y of points with this x on the rays."""
        return safe_sqrt((x - impact[..., None]) * (x + impact[..., None] + 2.0 * EARTH_RADIUS))

    y_point = along(x_point[:, None, None])
    y = along(x_level)

    def sums(y):
        """Bending and columns of a stretch of the rays that ends at these y."""
        length = jnp.diff(y) / stretch
        # (z - middle) along the ray, from x = a + y^2 / 2a.
        rise = (impact[..., None] - 0.5 * (x_level[1:] + x_level[:-1])) * jnp.diff(y) + jnp.diff(y**3) / (
            6.0 * EARTH_RADIUS
        )
        return length @ (turn * stretch), length @ mean + (rise / stretch**2) @ slope

    above, below = sums(jnp.maximum(y, y_point)), sums(jnp.minimum(y, y_point))
    depression = 2.0 * jnp.arcsin(safe_sqrt(0.5 * (x_point[:, None] - impact) / (EARTH_RADIUS + x_point[:, None])))
    through = [up + 2.0 * down for up, down in zip(above, below, strict=True)]

    def both(rising, falling):
        return jnp.concatenate([rising[:, :0:-1], falling], axis=1)

    return Ways(
        depression=both(-depression, depression),
        refraction=both(above[0], through[0]),
        columns=both(above[1], through[1]),
        lowest=both(jnp.broadcast_to(altitude[:, None], tangent.shape), tangent),
    )


def paired(
    depression: Float[Array, " ray"],
    direction: Float[Array, " ray"],
    log_transmission: Float[Array, " ray"],
    sigma: Float[Array, ""],
    order: int,
) -> Float[Array, ""]:
    """The integral over both directions at one scattering point [rad]."""
    node, weight = gauss_legendre(order)
    count = depression.size
    rise = jnp.asarray(jnp.gradient(depression))  # a step in e; below, over that in omega, what spreads sunlight
    log_weighted = log_transmission + jnp.log(jnp.cos(depression))
    log_focused = log_weighted + jnp.log(rise / jnp.maximum(jnp.asarray(jnp.gradient(direction)), 1e-12))
    place = jnp.arange(count, dtype=float)
    # Of two equal halves that in which the way out lies deeper; from equal directions to the ground.
    start = jnp.interp(0.5 * sigma, direction, place)
    here = start + (count - 1.0 - start) * node
    first = jnp.clip(jnp.floor(here).astype(int), 0, count - 2)
    rows = jnp.stack([log_weighted + jnp.log(rise), direction])
    out, towards = rows[:, first] + (here - first) * (rows[:, first + 1] - rows[:, first])
    into = jnp.interp(sigma - towards, direction, log_focused)
    return 2.0 * (count - 1.0 - start) * jnp.sum(weight * jnp.exp(out + into))


def limb_brightness(
    atmosphere,
    scatterers: Scatterers,
    depression: Float[Array, " depression"],
    wavelength: Float[Array, " wavelength"],
    counts: Counts = COUNTS,
) -> Float[Array, "depression wavelength"]:
    """G of the module's formula for light scattered once, the Sun a point [m^2/sr].

    Divided by the square of the distance it is the fraction of sunlight that an arc of the limb of one radian brings.

    - `depression`: of the Sun below the horizontal of the limb, in the direction of the line of sight [rad].
    - `wavelength`: [nm].
    """
    edges = jnp.asarray(_panels(atmosphere))
    node, weight = gauss_legendre(counts.altitude)
    altitude = (edges[:-1, None] + jnp.diff(edges)[:, None] * node).reshape(-1)
    measure = (jnp.diff(edges)[:, None] * weight).reshape(-1) * (EARTH_RADIUS + altitude) ** 2
    breaks = ray_breaks(atmosphere)

    def clear(lowest):
        return 0.5 * jnp.log(jnp.maximum(atmosphere.limb_transmission(lowest), 1e-20))

    def brightness(traced: Ways, ratio, coefficients, wavelength):
        direction = traced.depression + ratio * traced.refraction
        log_transmission = jax.vmap(jax.vmap(clear))(traced.lowest) - traced.columns @ coefficients
        pair = jax.vmap(paired, in_axes=(None, None, None, 0, None))
        pairs = jax.vmap(pair, in_axes=(0, 0, 0, None, None))(
            traced.depression, direction, log_transmission, depression, counts.way
        )
        amount = jax.vmap(lambda z: scatterers.towards(atmosphere, z, wavelength))(altitude)
        return (measure * amount) @ pairs

    if hasattr(atmosphere, "profiles"):
        # Traced once: refraction is proportional to the refractivity of standard air (within 1e-3 of the light).
        refractivity = jax.vmap(atmosphere.dispersion)(wavelength)
        middle = jnp.mean(refractivity)
        traced = ways(scaled(atmosphere, middle), breaks, altitude, counts)
        ratio = refractivity / jnp.where(middle > 0.0, middle, 1.0)
        coefficients = jax.vmap(atmosphere.coefficients)(wavelength)
        return jax.vmap(lambda *spectrum: brightness(traced, *spectrum))(ratio, coefficients, wavelength).T

    def one(wavelength):
        traced = ways(medium(atmosphere, wavelength), breaks, altitude, counts)
        return brightness(traced, 1.0, jnp.ones(1), wavelength)

    return jax.lax.map(one, wavelength).T


def _panels(atmosphere):
    """Altitudes between which scattering is smooth [m]."""
    dust = getattr(atmosphere, "dust", None)
    middle = jnp.asarray([15e3, 25e3]) if dust is None else jnp.stack([dust.base, dust.top])
    return jnp.concatenate([jnp.zeros(1), jnp.clip(middle, 0.0, HIGHEST), jnp.asarray([HIGHEST])])
