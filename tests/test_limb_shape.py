import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.constants import EARTH_EQUATORIAL_RADIUS, EARTH_POLAR_RADIUS, EARTH_RADIUS
from eclipsejax.limb_shape import LimbShape
from eclipsejax.march import stepped
from tests import lopsided_oracle, oracles
from tests.test_limb import oracle
from tests.test_limb_sectors import ANGLES, CLEAR, OFFSETS, SOFT, light

DECLINATION = 0.35
EARTH = lopsided_oracle.Ellipsoid(DECLINATION, EARTH_EQUATORIAL_RADIUS, EARTH_POLAR_RADIUS)


def test_outline_is_that_of_the_ellipsoid():
    # Its own points in space, with the normals given; circles through three of them, close together.
    shape, angle = LimbShape(DECLINATION), np.linspace(0.0, 2.0 * np.pi, 9)
    normal = lambda nu: np.stack([0.0 * nu, np.cos(nu), np.sin(nu)], axis=-1)
    on_limb = EARTH.point(normal(angle))[:, 1:]
    radius, centre = np.asarray(shape.curvature_radius(angle))[:, None], np.asarray(shape.centre(angle))
    np.testing.assert_allclose(centre + radius * normal(angle)[:, 1:], on_limb, atol=1e-3)
    for h in (-2e-2, 2e-2):
        beside = EARTH.point(normal(angle + h))[:, 1:]
        np.testing.assert_allclose(np.linalg.norm(beside - centre, axis=-1), radius[:, 0], atol=0.1)  # not 800 m
    np.testing.assert_allclose(shape.radius(angle), np.sum(on_limb * normal(angle)[:, 1:], axis=-1), rtol=1e-12)
    towards_sun = np.array([1.0, 0.0, 0.0]) + 0.0 * normal(angle)
    np.testing.assert_allclose(
        shape.ray_radius(angle), EARTH.curvature_radius(normal(angle), towards_sun)[:, 0], rtol=1e-9
    )


def test_limb_passes_the_latitudes_that_the_sun_allows():
    # Facing the equator from pole to pole; at the solstice no farther than the polar circle.
    assert float(LimbShape(0.0).latitude(0.0)) == pytest.approx(0.5 * np.pi, abs=1e-6)
    latitude = np.degrees(LimbShape(np.radians(23.4)).latitude(np.linspace(0.0, 2.0 * np.pi, 181)))
    assert np.max(latitude) == pytest.approx(66.6) and np.min(latitude) == pytest.approx(-66.6)
    assert latitude[45] == pytest.approx(0.0, abs=1e-9)
    shape = LimbShape.facing(jnp.asarray([np.cos(0.2), 0.0, np.sin(0.2)]) * 1.5e11, jnp.asarray([0.0, 0.0, 1.0]))
    assert float(shape.declination) == pytest.approx(0.2)


def test_rays_bend_like_over_a_sphere_of_the_ground_along_them():
    # Marched through air in shells of the ellipsoid: at the pole, over the meridian, from 15 km.
    air, height = Atmosphere().air, 15e3
    shape = LimbShape(0.0)

    def bending(equatorial, polar):
        def index(position):
            # Altitude above an ellipse, by the distance along the gradient, to 1e-6 of itself.
            form = position**2 / jnp.asarray([equatorial, polar]) ** 2
            level = jnp.sqrt(jnp.sum(form))
            slope = jnp.sqrt(jnp.sum((position / jnp.asarray([equatorial, polar]) ** 2) ** 2)) / level
            return 1.0 + 2.78e-4 * air.density_ratio(jnp.maximum((level - 1.0) / slope, 0.0))

        def advance(_, state):
            return stepped(index, state[0], state[1], 500.0)

        start = jnp.asarray([0.0, polar + height])
        _, momentum = jax.lax.fori_loop(0, 2600, advance, (start, index(start) * jnp.asarray([1.0, 0.0])))
        return -jnp.arctan2(momentum[1], momentum[0])

    bent = eqx.filter_jit(bending)
    over_pole = bent(jnp.asarray(EARTH_EQUATORIAL_RADIUS), jnp.asarray(EARTH_POLAR_RADIUS))
    over_sphere = bent(jnp.asarray(EARTH_RADIUS), jnp.asarray(EARTH_RADIUS))
    expected = np.sqrt(float(shape.ray_radius(0.0)) / EARTH_RADIUS)
    assert expected > 1.002
    assert float(over_pole / over_sphere) == pytest.approx(expected, abs=2e-4)


def test_a_ball_for_a_shape_casts_the_shadow_of_a_sphere():
    ball = LimbShape(0.2, EARTH_RADIUS, EARTH_RADIUS)
    sphere = oracles.irradiance(oracle(CLEAR, 640.0), OFFSETS, np.eye(6)[1], rays=200, step=0.13)
    np.testing.assert_allclose(light(CLEAR, shape=ball), sphere, rtol=1e-4)


def test_shadow_of_the_flattened_earth_is_that_of_rays_in_space():
    # The flattening itself changes the light by 2 % near the axis and by 7 % at the edge. What is left comes from
    # where the limb is: the Sun's rays are inclined to the axis by half a degree. 5e-3 at the darkest point.
    some, found = [1, 5, 6], light(CLEAR, shape=LimbShape(DECLINATION))
    limb = oracle(CLEAR, 640.0)
    expected = [
        lopsided_oracle.traced_irradiance([limb] * 4, EARTH, offset, angle, SOFT, azimuths=300, panels=2)
        for offset, angle in zip(OFFSETS[some], ANGLES[some], strict=True)
    ]
    np.testing.assert_allclose(found[some], expected, rtol=6e-3)


def test_umbra_is_narrower_along_the_pole():
    # By as much as the outline is: the same light at the offset where its tangent is.
    shape, angle = LimbShape(0.0), np.array([0.0, 0.5 * np.pi])
    reach = 1.0 / 3.844e8 + 1.0 / oracles.AU
    radii = np.asarray(shape.radius(angle))
    assert np.degrees((radii[1] - radii[0]) * reach) * 60.0 == pytest.approx(0.19, abs=0.005)  # arcmin
    offset = 12.1e-3 + (radii - EARTH_RADIUS) * reach
    found = light(CLEAR, offset, angle, shape)
    assert found[0] == pytest.approx(found[1], rel=2e-2)
    unmoved = light(CLEAR, np.full(2, 12.1e-3), angle, shape)
    assert unmoved[0] > 1.05 * unmoved[1]
