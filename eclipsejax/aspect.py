"""How the Moon stands before an observer: its libration, and which way up its disc is in the sky."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.ephemeris import Geometry, moon_altitude
from eclipsejax.scene import sky_axes


class Aspect(NamedTuple):
    """The Moon as one observer sees it; from the Earth's centre altitude, azimuth and tilt are NaN."""

    longitude: Float[Array, ""]
    """Libration: selenographic longitude of the disc's centre, east positive [rad]."""
    latitude: Float[Array, ""]
    """Libration: selenographic latitude of the disc's centre, north positive [rad]."""
    axis: Float[Array, ""]
    """Position angle of the Moon's north pole, from celestial north through east, -pi to pi [rad]."""
    tilt: Float[Array, ""]
    """The same from the zenith: the north of the disc is so far to the left of up, -pi to pi [rad]."""
    altitude: Float[Array, ""]
    """Of the centre above the horizon, without refraction [rad]."""
    azimuth: Float[Array, ""]
    """Of the centre, from north through east, 0 to 2 pi [rad]."""


def aspect(geometry: Geometry) -> Aspect:
    """Libration and orientation of the Moon's disc, topocentric where the geometry has a site."""
    sight = geometry.moon - geometry.observer
    east, north = sky_axes(geometry, sight)
    x, y, z = -geometry.moon_axes @ sight / jnp.linalg.norm(sight)

    def position_angle(direction):
        return jnp.arctan2(direction @ east, direction @ north)

    axis = position_angle(geometry.moon_axes[2])
    on_earth = jnp.any(geometry.zenith != 0.0)
    tilt = jnp.mod(axis - position_angle(geometry.zenith) + jnp.pi, 2.0 * jnp.pi) - jnp.pi
    towards_east = jnp.cross(geometry.pole, geometry.zenith)
    towards_north = jnp.cross(geometry.zenith, towards_east)
    azimuth = jnp.mod(jnp.arctan2(sight @ towards_east, sight @ towards_north), 2.0 * jnp.pi)
    above = jnp.stack([tilt, moon_altitude(geometry), azimuth])
    return Aspect(jnp.arctan2(y, x), jnp.arcsin(z), axis, *jnp.where(on_earth, above, jnp.nan))
