"""Pictures of a flattened Earth's shadow, against the sectors of its limb (`test_limb_shape` has those)."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.ephemeris import geometry
from eclipsejax.lopsided_table import scene_table
from eclipsejax.render import channel_weights, scene_tabulator
from eclipsejax.scatterers import Scatterers
from eclipsejax.scene import Scene, axis_offset, axis_position_angle, limb_shape, rounded_offset
from eclipsejax.shadow import shadow_irradiance

# The Moon over the axis, and across the umbra's edge.
DEEP, EDGE = "2018-07-27T20:21:44Z", "2018-07-27T19:10:00Z"
OFFSETS = {
    DEEP: np.array([1e-5, 1e-3, 2.5e-3, 4e-3, 4.7e-3, 5.2e-3, 5.6e-3, 6.0e-3]),
    EDGE: np.array([6e-3, 7e-3, 8e-3, 9e-3, 10e-3, 11e-3, 11.8e-3, 13e-3]),
}
ANGLES = np.radians([10.0, 100.0, 5.0, 80.0, 185.0, 265.0, 40.0, 355.0])


def directed(where, offset):
    """Points on the near side of the Moon's distance, at these angles from the axis and at `ANGLES` about it."""
    axis = -np.asarray(where.sun) / np.linalg.norm(where.sun)
    east = np.cross(where.pole, axis) / np.linalg.norm(np.cross(where.pole, axis))
    across = np.cos(ANGLES)[:, None] * np.cross(axis, east) + np.sin(ANGLES)[:, None] * east
    distance = np.linalg.norm(where.moon) - 1.2e6
    return jnp.asarray(distance * (np.cos(offset)[:, None] * axis + np.sin(offset)[:, None] * across))


@pytest.mark.parametrize("utc", OFFSETS)
def test_points_are_where_they_are_meant_to_be(utc):
    where = geometry(utc)
    position = directed(where, OFFSETS[utc])
    np.testing.assert_allclose(axis_offset(where, position), OFFSETS[utc], rtol=1e-7)
    np.testing.assert_allclose(np.mod(axis_position_angle(where, position), 2.0 * np.pi), ANGLES, atol=1e-7)
    # The umbra is wider towards the equator: the same light is farther out there.
    stretch = OFFSETS[utc] / np.asarray(rounded_offset(where, position))
    assert np.all((stretch > 1.0) == (np.abs(np.sin(ANGLES)) > 0.71))


@pytest.mark.slow  # programs that take long to compile
def test_table_is_the_shadow_of_the_flattened_earth():
    @eqx.filter_jit
    def looked_up(scene, atmosphere, position):
        prepared = scene_tabulator(scene, 1e-3)
        angle = axis_position_angle(scene.geometry, position)
        places = prepared.grid.places(scene.offset(position), jnp.linalg.norm(position, axis=-1), angle)
        return scene_table(prepared, atmosphere).at(places)

    def errors(utc, atmosphere):
        scene = Scene.at(utc, flattened=True)
        where = scene.geometry
        position = directed(where, OFFSETS[utc])
        wavelength, weights = channel_weights(scene, 24)
        sky = {"moon_distance": jnp.linalg.norm(position[0]), "sun_distance": jnp.linalg.norm(where.sun)}
        limb = {"position_angle": ANGLES, "shape": limb_shape(where)}
        light = shadow_irradiance(atmosphere, OFFSETS[utc], wavelength, **limb, **sky, tolerance=1e-3)
        return np.abs(np.asarray(looked_up(scene, atmosphere, position) / (light @ weights)) - 1.0)

    for atmosphere in (Atmosphere.typical(), Atmosphere()):
        # The flattening itself changes this light by up to 2 % in the one, by up to 8 % in the other.
        assert np.max(errors(DEEP, atmosphere)) < 1e-3
        assert np.max(errors(EDGE, atmosphere)) < 3e-3

    scene = Scene.at(DEEP, flattened=True)
    glowing = eqx.tree_at(lambda s: s.scatterers, scene, Scatterers(), is_leaf=lambda x: x is None)
    on_axis = directed(scene.geometry, OFFSETS[DEEP])
    direct, both = (looked_up(one, Atmosphere(), on_axis)[0] for one in (scene, glowing))
    assert np.all(np.asarray(both) > np.asarray(direct))
