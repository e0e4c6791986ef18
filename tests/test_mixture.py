"""Mixtures: a density that integrates to one, draws that have it, and a fit to weighed draws."""

import numpy as np
import pytest

from inverse.gaussian import Gaussian
from inverse.mixture import FEWEST, Mixture, about, fitted, tempered


def two_bells(freedom):
    bells = (Gaussian(np.array([-1.0, 0.5]), np.array([[0.7, 0.0], [0.2, 0.5]])), Gaussian(np.zeros(2), np.eye(2)))
    return Mixture(np.array([0.3, 0.7]), bells, freedom)


@pytest.mark.parametrize("freedom", [np.inf, 8.0])
def test_the_density_integrates_to_one_and_draws_have_it(freedom):
    mixture = two_bells(freedom)
    line = np.linspace(-12.0, 12.0, 481)
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    density = np.exp(mixture.log_density(grid)) * (line[1] - line[0]) ** 2
    assert density.sum() == pytest.approx(1.0, abs=2e-3)
    z = mixture.draw(40_000, np.random.default_rng(0))
    assert z.mean(axis=0) == pytest.approx(density @ grid, abs=0.03)
    assert np.mean(np.all(z > 0.5, axis=1)) == pytest.approx(density[np.all(grid > 0.5, axis=1)].sum(), abs=0.01)


def test_weights_are_tempered_until_enough_count():
    log_ratio = np.append(np.zeros(500), 40.0)
    weight = tempered(log_ratio)
    assert weight.sum() == pytest.approx(1.0) and 1.0 / np.sum(weight**2) == pytest.approx(FEWEST, rel=0.01)
    even = np.random.default_rng(1).normal(scale=0.1, size=500)
    np.testing.assert_allclose(tempered(even), np.exp(even) / np.exp(even).sum(), rtol=1e-6)
    assert tempered(np.append(even, -np.inf))[-1] == 0.0


def test_a_fit_follows_two_peaks():
    random = np.random.default_rng(2)
    z = np.concatenate([random.normal(-2.0, 0.3, (1500, 3)), random.normal(1.5, 0.5, (1500, 3))])
    weight = np.append(np.full(1500, 1.0), np.full(1500, 3.0))
    found = fitted(z, weight / weight.sum(), [Gaussian(np.zeros(3), np.eye(3))], random)
    fresh = found.draw(20_000, random)
    assert np.mean(fresh.mean(axis=1) > 0.0) == pytest.approx(0.75, abs=0.08)
    right = np.mean(found.log_density(random.normal(1.5, 0.5, (500, 3))))
    between = np.mean(found.log_density(random.normal(-0.3, 0.1, (500, 3))))
    assert right > between + 1.0


def test_the_first_proposal_reaches_where_the_prior_does():
    narrow = about([Gaussian(np.full(4, 2.0), 0.01 * np.eye(4))])
    z = narrow.draw(4000, np.random.default_rng(3))
    assert np.mean(np.linalg.norm(z, axis=1) < 2.5) > 0.05
    assert np.mean(np.linalg.norm(z - 2.0, axis=1) < 0.1) > 0.5
