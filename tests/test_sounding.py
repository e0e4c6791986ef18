import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.air import Air, geometric
from eclipsejax.atmosphere import Atmosphere, Dust, Haze
from eclipsejax.camera import Camera
from eclipsejax.constants import EARTH_RADIUS, STANDARD_PRESSURE, STANDARD_TEMPERATURE
from eclipsejax.errors import InputError
from eclipsejax.limb import grazing_ray, medium
from eclipsejax.render import render
from eclipsejax.scene import Scene
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.sounding import AFGL, Sounding
from eclipsejax.spectra import ciddor_refractivity
from eclipsejax.sun import Sun
from tests import oracles
from tests.test_limb import oracle

ARCMIN = np.pi / 180 / 60
BASES = np.array([0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3, 84852.05])  # of the standard's layers, geopotential [m]
TANGENTS = np.array([0.0, 1.0, 3e3, 8e3, 10.7e3, 11.019e3, 11.4e3, 15e3, 19.6e3, 20.5e3, 25e3, 31e3, 40e3, 60e3, 95e3])


def standard(altitude):
    """A table of the standard atmosphere."""
    temperature, pressure, _, _ = oracles.standard_air(altitude)
    return altitude, temperature, pressure


@eqx.filter_jit
def rays(atmosphere, tangent=TANGENTS, wavelength=550.0):
    """Bending angle and optical depth, (2, tangent)."""

    def one(tangent):
        bending, columns = grazing_ray(medium(atmosphere, wavelength), atmosphere.breaks, tangent)
        return jnp.stack([bending, columns[0]])

    return jax.vmap(one, out_axes=1)(jnp.asarray(tangent))


@eqx.filter_jit
def state(air, altitude):
    """Temperature [K], pressure [Pa], density [kg/m^3] along altitudes [m]."""
    return tuple(jax.vmap(quantity)(jnp.asarray(altitude)) for quantity in (air.temperature, air.pressure, air.density))


def test_standard_layers_are_standard_air():
    sounding = Sounding(*standard(geometric(BASES)))
    np.testing.assert_allclose(rays(Atmosphere(air=sounding)), rays(Atmosphere()), rtol=1e-12)
    altitude = np.linspace(0.0, 119e3, 40)
    for found, expected in zip(state(sounding, altitude), state(Air(), altitude), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert sounding.surface_temperature == pytest.approx(288.15) and sounding.surface_pressure == pytest.approx(101325)


def test_thousands_of_levels_become_a_few_that_bend_alike():
    table = standard(np.arange(0.0, 80e3, 25.0))
    sounding = Sounding.from_table(*table, tolerance=1e-4)
    assert sounding.levels.size <= 16
    found, expected = (np.asarray(rays(Atmosphere(air=air))) for air in (sounding, Air()))
    away = np.abs(TANGENTS - 11.019e3) > 25.0
    low = TANGENTS < 35e3
    np.testing.assert_allclose(found[:, away & low], expected[:, away & low], rtol=1e-4)
    np.testing.assert_allclose(found[1], expected[1], rtol=4e-4, atol=5e-6)
    # Air so high hardly bends: 1e-3 of an arcsecond is all that is wrong.
    np.testing.assert_allclose(found[0, ~low], expected[0, ~low], atol=1e-3 * ARCMIN / 60.0)


def test_between_two_levels_of_a_table_a_kink_is_where_the_table_cannot_say():
    """The standard tropopause lies between two levels, and rays lowest there are bent by what is not in the table.

    As many too much as too little: over some steps of the table it averages out, and the light is right.
    """
    sounding = Sounding.from_table(*standard(np.arange(0.0, 80e3, 25.0)), tolerance=1e-4)
    tangent = geometric(11e3) + np.linspace(-60.0, 60.0, 25)
    found, expected = (np.asarray(rays(Atmosphere(air=air), tangent))[0] for air in (sounding, Air()))
    wrong = np.abs(found / expected - 1.0)
    assert np.all(wrong[np.abs(tangent - geometric(11e3)) > 30.0] < 1e-3)
    assert 1e-3 < np.max(wrong) < 6e-3
    assert abs(np.mean(found / expected) - 1.0) < 2e-4


@pytest.mark.slow
def test_a_dense_table_keeps_the_light_to_its_tolerance():
    sounding = Sounding.from_table(*standard(np.arange(0.0, 80e3, 25.0)), tolerance=1e-4)
    found, expected = (
        np.asarray(shadow_irradiance(Atmosphere(air=air), OFFSETS, [400.0, 550.0, 700.0])) for air in (sounding, Air())
    )
    np.testing.assert_allclose(found, expected, rtol=1e-4)


class Tabulated:
    """A sounding for the slow integrals, alone: between levels p goes as a power of T, the exponent from both ends."""

    def __init__(self, sounding, refractivity, scattering):
        self.levels, self.temperatures, self.pressures = (
            np.asarray(column) for column in (sounding.levels, sounding.temperatures, sounding.pressures)
        )
        self.refractivity, self.scattering = refractivity, scattering

    def temperature_pressure_slopes(self, z):
        """T, p, dT/dz and d ln p / dz."""
        radius = oracles.POTENTIAL_RADIUS
        h, heights = radius * z / (radius + z), radius * self.levels / (radius + self.levels)
        i = np.clip(np.searchsorted(heights, h, side="right") - 1, 0, heights.size - 1)
        j = np.minimum(i + 1, heights.size - 1)
        cold, warm = self.temperatures[i], self.temperatures[j]
        rate = np.where(j > i, (warm - cold) / np.where(j > i, heights[j] - heights[i], 1.0), 0.0)
        temperature = cold + rate * (h - heights[i])
        still = np.abs(rate) < 1e-9
        exponent = np.log(self.pressures[j] / self.pressures[i]) / np.where(still, 1.0, np.log(warm / cold))
        fall = np.where(
            j > i,
            np.log(self.pressures[j] / self.pressures[i]) / np.where(j > i, heights[j] - heights[i], 1.0),
            -oracles.HYDROSTATIC / cold,
        )
        log_ratio = np.where(still, fall * (h - heights[i]), exponent * np.log(temperature / cold))
        gravity = (radius / (radius + z)) ** 2
        steepness = np.where(still, fall, exponent * rate / temperature) * gravity
        return temperature, self.pressures[i] * np.exp(log_ratio), rate * gravity, steepness

    def air(self, z):
        temperature, pressure, rate, steepness = self.temperature_pressure_slopes(z)
        refractivity = self.refractivity * pressure / 101325.0 * 288.15 / temperature
        return refractivity, refractivity * (steepness - rate / temperature)

    def extinction(self, z):
        temperature, pressure, _, _ = self.temperature_pressure_slopes(z)
        return self.scattering * pressure / (1.380622e-23 * temperature)

    def breaks(self):
        return np.unique(np.concatenate([[0.0, oracles.TOP], self.levels[self.levels < oracles.TOP]]))


def only_air(sounding):
    return Atmosphere(air=sounding, ozone=None, dust=None, haze=None, clouds=None)


# A surface inversion of 3 K in 200 m over ice, and one of 11 K in 100 m: there n r rises by a seventh of what it does
# in vacuum, and rays at the ground turn by 2.8 degrees.
INVERSIONS = {
    "polar": ([0.0, 200.0], [250.0, 253.0]),
    "near a duct": ([0.0, 100.0], [250.0, 257.0]),
}


def inverted(levels, temperatures, height=2e3):
    """A sounding that begins so, and goes on to 216.65 K at 11 km and as the standard above."""
    z = np.array([*levels, height, 11e3, 20e3, 32e3, 47e3])
    t = np.array([*temperatures, temperatures[-1] - 6.5e-3 * (height - levels[-1]), 216.65, 216.65, 228.65, 270.65])
    mean = 0.5 * (t[1:] + t[:-1])
    p = 101325.0 * np.exp(-np.cumsum([0.0, *(oracles.HYDROSTATIC * np.diff(z) / mean)]))
    return Sounding(z, t, p)


@pytest.mark.parametrize("name", ["tropical", "polar", "near a duct"])
def test_rays_are_those_of_another_quadrature(name):
    sounding = Sounding.afgl(name) if name in AFGL else inverted(*INVERSIONS[name])
    limb = Tabulated(sounding, float(ciddor_refractivity(550.0)), float(sounding.coefficient(550.0)))
    tangent = np.array([0.0, 50.0, 150.0, *TANGENTS[2:]])
    expected = oracles.grazing_ray(limb, tangent)
    np.testing.assert_allclose(rays(only_air(sounding), tangent), expected, rtol=1e-7)


def test_a_table_keeps_its_pressures_and_rests_on_itself_between_them():
    sounding = Sounding.afgl("midlatitude_summer")
    temperature, pressure, density = state(sounding, sounding.levels)
    np.testing.assert_allclose(temperature, sounding.temperatures, rtol=1e-12)
    np.testing.assert_allclose(pressure, sounding.pressures, rtol=1e-12)
    np.testing.assert_allclose(density, pressure * 28.9644e-3 / (8.31432 * temperature), rtol=1e-12)
    # d ln p = -w g dz / T with one w in a layer; below 80 km the table's three digits leave it right to 3 %.
    low, high = sounding.levels[:-1], sounding.levels[1:]
    node, weight = np.polynomial.legendre.leggauss(16)
    inside = np.asarray(low)[:, None] + np.diff(sounding.levels)[:, None] * 0.5 * (node + 1.0)
    warmth = np.asarray(state(sounding, inside.ravel())[0]).reshape(inside.shape)
    gravity = (oracles.POTENTIAL_RADIUS / (oracles.POTENTIAL_RADIUS + inside)) ** 2
    column = np.sum(gravity / warmth * weight, axis=1) * 0.5 * np.diff(sounding.levels)
    weights = -np.diff(np.log(pressure)) / column
    np.testing.assert_allclose(weights[high < 80e3], oracles.HYDROSTATIC, rtol=0.04)
    middle = 0.5 * (np.asarray(low) + np.asarray(high))
    slope = jax.jit(jax.vmap(jax.grad(lambda z: jnp.log(sounding.pressure(z)))))(middle)
    gravity = (oracles.POTENTIAL_RADIUS / (oracles.POTENTIAL_RADIUS + middle)) ** 2
    np.testing.assert_allclose(slope, -weights * gravity / state(sounding, middle)[0], rtol=1e-9)


@pytest.mark.parametrize("name", AFGL)
def test_thinned_tables_keep_the_density(name):
    full, thin = Sounding.afgl(name, tolerance=0.0, count=99), Sounding.afgl(name)
    assert 10 <= thin.levels.size <= 24 < full.levels.size
    density, kept = (np.asarray(state(air, full.levels)[2]) for air in (full, thin))
    assert np.max(np.abs(kept - density) / (density + 0.01 * density[0])) < 1.0e-3
    few = Sounding.afgl(name, count=9)
    assert few.levels.size == 9


def test_grazing_rays_are_bent_the_more_the_colder_the_air():
    # All 50 levels, so that one program serves the three.
    bending, depth = np.array(
        [
            rays(Atmosphere(air=Sounding.afgl(name, tolerance=0.0, count=99)))[:, 0]
            for name in (AFGL[1], AFGL[0], AFGL[-1])
        ]
    ).T
    # Standard air 66.0'; the first kilometre of the subarctic winter is an inversion.
    np.testing.assert_allclose(bending / ARCMIN, [61.89, 65.93, 88.43], atol=0.01)
    assert np.all(np.diff(depth) > 0.0) and 7.5 < depth[0] < depth[2] < 9.5


def test_a_balloon_that_starts_on_a_hill_and_bursts_at_30_km_is_continued():
    altitude, temperature, pressure = standard(np.arange(600.0, 30e3, 10.0))
    sounding = Sounding.from_table(altitude, temperature + 3.0, pressure)
    assert sounding.levels[0] == 0.0 and sounding.levels[-1] == pytest.approx(86e3, rel=1e-4)
    assert sounding.surface_temperature == pytest.approx(291.15, abs=0.01)
    found = state(sounding, [47.35e3, 86e3, 110e3])
    np.testing.assert_allclose(found[0], [270.65, 186.946, 186.946], atol=0.02)
    # From its last pressure on, through air that is on average 3 K warmer: 3 K / 250 K * 17 km / 7 km.
    standard_pressure = oracles.standard_air(np.array([29990.0, 47.35e3]))[1]
    np.testing.assert_allclose(
        np.divide(state(sounding, [29990.0, 47.35e3])[1], standard_pressure), [1.0, 1.03], rtol=3e-3
    )
    both = state(sounding, np.asarray(sounding.levels)[-6:-1] - 1e-6), state(sounding, sounding.levels[-6:-1] + 1e-6)
    for below, above in zip(*both, strict=True):
        np.testing.assert_allclose(below, above, rtol=1e-9)


def test_rays_have_the_derivatives_that_differences_show():
    start = Sounding.afgl("subarctic_winter")
    tangent = jnp.asarray([0.0, 600.0, 3.5e3, 9.7e3, 20e3, 40e3])

    def both(columns):
        return rays(Atmosphere(air=Sounding(*columns)), tangent)

    pushed = jax.jit(lambda columns, direction: jax.jvp(both, (columns,), (direction,)))
    columns = start.levels, start.temperatures, start.pressures
    steps = 10.0, 1.0, 0.01 * start.pressures
    for column, step in enumerate(steps):
        for level in (0, 2, 5, 8):  # each its own direction of one program
            direction = [jnp.zeros_like(c) for c in columns]
            direction[column] = direction[column].at[level].set(jnp.broadcast_to(step, start.levels.shape)[level])

            def moved(h, direction=direction):
                return np.asarray(
                    pushed(tuple(c + h * d for c, d in zip(columns, direction, strict=True)), tuple(direction))[0]
                )

            found = np.asarray(pushed(columns, tuple(direction))[1])
            expected = oracles.derivative(moved, 0.0, 1.0)
            largest = np.max(np.abs(expected), axis=1, keepdims=True)
            assert np.max(np.abs(found - expected) / largest) < 1e-6, (column, level)


OFFSETS = np.array([0.0, 2.4e-3, 4.65e-3, 8e-3, 12.1e-3, 17e-3])


@eqx.filter_jit
def shadow_and_slopes(sounding):
    """Light in the shadow, and its derivative along 1 % more pressure at the third level."""

    def light(pressures):
        air = Sounding(sounding.levels, sounding.temperatures, pressures)
        atmosphere = Atmosphere(air=air, dust=Dust(1e-6), haze=Haze(0.1))
        return shadow_irradiance(atmosphere, OFFSETS, [550.0], tolerance=1e-3)

    direction = jnp.zeros_like(sounding.pressures).at[2].set(0.01 * sounding.pressures[2])
    return jax.jvp(light, (sounding.pressures,), (direction,))


def test_a_sounding_casts_a_shadow():
    sounding = Sounding(*standard(geometric(BASES)))
    light, slope = shadow_and_slopes(sounding)
    limb = oracle(Atmosphere(dust=Dust(1e-6), haze=Haze(0.1)), 550.0)
    darkening = np.asarray(Sun().limb_darkening_coefficients(550.0))
    expected = oracles.irradiance(limb, OFFSETS, darkening, rays=150, step=0.13)
    np.testing.assert_allclose(light[:, 0], expected, rtol=1e-3)

    def moved(h):
        raised = sounding.pressures.at[2].multiply(1.0 + 0.01 * h)
        return np.asarray(shadow_and_slopes(Sounding(sounding.levels, sounding.temperatures, raised))[0])

    np.testing.assert_allclose(slope, oracles.derivative(moved, 0.0, 0.5), rtol=1e-3, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("name", AFGL)
def test_thinned_tables_keep_the_light(name):
    # What the docstring of `Sounding.from_table` says, in air that nothing but ozone makes less clear.
    def shadow(sounding):
        return np.asarray(shadow_irradiance(Atmosphere(air=sounding), OFFSETS, [400.0, 550.0, 700.0]))

    change = shadow(Sounding.afgl(name)) / shadow(Sounding.afgl(name, tolerance=0.0, count=99)) - 1.0
    assert np.all(np.max(np.abs(change), axis=0) < [0.03, 0.007, 0.007])


@pytest.mark.slow
def test_a_picture_through_standard_layers_is_that_through_standard_air():
    scene = Scene.at("2022-05-16T04:11:30Z", camera=Camera(shape=(16, 16), scale=6.4e-4))
    found, expected = (
        np.asarray(render(scene, Atmosphere(air=air))) for air in (Sounding(*standard(geometric(BASES))), Air())
    )
    assert expected.max() > 1e-4
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


GOOD = [np.asarray(column) for column in standard(np.arange(0.0, 40e3, 1e3))]


def with_changed(column, level, value):
    table = [np.array(values) for values in GOOD]
    table[column][level] = value
    return table


@pytest.mark.parametrize(
    ("table", "complaint"),
    [
        (with_changed(0, 7, 5e3), "Level 8 .* not above"),
        (with_changed(1, 3, np.nan), "Level 4 .* lacks a number"),
        (with_changed(2, 5, -1.0), "not positive"),
        (with_changed(2, 5, 9e4), "below that of the level under"),
        (with_changed(1, 0, 15.0), "kelvin"),
        ([values[:3] for values in GOOD], "10000 m"),
        ([values[[0, 20, 39]] for values in GOOD], "needs 5 or more"),
        ([values[:0] for values in GOOD], "more levels"),
        ([GOOD[0] / 1e3, *GOOD[1:]], "in metres"),
        ([GOOD[0][1:], *GOOD[1:]], "one length"),
        ([GOOD[0] * 3.28084, *GOOD[1:]], "check the units"),
    ],
)
def test_what_is_no_sounding_is_refused_in_one_sentence(table, complaint):
    with pytest.raises(InputError, match=complaint) as error:
        Sounding.from_table(*table)
    assert str(error.value).count("\n") == 0 and str(error.value).endswith((".", "?"))


@pytest.mark.parametrize("rise", [7.0, 8.0, 9.0, 9.5, 10.0, 11.0, 14.0])
def test_a_duct_is_refused_and_nothing_else(rise):
    try:
        inverted([0.0, 100.0], [250.0, 250.0 + rise])
        refused = False
    except InputError as error:
        assert "duct" in str(error)
        refused = True
    # By hand: dn/dr = -(n - 1) (g M / R + dT/dz) / T.
    refractivity = float(ciddor_refractivity(380.0)) * 101325.0 / STANDARD_PRESSURE * STANDARD_TEMPERATURE / 250.0
    fall = refractivity * (oracles.HYDROSTATIC + rise / 100.0) / 250.0
    assert refused == (1.0 + refractivity < EARTH_RADIUS * fall)


def test_a_duct_inside_a_program_gives_no_nan():
    # There nothing can be refused, and light that is caught is no light: any finite number will do.
    start = inverted([0.0, 100.0], [250.0, 251.0])
    tangent = np.resize([0.0, 30.0, 99.0, 100.0, 101.0, 150.0, 1e3, 5e3], TANGENTS.shape)

    @jax.jit
    def pushed(rise, tangent):
        def bent(rise, tangent):
            temperatures = start.temperatures.at[1].set(250.0 + rise)
            return rays(only_air(Sounding(start.levels, temperatures, start.pressures)), tangent)

        return jax.jvp(bent, (rise, tangent), (jnp.ones_like(rise), jnp.ones_like(tangent)))

    for rise in (9.0, 9.9, 9.99, 10.0, 10.5, 12.71, 12.72, 15.0, 60.0):
        for found in pushed(jnp.asarray(rise), tangent):
            assert np.all(np.isfinite(found)), rise


def test_a_file_is_read_by_the_names_of_its_columns(tmp_path):
    altitude, temperature, pressure = GOOD
    path = tmp_path / "balloon.csv"
    rows = [f"{p:.6f},x,{t:.6f},{z:.3f}" for z, t, p in zip(altitude, temperature, pressure, strict=True)]
    path.write_text("\n".join(["# a balloon", "Pressure_Pa,wind,temperature_K,altitude_m", *rows]))
    found, expected = Sounding.from_csv(path), Sounding.from_table(*GOOD)
    np.testing.assert_allclose(found.pressures, expected.pressures, rtol=1e-6)
    np.testing.assert_allclose(found.temperatures, expected.temperatures, rtol=1e-6)
    for text, complaint in {
        "altitude_m,temperature_k\n1,2": "lacks a column",
        "": "lacks a column",
        "altitude_m,temperature_k,pressure_pa\n0,288,-": "without a number",
        "altitude_m,temperature_k,pressure_pa\n0,288,101325": "more levels",
    }.items():
        path.write_text(text)
        with pytest.raises(InputError, match=complaint):
            Sounding.from_csv(path)
    with pytest.raises(InputError, match="cannot be read"):
        Sounding.from_csv(tmp_path)
    with pytest.raises(InputError, match="tropical"):
        Sounding.afgl("martian")


def test_one_trace_serves_all_tables_of_a_size():
    traces = []

    @eqx.filter_jit
    def at_ten_kilometres(air):
        traces.append(1)
        return air.density(jnp.asarray(10e3))

    start = Sounding(*GOOD)
    warmer = Sounding(start.levels, start.temperatures + 5.0, start.pressures)
    assert at_ten_kilometres(start) > at_ten_kilometres(warmer)
    assert len(traces) == 1
