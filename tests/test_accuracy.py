"""What the benchmarks of accuracy and of the series of 2015 make of fits."""

import numpy as np
import pytest

from benchmarks import at_truth
from benchmarks.accuracy import judged
from benchmarks.drawn_errors import DrawnErrors, Located, Smooth, at, field, rough
from benchmarks.drawn_photograph import FULL
from benchmarks.drawn_series import draw_series
from benchmarks.series_2015 import part_of, told
from benchmarks.shared_misfits import SQUARE, Seen, beside_offset, beside_shadow, by_place, rms, variances
from inverse import error_modes
from inverse.cells import CELLS_PER_RADIUS
from inverse.error_modes import MOON
from inverse.photo import read_photo
from inverse.result import PhotoFit


def test_drawn_errors_change_from_cell_to_cell_as_fits_think():
    """Smooth ones, in 24 photographs: a fit that thought twice of it had temperatures that were too vague."""
    rows, columns = np.indices((240, 240))
    right, up = (columns - 120.3) / 145.0, (119.6 - rows) / 145.0
    shadow = MOON * right + 2e-3, MOON * up - 3e-3
    square = np.floor(np.stack([up, right]) * CELLS_PER_RADIUS).astype(int) + CELLS_PER_RADIUS // 2
    inside = ((square >= 0) & (square < CELLS_PER_RADIUS)).all(axis=0)

    def means(values):
        found = np.zeros((2, CELLS_PER_RADIUS, CELLS_PER_RADIUS))
        np.add.at(found[0], tuple(square[:, inside]), values[inside])
        np.add.at(found[1], tuple(square[:, inside]), 1.0)
        return found[0] / found[1]

    located = Located(right, up, right, up, shadow)
    drawn = np.array([means(Smooth(np.random.default_rng(seed))(located)) for seed in range(24)])
    away, offset = np.stack([means(right), means(up)]), means(np.hypot(*shadow))
    correlation = lambda apart, farther: 0.5 * (error_modes.over_disc(apart) + error_modes.over_rings(farther))
    for cells in (1, 4):
        change = np.square(drawn[..., cells:] - drawn[..., :-cells]).mean()
        apart = np.linalg.norm(away[..., cells:] - away[..., :-cells], axis=0)
        thought = correlation(0.0, 0.0) - correlation(apart, np.abs(offset[:, cells:] - offset[:, :-cells]))
        assert 0.5 * change == pytest.approx(thought.mean(), rel=0.12)


def row(truth, median, sd):
    return {name: {"dust.extinction": 1e-4 * value} for name, value in
            {"truth": truth, "median": median, "sd": sd}.items()}  # fmt: skip


def test_errors_and_widths_are_judged_together():
    found = judged([row(0.01, 0.012, 0.001), row(0.01, 0.008, 0.003), {"error": "refused"}], 0.0021)
    assert found["rms error"] == pytest.approx(0.002) and found["mean bias"] == pytest.approx(0.0, abs=1e-12)
    assert found["mean sd"] == pytest.approx(0.002) and found["not fitted"] == 1 and found["inside"]
    assert not judged([row(0.01, 0.0101, 0.004)], 0.002)["inside"]  # right, but it does not know
    assert not judged([row(0.01, 0.02, 0.001)], 0.002)["inside"]


def test_steps_from_the_truth_are_standard_where_the_model_is_right():
    random = np.random.default_rng(0)
    slopes = random.standard_normal((40, 3)) * [0.05, 0.3, 2.0]  # told by the prior, by both, by the data

    def drawn(wrong):
        misfits, z = random.standard_normal((40, 4000)) + wrong[:, None], random.standard_normal((3, 4000))
        return np.array([at_truth.steps(*pair) for pair in zip(misfits.T, [slopes] * 4000, z.T, strict=True)])

    right = drawn(np.zeros(40))
    assert right.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.06)
    assert right.std(axis=0) == pytest.approx(np.ones(3), abs=0.05)
    # Data that a model with its last parameter 0.5 higher would explain, and their errors: so far it is off, if known.
    off = drawn(-0.5 * slopes[:, 2])
    known = np.sqrt(np.sum(slopes[:, 2] ** 2))
    assert off.mean(axis=0)[2] == pytest.approx(0.5 * known, rel=0.1) and abs(off.mean(axis=0)[0]) < 0.1


def test_the_floor_is_what_no_smooth_function_of_the_offset_can_take():
    random = np.random.default_rng(0)
    offset = random.uniform(0.0, 0.012, 2000)
    smooth = -8.0 + 500.0 * offset - np.exp(-offset / 3e-3)
    assert np.abs(beside_offset(offset, smooth)).max() < 2e-3
    rough = 0.1 * random.standard_normal(2000)
    left = beside_offset(offset, smooth + rough)
    assert left.std() == pytest.approx(0.1, rel=0.03) and np.corrcoef(left, rough)[0, 1] > 0.99


def disc_in_shadow(centre, light):
    """Cells of a disc whose centre lies in the shadow [rad]; `light`: of places in the shadow."""
    line = np.arange(-0.95, 0.96, 0.1)
    moon = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    moon = moon[np.hypot(*moon.T) < 0.95]
    shadow = MOON * moon + np.array(centre)
    return Seen(shadow, moon, light(shadow, moon))


CENTRES = ((7e-3, 2e-3), (6e-3, -1e-3), (4e-3, 3e-3), (3e-3, 5e-3))


def test_an_uneven_limb_is_a_function_of_the_place_in_the_shadow():
    def light(shadow, moon):
        angle, offset = np.arctan2(*shadow.T), np.linalg.norm(shadow, axis=1)
        return 400.0 * offset + 0.4 * np.sin(3.0 * angle) * offset / 8e-3

    each = [disc_in_shadow(centre, light) for centre in CENTRES]
    even = rms(np.concatenate([beside_offset(one.offset, one.log_light) for one in each]))
    assert even > 0.08 and rms(beside_shadow(each)) < 0.15 * even
    noisy = [
        Seen(one.shadow, one.moon, one.log_light + 0.1 * np.random.default_rng(i).standard_normal(len(one.moon)))
        for i, one in enumerate(each)
    ]
    assert rms(beside_shadow(noisy)) == pytest.approx(0.1, rel=0.1)


def test_misfits_by_place_are_those_of_the_shadow_and_spread_by_the_moons_own():
    slope, own = 30.0, 0.05
    each = [disc_in_shadow(centre, lambda shadow, moon: slope * shadow[:, 0] + own * moon[:, 1]) for centre in CENTRES]
    squares = by_place(each)
    east, north, mean, spread = (
        np.array([one[name] for one in squares]) for name in ("east", "north", "mean", "spread")
    )
    assert len(squares) > 50 and min(one["cells"] for one in squares) >= 8
    limb = slope * np.radians(east / 60.0)
    # Squares half full are off by a quarter of one; the Moon's own has any value up to its amplitude.
    assert np.all(np.abs(mean - limb) < slope * np.radians(SQUARE / 60.0) / 4 + own)
    assert np.corrcoef(mean, limb)[0, 1] > 0.9
    even = by_place([disc_in_shadow(centre, lambda shadow, moon: slope * shadow[:, 0]) for centre in CENTRES])
    assert np.median(spread) > 3.0 * np.median([one["spread"] for one in even])


def test_variances_are_told_apart_by_place():
    """Of fields drawn over the shadow and over the Moon, mean of several."""
    found = []
    for seed in range(64):
        random = np.random.default_rng(seed)
        limb, relief = field(random, rough), field(random, rough)

        def light(shadow, moon, limb=limb, relief=relief):
            return 0.3 * at(limb, *(shadow.T / MOON)) + 0.2 * at(relief, *moon.T)

        found.append(variances([disc_in_shadow(centre, light) for centre in CENTRES]))
    assert np.mean([one["between"]["shadow"] for one in found]) == pytest.approx(0.09, rel=0.3)
    assert np.mean([one["between"]["moon"] for one in found]) == pytest.approx(0.04, abs=0.02)
    assert np.mean([one["within"]["all"] for one in found]) == pytest.approx(0.13, rel=0.25)


def test_cells_of_little_signal_are_left_out_of_a_misfit():
    count = 400
    offset, light = np.linspace(1e-4, 0.01, count), np.ones((count, 3))
    sigma = np.where(np.arange(count) < 100, 0.2, 0.05)[:, None] * [1.0, 1.0, 4.0]
    photo = PhotoFit(
        "a.jpg", "2015-09-28T02:00:00Z", None, offset, np.ones(count, dtype=bool), np.ones((count, 3), dtype=bool),
        light, light * [1.0, np.exp(0.2), 1.0], sigma, np.ones(count), light[None],
        shadow=np.stack([offset, np.zeros(count)], axis=1), shared=light * [0.0, -0.15, 0.0],
    )  # fmt: skip
    assert part_of(photo, 2) is None
    red, green = part_of(photo, 0), part_of(photo, 1)
    assert red is not None and green is not None
    assert told([red])["cells"] == 300 and told([red])["misfit"] == 0.0
    assert told([green])["misfit"] == pytest.approx(0.2) and told([green])["uneven misfit"] == pytest.approx(0.05)
    assert told([green])["floor"] < 1e-9  # what is the same everywhere is smooth


def test_errors_of_a_series_are_the_same_at_the_same_place_but_for_each_one_s_own():
    """Drawn for two photographs of the same moment, and for one of another: within a quarter of what is stated."""
    together, apart, alone = [], [], []
    row, column = np.indices((60, 60)) / 30.0 - 1.0
    for seed in range(12):
        random = np.random.default_rng(seed)
        errors = DrawnErrors(random)
        size = errors.common**2 + errors.uneven**2

        def of(shift, errors=errors, random=random):
            shadow = (MOON * column + shift, MOON * row)
            return errors.of(random, Located(column, row, column, row, shadow)).mean(axis=-1)

        first, second, third = of(8e-3), of(8e-3), of(40e-3)
        alone.append(np.mean(first**2) / size)
        together.append(np.mean(first * second) / size)
        apart.append(np.mean(first * third) / size)
    assert np.mean(together) > 0.6 * np.mean(alone) and abs(np.mean(apart)) < 0.35 * np.mean(alone)


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
