"""What is in the picture: the geometry of one instant and the things that make the light."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from eclipsejax.camera import Camera
from eclipsejax.constants import EARTH_RADIUS, MOON_RADIUS, SUN_RADIUS
from eclipsejax.ephemeris import Geometry, geometry, moon_altitude, nearest_eclipse
from eclipsejax.errors import InputError
from eclipsejax.limb_shape import LimbShape
from eclipsejax.moon import Moon
from eclipsejax.scatterers import Scatterers
from eclipsejax.sky import Sky
from eclipsejax.sun import Sun
from eclipsejax.sunlight import umbra_edge
from eclipsejax.traced import safe_sqrt


class DiscPoints(eqx.Module):
    """The lunar surface behind points of the sky; all fields have the shape of the points."""

    on_disc: Bool[Array, "..."]
    """Whether the line of sight meets the Moon; elsewhere the other fields are those of the nearest limb."""
    position: Float[Array, "... 3"]
    """Geocentric, ICRS axes [m]."""
    longitude: Float[Array, "..."]
    """Selenographic, east positive [rad]."""
    latitude: Float[Array, "..."]
    """Selenographic, north positive [rad]."""
    incidence_cosine: Float[Array, "..."]
    """Of the angle between the surface normal and the Sun's centre [-]."""
    emission_cosine: Float[Array, "..."]
    """Of the angle between the surface normal and the observer [-]."""
    phase_angle: Float[Array, "..."]
    """Between the light that arrives and the observer [rad].

    Where the Earth hides the Sun's centre the light comes from the Earth's limb, some 57' from the Earth's centre
    and, on average, from the observer.
    """


def disc_points(geometry: Geometry, east: Float[Array, "..."], north: Float[Array, "..."]) -> DiscPoints:
    """Where lines of sight meet the Moon, a sphere of `MOON_RADIUS`.

    - `east`, `north`: tangent-plane angles from the apparent centre of the disc towards celestial east and north [rad].
    """
    sight = geometry.moon - geometry.observer
    distance = jnp.linalg.norm(sight)
    ahead = sight / distance
    to_east, to_north = sky_axes(geometry, ahead)

    # The point is the centre plus (e, n) across the line of sight and -d along it; squares of sines, not
    # differences of distances, so that float32 keeps the limb.
    tangent_squared = east**2 + north**2
    scale = jnp.sqrt(1.0 + tangent_squared)
    perpendicular = distance * jnp.sqrt(tangent_squared) / scale
    on_disc = perpendicular < MOON_RADIUS
    half_chord = safe_sqrt(MOON_RADIUS**2 - perpendicular**2)
    across = (distance / scale - half_chord) / scale
    along = -distance * tangent_squared / scale**2 - half_chord / scale
    from_centre = (
        (across * east)[..., None] * to_east + (across * north)[..., None] * to_north + along[..., None] * ahead
    )
    normal = from_centre / jnp.linalg.norm(from_centre, axis=-1, keepdims=True)
    position = geometry.moon + MOON_RADIUS * normal

    x, y, z = jnp.moveaxis(normal @ geometry.moon_axes.T, -1, 0)
    to_sun = _unit(geometry.sun - position)
    to_observer = _unit(geometry.observer - position)
    separation = jnp.linalg.norm(jnp.cross(to_sun, to_observer), axis=-1)
    earth_limb = EARTH_RADIUS / jnp.linalg.norm(position, axis=-1)
    return DiscPoints(
        on_disc=on_disc,
        position=position,
        longitude=jnp.arctan2(y, x),
        latitude=jnp.arcsin(jnp.clip(z, -1.0, 1.0)),
        incidence_cosine=jnp.sum(normal * to_sun, axis=-1),
        emission_cosine=jnp.sum(normal * to_observer, axis=-1),
        phase_angle=jnp.maximum(jnp.arcsin(jnp.clip(separation, 0.0, 1.0)), earth_limb),
    )


def _unit(vector):
    return vector / jnp.linalg.norm(vector, axis=-1, keepdims=True)


def sky_axes(geometry: Geometry, sight: Float[Array, "3"]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Unit vectors towards celestial east and north, across a line of sight of any length."""
    ahead = _unit(sight)
    east = _unit(jnp.cross(geometry.pole, ahead))
    return east, jnp.cross(ahead, east)


def axis_offset(geometry: Geometry, position: Float[Array, "... 3"]) -> Float[Array, "..."]:
    """Angle at the Earth's centre between a point and the axis of the shadow [rad]; gradient 0 on the axis."""
    axis = -_unit(geometry.sun)
    sine = jnp.cross(_unit(position), axis)
    return jnp.arcsin(jnp.clip(safe_sqrt(jnp.sum(sine**2, axis=-1)), 0.0, 1.0))


def axis_position_angle(geometry: Geometry, position: Float[Array, "... 3"]) -> Float[Array, "..."]:
    """Position angle of a point about the axis of the shadow, from north through east [rad]."""
    east, north = sky_axes(geometry, -geometry.sun)
    eastward, northward = position @ east, position @ north
    on_axis = eastward**2 + northward**2 == 0.0
    return jnp.arctan2(eastward, jnp.where(on_axis, 1.0, northward))


def rounded_offset(geometry: Geometry, position: Float[Array, "... 3"]) -> Float[Array, "..."]:
    """Offset [rad] at which a round Earth (`LimbShape.rounded`) gives nearly the light that the flattened one gives.

    Offsets are scaled with the edge of the umbra at the point's position angle. What the light still swings about that
    of the round Earth is left to `flattened_table`.
    """
    distance, sun_distance = jnp.linalg.norm(position, axis=-1), jnp.linalg.norm(geometry.sun)
    stretch = limb_shape(geometry).umbra_stretch(axis_position_angle(geometry, position), distance, sun_distance)
    return axis_offset(geometry, position) / stretch


def limb_shape(geometry: Geometry) -> LimbShape:
    """The flattened Earth as the Sun sees it."""
    return LimbShape.facing(geometry.sun, geometry.pole)


class Scene(eqx.Module):
    """A lunar eclipse as one camera sees it at one instant."""

    geometry: Geometry
    """Sun, Moon and observer."""
    camera: Camera = eqx.field(default_factory=Camera)
    """Where the picture is taken to."""
    sun: Sun = eqx.field(default_factory=Sun)
    """The source."""
    moon: Moon = eqx.field(default_factory=Moon)
    """The screen."""
    sky: Sky | None = None
    """The observer's air; None for a picture above it."""
    flattened: bool = eqx.field(static=True, default=False)
    """Whether the shadow is that of the flattened Earth (`flattened_table`) and not of a sphere."""
    scatterers: Scatterers | None = None
    """Of the light that the Earth's limb scatters into the shadow; None leaves that light out."""
    umbral: bool = eqx.field(static=True, default=True)
    """Whether some of the Moon may be in the umbra, or within 1' of it: without, less work does (`render`)."""

    @classmethod
    def at(
        cls,
        utc: str,
        latitude: float | None = None,
        longitude: float | None = None,
        height: float = 0.0,
        **parts,
    ) -> "Scene":
        """The scene at a time, from a site, or from the Earth's centre if none is given.

        Raises `InputError` where there is no eclipse at that time, or the Moon is below the site's horizon.

        - `utc`: ISO string with its zone.
        - `latitude`, `longitude`: geodetic, north and east positive [degrees].
        - `height`: [m].
        - `parts`: `camera`, `sun`, `moon`, `sky`, `flattened`, `scatterers`, `umbral`.
        """
        where = geometry(utc, latitude, longitude, height)
        check_eclipsed(where)
        parts.setdefault("umbral", touches_umbra(where, parts.get("sun", Sun())))
        altitude = moon_altitude(where.on_host(), np)
        if latitude is not None and altitude < np.radians(-1.0):
            raise InputError(
                f"At {where.utc} the Moon is {-np.degrees(altitude):.0f} degrees below the horizon of "
                f"{latitude:g}, {longitude:g}: check time, longitude (east is positive) and site."
            )
        if latitude is not None and "sky" not in parts:
            parts["sky"] = Sky(height=height)
        return cls(where, **parts)

    def umbra(self) -> Float[Array, ""]:
        """Angle from the shadow's axis of the umbra's edge, of a ball without air, at the Moon's centre [rad]."""
        moon, sun = jnp.linalg.norm(self.geometry.moon), jnp.linalg.norm(self.geometry.sun)
        return umbra_edge(moon, sun, self.sun.radius)

    def offset(self, position: Float[Array, "... 3"]) -> Float[Array, "..."]:
        """Angle from the shadow's axis with which the light of a point is looked up [rad]."""
        return (rounded_offset if self.flattened else axis_offset)(self.geometry, position)


def touches_umbra(where: Geometry, sun: Sun) -> bool:
    """Whether any of the Moon is in the umbra of a ball, or within 1' of it."""
    offset, distance, sun_distance = _standing(where)
    distance -= MOON_RADIUS
    nearest = offset - np.arcsin(MOON_RADIUS / distance)
    return bool(nearest < umbra_edge(distance, sun_distance, float(sun.radius), np) + np.radians(1.0 / 60.0))


def _standing(where: Geometry) -> tuple[float, float, float]:
    """Angle of the Moon's centre from the axis [rad], distances of Moon and Sun from the Earth's centre [m].

    In NumPy: each operation of JAX's outside `jit` would be compiled by itself, half a second at a command's start.
    """
    here = where.on_host()
    across, along = np.cross(here.moon, -here.sun), np.dot(here.moon, -here.sun)
    offset = np.arctan2(np.linalg.norm(across), along)
    return float(offset), float(np.linalg.norm(here.moon)), float(np.linalg.norm(here.sun))


def check_eclipsed(where: Geometry) -> None:
    """Raise `InputError` if no part of the Moon is in the penumbra."""
    offset, distance, sun_distance = _standing(where)
    penumbra = (EARTH_RADIUS + MOON_RADIUS) / distance + (EARTH_RADIUS + SUN_RADIUS) / sun_distance
    if offset > 1.02 * penumbra:
        eclipse = nearest_eclipse(where.utc)
        raise InputError(
            f"There is no eclipse at {where.utc}: the nearest is {eclipse.kind}, greatest at {eclipse.greatest}, "
            f"in the penumbra from {eclipse.contacts['P1']} to {eclipse.contacts['P4']}."
        )
