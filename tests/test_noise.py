"""Whitening is C^(-1/2), and the smooth errors have the covariance they claim."""

import numpy as np
import pytest

from inverse import noise


def test_whitened_residuals_have_the_mahalanobis_norm():
    random = np.random.default_rng(0)
    sigma, low_rank = random.uniform(0.5, 2.0, 40), random.standard_normal((40, 6))
    residual = random.standard_normal(40)
    covariance = np.diag(sigma**2) + low_rank @ low_rank.T
    whitened = np.asarray(noise.whitener(sigma, low_rank)(residual))
    assert whitened @ whitened == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-10)


def test_a_repeated_column_does_no_harm():
    random = np.random.default_rng(1)
    sigma, column = np.ones(20), random.standard_normal((20, 1))
    twice = np.concatenate([column, column, np.zeros((20, 1))], axis=1)
    residual = random.standard_normal(20)
    covariance = np.eye(20) + twice @ twice.T
    whitened = np.asarray(noise.whitener(sigma, twice)(residual))
    assert whitened @ whitened == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-8)


def test_smooth_modes_rebuild_the_squared_exponential():
    line = np.linspace(-1, 1, 15)
    position = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    modes = noise.smooth_modes(position, length=0.5, variance=0.9999)
    apart = np.sum((position[:, None] - position[None]) ** 2, axis=-1)
    assert modes.shape[1] < 80
    assert np.abs(modes @ modes.T - np.exp(-0.5 * apart / 0.25)).max() < 0.03


def test_smooth_errors_have_the_stated_size_and_leave_the_sky_alone():
    position = np.random.default_rng(2).uniform(-0.7, 0.7, (60, 2))
    on_disc = np.arange(60) < 50
    errors = noise.smooth_errors(noise.smooth_modes(position[on_disc]), on_disc).reshape(60, 3, -1)
    covariance = np.einsum("icr,jdr->icjd", errors, errors)
    red, both = covariance[10, 0, 10, 0], covariance[10, 0, 10, 1]
    assert both == pytest.approx(noise.COMMON**2, rel=0.05)
    assert red == pytest.approx(noise.COMMON**2 + noise.CHROMATIC**2, rel=0.05)
    assert np.all(errors[50:] == 0)
