"""Importance sampling mends a Gaussian that is nearly right, and says when it cannot."""

import numpy as np
import pytest

from inverse.diagnostics import LEAST_SAMPLES
from inverse.gaussian import Gaussian
from inverse.importance import ENOUGH, LARGEST_K, importance
from tests.targets import correlated, gaussian, half_normal

SIZE = 8


def test_a_gaussian_stays_one():
    covariance = correlated(SIZE)
    found = importance(gaussian(covariance), [Gaussian.about(np.zeros(SIZE), covariance)], seed=0)
    assert found.trusted and found.effective_samples > ENOUGH
    ratio = np.diag(np.cov(found.z.T)) / np.diag(covariance)
    assert ratio == pytest.approx(np.ones(SIZE), abs=5 * np.sqrt(2 / ENOUGH))
    np.testing.assert_allclose(found.log_posterior, gaussian(covariance)(found.z), rtol=1e-9, atol=1e-9)


def test_mean_and_variance_are_mended():
    # The truth is shifted by 0.5 and has 0.7 of the variance.
    density = lambda z: -0.5 * np.sum((z - 0.5) ** 2 / 0.7, axis=1)
    found = importance(density, [Gaussian.about(np.zeros(SIZE), np.eye(SIZE))], seed=1)
    assert found.trusted
    sigma = np.sqrt(0.7 / found.effective_samples)
    assert found.z.mean(axis=0) == pytest.approx(np.full(SIZE, 0.5), abs=5 * sigma)
    assert np.mean(np.var(found.z, axis=0)) == pytest.approx(0.7, abs=0.06)


def test_a_bound_is_kept():
    found = importance(half_normal, [Gaussian.about(np.zeros(2), np.eye(2))], seed=0)
    assert found.trusted and np.all(found.z[:, 0] > 0) and np.all(np.isfinite(found.log_posterior))
    assert np.mean(found.z[:, 0]) == pytest.approx(np.sqrt(2 / np.pi), abs=0.07)


@pytest.mark.parametrize(
    ("density", "quartile"),
    [
        (lambda z: -0.5 * np.sum(z**2, axis=1) / 3.0, np.sqrt(3.0) * 0.6745),  # variance 3, not 1
        (lambda z: -2.0 * np.sum(np.log1p(z**2 / 3.0), axis=1), 0.7649),  # Student's t, three degrees of freedom
        (lambda z: -np.sum(np.log1p(z**2), axis=1), 1.0),  # Cauchy
    ],
)
def test_a_gaussian_that_is_too_narrow_is_widened(density, quartile):
    found = importance(density, [Gaussian.about(np.zeros(SIZE), np.eye(SIZE))], seed=0)
    assert found.trusted
    assert np.mean(np.abs(found.z) < quartile) == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    "density",
    [
        lambda z: -0.5 * np.sum(np.square((z - 8.0) / 0.01), axis=1),  # far away, and small
        lambda z: -0.5 * np.sum(z[:, 1:] ** 2, axis=1) - 50.0 * (z[:, 0] - 2.0 * np.sum(z[:, 1:] ** 2, axis=1)) ** 2,
        lambda z: np.full(len(z), -np.inf),
    ],
)
def test_what_no_such_proposal_covers_is_not_trusted(density):
    found = importance(density, [Gaussian.about(np.zeros(SIZE), np.eye(SIZE))], seed=0)
    assert not found.trusted
    assert found.k_hat >= LARGEST_K or found.effective_samples < LEAST_SAMPLES


def two_peaks(z):
    """A high one of sd 0.3 at 1.2, with 0.14 of the probability, and a broad one at -0.5."""
    wide = np.array([0.6] * 3 + [0.4] * (SIZE - 3))
    high, broad = ((z - 1.2) / 0.3, (z + 0.5) / wide)
    share = np.log(0.14 / 0.86) + np.sum(np.log(wide / 0.3))
    return np.logaddexp(share - 0.5 * np.sum(high**2, axis=1), -0.5 * np.sum(broad**2, axis=1))


def test_the_peak_beside_the_one_that_was_found_is_found():
    """Laplace's Gaussian about the higher peak alone would be weighed as perfect."""
    found = importance(two_peaks, [Gaussian.about(np.full(SIZE, 1.2), 0.09 * np.eye(SIZE))], seed=0)
    assert found.trusted
    assert np.mean(found.z.mean(axis=1) > 0.35) == pytest.approx(0.14, abs=0.03)


def test_a_peak_that_the_prior_hardly_meets_is_found_from_its_own_optimum():
    """A narrow one with half of the probability: of 2000 draws about the other, or from the prior, none falls there."""
    narrow, broad = 0.04, 0.5
    far = np.full(SIZE, -1.0)

    def density(z):
        peaks = [
            -0.5 * np.sum(((z - c) / sd) ** 2, axis=1) - SIZE * np.log(sd) for c, sd in ((far, narrow), (1.0, broad))
        ]
        return np.logaddexp(*peaks)

    bells = [Gaussian.about(np.full(SIZE, 1.0), broad**2 * np.eye(SIZE)), Gaussian.about(far, narrow**2 * np.eye(SIZE))]
    shares = [np.mean(importance(density, some, seed=0).z[:, 0] < 0.0) for some in (bells[:1], bells)]
    assert shares[0] < 0.05 and shares[1] == pytest.approx(0.5, abs=0.05)


def test_a_bent_posterior_is_followed_to_its_ends():
    """Where it is bent, Laplace's Gaussian takes the first parameter's standard deviation for less than half of it.

    In the mean of several seeds: draws that proposals learnt from had 0.91 of it, with every one of them.
    """
    density = lambda z: -0.5 * np.sum(z**2, axis=1) - 0.5 * np.square((z[:, 0] - 0.5 * (z[:, 1] ** 2 - 1.0)) / 0.2)
    exact = np.random.default_rng(0).standard_normal((200_000, 2))
    bend = 0.5 * (exact[:, 1] ** 2 - 1.0)
    weight = np.exp(-0.5 * bend**2 / 1.04)
    first = bend / 1.04 + 0.2 / np.sqrt(1.04) * exact[:, 0]
    mean = np.average(first, weights=weight)
    sd = np.sqrt(np.average((first - mean) ** 2, weights=weight))
    covariance = np.diag([1.0 / 26.0, *np.ones(SIZE - 1)])
    assert np.sqrt(covariance[0, 0]) < 0.45 * sd
    start = np.zeros(SIZE)
    start[0] = -0.5 / 1.04
    found = [importance(density, [Gaussian.about(start, covariance)], seed=seed) for seed in range(8)]
    assert all(one.trusted for one in found)
    # One seed's standard deviation is off by 0.03, its mean by 0.025.
    assert np.mean([one.z[:, 0].mean() for one in found]) == pytest.approx(mean, abs=0.025)
    assert np.mean([one.z[:, 0].std() for one in found]) == pytest.approx(sd, rel=0.06)


def test_beside_zero_the_prior_is_followed():
    """A limit from above: the posterior of a logarithm falls to one side and is the prior's on the other."""
    density = lambda z: -0.5 * np.sum(z**2, axis=1) - np.exp(3.0 * (z[:, 0] + 0.5))
    line = np.linspace(-8.0, 3.0, 20_001)
    below = np.cumsum(np.exp(-0.5 * line**2 - np.exp(3.0 * (line + 0.5))))
    wanted = np.interp([0.025, 0.5, 0.975], below / below[-1], line)
    mode = line[np.argmax(-0.5 * line**2 - np.exp(3.0 * (line + 0.5)))]
    start = np.array([mode, *np.zeros(SIZE - 1)])
    covariance = np.diag([1.0 / (1.0 + 9.0 * np.exp(3.0 * (mode + 0.5))), *np.ones(SIZE - 1)])
    found = [importance(density, [Gaussian.about(start, covariance)], seed=seed) for seed in range(4)]
    assert all(one.trusted for one in found)
    quantiles = np.mean([np.quantile(one.z[:, 0], [0.025, 0.5, 0.975]) for one in found], axis=0)
    assert quantiles == pytest.approx(wanted, abs=0.1)


def test_a_seed_reproduces_the_draws():
    one, two, other = (
        importance(half_normal, [Gaussian.about(np.zeros(2), np.eye(2))], seed=seed).z for seed in (3, 3, 4)
    )
    assert np.array_equal(one, two) and not np.array_equal(one, other)


def test_what_is_learnt_late_is_part_of_what_is_drawn():
    """A standard normal of which it becomes known, from its own draws, that it is tilted: the tilt moves its mean."""
    slope, given = np.linspace(-0.5, 0.5, SIZE), []
    plain = gaussian(np.eye(SIZE))
    density = lambda z: plain(z) + (z @ slope if given else 0.0)

    def learn(z):
        given.append(z)
        return lambda points: points @ slope

    found = importance(density, [Gaussian.about(np.zeros(SIZE), np.eye(SIZE))], seed=2, learn=learn)
    assert len(given) == 1 and np.abs(given[0].mean(axis=0)).max() < 5 / np.sqrt(ENOUGH)
    assert found.trusted and found.z.mean(axis=0) == pytest.approx(slope, abs=5 / np.sqrt(found.effective_samples))
    np.testing.assert_allclose(found.log_posterior, plain(found.z) + found.z @ slope, rtol=1e-9, atol=1e-9)
