"""Slopes learnt from steps say of every step what it did, and lead to where the squares are least."""

import numpy as np
from scipy.optimize import least_squares

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


def test_what_was_dark_at_first_is_fitted_in_three_steps():
    """Logs above a floor of light that is brighter by e than where the slopes are from: those would need six."""
    random = np.random.default_rng(1)
    by = np.column_stack([np.ones(60), random.standard_normal((60, 3))])
    light = np.exp(random.uniform(-4.0, 0.0, 60))
    first = 10.0 * (light / (light + 0.1))[:, None] * by

    def log(x):
        return np.log(light * np.exp(x @ by.T) + 0.1)

    target = log(np.array([1.0, 0.2, -0.3, 0.1])) + 0.05 * random.standard_normal(60)

    def rows(x):
        return 10.0 * (log(x) - target)

    least = 2.0 * least_squares(lambda x: np.append(rows(x), x), np.zeros(4), ftol=1e-12, xtol=1e-12).cost

    def too_much(steps, learns):
        slopes, who, x = Secants(first, np.eye(4) + first.T @ first, 1), np.zeros(1, dtype=int), np.zeros((1, 4))
        for _ in range(steps):
            move = -slopes.step(who, slopes.transposed(who, rows(x)) + x)
            if learns:
                slopes.learn(who, move, rows(x + move) - rows(x))
            x = x + move
        return np.sum(rows(x) ** 2) + np.sum(x**2) - least

    assert -1e-9 < too_much(3, True) < 0.05
    assert too_much(3, False) > 1.0 > too_much(6, False)
