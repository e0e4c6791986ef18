import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.camera import Camera
from eclipsejax.constants import EARTH_RADIUS, MOON_RADIUS
from eclipsejax.ephemeris import geometry
from eclipsejax.errors import InputError
from eclipsejax.scene import Scene, axis_offset, disc_points

MIDDLE = "2008-02-21T03:26:03Z"
points_at = eqx.filter_jit(disc_points)


@pytest.fixture(scope="module", params=[None, (42.73, -73.68)], ids=["geocentric", "Troy"])
def where(request):
    return geometry(MIDDLE, *(request.param or ()))


def unit(vector):
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def sky(where):
    """Unit vectors ahead, east and north of the disc's centre."""
    ahead = unit(np.asarray(where.moon - where.observer))
    east = unit(np.cross(where.pole, ahead))
    return ahead, east, np.cross(ahead, east)


def limb_radius(where):
    """Of the disc, in the tangent plane."""
    distance = np.linalg.norm(where.moon - where.observer)
    return np.tan(np.arcsin(MOON_RADIUS / distance))


def test_disc_has_the_apparent_radius_of_the_moon(where):
    radius = limb_radius(where)
    assert 14.5 / 60 < np.degrees(radius) < 17 / 60
    angle = np.linspace(0.0, 2.0 * np.pi, 12)
    for factor, inside in ((1 - 1e-9, True), (1 + 1e-9, False)):
        points = points_at(where, factor * radius * np.sin(angle), factor * radius * np.cos(angle))
        assert np.all(np.asarray(points.on_disc) == inside)
        np.testing.assert_allclose(points.emission_cosine, 0.0, atol=1e-4)


def test_points_lie_on_the_moon_in_the_direction_asked_for(where):
    angle, fraction = np.meshgrid(np.linspace(0.0, 6.0, 9), [0.0, 0.3, 0.7, 0.99])
    east, north = (fraction * limb_radius(where) * f(angle) for f in (np.sin, np.cos))
    points = points_at(where, east, north)
    np.testing.assert_allclose(np.linalg.norm(points.position - where.moon, axis=-1), MOON_RADIUS, rtol=1e-9)
    ahead, to_east, to_north = sky(where)
    sight = np.asarray(points.position - where.observer)
    np.testing.assert_allclose(sight @ to_east / (sight @ ahead), east, atol=1e-12)
    np.testing.assert_allclose(sight @ to_north / (sight @ ahead), north, atol=1e-12)
    # The near side of the Moon, not the far one.
    assert np.all(np.linalg.norm(sight, axis=-1) < np.linalg.norm(where.moon - where.observer))
    assert np.all(np.asarray(points.emission_cosine) > 0.0)


def test_centre_of_the_disc_is_the_libration(where):
    points = points_at(where, np.zeros(1), np.zeros(1))
    x, y, z = np.asarray(where.moon_axes) @ unit(np.asarray(where.observer - where.moon))
    assert points.longitude[0] == pytest.approx(np.arctan2(y, x), abs=1e-9)
    assert points.latitude[0] == pytest.approx(np.arcsin(z), abs=1e-9)
    assert abs(np.degrees(points.longitude[0])) < 9 and abs(np.degrees(points.latitude[0])) < 8
    assert points.emission_cosine[0] == pytest.approx(1.0, abs=1e-12)


def test_north_of_the_moon_is_up_and_its_east_is_right_in_the_sky(where):
    # Lunar east (Mare Crisium) is towards celestial west; the Moon's pole is within 25 degrees of north.
    step = 0.2 * limb_radius(where)
    points = points_at(where, np.array([0.0, 0.0, step, -step]), np.array([step, -step, 0.0, 0.0]))
    assert points.latitude[0] > points.latitude[1]
    assert points.longitude[3] > points.longitude[2]


def test_full_moon_is_lit_from_behind_the_observer(where):
    points = points_at(where, np.zeros(1), np.zeros(1))
    assert points.incidence_cosine[0] > 0.999
    # Within the umbra light arrives from the limb of the Earth, 57' from its centre.
    assert points.phase_angle[0] == pytest.approx(EARTH_RADIUS / np.linalg.norm(points.position[0]), rel=1e-9)


@pytest.mark.parametrize(
    ("utc", "gamma"),
    [
        ("2008-02-21T03:26:03Z", 0.3992),
        ("2010-12-21T08:16:57Z", 0.3214),
        ("2018-07-27T20:21:43Z", 0.1168),
        ("2022-05-16T04:11:29Z", 0.2532),
    ],
)
def test_distance_from_the_axis_is_gamma_of_the_canon(utc, gamma):
    # Five Millennium Canon: least distance of the Moon's centre from the axis, in equatorial radii of the Earth.
    where = geometry(utc)
    distance = np.sin(axis_offset(where, where.moon)) * np.linalg.norm(where.moon) / 6.378137e6
    assert float(distance) == pytest.approx(gamma, abs=1e-4)


def test_offset_has_a_slope_on_the_axis():
    where = geometry(MIDDLE)
    on_axis = -where.sun / jnp.linalg.norm(where.sun) * 3.8e8
    assert float(axis_offset(where, on_axis)) < 1e-8
    assert np.all(np.isfinite(jax.grad(lambda p: axis_offset(where, p))(on_axis)))


def test_scene_takes_its_parts_from_the_caller():
    scene = Scene.at(MIDDLE, 42.73, -73.68, camera=Camera(shape=(5, 7)))
    assert scene.camera.shape == (5, 7) and scene.sky is not None
    assert Scene.at(MIDDLE).sky is None
    assert Scene.at(MIDDLE, 42.73, -73.68, sky=None).sky is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("2008-02-21T00:00:00Z",), ["no eclipse", "total", "00:36:3", "06:15:3"]),
        (("2008-03-10T00:00:00Z",), ["2008-02-21"]),
        ((MIDDLE, -33.9, 151.2), ["below the horizon", "-33.9", "151.2"]),
    ],
)
def test_a_scene_that_cannot_be_is_refused_in_one_sentence(arguments, words):
    with pytest.raises(InputError) as refusal:
        Scene.at(*arguments)
    sentence = str(refusal.value)
    assert sentence.endswith(".") and "\n" not in sentence
    for word in words:
        assert word in sentence
