"""Dust read from a report of brightness: against the closed form, and back from the photometer's own dimmings."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ndtri

import eclipsejax as ej
from eclipsejax.dust_of_brightness import EXTINCTIONS, LOWER_95, PRIOR

PATH = 5e5  # m: light passes through this length of dust

LIMBS = 12


@pytest.fixture(scope="module")
def table():
    """Dimmings on 2008-02-21 under three limbs; one compilation for all dust, limbs and scatterers."""
    greatest = ej.nearest_eclipse("2008-02-21").greatest

    def dimmed(limbs, extinction=EXTINCTIONS, **scatterers):
        scene = ej.Scene.at(greatest, scatterers=ej.Scatterers(**scatterers))
        return np.asarray(ej.dimmings(ej.photometer(scene, tolerance=1e-2), limbs, extinction))

    return dimmed


@pytest.fixture(scope="module")
def modelled(table):
    return table(ej.uncertain_limbs(3))


def beer(spread=0.0):
    """Dimming of a shadow in which dust absorbs along `PATH`, under limbs that differ evenly by `spread` [mag]."""
    limbs = spread * ndtri((np.arange(LIMBS) + 0.5) / LIMBS)
    return 10.0 + limbs[:, None] + 2.5 / np.log(10.0) * PATH * EXTINCTIONS


def test_limbs_fill_their_ranges_evenly():
    limbs = ej.uncertain_limbs(256)
    assert limbs.clouds is not None and limbs.haze is not None and limbs.ozone is not None
    parts = (limbs.clouds.top, limbs.clouds.cover, limbs.clouds.width, limbs.haze.optical_depth, limbs.ozone.column_du)
    for values, (low, high) in zip(parts, PRIOR.values(), strict=True):
        unit = (np.sort(np.asarray(values)) - low) / (high - low)
        assert np.abs(unit - (np.arange(256) + 0.5) / 256).max() < 0.02
    assert np.abs(np.corrcoef(np.array([np.asarray(part) for part in parts])) - np.eye(5)).max() < 0.1


def test_dust_of_a_sharp_report_is_the_dust_that_dims_so():
    true = 7e-6
    found = ej.dust_of_dimming(beer(), 10.0 + 2.5 / np.log(10.0) * PATH * true, 0.05)
    error = 0.05 / (2.5 / np.log(10.0) * PATH)
    assert float(found.quantile(0.5)) == pytest.approx(true, rel=0.01)
    least, most = found.limits()
    assert least == pytest.approx(true - 1.645 * error, rel=0.01)
    assert most == pytest.approx(true + 1.645 * error, rel=0.01)


def test_unknown_clouds_add_to_the_error_of_a_report():
    """Normal limbs and a normal error: the likelihood is that of both together."""
    dimming = 10.0 + 2.5 / np.log(10.0) * PATH * 1e-5
    apart = ej.dust_of_dimming(beer(spread=0.4), dimming, 0.3)
    together = ej.dust_of_dimming(beer(), dimming, np.hypot(0.3, 0.4))
    assert np.abs(apart.likelihood - together.likelihood).max() < 0.06  # twelve limbs for all


def test_probability_sums_to_one_and_quantiles_rise():
    found = ej.dust_of_dimming(beer(spread=0.4), 15.0, 0.5)
    step = np.log(found.extinction[1] / found.extinction[0])
    assert float(jnp.sum(found.density) * step) == pytest.approx(1.0)
    assert np.all(np.diff(found.quantile(np.linspace(0.01, 0.99, 9))) > 0)


def test_a_bright_moon_gives_no_least_dust_and_a_dark_one_no_greatest():
    assert ej.dust_of_dimming(beer(), 10.0, 0.5).limits()[0] == 0.0
    thick = np.minimum(beer(), 19.0)  # scattered light is left
    found = ej.dust_of_dimming(thick, 19.2, 0.5)
    assert found.bounded == (True, False)
    assert found.limits()[1] == np.inf
    assert float(np.interp(found.limits()[0], EXTINCTIONS, thick[0])) == pytest.approx(19.0 - 0.41, abs=0.5)


def test_fainter_than_something_is_a_lower_limit():
    dimming = 10.0 + 2.5 / np.log(10.0) * PATH * 1e-5
    found = ej.dust_of_dimming(beer(), dimming, 0.3, fainter=True)
    least, most = found.limits()
    assert most == np.inf
    # Where the chance to be fainter, given this dust, falls below the limit.
    assert 10.0 + 2.5 / np.log(10.0) * PATH * least == pytest.approx(
        dimming + 0.3 * ndtri(LOWER_95), abs=0.06
    )  # a step


def test_more_dust_is_never_brighter(modelled):
    assert np.all(np.diff(modelled, axis=1) > -1e-3)


def test_thick_dust_leaves_what_the_air_above_it_scatters(table, modelled):
    """Whether dust itself scatters shows only where there is some and light still reaches it."""
    black = table(ej.uncertain_limbs(3), dust_albedo=0.0)
    assert np.abs(black - modelled)[:, 0].max() < 2e-3
    assert np.all((black - modelled).max(axis=1) > 0.02)  # 0.05 mag
    assert np.abs(black - modelled)[:, -1].max() < 2e-3
    assert np.all(modelled[:, -1] - modelled[:, -2] < 0.1)  # more dust dims no more


def test_dust_is_recovered_under_a_limb_that_is_not_among_the_draws(table, modelled):
    true = EXTINCTIONS[3] * 1.2
    typical = jax.tree.map(lambda *same: jnp.stack(same), *3 * [ej.Atmosphere.typical()])
    seen = float(table(typical, np.full_like(EXTINCTIONS, true))[0, 0])
    found = ej.dust_of_dimming(modelled, seen, 0.3)
    low, high = found.quantile(jnp.asarray([0.025, 0.975]))
    assert low < true < high < 4.0 * low
