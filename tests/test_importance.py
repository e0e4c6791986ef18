"""Importance sampling mends a Gaussian that is nearly right, and says when it cannot."""

import numpy as np
import pytest

from inverse.diagnostics import LEAST_SAMPLES
from inverse.importance import DRAWS, LARGEST_K, importance
from tests.targets import correlated, gaussian, half_normal

SIZE = 8


def test_a_gaussian_is_taken_as_it_is():
    covariance = correlated(SIZE)
    found = importance(gaussian(covariance), np.zeros(SIZE), covariance, seed=0)
    assert found.trusted and found.effective_samples == pytest.approx(DRAWS, rel=1e-6)
    ratio = np.diag(np.cov(found.z.T)) / np.diag(covariance)
    assert ratio == pytest.approx(np.ones(SIZE), abs=5 * np.sqrt(2 / DRAWS))
    np.testing.assert_allclose(found.log_posterior, gaussian(covariance)(found.z), rtol=1e-9, atol=1e-9)


def test_mean_and_variance_are_mended():
    # The truth is shifted by 0.5 and has 0.7 of the variance.
    density = lambda z: -0.5 * np.sum((z - 0.5) ** 2 / 0.7, axis=1)
    found = importance(density, np.zeros(SIZE), np.eye(SIZE), seed=1)
    assert found.trusted
    sigma = np.sqrt(0.7 / found.effective_samples)
    assert found.z.mean(axis=0) == pytest.approx(np.full(SIZE, 0.5), abs=5 * sigma)
    assert np.mean(np.var(found.z, axis=0)) == pytest.approx(0.7, abs=0.06)


def test_a_bound_is_kept():
    found = importance(half_normal, np.zeros(2), np.eye(2), seed=0)
    assert found.trusted and np.all(found.z[:, 0] > 0) and np.all(np.isfinite(found.log_posterior))
    assert np.mean(found.z[:, 0]) == pytest.approx(np.sqrt(2 / np.pi), abs=0.07)


@pytest.mark.parametrize(
    ("density", "quartile"),
    [
        (lambda z: -0.5 * np.sum(z**2, axis=1) / 3.0, np.sqrt(3.0) * 0.6745),  # variance 3, not 1
        (lambda z: -2.0 * np.sum(np.log1p(z**2 / 3.0), axis=1), 0.7649),  # Student's t, three degrees of freedom
    ],
)
def test_a_gaussian_that_is_too_narrow_is_widened(density, quartile):
    found = importance(density, np.zeros(SIZE), np.eye(SIZE), seed=0)
    assert found.trusted
    assert np.mean(np.abs(found.z) < quartile) == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    "density",
    [
        lambda z: -np.sum(np.log1p(z**2), axis=1),  # Cauchy's tails
        lambda z: -0.5 * np.sum(z[:, 1:] ** 2, axis=1) - 50.0 * (z[:, 0] - 2.0 * np.sum(z[:, 1:] ** 2, axis=1)) ** 2,
        lambda z: np.full(len(z), -np.inf),
    ],
)
def test_what_no_such_proposal_covers_is_not_trusted(density):
    found = importance(density, np.zeros(SIZE), np.eye(SIZE), seed=0)
    assert not found.trusted
    assert found.k_hat >= LARGEST_K or found.effective_samples < LEAST_SAMPLES


def test_a_seed_reproduces_the_draws():
    one, two, other = (importance(half_normal, np.zeros(2), np.eye(2), seed=seed).z for seed in (3, 3, 4))
    assert np.array_equal(one, two) and not np.array_equal(one, other)
