"""The priors are smooth, increasing maps of a standard normal, and say what they claim."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from inverse import prior

EVERY = prior.ATMOSPHERE + prior.PHOTOGRAPH + prior.TONE + prior.PROFILE


@pytest.mark.parametrize("parameter", EVERY, ids=lambda p: p.name)
def test_value_increases_with_z_and_its_centre_is_the_median(parameter):
    z = jnp.linspace(-5.0, 5.0, 101)
    value = np.asarray(jax.vmap(parameter.value)(z))
    assert np.all(np.isfinite(value)) and np.all(np.diff(value) > 0)
    assert value[50] == pytest.approx(parameter.centre, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("parameter", EVERY, ids=lambda p: p.name)
def test_slope_is_the_derivative(parameter):
    step = 1e-5
    difference = (parameter.value(0.7 + step) - parameter.value(0.7 - step)) / (2 * step)
    assert float(parameter.slope(0.7)) == pytest.approx(float(difference), rel=1e-8)


def test_dust_prior_spans_quiet_and_volcanic_stratospheres():
    # A vertical optical depth from 0.0004 (cleaner than any since 1995) to 0.13 (a year after Pinatubo) at 95 %.
    low, high = (float(prior.ATMOSPHERE[0].value(z)) * 10e3 for z in (-1.96, 1.96))
    assert 3e-4 < low < 6e-4 and 0.12 < high < 0.15


def test_atmosphere_takes_its_values_by_name():
    z = jnp.arange(8) * 0.1
    limb, value = prior.atmosphere(z), prior.values(prior.ATMOSPHERE, z)
    assert limb.dust is not None and limb.clouds is not None and limb.haze is not None and limb.ozone is not None
    assert limb.dust.extinction == value["dust.extinction"]
    assert limb.air.surface_pressure == value["air.surface_pressure"]
    assert limb.clouds.width == value["clouds.width"]
    assert limb.ozone.column_du == value["ozone.column_du"]


def test_a_linear_photograph_has_no_tone_curve():
    names = {parameter.name for parameter in prior.photograph_parameters("linear")}
    assert not any(name.startswith("tone.") for name in names)
    assert {"tone.toe", "tone.exponent"} <= {p.name for p in prior.photograph_parameters("srgb")}
