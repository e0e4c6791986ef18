"""The shadow as an image that renderers look into, in the layout of CosmoScout VR's eclipse shadow maps.

A point that sees the Earth with the angular radius phi_E, the Sun with phi_S and their centres delta apart finds its
light, as a fraction of the unobstructed Sun's, at the texture coordinates

    u = phi_S / (phi_E + phi_S),    v = 1 - delta / (phi_E + phi_S),

so columns are distances from the Earth, and the last row is next to the shadow's axis (CosmoScout VR, file
`eclipseShadows.glsl`, with its exponent 1 and the umbra included). Beyond delta = phi_E + phi_S it is 1.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from eclipsejax.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS
from eclipsejax.errors import InputError
from eclipsejax.limb_sectors import is_lopsided
from eclipsejax.response import responses
from eclipsejax.scattered import ring_glow
from eclipsejax.scatterers import Scatterers
from eclipsejax.shadow_operator import counts_for, shadow_operator
from eclipsejax.sun import Sun

SIZE = 256  # texels along a side, as in CosmoScout
MOON_DISTANCES = (3.5e8, 4.1e8)  # m, of the Moon's surface, from any perigee to any apogee
SPACING = 10.0  # nm, of the wavelengths that make colours


class Channels(NamedTuple):
    """What the three channels hold: weighted sums of irradiance."""

    wavelength: np.ndarray
    """(wavelength,) [nm]"""
    weights: np.ndarray
    """(wavelength, 3); each channel's sum is 1."""


def colours(sun) -> Channels:
    """Linear sRGB, of which the unobstructed Sun is the white."""
    wavelength = np.arange(385.0, 780.0, SPACING)
    weights = np.asarray(sun.irradiance(jnp.asarray(wavelength)))[:, None] * responses("srgb", wavelength)
    return Channels(wavelength, weights / weights.sum(axis=0))


def three_wavelengths(red: float, green: float, blue: float) -> Channels:
    """One wavelength [nm] a channel: CosmoScout's own maps have 680, 550 and 440."""
    return Channels(np.array([red, green, blue]), np.eye(3))


def shadow_texture(
    atmosphere,
    *,
    distances: tuple[float, float] = MOON_DISTANCES,
    size: int = SIZE,
    channels: Channels | None = None,
    sun: Sun | None = None,
    sun_distance: float = ASTRONOMICAL_UNIT,
    scatterers: Scatterers | None = None,
    tolerance: float = 1e-3,
) -> Float32[np.ndarray, "row column 3"]:
    """Fraction of unobstructed sunlight [-] in each channel; 0 in place of the negatives of colours outside sRGB.

    Only the columns between which points at the given distances fall are worked out; the others repeat the nearest.
    Read back linearly between texels the light on the Moon errs by 0.06 % (median), by up to 11 % in the deepest umbra
    and by up to 20 % within an arcminute of the umbra's edge, which moves by two rows from one column to the next: that
    is in the layout, and is a quarter of it at twice the size.

    - `distances`: nearest and farthest from the Earth's centre [m].
    - `channels`: None for `colours`.
    - `sun_distance`: from the Earth's centre [m].
    - `scatterers`: adds the light that the limb scatters into the shadow; None leaves it out.
    - `tolerance`: relative error wanted of the irradiance in the texels.
    """
    if is_lopsided(atmosphere):
        raise InputError(
            "The layout of the texture has no angle about the axis: give an atmosphere without a limb axis."
        )
    sun = Sun() if sun is None else sun
    wavelength, weights = colours(sun) if channels is None else channels
    counts_for(tolerance)  # refuses what cannot be met, before the work
    first, last = _columns(sun, distances, size, sun_distance)
    texture = np.empty((size, size, 3), np.float32)
    for column in range(first, last + 1):
        light = _column(
            atmosphere,
            sun,
            scatterers,
            jnp.asarray((column + 0.5) / size),
            size,
            sun_distance,
            jnp.asarray(wavelength),
            tolerance,
        )
        texture[::-1, column] = np.maximum(np.asarray(light) @ weights, 0.0)
    texture[:, :first] = texture[:, first : first + 1]
    texture[:, last + 1 :] = texture[:, last : last + 1]
    return texture


def _columns(sun, distances: tuple[float, float], size: int, sun_distance: float) -> tuple[int, int]:
    """First and last column that a lookup at these distances meets."""
    near, far = distances
    if not 2.0 * EARTH_RADIUS < near <= far:
        raise InputError(f"The shadow cannot be drawn from {near:g} to {far:g} m: start beyond two Earth radii.")
    u = []
    for distance in (far, near):
        earth, disc = np.arcsin(EARTH_RADIUS / distance), np.arcsin(float(sun.radius) / (sun_distance + distance))
        u.append(disc / (earth + disc) * size - 0.5)
    return max(int(np.floor(min(u))), 0), min(int(np.ceil(max(u))), size - 1)


@eqx.filter_jit
def _column(atmosphere, sun, scatterers, u, size: int, sun_distance, wavelength, tolerance: float):
    """Irradiance (row, wavelength) of a column, from the axis outwards."""
    separation = (jnp.arange(size) + 0.5) / size  # of the centres, in units of the sum of the radii
    distance, _ = place(u, jnp.asarray(0.0), sun, sun_distance)
    _, offset = place(u, separation, sun, sun_distance)
    operator = shadow_operator(sun, offset[None], distance[None], sun_distance, wavelength, tolerance=tolerance)
    light = operator(atmosphere)[0]
    if scatterers is not None:
        disc = sun.radius / sun_distance
        where = offset, jnp.broadcast_to(distance, offset.shape), sun_distance, disc
        light += ring_glow(atmosphere, scatterers, *where, operator.darkening, wavelength)
    return light


def place(
    u: Float[Array, "..."], separation: Float[Array, "..."], sun, sun_distance
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Distance from the Earth's centre [m] and angle there from the shadow's axis [rad] of a point in the texture.

    - `u`: first texture coordinate.
    - `separation`: delta / (phi_E + phi_S), one minus the second.
    """
    # Both radii follow from the distance to the Sun, which hardly depends on where in the shadow the point is.
    to_sun = jnp.broadcast_to(jnp.asarray(sun_distance, float), jnp.broadcast_shapes(u.shape, separation.shape))
    distance = offset = jnp.zeros_like(to_sun)
    for _ in range(6):
        disc = jnp.arcsin(sun.radius / to_sun)
        distance = EARTH_RADIUS / jnp.sin((1.0 / u - 1.0) * disc)
        offset = jnp.arcsin(jnp.sin(separation * disc / u) * to_sun / sun_distance)
        to_sun = jnp.sqrt(sun_distance**2 + distance**2 + 2.0 * sun_distance * distance * jnp.cos(offset))
    return distance, offset
