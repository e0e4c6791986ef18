import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.sky import (
    Sky,
    air_mass,
    haze_air_mass,
    ozone_air_mass,
    refraction,
    station_pressure,
    transmission,
)


def test_air_mass_has_young_s_values():
    # Young 1994 from the zenith to the horizon (true zenith angles), as tabulated by pvlib 0.16.
    zenith = np.array([0, 30, 60, 75, 80, 85, 87, 88, 89, 90])
    young = [1.0000, 1.1541, 1.9917, 3.7964, 5.5407, 10.0587, 14.4330, 18.0629, 23.4584, 31.7349]
    np.testing.assert_allclose(air_mass(np.deg2rad(90 - zenith)), young, atol=6e-5)


def test_air_mass_of_the_apparent_horizon_is_that_of_kasten_and_young():
    # Apparent zenith distance 90 is true 90.55; Kasten & Young 1989, who take the apparent one, have 37.92.
    assert air_mass(np.deg2rad(-0.55)) == pytest.approx(37.92, rel=0.01)


def column_along_a_straight_line(altitude, scale_height):
    """Path through an exponential spherical atmosphere over the vertical one."""
    c, radius = np.sin(altitude), EARTH_RADIUS

    def integrand(root):  # height = root^2 removes the singularity at the horizon
        height = root**2
        slope = (1 + height / radius) / np.sqrt(c**2 + 2 * height / radius + (height / radius) ** 2)
        return np.exp(-height / scale_height) * slope * 2 * root / scale_height

    return quad(integrand, 0, np.sqrt(40 * scale_height), limit=300)[0]


@pytest.mark.parametrize("degrees", [60.0, 10.0, 4.0, 1.5, 0.1])
def test_haze_air_mass_is_the_integral_through_a_low_layer(degrees):
    true = np.deg2rad(degrees)
    apparent = true + float(refraction(true))
    assert haze_air_mass(true) == pytest.approx(column_along_a_straight_line(apparent, 1.5e3), rel=0.02)


def test_ozone_air_mass_is_a_thin_shell():
    assert ozone_air_mass(jnp.pi / 2) == pytest.approx(1.0, abs=1e-12)
    # At the true horizon the ray meets the shell under an angle with cosine sqrt(1 - (R / (R + h))^2).
    cosine = np.sqrt(1 - (EARTH_RADIUS / (EARTH_RADIUS + 22e3)) ** 2)
    assert ozone_air_mass(0.0) == pytest.approx(1 / cosine, rel=1e-9)


def test_vertical_rayleigh_depth_is_bodhaine_s():
    # Bodhaine et al. 1999 eq. 30 (sea level, latitude 45).
    depth = -np.log(transmission(np.array([400.0, 550.0, 700.0]), np.pi / 2, aerosol_optical_depth=0.0, ozone_du=0.0))
    np.testing.assert_allclose(depth, [0.36021, 0.09707, 0.03642], rtol=2e-3)


def test_each_constituent_dims_its_own_colour():
    wavelength = np.array([400.0, 550.0, 602.0, 750.0])
    clear = transmission(wavelength, 0.5, aerosol_optical_depth=0.0, ozone_du=0.0)
    haze = -np.log(
        transmission(wavelength, np.pi / 2, aerosol_optical_depth=0.2, ozone_du=0.0)
        / transmission(wavelength, np.pi / 2, aerosol_optical_depth=0.0, ozone_du=0.0)
    )
    np.testing.assert_allclose(haze, 0.2 * (wavelength / 550.0) ** -1.3, rtol=1e-6)
    ozone = -np.log(transmission(wavelength, 0.5, aerosol_optical_depth=0.0) / clear)
    # Chappuis band: 300 DU x 5.2e-21 cm^2 at 602 nm is 0.042 in the vertical.
    assert ozone[2] / ozone_air_mass(0.5) == pytest.approx(0.042, rel=0.03)
    assert ozone.argmax() == 2 and ozone[0] < 0.01 * ozone[2]


def test_no_air_is_transparent_and_does_not_refract():
    vacuum = Sky(pressure=0.0, aerosol_optical_depth=0.0, ozone_du=0.0)
    altitude = jnp.linspace(-1.5, 1.5, 7)
    np.testing.assert_array_equal(vacuum.transmission(500.0, altitude), 1.0)
    np.testing.assert_array_equal(vacuum.apparent_altitude(altitude), altitude)
    np.testing.assert_array_equal(vacuum.flattening(altitude), 1.0)


def test_a_mountain_has_less_air_above_it():
    # U.S. Standard Atmosphere 1976 at 1000 and 5000 m.
    assert station_pressure(101325.0, 1000.0) == pytest.approx(89876.3, rel=1e-3)
    assert station_pressure(101325.0, 5000.0) == pytest.approx(54048.3, rel=1e-3)
    assert (Sky(height=2500.0).transmission(450.0, 0.3) > Sky().transmission(450.0, 0.3)).all()


def test_refraction_agrees_with_slalib():
    # SLALIB sla_refro (Hohenkerk & Sinclair 1985), 288.15 K, 101325 Pa, dry, 550 nm: apparent zenith distance
    # [degree], refraction [arcsec].
    zenith = np.array([45, 60, 75, 80, 85, 87, 88, 89, 89.5, 90])
    slalib = np.array([57.16, 98.78, 210.22, 313.33, 579.85, 843.02, 1067.08, 1412.37, 1658.62, 1979.57])
    true = np.deg2rad(90 - zenith - slalib / 3600)
    ours = np.rad2deg(refraction(true, pressure=101325.0, temperature=288.15)) * 3600
    assert (abs(ours - slalib) < np.where(zenith < 88, 10, 45)).all()
    assert refraction(np.pi / 2) == pytest.approx(0.0, abs=1e-8)


def test_setting_moon_is_flattened_by_a_sixth():
    # From the same SLALIB values: 1979.57" at 90 and 1658.62" at 89.5 degrees of apparent zenith distance.
    expected = 1800 / (1800 + 1979.57 - 1658.62)
    assert Sky(temperature=288.15).flattening(np.deg2rad(-0.27)) == pytest.approx(expected, rel=0.01)
    assert Sky().flattening(np.deg2rad(60.0)) == pytest.approx(1.0, abs=1e-3)


def test_everything_is_finite_and_differentiable_from_nadir_to_zenith():
    altitude = jnp.deg2rad(jnp.array([-90.0, -5.2, -5.11, -5.0, -0.61, -0.6, -0.59, 0.0, 5.0, 90.0]))
    sky = Sky()
    for function in (lambda a: sky.transmission(450.0, a), sky.apparent_altitude, sky.flattening):
        value, slope = jax.jit(jax.vmap(jax.value_and_grad(function)))(altitude)
        assert jnp.isfinite(value).all() and jnp.isfinite(slope).all()
    set_moon = sky.transmission(650.0, altitude)
    np.testing.assert_array_equal(set_moon[:5], set_moon[0])
    assert (jnp.diff(set_moon) >= 0).all()


def test_gradients_of_every_parameter_agree_with_central_differences():
    names = ("pressure", "aerosol_optical_depth", "angstrom", "ozone_du", "height")
    values = np.array([1e5, 0.2, 1.1, 320.0, 800.0])
    wavelength = jnp.array([480.0, 600.0])
    log = jax.jit(lambda p: jnp.log(Sky(**dict(zip(names, p, strict=True))).transmission(wavelength, 0.2)).sum())
    slopes = jax.jit(jax.grad(log))(values)
    for i, value in enumerate(values):
        step = np.eye(5)[i] * 1e-5 * value
        numeric = float(log(values + step) - log(values - step)) / (2e-5 * value)
        assert float(slopes[i]) == pytest.approx(numeric, rel=1e-6), names[i]
