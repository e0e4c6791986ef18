"""What the benchmarks of accuracy and of the series of 2015 make of fits."""

import numpy as np
import pytest

from benchmarks.accuracy import judged
from benchmarks.drawn_photograph import FULL
from benchmarks.drawn_series import draw_series
from benchmarks.series_2015 import floor_of, misfits
from inverse.photo import read_photo
from inverse.result import PhotoFit


def row(truth, median, sd):
    return {name: {"dust.extinction": 1e-4 * value} for name, value in
            {"truth": truth, "median": median, "sd": sd}.items()}  # fmt: skip


def test_errors_and_widths_are_judged_together():
    found = judged([row(0.01, 0.012, 0.001), row(0.01, 0.008, 0.003), {"error": "refused"}], 0.0021)
    assert found["rms error"] == pytest.approx(0.002) and found["mean bias"] == pytest.approx(0.0, abs=1e-12)
    assert found["mean sd"] == pytest.approx(0.002) and found["not fitted"] == 1 and found["inside"]
    assert not judged([row(0.01, 0.0101, 0.004)], 0.002)["inside"]  # right, but it does not know
    assert not judged([row(0.01, 0.02, 0.001)], 0.002)["inside"]


def test_the_floor_is_what_no_smooth_function_of_the_offset_can_take():
    random = np.random.default_rng(0)
    offset = random.uniform(0.0, 0.012, 2000)
    smooth = -8.0 + 500.0 * offset - np.exp(-offset / 3e-3)
    assert np.abs(floor_of(offset, smooth)).max() < 2e-3
    rough = 0.1 * random.standard_normal(2000)
    left = floor_of(offset, smooth + rough)
    assert left.std() == pytest.approx(0.1, rel=0.03) and np.corrcoef(left, rough)[0, 1] > 0.99


def test_cells_of_little_signal_are_left_out_of_a_misfit():
    count = 400
    offset, light = np.linspace(0.0, 0.01, count), np.ones((count, 3))
    sigma = np.where(np.arange(count) < 100, 0.2, 0.05)[:, None] * [1.0, 1.0, 4.0]
    photo = PhotoFit(
        "a.jpg", "2015-09-28T02:00:00Z", None, offset, np.ones(count, dtype=bool), np.ones((count, 3), dtype=bool),
        light, light * [1.0, np.exp(0.2), 1.0], sigma, np.ones(count), light[None],
    )  # fmt: skip
    found = misfits(photo)
    assert set(found) == {"red", "green"} and found["red"]["cells"] == 300
    assert found["red"]["misfit"] == 0.0 and found["green"]["misfit"] == pytest.approx(0.2)
    assert found["green"]["floor"] < 1e-9  # what is the same everywhere is smooth


@pytest.mark.slow
def test_a_series_states_exposures_that_tell_its_light(tmp_path):
    drawn = draw_series(tmp_path, 1, 0, (0.5, FULL), 1e-6)
    eclipsed, full = (read_photo(one.path) for one in drawn)
    assert eclipsed.camera == full.camera and eclipsed.tone_curve == "linear"
    for photo, one in zip((eclipsed, full), drawn, strict=True):
        assert np.quantile(photo.pixels, 0.99) > 0.2
        assert photo.exposure_s == pytest.approx(0.01 * one.sensitivity, rel=1e-3)
    first, second = drawn
    assert first.sensitivity > 300.0 * second.sensitivity  # as the light of the Moon falls
