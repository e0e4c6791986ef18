"""Errors of a size that is not quite known: the mean of the posteriors with each size, and intervals that hold."""

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks import drawn_evidence, error_sizes
from inverse import error_size as module
from inverse import prior
from inverse.error_size import MEAN, SHARE, SIZE, SPREAD, ErrorSize
from inverse.likelihood import LIMB
from inverse.map_estimate import Optimum
from inverse.noise import Errors

DATA = 30


class Straight:
    """Misfits straight in the limb, some of whose parameters the data hardly know."""

    def __init__(self, seed: int, known: float = 1.0):
        random = np.random.default_rng(seed)
        self.slopes = known * random.standard_normal((DATA, LIMB)) * np.geomspace(0.02, 2.0, LIMB)
        self.data = self.slopes @ random.standard_normal(LIMB) + random.standard_normal(DATA)

    def squares(self, z):
        return np.sum((self.data - z @ self.slopes.T) ** 2, axis=1)

    def posterior(self, size):
        """Mean and covariance with errors of a size."""
        covariance = np.linalg.inv(self.slopes.T @ self.slopes / size**2 + np.eye(LIMB))
        return covariance @ self.slopes.T @ self.data / size**2, covariance

    def optimum(self):
        z, covariance = self.posterior(1.0)
        cost = float(self.squares(z[None])[0] + z @ z)
        return Optimum(z, cost, True, 1, np.linalg.inv(covariance), (cost,))


def log_normal(z, mean, covariance):
    away = np.linalg.solve(np.linalg.cholesky(covariance), (z - mean).T)
    return -0.5 * (np.sum(away**2, axis=0) + np.linalg.slogdet(covariance)[1])


def test_where_misfits_are_straight_it_is_the_mean_of_the_posteriors():
    given = Straight(1)
    z = np.random.default_rng(2).standard_normal((200, LIMB)) + given.posterior(1.0)[0]
    found = ErrorSize(given.optimum()).log_density(z, given.squares(z))
    each = [np.log(share) + log_normal(z, *given.posterior(size)) for share, size in zip(SHARE, SIZE, strict=True)]
    exact = np.logaddexp.reduce(each, axis=0)
    np.testing.assert_allclose(found - found[0], exact - exact[0], atol=1e-6)


def test_of_one_size_it_is_what_squares_and_prior_say(monkeypatch):
    monkeypatch.setattr(module, "SIZE", np.ones_like(SIZE))
    given, z = Straight(9), np.random.default_rng(10).standard_normal((50, LIMB))
    squares = given.squares(z)
    found, plain = ErrorSize(given.optimum()).log_density(z, squares), -0.5 * (squares + np.sum(z**2, axis=1))
    np.testing.assert_allclose(found - found[0], plain - plain[0], rtol=1e-9, atol=1e-9)


def test_laplaces_gaussians_are_those_posteriors():
    given = Straight(3)
    laplace = ErrorSize(given.optimum()).laplace
    assert laplace.shares.sum() == pytest.approx(1.0)
    for size, bell in zip(SIZE, laplace.bells, strict=True):
        mean, covariance = given.posterior(size)
        np.testing.assert_allclose(bell.centre, mean, atol=1e-6)
        np.testing.assert_allclose(bell.factor @ bell.factor.T, covariance, atol=1e-6)


def test_what_no_photograph_tells_of_has_its_prior():
    given = Straight(4, known=1e-6)
    draws = ErrorSize(given.optimum()).laplace.draw(20_000, np.random.default_rng(5))
    np.testing.assert_allclose(draws.std(axis=0), 1.0, atol=0.03)


def test_intervals_hold_what_they_claim_where_errors_are_larger_or_smaller_than_thought():
    """An estimate whose error has the size's distribution, against the interval of the mixture."""
    random = np.random.default_rng(6)
    error = np.exp(random.normal(MEAN, SPREAD, 400_000)) * random.standard_normal(400_000)
    rank = SHARE @ norm.cdf(error / SIZE[:, None])
    of_one = norm.cdf(error)
    for level in (0.68, 0.95):
        assert np.mean(np.abs(rank - 0.5) < level / 2) == pytest.approx(level, abs=0.003)
        assert np.mean(np.abs(of_one - 0.5) < level / 2) < level - 0.01


def test_a_point_without_finite_squares_is_ruled_out():
    given = Straight(7)
    z = np.zeros((3, LIMB))
    value = ErrorSize(given.optimum()).log_density(z, np.array([10.0, np.nan, np.inf]))
    assert np.isfinite(value[0]) and (value[1:] == -np.inf).all()


def test_the_benchmark_finds_the_truth_again_and_draws_errors_as_large_as_they_are():
    for parameter in (*prior.ATMOSPHERE, *prior.PHOTOGRAPH, *prior.TONE):
        for z in (-2.5, 0.0, 1.7):
            assert drawn_evidence.z_of(parameter, float(parameter.value(z))) == pytest.approx(z, abs=1e-9)
    random = np.random.default_rng(8)
    roots = random.standard_normal((20, 3, 3))
    modes = random.standard_normal((60, 4))
    errors = Errors(roots @ np.swapaxes(roots, 1, 2), modes, common=1, broad=1, black=1, independent=2.0, smooth=0.5)
    drawn = error_sizes.drawn_errors(errors, random, 20_000)
    scaled = modes * errors.amplitudes
    exact = scaled @ scaled.T
    for cell in range(20):
        exact[3 * cell : 3 * cell + 3, 3 * cell : 3 * cell + 3] += 4.0 * errors.cells[cell]
    size = np.sqrt(np.diag(exact))
    np.testing.assert_allclose(np.cov(drawn) / np.outer(size, size), exact / np.outer(size, size), atol=0.04)
