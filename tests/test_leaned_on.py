"""Errors that photographs share are held by modes where estimates lean on them."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from eclipsejax.ephemeris import geometry
from inverse.assumed_camera import response
from inverse.evidence import gather, prepare
from inverse.leaned_on import weights_of_light
from inverse.likelihood import LIMB
from inverse.map_estimate import quadratic
from inverse.shared_errors import SHARED, covariance, more_modes, places_of, shared_modes
from tests import synthetic
from tests.test_shared_errors import centred, of_disc, places

MINUTES = (0, 12, 24, 36, 48, 60)  # to the end of totality


def between(one, other):
    return SHARED * centred(covariance(of_disc(one), of_disc(other)))


def test_sums_of_errors_have_their_whole_variance():
    where = [places(), places((5e-3, -3e-3)), places((-2e-3, 4e-3))]
    random = np.random.default_rng(0)
    patterns = [random.standard_normal((len(one.disc), 5)) for one in where]
    twice = [pattern[:, [0, 1, 2, 3, 4, 2]] for pattern in patterns]
    known = shared_modes(where)
    found = more_modes(where, known, twice)
    assert [one.shape[1] for one in found] == [known[0].shape[1] + 5] * 3  # a pattern that is there twice is one
    on_disc = [pattern[one.on_disc] for one, pattern in zip(where, patterns, strict=True)]
    whole = sum(
        a.T @ between(one, other) @ b
        for one, a in zip(where, on_disc, strict=True)
        for other, b in zip(where, on_disc, strict=True)
    )
    held = np.sum([modes[one.on_disc].T @ a for one, modes, a in zip(where, found, on_disc, strict=True)], axis=0)
    np.testing.assert_allclose(held.T @ held, whole, rtol=1e-6, atol=1e-6 * np.trace(whole))
    for one, modes, before in zip(where, found, known, strict=True):
        assert np.array_equal(modes[:, : before.shape[1]], before) and not modes[~one.on_disc].any()
        np.testing.assert_allclose(modes[one.on_disc].mean(axis=0), 0.0, atol=1e-9)


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    """The likelihood of one synthetic photograph, taken for one of each of several times, and what answers to light."""
    path = synthetic.photograph(tmp_path_factory.mktemp("leaned_on") / "eclipse.jpg", synthetic.limb())
    (one,) = gather([path], time=synthetic.UTC, site=synthetic.SITE, disc=None, progress=lambda *_: None)
    at = np.datetime64(synthetic.UTC.rstrip("Z"))
    times = [f"{at + np.timedelta64(minute, 'm')}Z" for minute in MINUTES]
    likelihood = prepare([replace(one, where=geometry(time, *synthetic.SITE)) for time in times])
    assert one.cells is not None
    return likelihood, [response(model, one.cells.value) for model in likelihood.models]


@pytest.mark.parametrize("amplitudes", [(0.1, 0.04, 0.1), (0.3, 0.06, 0.5)])
def test_estimates_of_a_series_stray_no_farther_than_they_say(series, amplitudes):
    """What they do by whole kernels between photographs, against what they think of modes.

    The largest modes alone make them stray 1.05 and 1.13 times as far. Of smooth errors, those of single channels and
    those of an uneven limb.
    """
    likelihood, responses = series
    sizes = dict(zip(("smooth", "chromatic", "uneven"), amplitudes, strict=True))
    likelihood = likelihood.with_errors([replace(one, **sizes) for one in likelihood.errors])
    information = quadratic(likelihood, np.zeros(len(likelihood.parameters))).information
    spread = np.linalg.inv(information)
    claimed = np.diag(spread @ (information - np.eye(len(spread))) @ spread)[:LIMB]
    where = [places_of(model) for model in likelihood.models]
    weights = [one.reshape(len(one), 3, LIMB)[place.on_disc]
               for one, place in zip(weights_of_light(likelihood, responses), where, strict=True)]  # fmt: skip
    modes = [one.smooth[place.on_disc][:, -one.shared :] for one, place in zip(likelihood.sources, where, strict=True)]
    missed = np.zeros(LIMB)
    for one, other in combinations(range(len(where)), 2):
        missing = between(where[one], where[other]) - modes[one] @ modes[other].T
        together = np.einsum("ie,ij,je->e", weights[one].sum(axis=1), missing, weights[other].sum(axis=1))
        each = np.einsum("ice,ij,jce->e", weights[one], missing, weights[other])
        missed += 2.0 * (sizes["smooth"] ** 2 * together + sizes["chromatic"] ** 2 * each)
    ratio = np.sqrt(1.0 + missed / claimed)
    assert ratio.max() < 1.01 and ratio.min() > 0.85
