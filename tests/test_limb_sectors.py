import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import eclipsejax as ej
from eclipsejax.arc import arc_moments, sector_moments
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze
from eclipsejax.errors import InputError
from eclipsejax.limb_sectors import along_limb, limb_axes
from eclipsejax.limb_shape import LimbShape
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.sounding import Sounding
from eclipsejax.sun import Sun
from tests import lopsided_oracle, oracles
from tests.test_limb import oracle

SUN = float(np.arcsin(oracles.SOLAR_RADIUS / oracles.AU))
CLEAR = Atmosphere.typical()
DUSTY = Atmosphere(dust=Dust(1e-5), haze=Haze(0.2), clouds=Clouds(4e3, 0.9, 2e3))
PLACES = 6
HALF_DUSTY = along_limb([CLEAR, CLEAR, DUSTY, DUSTY, DUSTY, CLEAR])  # dust from 120 to 240 degrees
# On the axis, where the Sun's edge passes it, about the umbra's edge, in the penumbra, outside.
OFFSETS = np.array([0.0, 2e-3, SUN, 6e-3, 10e-3, 11.8e-3, 12.3e-3, 14e-3, 17e-3, 25e-3])
ANGLES = np.array([0.0, 0.1, 0.7, 1.0, 2.2, 3.0, 4.5, 5.0, 5.5, 6.0])


class SoftSun(Sun):
    """Dark at its edge, so that the rays of the oracle that just miss it make no error."""

    def limb_darkening_coefficients(self, wavelength):
        return jnp.asarray([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]) + 0.0 * wavelength


SOFT = np.array([0.0, 1.0])
SOFT_POWERS = np.eye(6)[1]


def light(atmosphere, offset=OFFSETS, angle=ANGLES, shape=None):
    """Always asked for in one shape, with one Sun and at one tolerance: every other would be compiled anew."""
    padded = np.resize(offset, OFFSETS.shape), np.resize(angle, ANGLES.shape)
    found = shadow_irradiance(
        atmosphere, padded[0], [640.0], position_angle=padded[1], shape=shape, sun=SoftSun(), tolerance=1e-4
    )
    return np.asarray(found)[: np.size(offset), 0]


def turned(atmosphere, places):
    """The limb turned by so many places, towards the east."""
    return jax.tree.map(lambda leaf: jnp.roll(leaf, places, axis=0), atmosphere)


def test_sectors_of_a_circle_add_up_to_the_arc():
    # For few and many sectors, of circles with arcs from a point to all around.
    circle = np.array([1e-4, 2e-3, 4e-3, 7e-3, 10e-3, 10.6e-3])
    for places, order, error in ((4, 6, 2e-3), (4, 10, 2e-5), (9, 10, 2e-5)):
        middles = 2.0 * np.pi * np.arange(places) / places
        for offset in (0.0, 3e-3, 6e-3):
            parts = jax.vmap(
                lambda apart, o=offset, n=order, h=2.0 * np.pi / places: sector_moments(
                    o, circle, SUN, n, apart=apart, half_width=h
                )
            )(middles - 0.3)
            whole = np.asarray(arc_moments(offset, circle, SUN, 24))
            np.testing.assert_allclose(np.sum(parts, axis=0), whole, rtol=error, atol=1e-9)


def test_the_same_air_all_around_casts_the_symmetric_shadow():
    symmetric = oracles.irradiance(oracle(CLEAR, 640.0), OFFSETS, SOFT_POWERS, rays=200, step=0.13)
    np.testing.assert_allclose(light(along_limb([CLEAR] * PLACES)), symmetric, rtol=1e-4)
    assert light(HALF_DUSTY)[-1] == 1.0


def test_air_that_differs_along_the_limb_casts_the_shadow_of_rays_in_space():
    limbs = [oracle(CLEAR, 640.0), oracle(DUSTY, 640.0)]
    some = [1, 4, 5, 6]
    expected = [
        lopsided_oracle.traced_irradiance(
            [limbs[i] for i in (0, 0, 1, 1, 1, 0)],
            lopsided_oracle.Ellipsoid(),
            offset,
            angle,
            SOFT,
            azimuths=240,
            panels=2,
        )
        for offset, angle in zip(OFFSETS[some], ANGLES[some], strict=True)
    ]
    np.testing.assert_allclose(light(HALF_DUSTY)[some], expected, rtol=2e-3)


def test_turning_or_mirroring_the_limb_turns_or_mirrors_the_shadow():
    found = light(HALF_DUSTY)
    np.testing.assert_allclose(light(turned(HALF_DUSTY, 2), angle=ANGLES + 2.0 * np.pi / 3.0), found, rtol=2e-5)
    np.testing.assert_allclose(light(HALF_DUSTY, angle=-ANGLES), found, rtol=2e-5)


def test_dust_dims_its_own_side_of_the_umbra_and_leaves_the_other():
    # At the umbra's edge the light comes through the limb on the same side, all of it within 25 degrees.
    offset, angle = np.full(2, 11.8e-3), np.array([0.0, np.pi])
    clear = light(along_limb([CLEAR] * PLACES), offset, angle)
    dusty = light(along_limb([DUSTY] * PLACES), offset, angle)
    near, far = light(HALF_DUSTY, offset, angle)
    assert near == pytest.approx(clear[0], rel=1e-9)
    assert far == pytest.approx(dusty[1], rel=1e-9) and far < 0.3 * near


def test_light_around_the_axis_is_on_average_that_of_all_the_air():
    # Every sector lights each angle in its turn.
    angle = 2.0 * np.pi * np.arange(OFFSETS.size) / OFFSETS.size  # ten angles; harmonics up to the ninth drop out
    for offset in (3e-3, 9e-3):
        mean = np.mean(light(HALF_DUSTY, np.full(OFFSETS.size, offset), angle))
        alone = [light(along_limb([air] * PLACES), [offset], [0.0])[0] for air in (CLEAR, DUSTY)]
        assert mean == pytest.approx(np.mean(alone), rel=2e-3)


def test_the_light_has_the_derivatives_that_differences_show():
    def of(x):
        extinction = jnp.asarray([1e-6, 2e-6, 3e-6, 1e-6, 1e-6, 1e-6]) * x[0]
        air = eqx.tree_at(lambda a: a.dust.extinction, HALF_DUSTY, extinction)
        return shadow_irradiance(
            air, OFFSETS * x[1], [640.0], position_angle=ANGLES + x[2], shape=LimbShape(x[3]), tolerance=1e-2
        )[:, 0]

    pushed = jax.jit(lambda x, v: jax.jvp(lambda x: jnp.log(of(x)), (x,), (v,)))
    start = np.array([1.0, 1.0, 0.2, 0.1])
    for unit, step in zip(np.eye(4), (1e-2, 1e-3, 1e-3, 1e-3), strict=True):
        found = np.asarray(pushed(start, unit)[1])
        assert np.all(np.isfinite(found))
        differences = oracles.derivative(lambda h, unit=unit: np.asarray(pushed(start + h * unit, unit)[0]), 0.0, step)
        smooth = np.abs(OFFSETS - SUN) > 1e-4  # there the Sun's edge passes the axis
        error = np.abs(found - differences) / (np.abs(differences) + 0.1 * np.max(np.abs(differences[smooth])) + 1e-9)
        assert np.max(error[smooth]) < 2e-2, unit
    on_axis = np.asarray(pushed(start * [1.0, 0.0, 1.0, 1.0], np.ones(4))[1])
    assert np.all(np.isfinite(on_axis))


def test_an_atmosphere_knows_its_places_along_the_limb():
    assert limb_axes(CLEAR) == (0, None)
    assert limb_axes(HALF_DUSTY)[0] == PLACES
    assert limb_axes(Atmosphere(dust=Dust(jnp.asarray([0.0, 1e-6, 0.0, 0.0, 0.0]))))[0] == 5
    tropics, winter = (Sounding.from_table(
        np.linspace(0.0, 45e3, 30), t - 2e-3 * np.linspace(0.0, 45e3, 30), 1e5 * np.exp(-np.linspace(0.0, 6.5, 30)),
        tolerance=0.0, count=30,
    ) for t in (300.0, 290.0))  # fmt: skip
    assert limb_axes(Atmosphere(air=tropics)) == (0, None)
    assert limb_axes(along_limb([Atmosphere(air=air) for air in (tropics, winter, tropics, winter)]))[0] == 4


def test_a_limb_that_makes_no_sense_is_refused():
    with pytest.raises(InputError, match="same parts"):
        along_limb([CLEAR, Atmosphere(dust=None), CLEAR, CLEAR])
    with pytest.raises(InputError, match="4 or more"):
        along_limb([CLEAR, DUSTY])
    with pytest.raises(InputError, match="4 or more"):
        limb_axes(Atmosphere(dust=Dust(jnp.zeros(5)), haze=Haze(jnp.zeros(6))))
    with pytest.raises(InputError, match="position_angle"):
        shadow_irradiance(HALF_DUSTY, [1e-3], [640.0])


OF_ONE_PLACE = {
    "refractivity": lambda air: ej.refractivity(air, 1e4, 550.0),
    "extinction": lambda air: ej.extinction(air, 2e4, 550.0),
    "impact_parameter": lambda air: ej.impact_parameter(air, 1e4, 550.0),
    "bending_angle": lambda air: ej.bending_angle(air, 1e4, 550.0),
    "optical_depth": lambda air: ej.optical_depth(air, 1e4, 550.0),
    "grazing_rays": lambda air: ej.grazing_rays(air, jnp.asarray([1e4]), jnp.asarray([550.0])),
    "march_ray": lambda air: ej.march_ray(air, 1e4, 550.0),
    "umbra_radius": ej.umbra_radius,
    "umbra_enlargement": ej.umbra_enlargement,
}


@pytest.mark.parametrize("name", OF_ONE_PLACE)
def test_what_is_of_one_place_says_so_of_a_limb(name):
    partly = eqx.tree_at(lambda a: a.dust.extinction, CLEAR, jnp.asarray([0.0, 1e-6, 2e-6, 3e-6]))
    for limb in (HALF_DUSTY, partly):
        with pytest.raises(InputError, match="same all around: give one"):
            OF_ONE_PLACE[name](limb)


def test_a_sounding_has_levels_but_no_limb_axis():
    altitude = jnp.linspace(0.0, 30e3, 7)
    air = Sounding.from_table(altitude, 288.0 - 1.5e-3 * altitude, 101325.0 * jnp.exp(-altitude / 8e3))
    assert float(ej.refractivity(Atmosphere(air=air), 1e3, 550.0)) > 2e-4
    assert limb_axes(Atmosphere(air=air))[0] == 0
    with pytest.raises(InputError, match="same all around"):
        ej.refractivity(along_limb([Atmosphere(air=air)] * 4), 1e3, 550.0)
