"""Libration and orientation of the Moon's disc, against the formulae of Meeus and against what a picture shows."""

import jax.numpy as jnp
import numpy as np
import pytest
from skyfield.api import wgs84

from eclipsejax.aspect import aspect
from eclipsejax.calendar import read_clock, skyfield_time
from eclipsejax.camera import Camera, sky_plane
from eclipsejax.ephemeris import geometry
from eclipsejax.scene import disc_points

UTC = ["1982-07-06T07:30:00Z", "2008-02-21T03:26:00Z", "2018-07-27T20:21:00Z", "2022-11-08T10:59:00Z"]
TROY = 42.73, -73.68


def optical_libration(moon, julian_date):
    """Longitude, latitude and position angle of the axis [degrees]: Meeus, Astronomical Algorithms, chapter 53.

    Without physical librations (0.04 degrees) and nutation. None of the program's own axes of the Moon are in it.
    """
    century = (julian_date - 2451545.0) / 36525.0
    node = np.radians(125.0445479 - 1934.1362891 * century)
    argument = np.radians(93.2720950 + 483202.0175233 * century)
    inclination, obliquity = np.radians(1.54242), np.radians(23.439291 - 0.0130042 * century)
    x, y, z = moon / np.linalg.norm(moon)  # ICRS; the ecliptic of J2000 will do, its longitude precesses
    tilted = np.radians(23.439291)
    beta = np.arcsin(z * np.cos(tilted) - y * np.sin(tilted))
    longitude = np.arctan2(y * np.cos(tilted) + z * np.sin(tilted), x) + np.radians(1.396971 * century)
    w = longitude - node
    a = np.arctan2(np.sin(w) * np.cos(beta) * np.cos(inclination) - np.sin(beta) * np.sin(inclination),
                   np.cos(w) * np.cos(beta))  # fmt: skip
    latitude = np.arcsin(-np.sin(w) * np.cos(beta) * np.sin(inclination) - np.sin(beta) * np.cos(inclination))
    east = np.sin(inclination) * np.sin(node)
    up = np.sin(inclination) * np.cos(node) * np.cos(obliquity) - np.cos(inclination) * np.sin(obliquity)
    right_ascension = np.arctan2(
        np.cos(obliquity) * np.sin(longitude) - np.tan(beta) * np.sin(obliquity), np.cos(longitude)
    )
    sine = np.hypot(east, up) * np.cos(right_ascension - np.arctan2(east, up)) / np.cos(latitude)
    turn = (a - argument + np.pi) % (2.0 * np.pi) - np.pi
    return np.degrees([turn, latitude, np.arcsin(sine)])


@pytest.mark.parametrize("utc", UTC)
def test_libration_and_axis_are_those_of_meeus(utc):
    where = geometry(utc)
    seen = aspect(where)
    found = np.degrees([seen.longitude, seen.latitude, seen.axis])
    np.testing.assert_allclose(
        found, optical_libration(np.asarray(where.moon), skyfield_time(read_clock(utc)).tt), atol=0.06
    )
    assert np.isnan([float(x) for x in (seen.tilt, seen.altitude, seen.azimuth)]).all()


def test_disc_of_a_picture_has_this_centre_and_this_north():
    where = geometry(UTC[1], *TROY)
    seen = aspect(where)
    up = float(seen.axis - seen.tilt)  # position angle of the zenith
    camera = Camera(shape=(1, 1), centre=(0.0, 0.0), scale=1e-3, roll=up)
    row, column = jnp.array([0.0, -1.0 * np.cos(seen.tilt)]), jnp.array([0.0, -1.0 * np.sin(seen.tilt)])
    points = disc_points(where, *sky_plane(camera, row, column))
    np.testing.assert_allclose([points.longitude[0], points.latitude[0]], seen[:2], atol=1e-6)
    assert float(points.longitude[1]) == pytest.approx(float(seen.longitude), abs=1e-3)  # due north on the Moon
    assert points.latitude[1] > points.latitude[0] + 0.1


def test_altitude_and_azimuth_are_those_of_skyfield():
    where = geometry(UTC[1], *TROY)
    seen = aspect(where)
    rotation = wgs84.latlon(*TROY).rotation_at(skyfield_time(read_clock(UTC[1])))
    north, east, up = rotation @ np.asarray(where.moon - where.observer)
    assert float(seen.altitude) == pytest.approx(np.arctan2(up, np.hypot(north, east)), abs=2e-6)
    assert float(seen.azimuth) == pytest.approx(np.arctan2(east, north) % (2 * np.pi), abs=2e-5)
