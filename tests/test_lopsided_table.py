import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze
from eclipsejax.camera import Camera
from eclipsejax.constants import ASTRONOMICAL_UNIT, MOON_RADIUS
from eclipsejax.errors import InputError
from eclipsejax.limb_sectors import along_limb
from eclipsejax.lopsided_table import scene_table
from eclipsejax.render import render
from eclipsejax.scattered import scattered_irradiance
from eclipsejax.scatterers import Scatterers
from eclipsejax.scene import Scene
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.shadow_table import tabulator
from eclipsejax.sun import Sun

DISTANCE = 3.844e8
TYPICAL = Atmosphere.typical()
DUSTY = Atmosphere(dust=Dust(1e-5), haze=Haze(0.2), clouds=Clouds(4e3, 0.9, 2e3))
PLACES = 8
LOPSIDED = along_limb([TYPICAL, TYPICAL, DUSTY, DUSTY, DUSTY, TYPICAL, TYPICAL, TYPICAL])
DUST = [5e-7, 5e-7, 1e-5, 1e-5, 1e-5, 5e-7, 5e-7, 5e-7]
OFFSETS = np.array([2.5e-3, 4e-3, 6e-3, 8e-3, 10e-3, 10e-3, 11.0e-3, 11.8e-3, 12.3e-3, 13.5e-3])
ANGLES = np.array([0.0, 0.7, 1.3, 2.0, 2.7, 3.6, 4.4, 5.0, 5.5, 6.2])
DEPTHS = DISTANCE - MOON_RADIUS * np.linspace(0.0, 1.0, OFFSETS.size)


@pytest.fixture(scope="module")
def prepared():
    """A table of two channels, each a wavelength, at a tolerance of 1e-2."""
    span, sky = jnp.asarray([2.4e-3, 14e-3]), (jnp.asarray(DISTANCE), jnp.asarray(ASTRONOMICAL_UNIT))
    wavelength = jnp.asarray([450.0, 640.0])
    return eqx.filter_jit(lambda span: tabulator(Sun(), *sky, span, wavelength, jnp.eye(2), tolerance=1e-2, count=128))(
        span
    )


@eqx.filter_jit
def looked_up(prepared, atmosphere, angle):
    places = prepared.grid.places(jnp.asarray(OFFSETS), jnp.asarray(DEPTHS), angle)
    return scene_table(prepared, atmosphere).at(places)


@pytest.mark.slow
def test_table_is_the_shadow_of_the_sectors(prepared):
    expected = shadow_irradiance(
        LOPSIDED, OFFSETS, [450.0, 640.0], position_angle=ANGLES, moon_distance=DEPTHS, tolerance=1e-3
    )
    error = np.asarray(looked_up(prepared, LOPSIDED, jnp.asarray(ANGLES)) / expected - 1.0)
    # The worst is where the cubic between two angles meets the light of a few rays beside a dark limb.
    assert np.max(np.abs(error)) < 2e-2 and np.median(np.abs(error)) < 2e-3


def test_table_of_the_same_air_all_around_is_the_symmetric_one(prepared):
    round_about = looked_up(prepared, along_limb([TYPICAL] * PLACES), jnp.asarray(ANGLES))
    np.testing.assert_allclose(round_about, looked_up(prepared, TYPICAL, jnp.asarray(ANGLES)), rtol=1e-4)


def test_table_goes_round_without_a_seam(prepared):
    around = [looked_up(prepared, LOPSIDED, jnp.asarray(ANGLES + turn)) for turn in (0.0, 2.0 * np.pi, -2.0 * np.pi)]
    np.testing.assert_allclose(around[1], around[0], rtol=1e-9)
    np.testing.assert_allclose(around[2], around[0], rtol=1e-9)


@pytest.mark.slow  # programs that take long to compile
def test_picture_is_darker_where_the_limb_is_dusty():
    # All four pictures in one shape; the camera's rows run from north to south.
    scene = Scene.at("2018-07-27T20:21:00Z", camera=Camera(shape=(24, 24), scale=4.4e-4))
    north = along_limb([DUSTY, DUSTY, TYPICAL, TYPICAL, TYPICAL, TYPICAL, TYPICAL, DUSTY])
    drawn = eqx.filter_jit(lambda scene, air: render(scene, air, tolerance=1e-2))
    plain, lopsided = np.asarray(drawn(scene, TYPICAL)), np.asarray(drawn(scene, north))
    same = np.asarray(drawn(scene, along_limb([TYPICAL] * PLACES)))
    np.testing.assert_allclose(same, plain, rtol=2e-3, atol=1e-3 * plain.max())
    ratio = lopsided[..., 0].sum(axis=1) / np.maximum(plain[..., 0].sum(axis=1), 1e-12)
    assert ratio[4] < 0.6 * ratio[19]


def test_tabulator_refuses_what_only_the_lopsided_table_knows(prepared):
    with pytest.raises(InputError, match="same all around"):
        prepared(LOPSIDED)


@pytest.mark.slow  # programs that take long to compile
def test_scattered_light_of_a_lopsided_limb_is_its_sectors_own(prepared):
    glowing = eqx.tree_at(lambda t: t.scatterers, prepared, Scatterers(), is_leaf=lambda x: x is None)
    angles = jnp.asarray(2.0 * np.pi * np.arange(OFFSETS.size) / OFFSETS.size)

    def glow(air, offset):
        """Scattered light at one offset, ten angles and both wavelengths."""

        @eqx.filter_jit
        def at(prepared, air):
            places = prepared.grid.places(jnp.full(OFFSETS.size, offset), jnp.full(OFFSETS.size, DISTANCE), angles)
            return scene_table(prepared, air).at(places)

        return np.asarray(at(glowing, air) - at(prepared, air))

    # Far inside, where little else is in the blue.
    clear, dusty = (along_limb([air] * PLACES) for air in (TYPICAL, DUSTY))
    whole = scattered_irradiance(TYPICAL, [3e-3], [450.0, 640.0], moon_distance=DISTANCE)
    np.testing.assert_allclose(glow(clear, 3e-3)[:, 0], float(whole[0, 0]), rtol=2e-2)
    mixed, parts = glow(LOPSIDED, 3e-3), [glow(air, 3e-3) for air in (clear, dusty)]
    np.testing.assert_allclose(np.mean(mixed, axis=0), (5 * parts[0] + 3 * parts[1]).mean(axis=0) / 8, rtol=2e-2)


@pytest.mark.slow  # programs that take long to compile
def test_table_has_slopes_by_the_dust_of_one_place(prepared):
    def total(extinction):
        air = eqx.tree_at(lambda a: a.dust.extinction, LOPSIDED, jnp.asarray([*DUST[:5], extinction, *DUST[6:]]))
        return jnp.log(looked_up(prepared, air, jnp.asarray(ANGLES)))

    pushed = jax.jit(lambda x: jax.jvp(total, (x,), (1.0,)))
    (low, _), (_, slope), (high, _) = (pushed(x) for x in (1.9e-6, 2e-6, 2.1e-6))
    difference = np.asarray(high - low) / 0.2e-6
    np.testing.assert_allclose(slope, difference, atol=2e-2 * np.max(np.abs(difference)))
    assert np.min(difference) < -1e3
