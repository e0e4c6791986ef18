"""A photograph tells how large its errors are, and which of its cells are no Moon."""

from dataclasses import replace

import numpy as np
import pytest

from inverse import error_modes, noise
from inverse.noise_fit import CENTRES, fitted_errors, improbability
from tests.test_noise import bright, disc, sources


@pytest.fixture(scope="module")
def before():
    position, offset = disc(30)
    response = np.broadcast_to(np.eye(3), (len(position), 3, 3))
    modes, _ = error_modes.smooth_modes(position, offset)
    errors = sources(0.05, modes).errors(bright(modes), response)
    apart = np.linalg.norm(position[:, None] - position, axis=-1)
    return errors, np.argsort(apart, axis=1)[:, :9]


def drawn(errors, random):
    smooth = errors.modes * errors.amplitudes
    alone = np.linalg.solve(errors.alone.roots, random.standard_normal((len(errors.cells), 3, 1))).ravel()
    return alone + smooth @ random.standard_normal(smooth.shape[1])


def fitted(before, misfit, slopes=None):
    errors, neighbours = before
    slopes = np.zeros((misfit.size, 1)) if slopes is None else slopes
    return fitted_errors(errors, misfit, slopes, np.ones(misfit.size), neighbours)


@pytest.mark.parametrize(("independent", "smooth", "chromatic"), [(1.3, 0.25, 0.06), (2.0, 0.15, 0.1)])
def test_amplitudes_are_found(before, independent, smooth, chromatic):
    truth = replace(before[0], independent=independent, smooth=smooth, chromatic=chromatic)
    found = [fitted(before, drawn(truth, np.random.default_rng(seed))) for seed in range(3)]
    assert np.mean([one.independent for one in found]) == pytest.approx(independent, rel=0.1)
    assert np.mean([one.smooth for one in found]) == pytest.approx(smooth, rel=0.25)
    assert np.mean([one.chromatic for one in found]) == pytest.approx(chromatic, rel=0.25)


def test_derivatives_of_the_evidence_agree_with_differences():
    random = np.random.default_rng(4)
    kinds = np.repeat([1, 2, 3, 0], [6, 9, 4, 3])
    columns = random.standard_normal((60, kinds.size + 6)) * np.exp(random.uniform(-2.0, 2.0, kinds.size + 6))
    place = CENTRES + random.uniform(-0.5, 0.5, CENTRES.size)
    at = lambda place: improbability(place, columns.T @ columns, kinds, 60)
    differences = [(at(place + step)[0] - at(place - step)[0]) / 2e-5 for step in 1e-5 * np.eye(CENTRES.size)]
    np.testing.assert_allclose(at(place)[1], differences, rtol=1e-6)


def test_an_uneven_limb_is_found_and_no_other_error_takes_it_for_its_own():
    position, offset = disc(30)
    everywhere = np.full(len(position), True)
    known = replace(
        sources(0.05, error_modes.smooth_modes(position, offset)[0]),
        broad=error_modes.broad_modes(position, everywhere),
    ).errors(np.full((len(position), 3), 1e4), np.broadcast_to(np.eye(3), (len(position), 3, 3)))
    around = np.argsort(np.linalg.norm(position[:, None] - position, axis=-1), axis=1)[:, :9]
    found = {}
    for uneven in (0.01, 0.1, 0.3):
        drawn_ones = [drawn(replace(known, uneven=uneven), np.random.default_rng(seed)) for seed in range(4)]
        ends = [fitted((known, around), misfit) for misfit in drawn_ones]
        found[uneven] = np.mean([one.uneven for one in ends])
        assert np.mean([one.smooth for one in ends]) == pytest.approx(noise.COMMON, rel=0.2)
    # What lies below the smooth errors cannot be told from them: it stays between nothing and the prior's middle.
    assert found[0.01] < 0.6 * noise.UNEVEN
    assert found[0.1] == pytest.approx(0.1, rel=0.25) and found[0.3] == pytest.approx(0.3, rel=0.2)


def test_what_the_model_took_away_is_not_taken_for_a_small_error(before):
    """Eighty free directions hide a part of the errors from the misfit; the evidence knows how many there were."""
    random = np.random.default_rng(3)
    errors = replace(before[0], smooth=2 * noise.COMMON)
    misfit, slopes = drawn(errors, random), 30.0 * errors.modes[:, :80] / errors.modes[:, :80].std(axis=0)
    white, by = errors.whitener(misfit), errors.whitener(slopes)
    best = np.linalg.lstsq(by, white, rcond=None)[0]
    left = fitted(before, misfit - slopes @ best, slopes)
    naive = fitted(before, misfit - slopes @ best)
    assert naive.smooth < 0.9 * left.smooth
    assert left.smooth == pytest.approx(2 * noise.COMMON, rel=0.35)


def test_a_star_loses_its_weight_and_nothing_else_does(before):
    misfit = drawn(before[0], np.random.default_rng(4))
    misfit[300] += 1.0  # twenty times the error
    found = fitted(before, misfit)
    outlying = np.asarray(found.outlying)
    assert outlying[300] > 30.0
    assert np.median(outlying) == pytest.approx(1.0, abs=0.2)
    assert found.independent == pytest.approx(1.0, rel=0.15)


def test_errors_are_never_smaller_than_was_thought(before):
    found = fitted(before, np.zeros(before[0].sigma.size))
    assert (found.independent, found.smooth, found.chromatic) == pytest.approx(
        (1.0, noise.COMMON, noise.CHROMATIC), rel=0.02
    )
