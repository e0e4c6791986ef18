"""The posterior of the limb is the joint one with the nuisances integrated out, however many points are asked for."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from inverse.likelihood import LIMB
from inverse.map_estimate import Optimum, descend, quadratic
from inverse.nuisance_guess import FEWEST
from inverse.posterior import BATCH, LimbPosterior, _entries, batched
from inverse.ridge import ALONG, APART, LIKELY, PLACES, ridge

LIMBS = 16


@pytest.fixture(scope="module")
def posterior(likelihood):
    z = np.full(len(likelihood.parameters), 0.1)
    return LimbPosterior(likelihood, Optimum(z, 0.0, True, 1, quadratic(likelihood, z).information, ()))


@pytest.fixture(scope="module")
def optimum(likelihood):
    return descend(likelihood, np.zeros(len(likelihood.parameters)))


def costs(posterior, limbs):
    """Of limbs with their best nuisances, as `Optimum.cost`."""
    return posterior.squares(limbs) + np.sum(limbs**2, axis=1)


def least_costs(likelihood, starts):
    """The same as descents of the nuisances find them, with fresh slopes at every step; `starts`: z of everything."""
    return np.array([descend(likelihood, z, 1e-7, np.arange(LIMB, z.size)).cost for z in starts])


def test_batches_of_any_length_give_what_single_points_give(posterior):
    z = 0.2 * np.random.default_rng(0).standard_normal((BATCH + 5, LIMB))
    together = posterior(z)
    assert together.shape == (BATCH + 5,)
    for index in (0, BATCH, BATCH + 4):
        assert posterior(z[index : index + 1])[0] == pytest.approx(together[index], rel=1e-9)
    assert posterior.evaluated == BATCH + 5 + 3 and posterior.not_finite == 0
    [end] = posterior.ends
    entries = batched(partial(_entries, posterior.likelihood.shadow), z)
    misfits, nuisances = np.split(end.best(z, entries), [-end.slopes.shape[1]], axis=1)
    white = end.likelihood.whitener.white(misfits.T)
    squares = np.sum(white**2, axis=0) + np.sum(nuisances**2, axis=1)
    np.testing.assert_allclose(posterior.squares(z), squares, rtol=1e-9)


def test_a_number_that_is_lost_anywhere_is_lost_in_every_datum(likelihood):
    """Were it taken for darkness on its way, the posterior would be finite, and wrong."""
    usable = np.asarray(likelihood.observed[0].measured) > 0
    for index in range(len(likelihood.parameters)):
        z = np.zeros(len(likelihood.parameters))
        z[index] = np.nan
        assert np.isnan(likelihood.misfits(z)[0][usable]).all(), likelihood.labels[index]


def test_nuisances_are_at_their_best(likelihood, optimum):
    """As a full descent finds them: exact where it counts, and never better."""
    posterior = LimbPosterior(likelihood, optimum)
    factor = np.linalg.cholesky(optimum.covariance[:LIMB, :LIMB])
    limbs = optimum.z[:LIMB] + np.random.default_rng(3).standard_normal((LIMBS, LIMB)) @ factor.T
    exact = least_costs(likelihood, np.concatenate([limbs, optimum.nuisances(limbs)], axis=1))
    worse = costs(posterior, limbs) - exact
    likely = exact < optimum.cost + 20.0
    assert likely.sum() > 8 and worse.min() > -0.1
    assert worse[likely].max() < 1.5 and np.median(worse[likely]) < 0.2


def test_what_other_limbs_tell_finds_nuisances_nearer_to_their_best(likelihood, optimum):
    """In the mean, with fewer steps, and nowhere far from it."""
    random = np.random.default_rng(4)
    limbs = optimum.limb.at(random.standard_normal((48, LIMB)))
    exact = least_costs(likelihood, np.concatenate([limbs, optimum.nuisances(limbs)], axis=1))
    likely = exact < optimum.cost + 20.0
    assert likely.sum() > 32

    def searched(posterior):
        """How much worse than the best, and how many points were tried."""
        [end] = posterior.ends
        tried, rows = [], end._rows
        end._rows = lambda entries, nuisances: tried.append(len(entries)) or rows(entries, nuisances)
        return (costs(posterior, limbs) - exact)[likely], sum(tried)

    told = LimbPosterior(likelihood, optimum)
    told.explore(optimum.limb.at(random.standard_normal((2 * FEWEST, LIMB))))
    (before, more), (after, fewer) = searched(LimbPosterior(likelihood, optimum)), searched(told)
    assert fewer < 0.8 * more and after.mean() < before.mean()
    assert after.min() > -0.1 and after.max() < 1.5


def test_the_ridge_has_the_best_points_under_other_clouds_and_dust(likelihood, optimum):
    """One quantity aside, nothing pulls there, and the posterior has their nuisances where a full descent does."""
    found = ridge(likelihood, optimum)
    names = [parameter.name for parameter in likelihood.parameters]
    for point in found:
        here = quadratic(likelihood, point.z)
        [number] = [names.index(name) for name in ALONG if point.z[names.index(name)] in PLACES]
        free = np.delete(np.arange(optimum.z.size), number)
        gradient, information = here.gradient[free], here.information[np.ix_(free, free)]
        assert gradient @ np.linalg.solve(information, gradient) < 0.5  # of the cost
        assert abs(point.z[number] - optimum.z[number]) > APART
        assert optimum.cost - 0.5 < here.cost < optimum.cost + LIKELY
    assert all(len({point.z[names.index(name)] for point in found} & set(PLACES)) > 1 for name in ALONG)
    limbs, exact = np.array([point.z[:LIMB] for point in found]), least_costs(likelihood, [point.z for point in found])
    known = LimbPosterior(likelihood, replace(optimum, ridge=tuple(found)))
    assert costs(known, limbs) == pytest.approx(exact, abs=0.3)


def test_a_rival_serves_its_own_neighbours(likelihood, optimum):
    """Points between two ends have one density, whichever of them their nuisances are sought from."""
    step = 0.5 * np.sqrt(np.diag(optimum.covariance))
    step[LIMB:] = 0.0
    aside = np.concatenate([optimum.z[:LIMB] + step[:LIMB], optimum.nuisances(optimum.z[:LIMB] + step[:LIMB])])
    rival = replace(optimum, z=aside, information=quadratic(likelihood, aside).information)
    factor = np.linalg.cholesky(optimum.covariance[:LIMB, :LIMB])
    limbs = optimum.z[:LIMB] + 0.7 * np.random.default_rng(5).standard_normal((LIMBS, LIMB)) @ factor.T
    alone, both = LimbPosterior(likelihood, optimum), LimbPosterior(likelihood, replace(optimum, rivals=(rival,)))
    nearest = [np.argmax([end.optimum.limb.log_density(limb[None])[0] for end in both.ends]) for limb in limbs]
    assert set(nearest) >= {0, 1}
    assert both(limbs) == pytest.approx(alone(limbs), abs=0.3)


def test_a_point_without_a_finite_density_is_ruled_out(posterior):
    z = np.zeros((2, LIMB))
    z[1] = np.nan
    before, lost = posterior.evaluated, posterior.not_finite
    value = posterior(z)
    assert np.isfinite(value[0]) and value[1] == -np.inf
    assert not np.isfinite(posterior.squares(z)[1])
    assert (posterior.evaluated - before, posterior.not_finite - lost) == (2, 1)
