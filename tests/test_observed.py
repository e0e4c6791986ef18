"""Limits cost nothing while they are kept, as measurements where they are broken, and less than one for each cell."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from inverse import noise
from inverse.observed import LEAST_ERROR, SHARE, observed

ERROR = float(np.hypot(noise.COMMON, noise.CHROMATIC))


def cells(limit, value=0.0, usable=False):
    one = np.full((1, 3), value)
    return observed(one, np.full((1, 3), usable), np.full((1, 3), float(limit)), np.array(ERROR))


@pytest.mark.parametrize("limit", [1, -1])
def test_the_cost_is_that_of_censored_data(limit):
    """Tobin 1958: twice minus the logarithm of the chance to be beyond the limit."""
    data = cells(limit, value=-0.7)
    for errors in (-5.0, -1.0, 0.0, 0.5, 3.0):  # above the limit
        predicted = -0.7 + errors * ERROR
        cost = np.square(np.asarray(data.misfit(jnp.full(3, predicted)))) / SHARE
        np.testing.assert_allclose(cost, -2.0 * norm.logcdf(limit * errors), rtol=1e-6)


def test_a_limit_far_away_says_nothing_and_one_far_broken_is_a_measurement():
    data = cells(1)
    misfit = lambda predicted: data.misfit(jnp.full(3, predicted))[0]
    for kept in (2.0, 5.0, 1e3):
        assert abs(float(misfit(kept))) < 1e-8 and float(jax.grad(misfit)(kept)) == pytest.approx(0.0, abs=1e-8)
    a_measurement = np.sqrt(SHARE) / ERROR
    assert float(misfit(-8.0)) == pytest.approx(8.0 * a_measurement, rel=2e-3)
    assert float(jax.grad(misfit)(-8.0)) == pytest.approx(-a_measurement, rel=2e-3)


def test_a_limit_is_worth_less_where_the_model_errs_more_and_is_never_without_error():
    data = cells(-1, value=0.0)
    cost = lambda error: np.square(data.with_error(np.full(3, error)).misfit(jnp.full(3, 0.4))[0]) / SHARE
    assert cost(0.8) == pytest.approx(-2.0 * norm.logcdf(-0.5), rel=1e-6)
    assert cost(0.1) > 5.0 * cost(0.8)
    assert cost(0.0) == pytest.approx(float(cost(LEAST_ERROR)))


@pytest.mark.parametrize("limit", [1, -1])
def test_slopes_agree_with_differences(limit):
    data = cells(limit, value=0.2)
    misfit = lambda predicted: data.misfit(jnp.full(3, predicted))[1]
    for predicted in (-0.5, 0.1, 0.2, 0.35, 0.8):
        difference = (misfit(predicted + 1e-5) - misfit(predicted - 1e-5)) / 2e-5
        assert float(jax.grad(misfit)(predicted)) == pytest.approx(float(difference), rel=1e-5, abs=1e-7)


def test_measurements_are_data_minus_model_and_the_rest_nothing():
    assert np.asarray(cells(0, 0.3, usable=True).misfit(jnp.full(3, 0.1))) == pytest.approx(0.2)
    assert not np.asarray(cells(0, 0.3).misfit(jnp.full(3, 0.1))).any()


@pytest.mark.parametrize("count", [1, 5, 8, 12])
def test_limits_are_of_few_sizes_and_cost_what_each_does(count):
    random = np.random.default_rng(count)
    value, limit = random.standard_normal((4, 3)), np.zeros((4, 3))
    limit.flat[random.permutation(12)[:count]] = random.choice([-1.0, 1.0], count)
    data = observed(value, limit == 0, limit, np.full(12, ERROR))
    assert data.limited.size in (1, 8, 12) and set(np.flatnonzero(limit)) <= set(np.asarray(data.limited).tolist())
    alone = [
        cells(one, at, usable=one == 0).misfit(jnp.zeros(3))[0] for one, at in zip(limit.flat, value.flat, strict=True)
    ]
    np.testing.assert_allclose(data.misfit(jnp.zeros(12)), alone, rtol=1e-12)
