"""Nuisances guessed for a limb from others are those that such limbs have."""

import numpy as np
import pytest

from inverse.nuisance_guess import FEWEST, MOST, NEAR, Known

LIMB = 4


def bent(limbs):
    """Two nuisances that a quadric does not follow."""
    return np.stack([np.exp(0.5 * limbs[:, 0]) + limbs[:, 1], np.sin(0.3 * limbs[:, 2]) * limbs[:, 3]], axis=1)


def known(count, seed=0):
    limbs = np.random.default_rng(seed).standard_normal((count, LIMB)) @ np.diag([1.0, 1e-3, 10.0, 1.0]) ** 0.5
    return limbs, bent(limbs), np.zeros(count)


def test_a_guess_follows_what_bends_the_better_the_more_is_known():
    limbs, nuisances, _ = known(200, seed=1)
    misses = []
    for count in (FEWEST, MOST):
        guess = Known.nothing(LIMB, 2).with_more(*known(count)).guess
        assert guess is not None
        misses.append(np.sqrt(np.mean((guess(limbs) - nuisances) ** 2)))
    assert misses[0] < 0.1 and misses[1] < 0.3 * misses[0]


def test_quadrics_are_guessed_to_the_last_digits():
    limbs, _, cost = known(FEWEST)
    quadric = lambda limbs: np.stack([limbs[:, 0] ** 2 - limbs[:, 1], limbs[:, 2] * limbs[:, 3]], axis=1)
    guess = Known(limbs, quadric(limbs), cost).guess
    assert guess is not None
    assert guess(known(50, seed=1)[0]) == pytest.approx(quadric(known(50, seed=1)[0]), abs=1e-6)


def test_nothing_is_guessed_from_too_little():
    assert Known.nothing(LIMB, 2).guess is None
    assert Known.nothing(LIMB, 2).with_more(*known(FEWEST - 1)).guess is None


def test_the_latest_points_near_the_best_are_kept():
    limbs, nuisances, cost = known(MOST + 10)
    cost[-5:] = [NEAR + 1.0, np.nan, np.inf, -1.0, 0.0]
    kept = Known.nothing(LIMB, 2).with_more(limbs, nuisances, cost)
    assert len(kept.limbs) == len(kept.nuisances) == MOST and (kept.cost[-2:] == [-1.0, 0.0]).all()
    assert np.isfinite(kept.cost).all() and (kept.limbs[-3] == limbs[-6]).all()
    better = kept.with_more(limbs[:1], nuisances[:1], np.array([-2.0 * NEAR]))
    assert better.limbs.tolist() == limbs[:1].tolist()
    assert kept.with_more(limbs[:2], nuisances[:2], np.full(2, np.nan)).cost.tolist() == kept.cost.tolist()
