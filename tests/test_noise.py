"""Whitening is C^(-1/2), and the smooth errors have the covariance they claim."""

import numpy as np
import pytest

from inverse import noise


def test_whitened_residuals_have_the_mahalanobis_norm():
    random = np.random.default_rng(0)
    sigma, low_rank = random.uniform(0.5, 2.0, 40), random.standard_normal((40, 6))
    residual = random.standard_normal(40)
    covariance = np.diag(sigma**2) + low_rank @ low_rank.T
    whitened = noise.whitener(sigma, low_rank)(residual)
    assert whitened @ whitened == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-10)


def test_a_repeated_column_does_no_harm():
    random = np.random.default_rng(1)
    sigma, column = np.ones(20), random.standard_normal((20, 1))
    twice = np.concatenate([column, column, np.zeros((20, 1))], axis=1)
    residual = random.standard_normal(20)
    covariance = np.eye(20) + twice @ twice.T
    whitened = noise.whitener(sigma, twice)(residual)
    assert whitened @ whitened == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-8)


def disc(count=14):
    line = np.linspace(-0.9, 0.9, count)
    position = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    position = position[np.hypot(*position.T) < 0.95]
    return position, np.hypot(position[:, 0] + 1.2, position[:, 1]) * 4.6e-3


def test_smooth_modes_hold_most_of_the_covariance_and_nothing_of_its_mean():
    position, offset = disc()
    modes = noise.smooth_modes(position, offset)
    assert modes.shape == (len(position), noise.MODES)
    assert np.abs(modes.mean(axis=0)).max() < 1e-8
    apart = np.linalg.norm(position[:, None] - position, axis=-1)
    wanted = 0.5 * np.exp(-apart / noise.LENGTH) + 0.5 * np.exp(-np.abs(offset[:, None] - offset) / noise.RADIAL)
    wanted = wanted - wanted.mean(axis=0) - wanted.mean(axis=1)[:, None] + wanted.mean()
    left = wanted - modes @ modes.T
    assert np.trace(left) < 0.2 * np.trace(wanted)
    assert np.linalg.eigvalsh(left).min() > -1e-9


def grey_sources(sigma, modes):
    """Errors of pixels, and smooth ones of the light."""
    cells = len(modes)
    return noise.Sources(np.full((cells, 3), sigma), np.zeros(cells), modes, np.full((cells, 3), True))


def test_a_colour_matrix_mixes_the_errors_of_the_light():
    position, offset = disc()
    cells, modes = len(position), noise.smooth_modes(position, offset)
    matrix = np.array([[1.2, -0.3, 0.1], [0.0, 1.5, -0.5], [-1.0, -0.4, 2.4]])
    usable = np.random.default_rng(2).uniform(size=(cells, 3)) > 0.1
    sources = noise.Sources(np.full((cells, 3), 0.02), np.full(cells, 0.05), modes, usable)
    errors = sources.errors(np.broadcast_to(matrix, (cells, 3, 3)))
    scaled = errors.modes * errors.amplitudes
    mixed = noise.COMMON**2 * np.outer(matrix.sum(axis=1), matrix.sum(axis=1)) + noise.CHROMATIC**2 * matrix @ matrix.T
    wanted = np.einsum("ij,kl->ikjl", modes @ modes.T, mixed).reshape(3 * cells, 3 * cells)
    used = usable.ravel()
    np.testing.assert_allclose((scaled @ scaled.T)[np.ix_(used, used)], wanted[np.ix_(used, used)], atol=1e-12)
    sigma = np.sqrt(0.02**2 + 0.05**2 * np.sum(matrix**2, axis=1))
    np.testing.assert_allclose(errors.scale.reshape(cells, 3)[usable], np.broadcast_to(sigma, (cells, 3))[usable])
    assert not scaled[~used].any() and np.all(errors.scale[~used] == 0.02)


def test_errors_have_the_stated_size_on_the_disc_and_beside_it():
    position, offset = disc()
    on_disc = np.concatenate([np.full(len(position), True), np.full(20, False)])
    around = 1.3 * np.stack([np.cos(np.arange(20)), np.sin(np.arange(20))], axis=1)
    position, offset = np.concatenate([position, around]), np.concatenate([offset, np.zeros(20)])
    modes = noise.modes_of(position, offset, on_disc)
    errors = grey_sources(0.05, modes).errors(np.broadcast_to(np.eye(3), (on_disc.size, 3, 3)))
    smooth = (errors.modes * errors.amplitudes).reshape(on_disc.size, 3, -1)
    together = smooth[~on_disc, 0] @ smooth[~on_disc, 1].T
    assert np.sqrt(np.diag(together).min()) >= noise.SKY and together.mean() == pytest.approx(noise.SKY**2, rel=0.1)
    assert not (smooth[on_disc, 0] @ smooth[~on_disc, 0].T).any()
    red, both = np.sum(smooth[:, 0] ** 2, axis=1), np.sum(smooth[:, 0] * smooth[:, 1], axis=1)
    variance = np.sum(modes**2, axis=1)
    np.testing.assert_allclose(both, noise.COMMON**2 * variance)
    np.testing.assert_allclose(red, (noise.COMMON**2 + noise.CHROMATIC**2) * variance)
    residual = np.random.default_rng(1).standard_normal(3 * on_disc.size)
    covariance = np.diag(errors.scale**2) + smooth.reshape(residual.size, -1) @ smooth.reshape(residual.size, -1).T
    expected = residual @ np.linalg.solve(covariance, residual)
    assert np.sum(errors.whitener(residual) ** 2) == pytest.approx(expected, rel=1e-9)
    alone = errors.without_smooth()
    np.testing.assert_allclose(alone.scale**2, np.diag(covariance))
    np.testing.assert_allclose(alone.whitener(residual), residual / alone.scale, rtol=1e-6)
