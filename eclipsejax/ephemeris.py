"""Where Sun, Moon, observer and the axes of Moon and Earth are at one instant of a lunar eclipse.

Everything is worked out on the host, in numpy, from the embedded table (`almanac`) and skyfield's rotation of
the Earth; what leaves is a `Geometry`, a tree of arrays that can be traced, stacked and moved in time.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .almanac import Eclipse as Eclipse
from .almanac import eclipses as eclipses
from .almanac import instant, nearest, places, table
from .almanac import nearest_eclipse as nearest_eclipse
from .calendar import SECONDS_PER_DAY, Clock, read_clock, write_clock
from .constants import SPEED_OF_LIGHT
from .errors import InputError
from .traced import real

EARTH_SPIN = 7.292115e-5  # rad/s, relative to the stars (WGS 84)
MOON_SPIN = 2.6616995e-6  # rad/s: 13.17635815 degrees a day
EARTH_MOON_GM = 4.035033e14  # m^3 s^-2, Earth and Moon together (DE440)

# Orientation of the Moon's mean-Earth axes, Archinal et al. 2011, Celest. Mech. Dyn. Astr. 109, 101 (IAU
# WGCCRE report 2009), table 2: E1 to E13 [degrees, degrees per day] and their amplitudes [degrees] in the
# right ascension (sine) and declination (cosine) of the pole and in the prime meridian (sine).
ANGLES = np.array(
    [
        # E at J2000, rate, right ascension, declination, meridian
        [125.045, -0.0529921, -3.8787, 1.5419, 3.5610],
        [250.089, -0.1059842, -0.1204, 0.0239, 0.1208],
        [260.008, 13.0120009, 0.0700, -0.0278, -0.0642],
        [176.625, 13.3407154, -0.0172, 0.0068, 0.0158],
        [357.529, 0.9856003, 0.0, 0.0, 0.0252],
        [311.589, 26.4057084, 0.0072, -0.0029, -0.0066],
        [134.963, 13.0649930, 0.0, 0.0009, -0.0047],
        [276.617, 0.3287146, 0.0, 0.0, -0.0046],
        [34.226, 1.7484877, 0.0, 0.0, 0.0028],
        [15.134, -0.1589763, -0.0052, 0.0008, 0.0052],
        [119.743, 0.0036096, 0.0, 0.0, 0.0040],
        [239.961, 0.1643573, 0.0, 0.0, 0.0019],
        [25.053, 12.9590088, 0.0043, -0.0009, -0.0044],
    ]
)


class Geometry(eqx.Module):
    """Sun, Moon, observer and axes at one instant: apparent (light-time corrected), geocentric, ICRS axes."""

    moon: Float[Array, "3"]
    """Centre of the Moon [m]."""
    sun: Float[Array, "3"]
    """Centre of the Sun [m]."""
    observer: Float[Array, "3"]
    """The observer [m]; zeros for a geocentric one."""
    moon_axes: Float[Array, "3 3"]
    """Rows are the Moon-fixed mean-Earth axes x, y, z: `moon_axes @ vector` is selenographic."""
    pole: Float[Array, "3"]
    """Celestial pole of date: it defines north in the sky."""
    zenith: Float[Array, "3"]
    """Geodetic up at the site; zeros for a geocentric observer."""
    moon_velocity: Float[Array, "3"]
    """[m/s]"""
    sun_velocity: Float[Array, "3"]
    """[m/s]"""
    observer_velocity: Float[Array, "3"]
    """[m/s]"""
    clock: Float[Array, "2"]
    """Julian day number of the date and seconds of that day in UTC, as `calendar.Clock`.

    An array, so that geometries of several instants can be stacked and one compilation serves them all: with
    the text `utc` as a static field every new time would compile anew.
    """

    def __init__(
        self,
        moon,
        sun,
        observer,
        moon_axes,
        pole,
        zenith,
        moon_velocity,
        sun_velocity,
        observer_velocity,
        utc: str,
    ):
        self.moon, self.sun, self.observer = real(moon), real(sun), real(observer)
        self.moon_axes, self.pole, self.zenith = real(moon_axes), real(pole), real(zenith)
        self.moon_velocity, self.sun_velocity = real(moon_velocity), real(sun_velocity)
        self.observer_velocity = real(observer_velocity)
        self.clock = real(read_clock(utc))

    @property
    def utc(self) -> str:
        """ISO string ending with Z, to the millisecond (float32: to 8 ms); outside jit only."""
        day, second = np.asarray(self.clock, dtype=float)
        return write_clock(Clock(round(day), float(second)))

    def on_host(self) -> "Geometry":
        """The same in NumPy's arrays, in float64: a few numbers are had from it without compiling anything."""
        return jax.tree.map(lambda field: np.asarray(field, dtype=float), self)

    def after(self, seconds: Float[Array, ""] | float) -> "Geometry":
        """The same scene `seconds` later or earlier, differentiable: for a series, or an uncertain clock.

        The Moon falls freely towards the Earth, the Sun moves on straight, the Earth turns about its pole and
        the Moon about its own. After 30 minutes the Moon is off by 50 m, the Sun by 10 km, the observer by
        5 cm and the Moon's axes by 2e-4 degrees.
        """
        seconds = real(seconds)
        gravity = -EARTH_MOON_GM * self.moon / jnp.linalg.norm(self.moon) ** 3

        def turned(vector):  # Rodrigues' rotation about the pole
            angle = EARTH_SPIN * seconds
            along = self.pole * jnp.dot(self.pole, vector)
            return along + jnp.cos(angle) * (vector - along) + jnp.sin(angle) * jnp.cross(self.pole, vector)

        x, y, z = self.moon_axes
        cosine, sine = jnp.cos(MOON_SPIN * seconds), jnp.sin(MOON_SPIN * seconds)
        moved = {
            "moon": self.moon + self.moon_velocity * seconds + 0.5 * gravity * seconds**2,
            "sun": self.sun + self.sun_velocity * seconds,
            "observer": turned(self.observer),
            "moon_axes": jnp.stack([cosine * x + sine * y, cosine * y - sine * x, z]),
            "zenith": turned(self.zenith),
            "moon_velocity": self.moon_velocity + gravity * seconds,
            "observer_velocity": turned(self.observer_velocity),
            "clock": self.clock.at[1].add(seconds),
        }
        return eqx.tree_at(lambda here: [getattr(here, name) for name in moved], self, list(moved.values()))


def geometry(utc: str, latitude: float | None = None, longitude: float | None = None, height: float = 0.0) -> Geometry:
    """The scene at a time within 4.5 hours of greatest eclipse, from a site or from the Earth's centre.

    Against DE440 and skyfield's full reduction the Moon's direction is right to 1e-3 arcsec from the Earth's
    centre and 0.3 arcsec from a site (the diurnal aberration, left out). Far from today Delta T rules: a
    minute of time in -1000 turns the Earth by a quarter of a degree.

    - `utc`: ISO string with its zone, `2008-02-21T03:26:00Z`; it means UT1 before 1972, see `calendar`.
    - `latitude`, `longitude`: geodetic (WGS 84), north and east positive [degrees]; both or neither.
    - `height`: above the ellipsoid [m].
    """
    site = _site(latitude, longitude, height)
    clock = read_clock(utc)
    time = instant(clock, utc)
    number, days = nearest(time)
    if abs(days) > table().half_width:
        other = nearest_eclipse(utc)
        raise InputError(
            f"No lunar eclipse is near {utc}: the nearest is the {other.kind} one with greatest eclipse at "
            f"{other.greatest}; give a time within 4.5 hours of that."
        )
    here = places(number, days)
    observer, observer_velocity, zenith = np.zeros((3, 3)) if site is None else _standpoint(site, time)
    light_time = np.linalg.norm(here.moon) / SPEED_OF_LIGHT / SECONDS_PER_DAY
    return Geometry(
        moon=here.moon,
        sun=here.sun,
        observer=observer,
        moon_axes=moon_orientation(time.tt - light_time),
        pole=np.asarray(time.M)[2],
        zenith=zenith,
        moon_velocity=here.moon_velocity,
        sun_velocity=here.sun_velocity,
        observer_velocity=observer_velocity,
        utc=write_clock(clock),
    )


def moon_orientation(terrestrial_time: float) -> np.ndarray:
    """Rows are the Moon-fixed mean-Earth axes (to the mean Earth, east, north) in ICRS axes, (3, 3).

    Within 0.005 degrees of the numerically integrated librations of DE421 from 1900 to 2050 (150 m on the
    Moon); the mean arguments are linear in time, and in -1000 Cassini's law is met to 0.06 degrees.

    - `terrestrial_time`: Julian date, TT (for TDB: 2 ms do not matter).
    """
    days = terrestrial_time - 2451545.0
    centuries = days / 36525.0
    angle = np.radians(ANGLES[:, 0] + ANGLES[:, 1] * days)
    right_ascension = np.radians(269.9949 + 0.0031 * centuries + ANGLES[:, 2] @ np.sin(angle))
    declination = np.radians(66.5392 + 0.0130 * centuries + ANGLES[:, 3] @ np.cos(angle))
    meridian = np.radians(38.3213 + 13.17635815 * days - 1.4e-12 * days**2 + ANGLES[:, 4] @ np.sin(angle))
    sine, cosine = np.sin(right_ascension), np.cos(right_ascension)
    pole = np.array([np.cos(declination) * cosine, np.cos(declination) * sine, np.sin(declination)])
    node = np.array([-sine, cosine, 0.0])  # where the Moon's equator rises above that of the ICRS
    beyond = np.cross(pole, node)
    sine, cosine = np.sin(meridian), np.cos(meridian)
    return np.array([cosine * node + sine * beyond, cosine * beyond - sine * node, pole])


def moon_altitude(geometry: Geometry, xp=jnp) -> Float[Array, ""]:
    """Altitude of the Moon's centre above the observer's horizon, without refraction [rad].

    An observer at the Earth's centre has no horizon: pi / 2, the Moon never sets and no air is in the way.

    - `xp`: JAX's or plain NumPy, for which the geometry must be `on_host`.
    """
    line_of_sight = geometry.moon - geometry.observer
    sine = xp.dot(geometry.zenith, line_of_sight) / xp.linalg.norm(line_of_sight)
    on_earth = xp.any(geometry.zenith != 0.0)
    return xp.where(on_earth, xp.arcsin(xp.where(on_earth, sine, 0.0)), 0.5 * np.pi)


def local_circumstances(eclipse: Eclipse, latitude: float, longitude: float, height: float = 0.0) -> dict[str, float]:
    """Altitude of the Moon's centre [rad] at `greatest` and at each contact, without refraction.

    The Moon is up where it is positive. Arguments as in `geometry`.
    """
    instants = {"greatest": eclipse.greatest} | eclipse.contacts
    site = (latitude, longitude, height)
    return {name: float(moon_altitude(geometry(utc, *site))) for name, utc in instants.items()}


def _site(latitude, longitude, height) -> tuple[float, float, float] | None:
    """The site, checked; None for a geocentric observer."""
    if latitude is None and longitude is None:
        return None
    if latitude is None or longitude is None:
        raise InputError("A site needs both latitude and longitude [degrees]: give both, or neither.")
    try:
        latitude, longitude, height = float(latitude), float(longitude), float(height)
    except (TypeError, ValueError):
        raise InputError(
            f"The site {latitude!r}, {longitude!r}, {height!r} is not three numbers: give latitude and "
            "longitude in degrees, and height in metres."
        ) from None
    if not -90.0 <= latitude <= 90.0:
        raise InputError(f"The latitude {latitude} is outside -90..90: give degrees, north positive.")
    if not -180.0 <= longitude <= 360.0:
        raise InputError(f"The longitude {longitude} is outside -180..360: give degrees, east positive.")
    if not -1e4 <= height <= 1e6:
        raise InputError(f"The height {height} is outside -1e4..1e6: give metres above the ellipsoid.")
    return latitude, longitude, height


def _standpoint(site: tuple[float, float, float], time) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place [m], velocity [m/s] and zenith of a site at a skyfield time, ICRS axes."""
    from skyfield.framelib import itrs
    from skyfield.toposlib import wgs84

    state = wgs84.latlon(*site).at(time)
    latitude, longitude = np.radians(site[:2])
    outwards = np.cos(latitude)
    up = np.array([outwards * np.cos(longitude), outwards * np.sin(longitude), np.sin(latitude)])
    turned = np.asarray(itrs.rotation_at(time)).T  # from Earth-fixed to ICRS axes
    return np.asarray(state.position.m), np.asarray(state.velocity.m_per_s), turned @ up
