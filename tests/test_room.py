"""The room that nuisances have makes of a density of their best values the marginal of the limb."""

from functools import partial

import numpy as np
import pytest
from scipy.special import logsumexp

from inverse.importance import importance
from inverse.likelihood import LIMB
from inverse.map_estimate import descend, quadratic
from inverse.posterior import LEARNT, LimbPosterior, _entries, batched
from inverse.room import Room, log_volume

LIMBS, DRAWS, STRETCH = 8, 600, 1.1


def test_a_straight_log_volume_is_found():
    random = np.random.default_rng(0)
    z, slope = 0.3 * random.standard_normal((96, LIMB)), random.standard_normal(LIMB)
    room = Room.through(z, 7.0 + z @ slope + 0.2 * random.standard_normal(96))
    assert room.slope == pytest.approx(slope, abs=4 * 0.2 / np.sqrt(96 * 0.09))
    assert room(z).mean() == pytest.approx(0.0, abs=1e-12)


def test_nothing_is_made_of_chance():
    """Where draws lie in a heap, a slope through their scatter would reach far beyond them."""
    random = np.random.default_rng(1)
    z = 0.01 * random.standard_normal((96, LIMB))
    assert np.abs(Room.through(z, 0.1 * random.standard_normal(96)).slope).max() < 0.5


def log_marginal(likelihood, about, z, normal):
    """Of the joint density at a limb and its best nuisances z, integrated over nuisances by importance sampling."""
    at = quadratic(likelihood, z)
    root = np.linalg.cholesky(at.information[LIMB:, LIMB:])
    moved = z[LIMB:] + STRETCH * normal @ np.linalg.inv(root)
    entries = batched(partial(_entries, likelihood.shadow), z[None, :LIMB])
    rows = about._rows(np.repeat(entries, len(moved), axis=0), moved)
    cost = rows**2 @ about.signs + z[:LIMB] @ z[:LIMB]
    return -np.sum(np.log(np.diag(root))) + logsumexp(-0.5 * cost + 0.5 * np.sum(normal**2, axis=1))


def test_the_limbs_density_is_the_marginal_of_all(likelihood):
    """Of draws of the posterior, the nuisances have as much more room in one as the marginals differ more."""
    optimum = descend(likelihood, np.zeros(len(likelihood.parameters)))
    density = LimbPosterior(likelihood, optimum)
    drawn = importance(density, [optimum.limb], seed=0).z
    room = density.learn(drawn)
    learnt = {tuple(one) for one in drawn[:LEARNT]}
    z = np.array([one for one in np.unique(drawn, axis=0) if tuple(one) not in learnt])  # heavy ones occur many times
    order = np.argsort(room(z))
    z = z[np.concatenate([order[:LIMBS], order[-LIMBS:]])]  # where there is least, and most
    size, nuisances = optimum.z.size, np.arange(LIMB, optimum.z.size)
    best = [descend(likelihood, np.concatenate([one, optimum.nuisances(one)]), 1e-7, nuisances).z for one in z]
    half = np.random.default_rng(0).standard_normal((DRAWS // 2, size - LIMB))
    normal = np.concatenate([half, -half])
    exact = np.array([log_marginal(likelihood, density.ends[0], one, normal) for one in best])
    profile = np.array([-0.5 * quadratic(likelihood, one).cost for one in best])
    volume = np.array([log_volume(likelihood, one) for one in best])
    missed = exact - profile
    assert np.std(missed) > 0.5 and np.std(missed - volume) < 0.4 * np.std(missed)
    steps = [np.mean(values[LIMBS:]) - np.mean(values[:LIMBS]) for values in (missed, room(z))]
    assert steps[0] > 0.5 and steps[1] == pytest.approx(steps[0], rel=0.5)
