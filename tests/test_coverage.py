"""Bands hold what a right posterior does, and not what a narrow one does."""

import numpy as np
import pytest

from benchmarks.coverage import CONFIDENCE, coverage, least_tail, smallest_tail


def test_the_band_of_one_test_is_the_binomial_one():
    # 63.8-72.0 % and 93.0-96.8 % at 500 photographs.
    ranks = np.random.default_rng(0).uniform(size=500)
    for level, low, high in ((0.68, 0.638, 0.720), (0.95, 0.930, 0.968)):
        found = coverage(ranks, level, tests=1)
        assert (found.low, found.high) == pytest.approx((low, high), abs=1.1e-3)
    assert coverage(ranks, 0.68, tests=10).low < 0.63


def test_right_posteriors_stay_inside_as_often_as_is_said():
    inside = smallest_tail(np.random.default_rng(1).uniform(size=(2000, 100))) >= least_tail(100, tests=1)
    assert np.mean(inside) == pytest.approx(CONFIDENCE, abs=0.02)


@pytest.mark.parametrize("wrong", ["narrow", "biased"])
def test_wrong_posteriors_leave_the_bands(wrong):
    random = np.random.default_rng(2)
    normal = random.standard_normal(500)
    ranks = 0.5 * (1.0 + np.tanh(1.3 * normal)) if wrong == "narrow" else random.uniform(size=500) ** 1.4
    assert smallest_tail(ranks[None])[0] < least_tail(500, tests=5)
    if wrong == "narrow":
        assert not coverage(ranks, 0.95, tests=10).inside
