import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.errors import InputError
from eclipsejax.moon import LAWS, Moon, lunar_map

albedo = eqx.filter_jit(lambda moon, longitude, latitude: moon.albedo(longitude, latitude))
reflectance = eqx.filter_jit(lambda moon, mu0, mu, phase: moon.reflectance(mu0, mu, phase))


def disc():
    """Longitude, latitude [rad], emission cosine, eastward offset [radii]; orthographic, zero libration."""
    east, north = np.stack(np.meshgrid(np.linspace(-1, 1, 401), np.linspace(-1, 1, 401)))
    seen = np.hypot(east, north) < 0.9999
    east, north = east[seen], north[seen]
    height = np.sqrt(1 - east**2 - north**2)
    return np.arctan2(east, height), np.arcsin(north), height, east


def disc_brightness(moon, phase_angle):
    _, _, mu, east = disc()
    mu0 = mu * np.cos(phase_angle) + east * np.sin(phase_angle)
    return float(reflectance(moon, jnp.asarray(mu0), jnp.asarray(mu), jnp.asarray(phase_angle)).mean())


@pytest.mark.parametrize("contrast", [0.0, 0.58, 0.7, 1.0])
def test_mean_albedo_of_the_disc_is_one_for_any_contrast(contrast):
    longitude, latitude, _, _ = disc()
    assert albedo(Moon(contrast=contrast), longitude, latitude).mean() == pytest.approx(1.0, abs=1e-3)


def test_another_map_is_normalised_whatever_its_unit():
    longitude, latitude, _, _ = disc()
    moon = Moon(albedo_map=37.0 * lunar_map(256))
    assert albedo(moon, longitude, latitude).mean() == pytest.approx(1.0, abs=3e-3)
    assert albedo(Moon(albedo_map=np.full((4, 8), 0.12)), 0.3, 0.2) == pytest.approx(1.0, abs=1e-12)


def test_seas_and_craters_are_where_selenographers_have_them():
    # Centres from the IAU gazetteer, east and north positive [degree].
    dark = {"Crisium": (59, 17), "Serenitatis": (18, 28), "Tranquillitatis": (31, 8), "Humorum": (-39, -24)}
    bright = {"Tycho": (-11, -43), "Aristarchus": (-47.5, 23.7), "southern highlands": (10, -40)}
    for places, limits in ((dark, (0.3, 0.7)), (bright, (1.3, 3.0))):
        found = albedo(Moon(), *np.deg2rad(list(places.values())).T)
        assert (found > limits[0]).all() and (found < limits[1]).all(), dict(zip(places, found, strict=True))


def test_albedo_is_periodic_and_continuous_across_the_far_side():
    moon, latitude = Moon(), np.linspace(-1.5, 1.5, 50)
    turned = albedo(moon, np.full(50, 0.4 - 2 * np.pi), latitude)
    np.testing.assert_allclose(albedo(moon, np.full(50, 0.4), latitude), turned, rtol=1e-9)
    east, west = (albedo(moon, np.full(50, x), latitude) for x in (np.pi - 1e-9, -np.pi + 1e-9))
    np.testing.assert_allclose(east, west, rtol=1e-5)


def test_coarser_maps_are_area_averages_of_the_finest():
    fine = lunar_map(2048)
    assert fine.shape == (1024, 2048)
    averaged = fine.reshape(256, 4, 512, 4).mean((1, 3))
    np.testing.assert_allclose(lunar_map(512) / lunar_map(512)[80, 200], averaged / averaged[80, 200], 1e-9)
    with pytest.raises(InputError, match="1000 columns"):
        lunar_map(1000)


def test_albedo_gradients_agree_with_central_differences():
    arguments = (0.7, -0.3141, 0.2718)
    surface = lunar_map(256)
    function = jax.jit(lambda contrast, *place: Moon(surface, contrast=contrast).albedo(*place))
    slopes = jax.jit(jax.grad(function, argnums=(0, 1, 2)))(*arguments)
    for i, slope in enumerate(slopes):
        step = 1e-6 * np.eye(3)[i]
        above, below = function(*(arguments + step)), function(*(arguments - step))
        assert float(slope) == pytest.approx(float(above - below) / 2e-6, rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_photometric_laws_have_mean_one_at_phase_zero(law):
    assert disc_brightness(Moon(law=law), 0.0) == pytest.approx(1.0, abs=2e-3)


def test_full_moon_is_flat_but_a_lambert_moon_is_not():
    mu = np.array([1.0, 0.5, 0.1])
    np.testing.assert_allclose(reflectance(Moon(), mu, mu, 0.0), 1.0, rtol=1e-12)
    np.testing.assert_allclose(reflectance(Moon(law="lambert"), mu, mu, 0.0), 1.5 * mu, rtol=1e-12)
    # Yapo & Cutler: 1 / (0.1 + 0.9 cos) times the cosine that their irradiance holds.
    flat = reflectance(Moon(law="flat"), mu, mu, 0.0)
    np.testing.assert_allclose(flat / flat[0], mu / (0.1 + 0.9 * mu), rtol=1e-12)


def test_surge_follows_rolo():
    # Disc reflectance at 549.1 nm from the ROLO coefficients (Kieffer & Stone 2005), zero libration; below
    # 1.55 degrees ROLO is extrapolated.
    phase = np.deg2rad([0.5, 1.0, 1.55, 2.0, 4.0, 7.0, 10.0])
    rolo = np.array([0.1509, 0.1437, 0.1369, 0.1320, 0.1157, 0.1006, 0.0906]) / 0.1592
    moon = Moon()
    ours = np.array([disc_brightness(moon, g) for g in phase]) / disc_brightness(moon, 0.0)
    np.testing.assert_allclose(ours, rolo, rtol=3e-3)


@pytest.mark.parametrize("law", LAWS)
def test_night_is_black_and_every_gradient_is_finite(law):
    moon = Moon(law=law)
    edge = [-1.0, -1e-3, 0.0, 1e-300, 1e-12, 1e-6, 2e-6, 1e-3, 1.0]
    mu0, mu = (jnp.asarray(a.ravel()) for a in np.meshgrid(edge, edge))
    value_and_slopes = jax.jit(jax.vmap(jax.value_and_grad(moon.reflectance, argnums=(0, 1, 2)), (0, 0, None)))
    value, slopes = value_and_slopes(mu0, mu, 0.01)
    night = (mu0 <= 0) | (mu <= 0)
    assert jnp.isfinite(value).all() and (value >= 0).all() and (value[night] == 0).all()
    for slope in slopes:
        assert jnp.isfinite(slope).all() and (slope[night] == 0).all()


def test_spectrum_is_the_apollo_16_soil(shared):
    wavelength, measured = np.loadtxt(
        shared / "reference" / "moon_apollo16.csv", delimiter=",", skiprows=2, usecols=(0, 1), unpack=True
    )
    seen = (wavelength >= 380) & (wavelength <= 780)
    ratio = np.asarray(Moon().spectrum(wavelength[seen])) / measured[seen]
    assert np.std(ratio / ratio.mean()) < 1.2e-3


def test_moon_reddens_by_the_published_slope():
    # Apollo 16 soil 62231: 0.17002 at 700 nm, 0.10331 at 400 nm.
    assert Moon().spectrum(780.0) == pytest.approx(1.0, abs=1e-12)
    assert Moon().spectrum(700.0) / Moon().spectrum(400.0) == pytest.approx(0.17002 / 0.10331, rel=5e-3)


def test_one_trace_serves_every_contrast():
    traces = []

    @eqx.filter_jit
    def brightness(moon):
        traces.append(None)
        return moon.albedo(0.1, 0.2)

    for contrast in (0.5, 0.7, 0.9):
        brightness(Moon(contrast=contrast))
    assert len(traces) == 1


def test_unknown_law_is_refused_in_one_sentence():
    with pytest.raises(InputError, match="no photometric law 'hapke'"):
        Moon(law="hapke")
