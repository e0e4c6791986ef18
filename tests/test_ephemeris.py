"""Places and axes against other people's reductions, and the motion from one instant to the next."""

import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax import almanac, calendar
from eclipsejax.ephemeris import (
    Geometry,
    geometry,
    local_circumstances,
    moon_altitude,
    moon_orientation,
    nearest_eclipse,
)
from eclipsejax.errors import InputError

# Apparent geocentric Moon and Sun [km] and, from a site (latitude, longitude, height), altitude [degrees]
# and distance [km] of the Moon: DE440 itself with skyfield 1.55's full reduction (light time, aberration,
# deflection, diurnal aberration).
REDUCED = [
    ("2008-02-21T03:26:00Z", (52.0, 0.0, 0.0), (-337929.2, 167821.0, 69995.5),
     (130311526.0, -64223326.0, -27843147.0), 32.31877, 380295.1),
    ("1982-12-30T12:40:00Z", (-33.9, 18.4, 500.0), (-58307.8, 322110.1, 142738.5),
     (22333379.0, -133393738.0, -57839258.0), -64.68684, 362864.1),
    ("2025-09-07T16:00:00Z", (35.0, 139.0, 0.0), (355189.7, -94023.9, -43509.8),
     (-145549485.0, 35961037.0, 15589295.0), 43.40862, 365571.5),
    ("2045-03-03T08:00:00Z", (10.0, -60.0, 0.0), (-345921.1, 102211.1, 37082.7),
     (141438878.0, -40886929.0, -17723069.0), 32.19924, 359168.7),
]  # fmt: skip

TROY = (42.73, -73.68, 50.0)


def angle(first, second) -> float:
    """Between two vectors [degrees], precise for small ones."""
    cross = np.linalg.norm(np.cross(first, second))
    return float(np.degrees(np.arctan2(cross, np.dot(first, second))))


def selenographic(here: Geometry, towards) -> np.ndarray:
    """Longitude and latitude of the point of the Moon under a direction [degrees]."""
    x, y, z = np.asarray(here.moon_axes) @ np.asarray(towards) / np.linalg.norm(towards)
    return np.degrees([np.arctan2(y, x), np.arcsin(z)])


def light_time_only(here: Geometry) -> np.ndarray:
    """From the observer to the Moon as it was, without aberration: what other people call the line of sight.

    Undoes the motion of the Earth during the light time, which is the opposite of the motion of the Sun.
    """
    line = np.asarray(here.moon - here.observer)
    return line + np.asarray(here.sun_velocity) * np.linalg.norm(line) / 299792458.0


@pytest.mark.parametrize(("utc", "site", "moon", "sun", "altitude", "distance"), REDUCED)
def test_places_are_those_of_de440_fully_reduced(utc, site, moon, sun, altitude, distance):
    here = geometry(utc, *site)
    assert angle(here.moon, moon) * 3600.0 < 0.05  # printed to 0.1 km = 0.05 arcsec
    assert angle(here.sun, sun) * 3600.0 < 0.01
    # 39 km of aberration, nearly across the line of sight, are in our vectors and not in that distance.
    assert float(jnp.linalg.norm(here.moon)) / 1e3 == pytest.approx(np.linalg.norm(moon), abs=2.0)
    assert float(jnp.degrees(moon_altitude(here))) == pytest.approx(altitude, abs=0.32 / 3600.0)
    assert float(jnp.linalg.norm(here.moon - here.observer)) / 1e3 == pytest.approx(distance, abs=2.0)


def test_libration_and_axis_of_the_2008_eclipse():
    # DE440 and the DE421 mean-Earth axes read with skyfield: light time, no aberration.
    here = geometry("2008-02-21T03:26:00Z")
    line = light_time_only(here)
    np.testing.assert_allclose(selenographic(here, -line), [4.7471, 0.5218], atol=0.005)
    np.testing.assert_allclose(selenographic(here, here.sun - here.moon), [4.8009, 0.1458], atol=0.005)
    paris = geometry("2008-02-21T03:26:00Z", 48.8566, 2.3522)
    np.testing.assert_allclose(selenographic(paris, -light_time_only(paris)), [4.4957, 1.2832], atol=0.005)

    direction = np.asarray(here.moon) / np.linalg.norm(here.moon)
    east = np.cross(here.pole, direction)
    east /= np.linalg.norm(east)
    axis = np.asarray(here.moon_axes[2])
    position_angle = np.degrees(np.arctan2(axis @ east, axis @ np.cross(direction, east)))
    assert position_angle == pytest.approx(19.3575, abs=0.005)


def test_cassinis_law_holds_in_every_century():
    # The Moon's equator is tilted by 1.543 degrees to the ecliptic, against its orbit of 5.145: near the
    # nodes, where eclipses are, the latitude of libration is -(1 + 1.543 / 5.145) times the ecliptic
    # latitude.
    numbers = np.arange(0, len(almanac.table().greatest), 97)
    here = almanac.places(numbers, np.zeros(len(numbers)))
    ecliptic_pole = np.cross(here.sun, here.sun_velocity)  # of date
    sine = np.sum(ecliptic_pole * here.moon, axis=1) / np.linalg.norm(ecliptic_pole, axis=1)
    latitude = np.degrees(np.arcsin(sine / np.linalg.norm(here.moon, axis=1)))
    axes = [moon_orientation(date) for date in almanac.table().greatest[numbers]]
    towards = [-a @ m / np.linalg.norm(m) for a, m in zip(axes, here.moon, strict=True)]
    longitude_libration = np.degrees([np.arctan2(v[1], v[0]) for v in towards])
    latitude_libration = np.degrees([np.arcsin(v[2]) for v in towards])
    np.testing.assert_allclose(latitude_libration, -(1 + 1.543 / 5.145) * latitude, atol=0.15)
    assert np.abs(longitude_libration).max() < 7.9
    for half in np.array_split(longitude_libration, 2):
        assert abs(half.mean()) < 1.0  # 4 standard errors


def test_moon_axes_are_a_right_handed_triad_facing_the_earth():
    axes = np.asarray(geometry("2015-09-28T02:47:00Z").moon_axes)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_the_pole_was_near_kochab_in_antiquity():
    right_ascension, declination = np.radians([222.6764, 74.1555])  # beta Ursae Minoris, J2000
    kochab = [
        np.cos(declination) * np.cos(right_ascension),
        np.cos(declination) * np.sin(right_ascension),
        np.sin(declination),
    ]
    here = geometry(nearest_eclipse("-1000-03-24").greatest)
    assert angle(here.pole, kochab) == pytest.approx(6.5, abs=0.2)
    assert angle(geometry("2000-07-16T14:00Z").pole, [0.0, 0.0, 1.0]) < 0.01


@pytest.mark.parametrize("latitude", [-90.0, -33.9, 0.0, 42.73, 90.0])
def test_the_site_stands_on_the_ellipsoid(latitude):
    here = geometry("2008-02-21T03:26Z", latitude, 12.0, 1000.0)
    assert float(here.zenith @ here.pole) == pytest.approx(np.sin(np.radians(latitude)), abs=1e-9)
    a, b, phi = 6378137.0, 6356752.3142, np.radians(latitude)
    sea_level = np.asarray(here.observer - 1000.0 * here.zenith)
    east_west = np.linalg.norm(np.cross(here.pole, sea_level))
    assert (east_west / a) ** 2 + (sea_level @ here.pole / b) ** 2 == pytest.approx(1.0, abs=1e-9)
    speed = float(jnp.linalg.norm(here.observer_velocity))
    radius = a**2 * np.cos(phi) / np.hypot(a * np.cos(phi), b * np.sin(phi)) + 1000.0 * np.cos(phi)
    assert speed == pytest.approx(2.0 * np.pi / 86164.0905 * radius, abs=1e-3)


def test_velocities_are_the_rates_of_the_places():
    before, here, after = (geometry(f"2008-02-21T03:{time}Z", *TROY) for time in ("25:59", "26:00", "26:01"))
    for body, tolerance in (("moon", 0.05), ("sun", 0.1), ("observer", 1e-3)):
        rate = (getattr(after, body) - getattr(before, body)) / 2.0
        np.testing.assert_allclose(rate, getattr(here, body + "_velocity"), atol=tolerance)


@pytest.mark.parametrize("greatest", ["2008-02-21T03:26:00Z", "2015-09-28T02:47:00Z", "1816-06-10T00:10:00Z"])
@pytest.mark.parametrize("minutes", [-30, -20, 20, 30])
def test_after_is_the_geometry_of_the_later_time(greatest, minutes):
    clock = calendar.read_clock(greatest)
    later = calendar.write_clock(calendar.Clock(clock.day, clock.second + 60.0 * minutes))
    moved, truth = geometry(greatest, *TROY).after(60.0 * minutes), geometry(later, *TROY)
    assert moved.utc == truth.utc == later
    tolerance = {
        "moon": 60.0,
        "sun": 12e3,
        "observer": 0.2,
        "zenith": 1e-7,
        "pole": 1e-7,
        "moon_axes": 1e-5,
        "moon_velocity": 0.1,
        "sun_velocity": 12.0,
        "observer_velocity": 1e-4,
    }
    for name, allowed in tolerance.items():
        ours, theirs = getattr(moved, name), getattr(truth, name)
        np.testing.assert_allclose(ours, theirs, atol=allowed, rtol=0.0, err_msg=name)


def test_after_can_be_differentiated():
    here = geometry("2008-02-21T03:26:00Z", *TROY)
    moved, rate = jax.jvp(here.after, (0.0,), (1.0,))
    for body in ("moon", "sun", "observer"):
        np.testing.assert_allclose(getattr(moved, body), getattr(here, body))
    np.testing.assert_allclose(rate.moon, here.moon_velocity)
    np.testing.assert_allclose(rate.observer, here.observer_velocity, atol=1e-3)
    slope = jax.grad(lambda seconds: moon_altitude(here.after(seconds)))(600.0)
    late, early = (moon_altitude(geometry(f"2008-02-21T03:{t}Z", *TROY)) for t in ("37:00", "35:00"))
    assert float(slope) == pytest.approx(float(late - early) / 120.0, rel=1e-4)


def test_one_compilation_serves_every_time_and_times_stack():
    traces = []

    @eqx.filter_jit
    def altitude(here):
        traces.append(1)
        return moon_altitude(here)

    scenes = [geometry(utc, *TROY) for utc in ("2008-02-21T03:26Z", "2010-12-21T08:17Z")]
    single = [float(altitude(scene)) for scene in scenes]
    assert len(traces) == 1
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *scenes)
    np.testing.assert_allclose(jax.vmap(moon_altitude)(stacked), single)


def test_a_geocentric_observer_always_sees_the_moon():
    here = geometry("2008-02-21T03:26:00Z")
    assert not np.any(here.observer) and not np.any(here.zenith) and not np.any(here.observer_velocity)
    altitude, gradient = jax.value_and_grad(lambda t: moon_altitude(here.after(t)))(0.0)
    assert float(altitude) == pytest.approx(np.pi / 2) and float(gradient) == 0.0


def test_local_circumstances():
    eclipse = nearest_eclipse("2008-02-21T03:26Z")
    greenwich = local_circumstances(eclipse, 52.0, 0.0)
    assert set(greenwich) == {"greatest", *almanac.CONTACTS}
    # 2 s after the fully reduced place above.
    assert np.degrees(greenwich["greatest"]) == pytest.approx(32.3188, abs=0.02)
    assert greenwich["P1"] > greenwich["U1"] > greenwich["U4"] > greenwich["P4"] > 0.0  # setting
    antipodes = local_circumstances(eclipse, -52.0, 180.0)
    parallax = np.degrees(2.0 * 6.37e6 * np.cos(np.radians(32.3)) / 3.837e8)
    assert np.degrees(antipodes["greatest"] + greenwich["greatest"]) == pytest.approx(-parallax, abs=0.02)


@pytest.mark.parametrize("utc", ["2008-03-06T12:00Z", "2008-02-20T22:50:00Z", "2008-02-21T08:00:00Z"])
def test_a_time_without_an_eclipse_names_the_nearest(utc):
    with pytest.raises(InputError, match=r"nearest is the total one .* 2008-02-21T03:26:0\dZ"):
        geometry(utc)


@pytest.mark.parametrize("utc", ["-1001-06-01T00:00Z", "2999-06-01T00:00Z", "+12008-02-21T03:26Z"])
def test_a_time_outside_the_table_is_refused(utc):
    with pytest.raises(InputError, match="from -1000 to 2998"):
        geometry(utc)


@pytest.mark.parametrize(
    ("site", "word"),
    [
        ((91.0, 0.0), "latitude"),
        ((float("nan"), 0.0), "latitude"),
        ((0.0, -181.0), "longitude"),
        ((0.0, 361.0), "longitude"),
        ((0.0, 0.0, 1e8), "height"),
        ((45.0, None), "both"),
        (("north", 0.0), "numbers"),
    ],
)
def test_an_impossible_site_is_refused(site, word):
    with pytest.raises(InputError, match=word):
        geometry("2008-02-21T03:26Z", *site)


def test_import_stays_cheap():
    code = "import sys, eclipsejax.ephemeris; sys.exit('skyfield' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0
