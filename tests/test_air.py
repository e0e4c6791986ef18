import warnings

import equinox as eqx
import jax
import numpy as np
import pytest
from ambiance import Atmosphere as Ambiance

from eclipsejax.air import Air, geometric, geopotential
from tests.oracles import derivative

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of xarray's many dependencies
    import ussa1976

SURFACES = [(250.0, 95e3), (310.0, 105e3), (220.0, 80e3), (330.0, 110e3)]  # K, Pa


@eqx.filter_jit
def state(air, altitude):
    """Temperature [K], pressure [Pa], density [kg/m^3] along altitudes [m]."""
    return tuple(jax.vmap(quantity)(altitude) for quantity in (air.temperature, air.pressure, air.density))


def test_standard_air_is_that_of_ussa1976():
    altitude = np.linspace(0.0, 80e3, 161)
    standard = ussa1976.compute(z=altitude, variables=["t", "p", "rho"])
    temperature, pressure, density = state(Air(), altitude)
    np.testing.assert_allclose(temperature, standard["t"].values, atol=1e-3)
    np.testing.assert_allclose(pressure, standard["p"].values, rtol=5e-5)
    np.testing.assert_allclose(density, standard["rho"].values, rtol=5e-5)


def test_standard_air_is_that_of_ambiance():
    altitude = np.linspace(0.0, 80e3, 161)
    standard = Ambiance(altitude)
    temperature, pressure, density = state(Air(), altitude)
    np.testing.assert_allclose(temperature, standard.temperature, atol=1e-3)
    np.testing.assert_allclose(pressure, standard.pressure, rtol=5e-5)
    np.testing.assert_allclose(density, standard.density, rtol=5e-5)


@pytest.mark.parametrize(("temperature", "pressure"), SURFACES)
def test_air_over_any_surface_rests_on_itself(temperature, pressure):
    # ln p falls by the integral of M g / (R T), with gravity by the inverse square of the standard's own radius.
    air = Air(surface_temperature=temperature, surface_pressure=pressure)
    edges = np.array([0.0, *np.sort(np.asarray(air.breaks)), 100e3])
    node, weight = np.polynomial.legendre.leggauss(20)
    altitude = edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (node + 1.0)
    warmth = np.asarray(state(air, altitude.ravel())[0]).reshape(altitude.shape)
    gravity = 9.80665 * (6356766.0 / (6356766.0 + altitude)) ** 2
    column = np.cumsum(np.sum(gravity / warmth * weight, axis=1) * 0.5 * np.diff(edges)) * 28.9644e-3 / 8.31432
    at_edges = state(air, edges[1:])
    np.testing.assert_allclose(at_edges[1], pressure * np.exp(-column), rtol=1e-9)
    np.testing.assert_allclose(at_edges[2], at_edges[1] * 28.9644e-3 / (8.31432 * at_edges[0]), rtol=1e-12)


@pytest.mark.parametrize(("temperature", "pressure"), SURFACES)
def test_troposphere_cools_at_its_rate_up_to_the_standard_stratosphere(temperature, pressure):
    air = Air(surface_temperature=temperature, surface_pressure=pressure)
    tropopause = (temperature - 216.65) / 6.5e-3
    height = np.array([0.0, 0.3 * tropopause, 0.9 * tropopause, 1.001 * tropopause, 19e3, 20e3, 32e3, 47e3])
    expected = np.array([temperature, 0, 0, 216.65, 216.65, 216.65, 228.65, 270.65])
    expected[1:3] = temperature - 6.5e-3 * height[1:3]
    np.testing.assert_allclose(state(air, geometric(height))[0], expected, atol=1e-6)


def test_warm_ground_lifts_the_air_above_it():
    # What the docstring of `Air` says. Above the raised tropopause (14.1 km) the ratio is the same everywhere:
    # (216.65 / 308.15)^5.2559 against (216.65 / 288.15)^5.2559 and 3.08 km of isothermal air.
    altitude = np.array([14.2e3, 25e3, 60e3])
    ratio = np.divide(state(Air(surface_temperature=308.15), altitude)[2], state(Air(), altitude)[2])
    np.testing.assert_allclose(ratio, 1.1417, rtol=1e-3)


def test_pressure_scales_the_density_everywhere_alike():
    altitude = np.array([0.0, 5e3, 15e3, 40e3, 100e3])
    thin, thick = state(Air(surface_pressure=9e4), altitude)[2], state(Air(), altitude)[2]
    np.testing.assert_allclose(thin / thick, 9e4 / 101325.0, rtol=1e-12)


def test_nothing_jumps_at_the_breaks():
    air = Air(surface_temperature=300.0)
    breaks = np.asarray(air.breaks)
    for below, above in zip(state(air, breaks - 1e-6), state(air, breaks + 1e-6), strict=True):
        np.testing.assert_allclose(below, above, rtol=1e-9)


def test_geometric_altitude_inverts_geopotential_height():
    altitude = np.array([0.0, 11e3, 86e3, 120e3])
    np.testing.assert_allclose(geometric(geopotential(altitude)), altitude, rtol=1e-13)
    assert geopotential(86e3) == pytest.approx(84852.05, abs=0.01)  # U.S. Standard Atmosphere 1976, table 4


def test_density_has_the_derivatives_that_differences_show():
    altitude = np.array([0.0, 6e3, 15e3, 25e3, 100e3])

    @jax.jit
    def density(temperature, pressure):
        air = Air(surface_temperature=temperature, surface_pressure=pressure)
        return jax.vmap(air.density_ratio)(altitude)

    by_temperature, by_pressure = jax.jit(jax.jacfwd(density, argnums=(0, 1)))(288.15, 101325.0)
    expected = derivative(lambda t: np.asarray(density(t, 101325.0)), 288.15, 1.0)
    np.testing.assert_allclose(by_temperature, expected, rtol=1e-8)
    np.testing.assert_allclose(by_pressure, density(288.15, 101325.0) / 101325.0, rtol=1e-12)
