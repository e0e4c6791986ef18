import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Dust, Ozone
from eclipsejax.constants import ASTRONOMICAL_UNIT, MOON_RADIUS
from eclipsejax.moon import Moon
from eclipsejax.render import PENUMBRAL_SAMPLINGS, SAMPLINGS
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.shadow_table import from_edge_at, tabulator, variable
from eclipsejax.sun import Sun
from eclipsejax.sunlight import umbra_edge
from eclipsejax.wavelengths import MANY, binned_weights, channel_weights
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


SLOW = pytest.mark.slow
CENTRES = [
    pytest.param(SAMPLINGS, 0.0, marks=SLOW),
    pytest.param(SAMPLINGS, 5e-3, marks=SLOW),
    (SAMPLINGS, 9e-3),
    pytest.param(SAMPLINGS, 14e-3, marks=SLOW),
    (PENUMBRAL_SAMPLINGS, 17.1e-3),
    pytest.param(PENUMBRAL_SAMPLINGS, 21e-3, marks=SLOW),
]


@pytest.mark.parametrize(("samplings", "centre"), CENTRES)
def test_shadow_of_a_picture_at_every_point_of_the_disc(samplings, centre, over_the_depth):
    # As the renderer looks it up, against the operator at 1e-5 at the points themselves.
    offset, distance, light = over_the_depth(centre)
    tables = {}
    for tolerance, sampling in samplings.items():
        weights = channel_weights(Sun(), Moon(), "srgb", sampling.wavelengths)
        tables[tolerance] = prepared_table(spanned(centre), *weights, tolerance=tolerance, count=sampling.offsets)
    for slack, atmosphere in LIMBS:
        expected = light(atmosphere)
        for tolerance, table in tables.items():
            found = np.asarray(looked_up(table, atmosphere, offset, distance))
            error = np.abs(found - expected).max(axis=-1) / expected.max(axis=-1)
            assert np.max(error) < slack * tolerance
            assert np.sqrt(np.mean(error**2)) < tolerance


# What exceeds the tolerance, and by what: the hidden Sun's last light over thick dust, a caustic near the axis.
LIMBS = [
    (1.0, Atmosphere.typical()),
    (1.3, Atmosphere()),
    (1.3, Atmosphere(dust=Dust(1e-5))),
    (16.0, Atmosphere(dust=Dust(3e-5))),
    (3.0, Atmosphere(air=Air(255.0, 98e3))),
]


@pytest.fixture(scope="module")
def over_the_depth():
    """Offsets and distances of points all over a disc; their channels, by the operator at 1e-5 and 200 wavelengths."""
    wavelength, weights = binned_weights(Sun(), Moon(), "xyz", MANY)
    distance = DISTANCE - MOON_RADIUS * np.array([0.0, 0.2, 0.5, 0.8, 1.0])
    operator = eqx.filter_jit(
        lambda offset: shadow_operator(
            Sun(), offset, jnp.asarray(distance), ASTRONOMICAL_UNIT, wavelength, tolerance=1e-5
        )
    )
    light = eqx.filter_jit(lambda operator, atmosphere: operator(atmosphere) @ weights)

    def points(centre):
        offset = np.random.default_rng(5).uniform(*np.asarray(spanned(centre)), size=(distance.size, 60))
        here = operator(jnp.asarray(offset))
        away = jnp.asarray(distance[:, None] + 0.0 * offset)
        return jnp.asarray(offset), away, lambda atmosphere: np.asarray(light(here, atmosphere))

    return points


@eqx.filter_jit
def prepared_table(offsets, wavelength, weights, *, tolerance, count):
    distances = jnp.asarray(DISTANCE), jnp.asarray(ASTRONOMICAL_UNIT)
    return tabulator(Sun(), *distances, offsets, wavelength, weights, tolerance=tolerance, count=count)


looked_up = eqx.filter_jit(lambda table, atmosphere, offset, distance: table(atmosphere)(offset, distance))


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


def test_the_variable_of_the_table_can_be_undone():
    offset = np.array([-12e-3, -1e-3, -6e-4, 0.0, 1e-4, 9e-3, 0.5])
    np.testing.assert_allclose(from_edge_at(variable(jnp.asarray(offset))), offset, rtol=1e-12, atol=1e-17)
    slope = jax.vmap(jax.grad(lambda x: from_edge_at(variable(x))))(jnp.asarray(offset))
    np.testing.assert_allclose(slope, 1.0, rtol=1e-9)


def test_edge_of_a_shadow_without_air_is_dark():
    # All light ends at the edge of the umbra: a cubic through the logs beside it would draw a bright line there.
    bare = Atmosphere(Air(refraction=0.0, scattering=0.0), ozone=Ozone(0.0))
    table = table_of(bare, spanned(11e-3), jnp.eye(3))
    edge = float(umbra_edge(DISTANCE, ASTRONOMICAL_UNIT, Sun().radius))
    offset = edge + np.linspace(-4e-4, 4e-4, OFFSETS.size)
    found = np.asarray(table(jnp.asarray(offset), jnp.full(offset.shape, DISTANCE)))
    expected = np.asarray(irradiance(bare, offset, moon_distance=DISTANCE))
    assert np.all(found[offset < edge - 2e-4] < 1e-6)
    np.testing.assert_allclose(found, expected, atol=1e-3)
