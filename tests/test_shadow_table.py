import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.constants import ASTRONOMICAL_UNIT, MOON_RADIUS
from eclipsejax.shadow_table import tabulator, umbra_edge
from eclipsejax.sun import Sun
from tests.test_shadow import OFFSETS, SUN, WAVELENGTHS, irradiance

DISTANCE = 3.8e8
REACH = float(np.arcsin(MOON_RADIUS / (DISTANCE - MOON_RADIUS)))


@eqx.filter_jit
def table_of(atmosphere, offsets, weights):
    return tabulator(
        Sun(),
        jnp.asarray(DISTANCE),
        jnp.asarray(ASTRONOMICAL_UNIT),
        offsets,
        jnp.asarray(WAVELENGTHS),
        weights,
        tolerance=1e-4,
        count=64,
    )(atmosphere)


def spanned(centre):
    """Smallest and largest offset on a Moon whose centre stands at `centre` [rad]."""
    return jnp.asarray([max(centre - REACH, 0.0), centre + REACH])


def test_table_holds_the_shadow_at_its_entries():
    table = table_of(Atmosphere.typical(), spanned(9e-3), jnp.eye(3))
    for distance in (DISTANCE - MOON_RADIUS, DISTANCE):
        offset = np.asarray(table.grid.offsets_at(distance))[2:-2:7][: OFFSETS.size]
        found = table(jnp.asarray(offset), jnp.full(offset.shape, distance))
        np.testing.assert_allclose(found, irradiance(Atmosphere.typical(), offset, moon_distance=distance), rtol=1e-4)


@pytest.mark.parametrize("centre", [0.0, 5e-3, 9e-3, 14e-3, 21e-3])
@pytest.mark.parametrize("atmosphere", [Atmosphere(), Atmosphere.typical()], ids=["clear", "typical"])
def test_shadow_between_the_entries(atmosphere, centre):
    # All over the Moon and its depth. Most points are right to 1e-3; up to 4 % off are the blue near caustics and,
    # for one entry's width, the end of the table nearest to or farthest from the axis.
    table = table_of(atmosphere, spanned(centre), jnp.eye(3))
    draw = np.random.default_rng(5)
    offset = draw.uniform(*np.asarray(spanned(centre)), size=6 * OFFSETS.size)
    distance = draw.uniform(DISTANCE - MOON_RADIUS, DISTANCE, size=offset.size)
    expected = np.concatenate(
        [
            irradiance(atmosphere, offset[part], moon_distance=distance[part])
            for part in np.split(np.arange(offset.size), 6)
        ]
    )
    error = np.abs(np.asarray(table(jnp.asarray(offset), jnp.asarray(distance))) / expected - 1.0)
    assert np.median(error) < 1e-3
    assert np.max(error) < 0.08


def test_channels_are_weighted_sums_of_the_spectrum():
    weights = jnp.asarray([[0.2, 0.0, 1.0], [0.5, 1.0, 0.0], [0.3, 0.0, 0.0]])
    offset, distance = jnp.asarray([10e-3, 11.9e-3, 14e-3]), jnp.asarray(DISTANCE)
    spectrum = table_of(Atmosphere.typical(), spanned(11e-3), jnp.eye(3))(offset, distance)
    channels = table_of(Atmosphere.typical(), spanned(11e-3), weights)(offset, distance)
    np.testing.assert_allclose(channels[:, 1], spectrum[:, 1], rtol=1e-9)
    np.testing.assert_allclose(channels[:, 2], spectrum[:, 0], rtol=1e-9)
    np.testing.assert_allclose(channels[:, 0], spectrum @ np.array([0.2, 0.5, 0.3]), rtol=0.05)


def test_umbra_edge_is_where_a_ball_just_covers_the_sun():
    # As in the geometric shadow: parallax of the Moon plus that of the Sun less the Sun's radius, about 0.7 degrees.
    edge = float(umbra_edge(DISTANCE, ASTRONOMICAL_UNIT, Sun().radius))
    assert edge == pytest.approx(6.371e6 / DISTANCE + 6.371e6 / ASTRONOMICAL_UNIT - SUN, rel=1e-4)


def test_table_has_finite_slopes_on_the_axis_and_outside():
    table = table_of(Atmosphere.typical(), spanned(9e-3), jnp.eye(3))
    slope = jax.vmap(jax.jacfwd(table, argnums=(0, 1)), in_axes=(0, None))
    for found in slope(jnp.asarray([0.0, 4.5e-3, 13.6e-3, 0.05]), jnp.asarray(DISTANCE)):
        assert np.all(np.isfinite(found))


def test_edge_of_a_shadow_without_air_is_dark():
    # All light ends at the edge of the umbra: a cubic through the logs beside it would draw a bright line there.
    bare = Atmosphere(Air(refraction=0.0, scattering=0.0), ozone=None)
    table = table_of(bare, spanned(11e-3), jnp.eye(3))
    edge = float(umbra_edge(DISTANCE, ASTRONOMICAL_UNIT, Sun().radius))
    offset = edge + np.linspace(-4e-4, 4e-4, OFFSETS.size)
    found = np.asarray(table(jnp.asarray(offset), jnp.full(offset.shape, DISTANCE)))
    expected = np.asarray(irradiance(bare, offset, moon_distance=DISTANCE))
    assert np.all(found[offset < edge - 2e-4] < 1e-6)
    np.testing.assert_allclose(found, expected, atol=1e-3)
