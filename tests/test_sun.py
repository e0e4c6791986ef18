import numpy as np
import pytest

from eclipsejax.sun import Sun, limb_darkening

WAVELENGTHS = np.array([385.0, 400.0, 422.5, 423.0, 500.0, 550.0, 650.0, 780.0])  # nm


def mean_over_centre(wavelength):
    node, weight = np.polynomial.legendre.leggauss(8)  # exact: a polynomial of degree 6
    mu = 0.5 * (node + 1.0)
    return np.sum(weight * mu * np.asarray(limb_darkening(Sun(), mu, wavelength)))


def test_centre_of_the_disc_is_the_unit():
    np.testing.assert_allclose(limb_darkening(Sun(), 1.0, WAVELENGTHS), 1.0, atol=1e-4)


@pytest.mark.parametrize(
    ("wavelength", "ratio"), [(457.345, 0.7651), (541.76, 0.8002), (610.975, 0.8221), (700.875, 0.8434)]
)
def test_mean_of_the_disc_is_that_measured_by_neckel_and_labs(wavelength, ratio):
    # The analytic coefficients of 2005 stand for the table of 1994 within 2e-3.
    assert mean_over_centre(wavelength) == pytest.approx(ratio, abs=2e-3)


def test_limb_darkening_is_that_of_the_table_of_1994(shared):
    file = shared / "reference" / "neckel_labs_1994.csv"
    table = np.genfromtxt(file, delimiter=",", skip_header=1, names=True)
    wavelength = table["lambda_nm"]
    inside = (wavelength > 385) & (wavelength < 800)
    coefficients = np.stack([table[f"A{k}"] for k in range(6)], axis=-1)[inside]
    mu = np.linspace(0.1, 1.0, 10)
    measured = sum(coefficients[:, k, None] * mu**k for k in range(6))
    np.testing.assert_allclose(limb_darkening(Sun(), mu, wavelength[inside][:, None]), measured, atol=0.015)


def test_limb_is_darker_in_the_blue():
    edge = limb_darkening(Sun(), 0.2, np.linspace(430.0, 780.0, 30))
    assert np.all(np.diff(edge) > 0)
    mu = np.linspace(0.0, 1.0, 50)
    assert np.all(np.diff(limb_darkening(Sun(), mu, 450.0)) > 0)


def test_a_sun_without_darkening_is_uniform():
    np.testing.assert_allclose(limb_darkening(Sun(darkening=0.0), np.linspace(0, 1, 5)[:, None], WAVELENGTHS), 1.0)


@pytest.mark.parametrize(
    ("wavelength", "mean"), [(400, 1.4827), (450, 1.9932), (550, 1.8730), (600, 1.7677), (700, 1.4102)]
)
def test_spectrum_e490_has_its_means_over_ten_nanometres(wavelength, mean):
    # W m^-2 nm^-1, from the 1697 points of the standard itself.
    band = np.arange(wavelength - 5.0, wavelength + 5.01, 0.1)
    assert np.mean(Sun(spectrum="e490").irradiance(band)) == pytest.approx(mean, rel=0.01)


def test_spectra_agree_in_broad_bands():
    for low, high in [(400, 500), (500, 600), (600, 700), (700, 780)]:
        band = np.arange(low, high, 0.5)
        gueymard, e490 = (float(np.mean(Sun(spectrum=name).irradiance(band))) for name in ("gueymard", "e490"))
        assert gueymard == pytest.approx(e490, rel=0.02)


def test_black_body_carries_the_solar_constant():
    # Stefan and Boltzmann: sigma T^4 diluted from the Sun's surface to 1 au.
    sun = Sun(spectrum="blackbody")
    wavelength = np.geomspace(100.0, 1e5, 4000)
    total = np.trapezoid(sun.irradiance(wavelength), wavelength)
    assert total == pytest.approx(5.670374e-8 * 5778.0**4 * (6.957e8 / 1.495978707e11) ** 2, rel=1e-3)
    visible = np.arange(380.0, 780.0)
    assert visible[np.argmax(sun.irradiance(visible))] == pytest.approx(2.897772e6 / 5778.0, abs=1.0)


def test_an_unknown_spectrum_is_refused():
    with pytest.raises(ValueError, match="gueymard"):
        Sun(spectrum="tungsten")
