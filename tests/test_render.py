"""One compiled program serves all pictures, another, twice as long to compile, all their gradients."""

import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.camera import Camera, signal
from eclipsejax.errors import InputError
from eclipsejax.render import channel_weights, disc_offsets, render
from eclipsejax.response import display
from eclipsejax.scene import Scene, axis_offset, disc_points
from tests.oracles import derivative

CAMERA = Camera(shape=(16, 16), scale=6.5e-4, centre=(7.3, 7.9), psf_fwhm=1.2, glare=1e-3)
PARTIAL = "2008-02-21T02:20:00Z"
WEIGHTS = np.random.default_rng(3).uniform(0.5, 1.5, (16, 16, 3))


def weighed(free, scene):
    """Weighted sum of the picture, and the picture."""
    atmosphere, camera = free
    image = signal(render(eqx.tree_at(lambda s: s.camera, scene, camera), atmosphere, tolerance=1e-3), camera)
    return jnp.sum(WEIGHTS * image), image


pictured = eqx.filter_jit(weighed)
sloped = eqx.filter_jit(eqx.filter_grad(weighed, has_aux=True))


def scene_at(utc):
    return Scene.at(utc, 42.73, -73.68, camera=CAMERA)


def picture(scene, atmosphere=None, camera=CAMERA):
    free = (Atmosphere.typical() if atmosphere is None else atmosphere, camera)
    return np.asarray(pictured(free, scene)[1])


@pytest.fixture(scope="module")
def partial_scene():
    return scene_at(PARTIAL)


@pytest.fixture(scope="module")
def partial(partial_scene):
    return picture(partial_scene)


def test_sky_is_black_and_the_umbra_dark(partial):
    row, column = np.mgrid[:16, :16]
    radius = np.hypot(row - 7.3, column - 7.9) * 6.5e-4
    assert partial.shape == (16, 16, 3)
    luminance = partial @ [0.2126, 0.7152, 0.0722]
    on_disc = luminance[radius < 3.5e-3]
    assert np.max(luminance[radius > 7e-3]) < 0.01 * np.max(on_disc)  # glare only
    assert np.max(on_disc) > 0.05 and np.min(on_disc) < 0.02 * np.max(on_disc)


def test_moon_goes_into_the_shadow_with_its_eastern_limb(partial):
    # North is up, so east is on the left: the Moon runs eastwards, and its left side is dark first.
    luminance = partial @ [0.2126, 0.7152, 0.0722]
    assert np.sum(luminance[:, :8]) < 0.25 * np.sum(luminance[:, 8:])


def test_moon_at_the_first_contact_is_the_unit():
    # Full Moon, whose edge touches the penumbra: mean luminance of the disc 1, above the air, at the phase of 1.5
    # degrees that the Earth's centre sees; from Troy it is nearer to 1 and the Moon 5 % brighter.
    scene = eqx.tree_at(lambda s: s.sky, scene_at("2008-02-21T00:37:30Z"), scene_at(PARTIAL).sky)
    image = picture(scene)
    sight = scene.geometry.moon - scene.geometry.observer
    pixels = np.pi * (1.7374e6 / float(jnp.linalg.norm(sight)) / 6.5e-4) ** 2
    luminance = np.sum(image @ [0.2126, 0.7152, 0.0722]) / pixels
    air = through_the_air(scene)
    assert luminance / air == pytest.approx(1.03, abs=0.05)


def through_the_air(scene):
    """Luminance left by the observer's air."""
    bare = eqx.tree_at(lambda s: s.sky, scene, None, is_leaf=lambda x: x is None)
    return float(jnp.sum(channel_weights(scene, 24)[1][:, 1]) / jnp.sum(channel_weights(bare, 24)[1][:, 1]))


def test_rolled_camera_turns_the_picture():
    # Up towards east, which was on the left: the picture turns clockwise. About the middle of the frame.
    scene = scene_at(PARTIAL)
    level, rolled = (
        picture(scene, camera=Camera((16, 16), 6.5e-4, roll, centre=(7.5, 7.5), psf_fwhm=1.2, glare=1e-3))
        for roll in (0.0, np.pi / 2)
    )
    np.testing.assert_allclose(rolled, np.rot90(level, -1), atol=1e-9 * np.max(level))


def test_more_dust_makes_the_umbra_darker_and_redder(partial_scene, partial):
    dusty = eqx.tree_at(lambda a: a.dust.extinction, Atmosphere.typical(), jnp.asarray(5e-6, dtype=float))
    image = picture(partial_scene, dusty)
    sharp = image.sum(axis=(0, 1)) < partial.sum(axis=(0, 1))
    assert np.all(sharp)


def test_no_gradient_of_a_picture_is_undefined(partial_scene):
    gradient, image = sloped((Atmosphere.typical(), CAMERA), partial_scene)
    assert np.all(np.isfinite(image))
    leaves = jax.tree_util.tree_leaves_with_path(eqx.filter(gradient, eqx.is_array))
    assert len(leaves) >= 18
    for path, leaf in leaves:
        assert np.all(np.isfinite(leaf)), jax.tree_util.keystr(path)


@pytest.mark.parametrize(
    ("part", "name", "step"),
    [("dust", "extinction", 1e-7), ("air", "surface_temperature", 0.5), ("clouds", "top", 60.0)],
)
def test_picture_has_the_gradient_that_differences_show(partial_scene, part, name, step):
    where = lambda a: getattr(getattr(a, part), name)
    atmosphere = Atmosphere.typical()

    def total(x):
        changed = eqx.tree_at(where, atmosphere, jnp.asarray(x, dtype=float))
        return float(pictured((changed, CAMERA), partial_scene)[0])

    found = float(where(sloped((atmosphere, CAMERA), partial_scene)[0][0]))
    assert found == pytest.approx(derivative(total, float(where(atmosphere)), step), rel=5e-3)


def test_a_picture_can_be_shown(partial):
    shown = display(partial, gain=3.0)
    assert shown.shape == (16, 16, 3) and shown.dtype == np.uint8
    assert shown.max() > 100 and shown.min() == 0


def test_a_tolerance_that_cannot_be_met_is_refused(partial_scene):
    with pytest.raises(InputError, match="0.001"):
        render(partial_scene, Atmosphere(), tolerance=1e-5)


def test_offsets_of_the_disc_bound_those_of_its_points(partial_scene):
    where = partial_scene.geometry
    angle, radius = np.meshgrid(np.linspace(0.0, 6.2, 24), np.linspace(0.0, 4.6e-3, 12))
    points = disc_points(where, radius * np.sin(angle), radius * np.cos(angle))
    offset = np.asarray(axis_offset(where, points.position))[np.asarray(points.on_disc)]
    low, high = np.asarray(disc_offsets(where))
    assert low <= offset.min() < low + 6e-4
    assert high - 6e-4 < offset.max() <= high


def test_a_picture_made_in_bands_is_the_same(partial_scene, partial, monkeypatch):
    monkeypatch.setattr(
        sys.modules["eclipsejax.render"], "_BAND", 5 * 16
    )  # four bands of five rows, of which the last overlaps
    banded = eqx.filter_jit(lambda scene, air: signal(render(scene, air, tolerance=1e-3), scene.camera))
    np.testing.assert_allclose(banded(partial_scene, Atmosphere.typical()), partial, rtol=1e-9, atol=1e-15)
