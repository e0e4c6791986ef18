"""Light that the air along the limb scatters into the shadow: what the umbra has when its direct light is spent.

From a point of the Moon the limb is a ring, and each arc of it shines by G of the Sun's depression there (`twilight`),
less on the side away from the Sun's centre: at the azimuth phi

    sigma = asin(a / D) + asin(a / D_s) - offset cos(phi),

about 57' all around on the axis. The irradiance is G summed around the ring, over D^2. The Sun's disc counts through
its variance: two points do for it what the whole disc would do, to 1e-4.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS, MOON_MEAN_DISTANCE
from eclipsejax.errors import InputError
from eclipsejax.limb_sectors import limb_axes
from eclipsejax.limb_table import chebyshev, chebyshev_nodes
from eclipsejax.scatterers import Scatterers, higher_orders
from eclipsejax.sun import Sun
from eclipsejax.sunlight import sky_angle
from eclipsejax.traced import real
from eclipsejax.twilight import limb_brightness

_DEPRESSIONS = 10  # Chebyshev nodes of log G
_AZIMUTHS = 12  # on half of the ring
_GLOWING = 20e3  # m; the light's mean altitude: the ring's radius is not critical, 0.1 % for 6 km
_NOTHING = 1e-3  # m^2/sr; 1e-12 of what clear air scatters: keeps the log finite without any


def scattered_irradiance(
    atmosphere,
    offset,
    wavelength,
    *,
    sun: Sun | None = None,
    moon_distance=MOON_MEAN_DISTANCE,
    sun_distance=ASTRONOMICAL_UNIT,
    position_angle=None,
    scatterers: Scatterers | None = None,
) -> Float[Array, "offset wavelength"]:
    """Scattered light as a fraction of unobstructed sunlight [-], to be added to `shadow_irradiance`.

    Scattered once, with refraction and extinction on both ways, to 1 % (2 % in clear air beyond 700 nm); times a factor
    of 1.06 to 1.12, good to 0.04, for the higher orders (`scatterers.higher_orders`). Clouds: each of the two ways is
    half a grazing ray, so it keeps the square root of `limb_transmission` at its lowest point.

    - `atmosphere`: with a leading limb axis (`limb_sectors.along_limb`) it differs along the limb.
    - `offset`: angle at the Earth's centre between the point and the shadow's axis, shape (offset,) [rad].
    - `wavelength`: shape (wavelength,) [nm].
    - `moon_distance`: distance of the point itself from the Earth's centre, scalar or shape (offset,) [m].
    - `sun_distance`: from the Earth's centre [m].
    - `position_angle`: of the point about the axis, as in `shadow_irradiance`; only a limb that differs needs it.
    - `scatterers`: optical properties of dust and haze.
    """
    offset = jnp.atleast_1d(real(offset))
    if limb_axes(atmosphere)[0] and position_angle is None:
        raise InputError("This limb is not the same all around: give `position_angle` [rad] for each offset.")
    return _scattered(
        atmosphere,
        Scatterers() if scatterers is None else scatterers,
        Sun() if sun is None else sun,
        offset,
        jnp.broadcast_to(real(moon_distance), offset.shape),
        real(sun_distance),
        jnp.atleast_1d(real(wavelength)),
        jnp.broadcast_to(real(0.0 if position_angle is None else position_angle), offset.shape),
    )


@eqx.filter_jit
def _scattered(atmosphere, scatterers, sun, offset, distance, sun_distance, wavelength, position_angle):
    darkening = jax.vmap(sun.limb_darkening_coefficients)(wavelength)
    view = offset, distance, sun_distance, sun.radius / sun_distance, darkening, wavelength
    places, axes = limb_axes(atmosphere)
    if not places:
        return ring_glow(atmosphere, scatterers, *view)
    arcs = jax.vmap(lambda air: ring_arcs(air, scatterers, *view), in_axes=(axes,))(atmosphere)
    return jnp.einsum("pokw,okp->ow", arcs, arc_shares(position_angle, places))


def ring_glow(*scene) -> Float[Array, "... wavelength"]:
    """`scattered_irradiance` for points of any shape; the arguments are those of `ring_arcs`."""
    return jnp.mean(ring_arcs(*scene), axis=-2)


def ring_azimuths() -> np.ndarray:
    """Of the arcs of `ring_arcs`, from the side where the Sun stands; on the other half of the ring the same [rad]."""
    return np.pi * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS


def arc_shares(angle: Float[Array, "..."], places: int) -> Float[Array, "... azimuth place"]:
    """Share of the ring that each arc of `ring_arcs` has with the air of each of equally spaced places.

    - `angle`: of the point about the axis, on whose side the Sun stands [rad].
    """
    both = jnp.stack([ring_azimuths(), -ring_azimuths()])  # halves of the ring
    around = jnp.asarray(angle)[..., None, None] + both
    apart = around[..., None] / (2.0 * np.pi) * places - np.arange(places)
    apart = jnp.abs((apart + 0.5 * places) % places - 0.5 * places)
    return jnp.mean(jnp.maximum(1.0 - apart, 0.0), axis=-3) / _AZIMUTHS


def ring_arcs(
    atmosphere, scatterers: Scatterers, offset, distance, sun_distance, disc, darkening, wavelength
) -> Float[Array, "... azimuth wavelength"]:
    """Scattered light if all of the ring shone as its arcs at `ring_azimuths` do.

    - `offset`, `distance`: of the points, of one shape [rad], [m].
    - `disc`: radius of the Sun seen from the Earth [rad].
    - `darkening`: A_k of the Sun's I(mu)/I(1) = sum A_k mu^k, (wavelength, power).
    """
    ring, azimuth = EARTH_RADIUS + _GLOWING, ring_azimuths()
    depression = sky_angle(ring, distance, sun_distance)[..., None] - offset[..., None] * np.cos(azimuth)
    spread = jax.vmap(sun_spread)(darkening) * disc

    low, high = jnp.min(depression) - disc, jnp.max(depression) + disc
    node, to_coefficients = chebyshev_nodes(_DEPRESSIONS)
    glow = limb_brightness(atmosphere, scatterers, low + (high - low) * node, wavelength)
    log_glow = to_coefficients @ jnp.log(glow + _NOTHING)  # (node, wavelength)

    def at(shift):
        u = (depression[..., None] + shift - low) / (high - low)  # (..., azimuth, wavelength)
        return jnp.exp(jnp.einsum("...wk,kw->...w", chebyshev(u, _DEPRESSIONS), log_glow)) - _NOTHING

    shining = 0.5 * (at(spread) + at(-spread))
    nearer = (1.0 + distance / sun_distance) ** 2  # than the Moon is the limb to the Sun
    focus = nearer / (distance**2 * jnp.sqrt(1.0 - (ring / distance) ** 2))
    return 2.0 * jnp.pi * focus[..., None, None] * shining * higher_orders(scatterers, wavelength)


def sun_spread(darkening):
    """Standard deviation of the Sun's light across its disc, in one direction [radii]."""
    power = np.arange(darkening.shape[0])
    light = darkening / (power + 2.0)
    return jnp.sqrt(0.5 * jnp.sum(light - darkening / (power + 4.0)) / jnp.sum(light))
