"""A posterior sampled through its surrogate is the posterior, however it is bent."""

import numpy as np
import pytest

from inverse.diagnostics import LEAST_SAMPLES
from inverse.gaussian import Gaussian
from inverse.surrogate import COMPONENTS, interpolated, surrogate

SIZE, DATA = 5, 60


class Bent:
    """Misfits that bend along the first parameter: a banana, whose moments are known by brute force."""

    def __init__(self, bend):
        random = np.random.default_rng(0)
        self.bend, self.calls = bend, 0
        self.slopes = random.standard_normal((DATA, SIZE)) * np.array([0.05, 0.8, 0.5, 0.5, 0.5])
        self.data = random.standard_normal(DATA)

    def misfits(self, z):
        self.calls += len(z)
        bent = z.copy()
        bent[:, 1] = z[:, 1] - self.bend * (z[:, 0] ** 2 - 1.0)
        return self.data - bent @ self.slopes.T

    def log_density(self, z, squares):
        value = -0.5 * (squares + np.sum(z**2, axis=1))
        return np.where(np.isfinite(value), value, -np.inf)

    def __call__(self, z):
        return self.log_density(z, np.sum(self.misfits(z) ** 2, axis=1))

    def laplace(self):
        """At the point where the first parameter is zero, as if the optimiser had ended there."""
        centre = np.zeros(SIZE)
        slopes, information = self.slopes.copy(), np.eye(SIZE)
        for _ in range(20):
            misfit = self.misfits(centre[None])[0]
            slopes[:, 0] = self.slopes[:, 0] - 2.0 * self.bend * centre[0] * self.slopes[:, 1]
            information = np.eye(SIZE) + slopes.T @ slopes
            centre = centre + 0.5 * np.linalg.solve(information, slopes.T @ misfit - centre)
        return centre, np.linalg.inv(information)


def weighted_moments(posterior, random):
    """Mean and standard deviation by importance sampling of the prior in the first, the exact Gaussian in the rest."""
    first = random.standard_normal(200_000)
    information = np.eye(SIZE - 1) + posterior.slopes[:, 1:].T @ posterior.slopes[:, 1:]
    z = np.zeros((first.size, SIZE))
    z[:, 0] = first
    misfit = posterior.misfits(z)  # the others at zero: straight in them
    right = misfit @ posterior.slopes[:, 1:]
    mean = np.linalg.solve(information, right.T).T
    log_weight = 0.5 * np.sum(right * mean, axis=1) - 0.5 * np.sum(misfit**2, axis=1)
    weight = np.exp(log_weight - log_weight.max())
    factor = np.linalg.cholesky(np.linalg.inv(information))
    z[:, 1:] = mean + random.standard_normal(mean.shape) @ factor.T
    average = np.average(z, axis=0, weights=weight)
    return average, np.sqrt(np.average((z - average) ** 2, axis=0, weights=weight))


@pytest.mark.parametrize("bend", [0.0, 0.6])
def test_moments_are_those_of_the_posterior(bend):
    posterior = Bent(bend)
    mean, sd = weighted_moments(posterior, np.random.default_rng(1))
    found = interpolated(posterior, Gaussian.about(*posterior.laplace()), seed=3)
    assert found.trusted and found.weighed.effective_samples > LEAST_SAMPLES
    np.testing.assert_allclose((found.weighed.z.mean(axis=0) - mean) / sd, 0.0, atol=0.15)
    np.testing.assert_allclose(found.weighed.z.std(axis=0) / sd, 1.0, atol=0.1)
    assert found.points < 15_000


def test_a_surrogate_goes_through_its_points():
    posterior, random = Bent(0.4), np.random.default_rng(2)
    gaussian = Gaussian.about(*posterior.laplace())
    z = gaussian.at(random.standard_normal((300, SIZE)))
    fast = surrogate(z, posterior.misfits(z), gaussian, posterior.log_density)
    np.testing.assert_allclose(fast(z), posterior(z), atol=1e-2)
    between = gaussian.at(random.standard_normal((100, SIZE)))
    assert np.std(fast(between) - posterior(between)) < 0.1
    assert fast.misfits.d.shape[1] <= COMPONENTS + 2


class Holed(Bent):
    """No numbers above 1.5 standard deviations of the second parameter."""

    def __init__(self):
        super().__init__(0.0)
        centre, covariance = Bent(0.0).laplace()
        self.wall = centre[1] + 1.5 * np.sqrt(covariance[1, 1])

    def misfits(self, z):
        return np.where(z[:, 1:2] > self.wall, np.nan, super().misfits(z))


def test_where_there_are_no_numbers_there_are_no_draws(monkeypatch):
    from inverse import surrogate as module

    monkeypatch.setattr(module, "ROUNDS", 1)
    posterior = Holed()
    found = interpolated(posterior, Gaussian.about(*Bent(0.0).laplace()), seed=3)
    assert found.weighed.z[:, 1].max() <= posterior.wall
    assert found.weighed.z[:, 0].std() > 0.5  # of the rest there are


class Torn(Bent):
    """Misfits with a jump that no interpolation follows, beside the optimum."""

    def misfits(self, z):
        found = super().misfits(z)
        return found + 6.0 * np.sign(np.sin(40.0 * z[:, :1])) * self.slopes[:, 1]


def test_a_surrogate_that_fails_is_not_trusted(monkeypatch):
    from inverse import surrogate as module

    monkeypatch.setattr(module, "ROUNDS", 1)
    posterior = Torn(0.0)
    assert not interpolated(posterior, Gaussian.about(*Bent(0.0).laplace()), seed=3).trusted
