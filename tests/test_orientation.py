"""Which way up a photograph is: with the camera's own convention, for maria, shadow, both and neither."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import ndimage

from eclipsejax.camera import Camera, sky_plane
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import geometry
from eclipsejax.moon import Moon
from eclipsejax.scene import axis_offset, disc_points
from inverse.disc_search import Circle
from inverse.orientation import orientation
from tests.moon_picture import CENTRE, RADIUS, picture, sunlight

TOTAL, PARTIAL, NO_SHADOW = "2022-05-16T03:45:00Z", "2022-05-16T02:58:00Z", "2022-05-16T00:30:00Z"
GAIN = {TOTAL: 1500.0, PARTIAL: 4.0, NO_SHADOW: 0.8}
GRID = np.linspace(-1.0, 1.0, 240)


def photographed(utc, roll, mirror=False, *, maria=1.0, noise=0.004):
    """A disc seen by a camera with this roll [degrees], the contrast of its maria raised to a power."""
    where = geometry(utc)
    scale = MOON_RADIUS / np.linalg.norm(where.moon - where.observer)
    camera = Camera(shape=(1, 1), centre=(0.0, 0.0), scale=scale, roll=np.radians(roll), mirror=mirror)
    points = disc_points(where, *sky_plane(camera, jnp.asarray(-GRID)[:, None], jnp.asarray(GRID)[None, :]))
    albedo = np.asarray(Moon().albedo(points.longitude, points.latitude)) ** maria
    offset = np.asarray(axis_offset(where, points.position)) * np.linalg.norm(where.moon) / MOON_RADIUS
    image = albedo * sunlight(offset)

    def surface(right, up):
        at = [(x + 1.0) / 2.0 * (GRID.size - 1) for x in np.broadcast_arrays(up, right)]
        return ndimage.map_coordinates(image, at, order=1, mode="nearest")

    # The shadow is in the surface; the picture's own is far away.
    photo = picture(surface=surface, axis=(0.0, 9.0), gain=GAIN[utc], noise=noise)
    return orientation(photo, Circle(*CENTRE, RADIUS, 1.0), where, Moon())


def off(found, roll):
    """Error of the roll [degrees]."""
    return abs((np.degrees(found.roll) - roll + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize(("utc", "roll"), [(TOTAL, 137.0), (TOTAL, 358.0), (PARTIAL, 41.0), (NO_SHADOW, 250.0)])
def test_roll_and_mirror_are_read_off_the_maria(utc, roll, mirror):
    found = photographed(utc, roll, mirror)
    assert "maria" in found.source and found.mirror is mirror
    assert off(found, roll) < max(1.0, 4 * np.degrees(found.error))
    assert found.quality > 0.1


def test_shadow_alone_gives_the_roll_but_not_the_mirror():
    found = photographed(PARTIAL, 41.0, maria=0.0)
    assert found.source == "shadow" and not found.mirror
    assert off(found, 41.0) < 5.0


def test_a_disc_without_features_is_assumed_north_up():
    found = photographed(NO_SHADOW, 41.0, maria=0.0)
    assert found.source == "assumed north up" and found.roll == 0.0 and found.error == np.pi


def test_noise_makes_the_roll_less_certain():
    clean, noisy = (photographed(NO_SHADOW, 250.0, noise=noise) for noise in (0.002, 0.1))
    assert noisy.error > 1.5 * clean.error
    assert off(noisy, 250.0) < max(1.0, 4 * np.degrees(noisy.error))
