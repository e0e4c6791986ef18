"""The optimum and its covariance, where both are known: straight models with Gaussian errors."""

from dataclasses import dataclass

import numpy as np
import pytest

from inverse import noise
from inverse.conditional import with_nuisances
from inverse.joint_whitener import joint_whitener
from inverse.likelihood import LIMB
from inverse.map_estimate import descend

COUNT = LIMB + 4  # two photographs of two nuisances each, and one that they share among those
PLACES = (np.array([LIMB, LIMB + 1, LIMB + 2]), np.array([LIMB, LIMB + 3]))


@dataclass
class Straight:
    """As a `Likelihood` whose misfits are data - slopes z, bent by `bend`."""

    slopes: list
    data: list
    errors: list
    bend: float = 0.0
    places: tuple = PLACES

    @property
    def whitener(self):
        return joint_whitener(self.errors)

    def columns(self, number):
        return np.concatenate([np.arange(LIMB), self.places[number]])

    def misfits_and_slopes(self, z):
        found = []
        for number, (slope, data) in enumerate(zip(self.slopes, self.data, strict=True)):
            line = slope @ z[self.columns(number)]
            bent = 1.0 + 2.0 * self.bend * line
            found.append((data - line - self.bend * line**2, -bent[:, None] * slope))
        return found


@pytest.fixture
def likelihood():
    random = np.random.default_rng(0)
    counts = (40, 30)
    slopes = [random.standard_normal((n, LIMB + len(place))) for n, place in zip(counts, PLACES, strict=True)]
    errors = [noise.Errors(random.uniform(0.5, 2.0, (n, 1, 1)) ** 2, random.standard_normal((n, 3)), 2) for n in counts]
    return Straight(slopes, [random.standard_normal(n) for n in counts], errors)


def solved(likelihood, known=()):
    """Normal equations, written out: mean and covariance of what is not `known`."""
    information, right = np.eye(COUNT), np.zeros(COUNT)
    for number, (slope, data, errors) in enumerate(
        zip(likelihood.slopes, likelihood.data, likelihood.errors, strict=True)
    ):
        smooth = errors.modes * errors.amplitudes
        inverse = np.linalg.inv(np.diag(errors.scale**2) + smooth @ smooth.T)
        whole = np.zeros((len(data), COUNT))
        whole[:, likelihood.columns(number)] = slope
        information += whole.T @ inverse @ whole
        right += whole.T @ inverse @ data
    return information, right


def test_optimum_and_covariance_are_those_of_the_normal_equations(likelihood):
    information, right = solved(likelihood)
    for start in (np.zeros(COUNT), np.ones(COUNT)):
        optimum = descend(likelihood, start)
        np.testing.assert_allclose(optimum.z, np.linalg.solve(information, right), atol=1e-4)
        np.testing.assert_allclose(optimum.covariance, np.linalg.inv(information), atol=1e-8)
        assert optimum.converged


def test_what_is_not_free_stays_where_it_is(likelihood):
    information, right = solved(likelihood)
    start, free = np.full(COUNT, 0.3), np.array([0, 4, LIMB + 1])
    optimum = descend(likelihood, start, free=free)
    known = np.setdiff1d(np.arange(COUNT), free)
    assert np.array_equal(optimum.z[known], start[known])
    there = right[free] - information[np.ix_(free, known)] @ start[known]
    np.testing.assert_allclose(optimum.z[free], np.linalg.solve(information[np.ix_(free, free)], there), atol=1e-4)
    assert optimum.information.shape == (COUNT, COUNT)


def test_a_bent_model_ends_where_the_cost_is_least(likelihood):
    likelihood.bend = 0.05
    optimum = descend(likelihood, np.zeros(COUNT))
    random = np.random.default_rng(5)
    for direction in random.standard_normal((20, COUNT)):
        there = descend(likelihood, optimum.z + 0.1 * direction)
        assert there.cost > optimum.cost - 1e-3
    assert optimum.converged


def test_a_start_where_nothing_is_finite_is_no_optimum(likelihood):
    lost = descend(likelihood, np.full(COUNT, np.nan))
    assert np.isinf(lost.cost) and not lost.converged and lost.not_finite == 1
    assert descend(likelihood, np.zeros(COUNT)).not_finite == 0


def test_nuisances_are_drawn_from_their_distribution_under_the_limb(likelihood):
    random = np.random.default_rng(2)
    optimum = descend(likelihood, np.zeros(COUNT))
    limb = optimum.z[:LIMB] + 0.3 * random.standard_normal(LIMB)
    normal = random.standard_normal((4000, COUNT - LIMB))
    z = np.array([with_nuisances(likelihood, optimum, limb, one) for one in normal])
    assert np.all(z[:, :LIMB] == limb)
    information, right = solved(likelihood)
    free = information[LIMB:, LIMB:]
    mean = np.linalg.solve(free, right[LIMB:] - information[LIMB:, :LIMB] @ limb)
    covariance = np.linalg.inv(free)
    scale = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose((z[:, LIMB:].mean(axis=0) - mean) / scale, 0.0, atol=0.08)
    np.testing.assert_allclose(np.cov(z[:, LIMB:].T) / np.outer(scale, scale), covariance / np.outer(scale, scale),
                               atol=0.1)  # fmt: skip
