"""What a fit says of its own worth, where the truth is written down: straight models with Gaussian errors."""

import json
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from inverse import noise, prior
from inverse.information import in_words, independent_in_words, information, under_independent_errors
from inverse.likelihood import LIMB
from inverse.map_estimate import Optimum, descend
from inverse.misfit_check import misfit_checks, unexplained
from inverse.summary import other_ends, warnings_of
from tests.test_map_estimate import Straight

LABELS = [*(parameter.name for parameter in prior.ATMOSPHERE), "1.gain", "1.clock"]
COUNT = len(LABELS)
FOUND = {"smooth": 0.1, "chromatic": 0.04, "uneven": 0.1}


def optimum_of(covariance) -> Optimum:
    return Optimum(np.zeros(len(covariance)), 0.0, True, 1, np.linalg.inv(covariance), ())


TWO_PEAKS = replace(
    optimum_of(np.eye(COUNT)),
    rivals=(replace(optimum_of(np.eye(COUNT)), z=np.eye(COUNT)[1], cost=2.0 * np.log(2.0)),),
)


def by_hand():
    """Sd of a quarter and a half of the prior's, tied by 0.6; of 0.8 for the third, tied to a gain of half its prior's.

    Less than the prior's covariance in all directions, as any posterior's is.
    """
    covariance = np.eye(COUNT)
    sd = np.ones(COUNT)
    sd[:3], sd[LIMB] = (0.25, 0.5, 0.8), 0.5
    covariance[0, 1] = covariance[1, 0] = 0.6
    covariance[2, LIMB] = covariance[LIMB, 2] = -0.8
    return covariance * np.outer(sd, sd)


def test_information_of_a_gaussian_written_down():
    said = information(optimum_of(by_hand()), LABELS)
    assert said["degrees_of_freedom"]["limb"] == pytest.approx(15 / 16 + 3 / 4 + 0.36)
    assert said["degrees_of_freedom"]["total"] == pytest.approx(15 / 16 + 3 / 4 + 0.36 + 3 / 4)
    # A bit for each halving of the sd, and what a correlation adds.
    limb = 2 + 1 - np.log2(0.8) - 0.5 * np.log2(1 - 0.36)
    assert said["bits"]["limb"] == pytest.approx(limb)
    assert said["bits"]["total"] == pytest.approx(limb + 1 - 0.5 * np.log2(1 - 0.64))
    first, third = said["parameters"][LABELS[0]], said["parameters"][LABELS[2]]
    assert first["bits"] == pytest.approx(2) and first["informed"] == pytest.approx(15 / 16)
    assert not first["prior_dominated"] and third["prior_dominated"]
    rows = np.asarray(said["averaging_kernel"]["rows"])
    np.testing.assert_allclose(rows, np.eye(LIMB) - by_hand()[:LIMB, :LIMB], atol=1e-12)
    pair, nuisance = (said["correlations"][key][0] for key in ("within_limb", "limb_with_nuisance"))
    assert set(pair["names"]) == set(LABELS[:2]) and pair["coefficient"] == pytest.approx(0.6)
    assert nuisance["names"] == [LABELS[2], "1.gain"] and nuisance["coefficient"] == pytest.approx(-0.8)
    assert json.loads(json.dumps(said)) == said
    assert "fix 2.0 of the" in in_words(said) and "(+0.60)" in in_words(said)


def test_a_photograph_that_says_nothing_leaves_the_prior():
    said = information(optimum_of(np.eye(COUNT)), LABELS)
    assert said["degrees_of_freedom"] == {"total": 0.0, "limb": 0.0} and said["bits"]["total"] == pytest.approx(0)
    assert all(one["prior_dominated"] for one in said["parameters"].values())


@dataclass
class Photograph(Straight):
    """As `Straight`, one photograph, with names and all of its data usable."""

    observed: tuple = ()
    sources: tuple = ()
    parameters: tuple = ()


def photograph(seed=0, count=300, error=1.0, patchy=1.0):
    """Data drawn from the prior and from errors as large as they say, or `error` and `patchy` times as large."""
    random = np.random.default_rng(seed)
    place = np.arange(LIMB, COUNT)
    slopes = random.standard_normal((count, COUNT))
    wave = np.cos(np.pi * np.arange(8) * (np.arange(count)[:, None] + 0.5) / count)
    errors = noise.Errors(np.full((count, 1, 1), 0.25), wave, 6, smooth=1.5, chromatic=1.0)
    drawn = error * 0.5 * random.standard_normal(count) + patchy * (wave * errors.amplitudes) @ random.standard_normal(
        8
    )
    data = slopes @ random.standard_normal(COUNT) + drawn
    gain = (SimpleNamespace(name="gain"), SimpleNamespace(name="clock"))
    parameters = (*prior.ATMOSPHERE, *gain)
    return Photograph(
        [slopes],
        [data],
        [errors],
        places=(place,),
        observed=(SimpleNamespace(measured=np.ones(count)),),
        sources=(SimpleNamespace(on_disc=np.ones(count)),),
        parameters=parameters,
    )


def test_independent_errors_of_the_same_size_are_compared_at_the_same_optimum():
    likelihood = photograph()
    likelihood.slopes[0] = likelihood.slopes[0] * 0.05 + np.linspace(-1, 1, 300)[:, None]  # as smooth as the errors
    optimum = descend(likelihood, np.zeros(COUNT))
    said = under_independent_errors(likelihood, optimum)
    errors = likelihood.errors[0]
    variance = errors.scale**2 + np.sum((errors.modes * errors.amplitudes) ** 2, axis=1)
    slopes = likelihood.slopes[0]
    alone = np.linalg.inv(np.eye(COUNT) + (slopes.T / variance) @ slopes)
    for index, parameter in enumerate(prior.ATMOSPHERE):
        unit = float(parameter.slope(optimum.z[index]))
        one = said[parameter.name]
        assert one["sd_independent"] == pytest.approx(unit * np.sqrt(alone[index, index]), rel=1e-6)
        assert one["sd"] == pytest.approx(unit * np.sqrt(optimum.covariance[index, index]), rel=1e-6)
        assert one["ratio"] == pytest.approx(one["sd"] / one["sd_independent"])
    assert "times as much" in independent_in_words(said)


def checked(**given):
    likelihood = photograph(**given)
    return misfit_checks(likelihood, descend(likelihood, np.zeros(COUNT)))[0]


def test_misfits_of_a_right_model_are_as_large_as_expected():
    """Chi-squared is on the average what it is said to be, and p evenly spread."""
    checks = [checked(seed=seed, count=60) for seed in range(150)]
    for which, tolerance in (("all", 0.04), ("smooth", 0.12), ("broad", 0.12)):
        assert np.mean([one[which]["per_datum"] for one in checks]) == pytest.approx(1.0, abs=tolerance)
        p = np.array([one[which]["p"] for one in checks])
        assert 0.4 < p.mean() < 0.6 and np.mean(p < 0.05) < 0.1
    assert checks[0]["all"]["effective_data"] == pytest.approx(60 - COUNT, abs=1)
    assert sum(one["p"] < 0.01 for one in checks) <= 5


def test_misfits_too_large_are_a_verdict():
    noisy, patchy = checked(error=1.3), checked(patchy=3.0)
    assert noisy["p"] < 1e-3 and patchy["p"] < 1e-3
    assert patchy["smooth"]["per_datum"] > 3 and patchy["smooth"]["effective_data"] <= 8
    noisy_words, patchy_words = (unexplained("a.jpg", FOUND, one) for one in (noisy, patchy))
    assert noisy_words is not None and "the misfits are 1." in noisy_words
    assert patchy_words is not None and ("smooth" in patchy_words or "across the disc" in patchy_words)
    assert unexplained("a.jpg", FOUND, checked()) is None
    assert "one side of it is wrong by 70 %, and" in str(unexplained("a.jpg", {**FOUND, "uneven": 0.7}, checked()))
    assert "it is wrong by 40 % in" in str(
        unexplained("a.jpg", {"smooth": 0.4, "chromatic": 0.04, "uneven": 0.1}, checked())
    )
    assert "colours are wrong by 24 % in" in str(
        unexplained("a.jpg", {"smooth": 0.1, "chromatic": 0.24, "uneven": 0.1}, checked())
    )


def test_a_side_too_dark_is_not_outvoted_by_fine_patterns_less_rough_than_believed():
    likelihood = photograph(count=600)
    wave = np.cos(np.pi * np.arange(1, 201) * (np.arange(600)[:, None] + 0.5) / 600) / np.sqrt(np.arange(1, 201))
    likelihood.errors[0] = noise.Errors(np.full((600, 1, 1), 0.25), wave, 200, smooth=1.0)
    likelihood.data[0] = 0.2 * np.random.default_rng(1).standard_normal(600) + 6.0 * wave[:, 0]
    found = misfit_checks(likelihood, descend(likelihood, np.zeros(COUNT)))[0]
    assert found["all"]["p"] > 0.99 and found["smooth"]["p"] > 0.99 and found["broad"]["p"] < 1e-3
    assert "across the disc are" in str(unexplained("a.jpg", FOUND, found))


def test_verdict_stands_among_the_warnings():
    from tests.test_report import fake_fit

    evidence = [SimpleNamespace(name="a.jpg", remarks=())]
    found = {
        name: replace(estimate, informed=0.9, ci95=(1.0, 2.0), prior_ci95=(0.1, 9.0))
        for name, estimate in fake_fit().estimates.items()
    }
    diagnostics = {
        "converged": True, "errors": [FOUND], "sampler": None, "misfit_checks": [checked()], "not_finite": 0,
        "method": "laplace", "other_ends": [],
    }  # fmt: skip
    assert warnings_of(evidence, found, diagnostics) == []
    [sentence] = warnings_of(evidence, found, {**diagnostics, "misfit_checks": [checked(error=1.3)]})
    assert sentence.startswith("This model cannot explain a.jpg")
    [sentence] = warnings_of(evidence, found, {**diagnostics, "evaluated": 4048, "not_finite": 12})
    assert "at 12 of the 4048 points" in sentence and "taken as zero there" in sentence
    two = {**diagnostics, "other_ends": other_ends(TWO_PEAKS)}
    [sentence] = warnings_of(evidence, found, two)
    assert "another peak, with some 33%" in sentence
    assert warnings_of(evidence, found, {**two, "method": "laplace+psis"}) == []


def test_other_ends_are_told_with_their_mass_and_limb():
    [end] = other_ends(TWO_PEAKS)
    assert end["mass"] == pytest.approx(0.5)
    assert end["air.surface_temperature"] == pytest.approx(285.0 + 12.0)
