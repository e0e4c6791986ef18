"""What the panel of misfits does to photographs, and how it judges their fits."""

import numpy as np
import pytest

from benchmarks.calibration import accuracy
from benchmarks.drawn_photograph import SHAPE, Wrong
from benchmarks.misfits import WAYS, judged
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.limb_sectors import is_lopsided

RADIUS = 140.0
RIGHT = SHAPE[1] // 2 + int(RADIUS)  # a radius to the right of the picture's middle


def test_nothing_is_wrong_by_default():
    light = np.random.default_rng(0).random((*SHAPE, 3))
    limb = Atmosphere.typical()
    assert Wrong().limb(limb) is limb
    np.testing.assert_array_equal(Wrong().light(light, RADIUS), light)
    np.testing.assert_array_equal(Wrong().curve(light), light)


def test_light_and_curve_are_wrong_by_what_is_said():
    even = np.ones((*SHAPE, 3))
    dark = Wrong(vignetting=0.1).light(even, RADIUS)
    assert dark[SHAPE[0] // 2, RIGHT] == pytest.approx(0.9, abs=1e-3) and dark.max() == pytest.approx(1.0, abs=1e-6)
    disc = np.zeros((*SHAPE, 3))
    rows, columns = np.indices(SHAPE)
    disc[np.hypot(rows - SHAPE[0] / 2, columns - SHAPE[1] / 2) < RADIUS] = 1.0
    glow = Wrong(glow=0.005).light(disc, RADIUS) - disc
    assert glow.mean() == pytest.approx(0.005, rel=0.01)
    assert glow[:, 0].max() < 1e-4 and glow[:, -1].min() == pytest.approx(0.01, rel=0.02)
    value = np.geomspace(1e-3, 1.0, 1000)
    swing = Wrong(tone=0.05).curve(value) / value - 1.0
    assert swing.max() == pytest.approx(0.05, rel=0.01) and swing.min() == pytest.approx(-0.05, rel=0.01)


def test_the_limb_is_another():
    assert is_lopsided(Wrong(clouds=13e3).limb(Atmosphere.typical()))
    tropical, arctic = (Wrong(air=name).limb(Atmosphere.typical()) for name in ("tropical", "subarctic_winter"))
    ground = [float(limb.air.temperature(0.0)) for limb in (tropical, arctic)]
    assert ground == pytest.approx([299.7, 257.2], abs=0.5)
    assert all(Wrong(**wrong) != Wrong() for wrong in WAYS.values())


def row(truth, median, rank):
    one = {"truth": truth, "median": median, "sd": 0.002}
    return {**{name: {"dust.extinction": 1e-4 * value} for name, value in one.items()},
            "rank": {"dust.extinction": rank}, "p": 0.5}  # fmt: skip


def test_a_bias_and_missed_truths_are_told():
    clean = [row(0.01, 0.012, 0.4) for _ in range(10)]
    same = judged(clean, clean)
    assert same["bias"] == 0.0 and same["coverage of 95 %"] == 1.0 and same["inside"]
    shifted = judged([row(0.01, 0.016, 0.1) for _ in range(10)], clean)
    assert shifted["bias"] == pytest.approx(0.004) and not shifted["inside"]
    missed = judged([row(0.01, 0.012, 0.99 if n < 2 else 0.4) for n in range(10)], clean)
    assert missed["coverage of 95 %"] == pytest.approx(0.8) and not missed["inside"]
    lost = judged([{"error": "refused"}, *clean[1:]], clean)
    assert lost["not fitted"] == 1 and lost["inside"]


def test_errors_of_optical_depths_in_a_range():
    found = accuracy([row(0.01, 0.013, 0.4), row(0.01, 0.006, 0.4), row(0.3, 0.1, 0.4)], 0.005, 0.02)
    assert found["photographs"] == 2 and found["mean sd"] == pytest.approx(0.002)
    assert found["rms error"] == pytest.approx(np.sqrt(0.5 * (0.003**2 + 0.004**2)))
    assert accuracy([], 0.0, 1.0) == {"photographs": 0}
