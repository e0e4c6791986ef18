"""Diagnostics on chains whose autocorrelation and faults are known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from inverse.diagnostics import LARGEST_R_HAT, LEAST_SAMPLES, autocorrelation_time, diagnose, quality

SHAPE = (2, 1500, 32)  # ensemble, step, walker


def autoregressive(memory, shape=SHAPE, seed=0):
    """Normal deviates x(t) = memory x(t - 1) + noise, of variance 1: autocorrelation time (1 + memory)/(1 - memory)."""
    random = np.random.default_rng(seed)
    noise = np.sqrt(1 - memory**2) * random.standard_normal(shape)
    noise[:, 0] = random.standard_normal((shape[0], shape[2]))
    return np.asarray(lfilter([1.0], [1.0, -memory], noise, axis=1))


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_autocorrelation_time_is_that_of_the_process(memory):
    time = autocorrelation_time(autoregressive(memory)[..., None])
    assert time == pytest.approx([(1 + memory) / (1 - memory)], rel=0.1)


def test_effective_samples_are_the_draws_over_the_autocorrelation_time():
    found = quality(autoregressive(0.8))
    assert found.ess_bulk == pytest.approx(np.prod(SHAPE) / 9.0, rel=0.15)
    assert LEAST_SAMPLES < found.ess_tail and found.r_hat < 1.001


def test_ensembles_that_disagree_are_seen():
    shifted, wider = autoregressive(0.8), autoregressive(0.8)
    shifted[1] += 0.5
    wider[1] *= 1.5  # same median: only the distances from it tell
    drifting = autoregressive(0.8) + np.linspace(0, 1, SHAPE[1])[:, None]
    for values in (shifted, wider, drifting):
        assert quality(values).r_hat > LARGEST_R_HAT
        assert any("R-hat" in words for words in diagnose(values[..., None]).unmet)


def test_walkers_that_are_stuck_lower_the_effective_samples():
    values = autoregressive(0.8)
    values[:, :, :3] = 4.0 + 1e-3 * values[:, :, :3]
    assert quality(values).ess_bulk < 0.05 * quality(autoregressive(0.8)).ess_bulk


def test_every_criterion_is_named_when_it_is_not_met():
    good = np.stack([autoregressive(0.8), autoregressive(0.5, seed=1)], axis=-1)
    diagnosis = diagnose(good)
    assert diagnosis.converged and diagnosis.autocorrelation_time[0] == pytest.approx(9.0, rel=0.1)
    assert 10 <= diagnosis.burn_in <= 25
    short = diagnose(good[:, :150])
    assert any("times long, not 50" in words for words in short.unmet)
    few = diagnose(autoregressive(0.9, (2, 1500, 1), seed=3)[..., None])
    assert any("samples of the middle" in words for words in few.unmet)
    # The second half remembers ten times longer than the first: the time changes while the chain grows.
    slower = np.concatenate([autoregressive(0.0, (2, 1000, 32)), autoregressive(0.9, (2, 1000, 32))], axis=1)
    assert any("last doubling" in words for words in diagnose(slower[..., None]).unmet)


@pytest.mark.parametrize("steps", [1, 5, 20])
def test_a_chain_of_few_steps_or_one_that_never_moved_is_not_believed(steps):
    for z in (autoregressive(0.5, (2, steps, 32))[..., None], np.ones((2, steps, 32, 1))):
        diagnosis = diagnose(z)
        assert not diagnosis.converged and np.all(np.isfinite(diagnosis.autocorrelation_time))
