"""Slopes learnt from steps say of every step what it did, and lead to where the squares are least."""

import numpy as np
import pytest

from inverse.secants import Secants


def test_slopes_say_what_every_step_did():
    random = np.random.default_rng(0)
    slopes, prior = random.standard_normal((40, 5)), np.eye(5)
    learnt = Secants(slopes, prior + slopes.T @ slopes, 3)
    every = np.arange(3)
    for who in (every, every[1:], every[:1]):
        move, changed = random.standard_normal((len(who), 5)), random.standard_normal((len(who), 40))
        learnt.learn(who, move, changed)
        np.testing.assert_allclose(learnt.times(who, move), changed, rtol=1e-9, atol=1e-9)
    whole = np.stack([learnt.times(every, np.tile(unit, (3, 1))) for unit in np.eye(5)], axis=-1)
    np.testing.assert_allclose(learnt.information, prior + np.swapaxes(whole, 1, 2) @ whole, rtol=1e-9, atol=1e-9)
    misfits = random.standard_normal((3, 40))
    np.testing.assert_allclose(
        learnt.transposed(every, misfits), np.einsum("ndp,nd->np", whole, misfits), rtol=1e-9, atol=1e-9
    )
    assert np.linalg.norm(whole[2] - whole[1]) > 1.0  # each search has slopes of its own


@pytest.mark.parametrize("wrong", [0.3, 3.0])
def test_slopes_that_are_wrong_at_first_lead_to_the_least_squares(wrong):
    random = np.random.default_rng(1)
    true, target = random.standard_normal((60, 4)), random.standard_normal(60)
    wanted = np.linalg.solve(np.eye(4) + true.T @ true, true.T @ target)
    first = true * (1.0 + wrong * random.uniform(-0.5, 1.0, 4))
    learnt, who, x = Secants(first, np.eye(4) + first.T @ first, 1), np.zeros(1, dtype=int), np.zeros((1, 4))
    off = []
    for _ in range(12):
        misfits = x @ true.T - target
        move = -learnt.step(who, learnt.transposed(who, misfits) + x)
        learnt.learn(who, move, move @ true.T)
        x = x + move
        off.append(float(np.linalg.norm(x[0] - wanted)))
    assert off[-1] < 1e-6 < 1e-2 * np.linalg.norm(wanted)
