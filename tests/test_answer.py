"""The cheapest way that can be trusted is the one that answers, and an answer says which it was."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any

import numpy as np
import pytest

from eclipsejax.errors import InputError
from inverse import answer as module
from inverse import prior
from inverse.answer import answer, beginning, begun, by_ensemble, identity
from inverse.diagnostics import LEAST_SAMPLES
from inverse.map_estimate import Optimum
from inverse.noise import Errors
from inverse.nuisance_guess import Known
from inverse.posterior import LimbPosterior
from inverse.room import Room
from tests.targets import draws_of, gaussian

SIZE = len(prior.ATMOSPHERE)


@dataclass
class Plain:
    """A log density that counts nothing."""

    density: Callable
    ends: Any = ()
    evaluated: int = 0
    not_finite: int = 0

    def __call__(self, z):
        return self.density(z)

    explore = __call__

    def learn(self, z):
        """There are no nuisances."""
        return Room.everywhere_alike()


@pytest.fixture
def asked(monkeypatch):
    """`answer` for a posterior that is a density of our choice, about an optimum of our choice."""

    def ask(density, z, covariance, draws=None, before=None, ridge=(), rivals=()):
        kept = []
        density = density if isinstance(density, LimbPosterior) else Plain(density)
        monkeypatch.setattr(module, "LimbPosterior", lambda likelihood, optimum: density)
        information = np.linalg.inv(covariance)
        optimum = Optimum(np.asarray(z), 1.0, True, 3, information, (1.0, 2.0))
        ends = lambda places: tuple(replace(optimum, z=point, cost=optimum.cost + above) for point, above in places)
        optimum = replace(optimum, ridge=ends(ridge), rivals=ends(rivals))
        nothing: Any = None
        found = answer(nothing, optimum, draws=draws, seed=1, before=before, keep=kept.append, progress=lambda *_: None)
        assert json.dumps(found.report, allow_nan=False)
        return found, kept

    return ask


COVARIANCE = 0.04 * np.eye(SIZE)
DUSTY = np.array([1.0, *np.zeros(SIZE - 1)])


def about(z, covariance):
    density = gaussian(covariance)
    return lambda points: density(points - z)


def test_a_posterior_like_its_gaussian_is_answered_at_once(asked):
    found, kept = asked(about(DUSTY, 1.1 * COVARIANCE), DUSTY, COVARIANCE)
    assert found.method == found.report["method"] == "laplace+psis" and not kept
    assert found.report["psis"]["k_hat"] < 0.7 and found.report["sampler"] is None
    assert np.var(found.z, axis=(0, 1)) == pytest.approx(np.full(SIZE, 0.044), rel=0.2)


@pytest.mark.parametrize("k_hat, leaps", [(0.9, True), (1.1, False)])
def test_a_posterior_unlike_its_gaussian_is_sampled(asked, monkeypatch, k_hat, leaps):
    """With leaps to draws like the weighed ones, where these can be thought to follow it."""
    monkeypatch.setattr(module, "MOST_DRAWS", 512_000)  # the autocorrelation time may be slow to settle
    weighed, sample, proposals = module.importance, module.sample, []

    def sampled(*given, proposal, **more):
        proposals.append(proposal)
        return sample(*given, proposal=proposal, **more)

    monkeypatch.setattr(module, "sample", sampled)
    monkeypatch.setattr(module, "importance", lambda *given, **more: replace(weighed(*given, **more), k_hat=k_hat))
    found, kept = asked(about(DUSTY, 9.0 * COVARIANCE), DUSTY, COVARIANCE)
    assert found.method == "emcee" and kept[-1].steps == found.report["sampler"]["steps"]
    assert found.report["psis"]["k_hat"] > 0.7 or found.report["psis"]["effective_samples"] < LEAST_SAMPLES
    assert found.report["sampler"]["converged"] and found.report["sampler"]["unmet"] == []
    assert [proposal is not None for proposal in proposals] == [leaps]
    assert np.var(found.z, axis=(0, 1)) == pytest.approx(np.full(SIZE, 0.36), rel=0.15)


@pytest.mark.parametrize("above, share", [(0.0, 0.5), (20.0, 0.0)])
def test_what_lies_along_the_ridge_is_drawn_from_as_far_as_it_is_likely(asked, above, share):
    """A place that Laplace's Gaussian of the optimum knows nothing of, as likely as all of what that knows."""
    there = DUSTY + np.array([0.0, 0.0, 0.0, -4.0, 3.0, *np.zeros(SIZE - 5)])
    here, apart = about(DUSTY, COVARIANCE), about(there, COVARIANCE)
    found, _ = asked(lambda z: np.logaddexp(here(z), apart(z)), DUSTY, COVARIANCE, ridge=[(there, above)])
    assert found.method == "laplace+psis"
    assert np.mean(found.z[..., 3] < -2.0) == pytest.approx(share, abs=0.05)


def test_draws_asked_for_are_sampled(asked):
    found, _ = asked(about(DUSTY, COVARIANCE), DUSTY, COVARIANCE, draws=draws_of(10, SIZE))
    assert found.method == "emcee" and found.report["psis"]["k_hat"] < 0.7
    assert found.report["sampler"]["steps"] == 10 and not found.report["sampler"]["converged"]


def test_no_draws_are_laplaces(asked):
    found, _ = asked(about(DUSTY, COVARIANCE), DUSTY, COVARIANCE, draws=0)
    assert found.method == "laplace" and found.log_posterior is None and found.report["psis"] is None
    assert np.abs(found.z - DUSTY).max() < 2.0


def test_without_draws_every_peak_has_its_share(asked):
    """A rival as narrow as the optimum, with a third of its probability."""
    there = DUSTY + 4.0
    found, _ = asked(about(DUSTY, COVARIANCE), DUSTY, COVARIANCE, draws=0, rivals=[(there, 2.0 * np.log(3.0))])
    assert np.mean(found.z[..., 1] > 2.0) == pytest.approx(0.25, abs=0.06)


class Holed(LimbPosterior):
    """Of straight misfits that make a Gaussian about `DUSTY`; no numbers where the second parameter is above a wall."""

    def __init__(self, wall):
        self.evaluated = self.not_finite = 0
        self.counting, self.wall = Lock(), wall
        self.sizes, self.room = self, Room.everywhere_alike()
        self.known = Known.nothing(SIZE, 0)

    def learn(self, z):
        return Room.everywhere_alike()

    def log_density(self, z, squares):
        return -0.5 * (squares + np.sum(z**2, axis=1))

    def _at_best(self, z):
        squares = (1 / 0.04 - 1) * np.sum((z - DUSTY / (1 - 0.04)) ** 2, axis=1)
        return np.where(z[:, 1] > self.wall, np.nan, squares), np.zeros((len(z), 0))


@pytest.mark.parametrize("draws, method", [(None, "laplace+psis"), (draws_of(10, SIZE), "emcee")])
def test_points_that_are_no_numbers_are_counted_and_none_of_the_draws(asked, draws, method):
    whole, _ = asked(Holed(np.inf), DUSTY, COVARIANCE, draws=draws)
    assert whole.report["not_finite"] == 0 and whole.z[..., 1].max() > 0.3
    assert whole.report["evaluated"] >= (draws or 2000)
    holed, _ = asked(Holed(0.3), DUSTY, COVARIANCE, draws=draws)  # 1.5 standard deviations: 7 %
    told = holed.report
    assert holed.method == told["method"] == method and holed.z[..., 1].max() <= 0.3
    assert 0.02 < told["not_finite"] / told["evaluated"] < 0.25  # a share of the proposals is wider than that


def test_a_chain_that_goes_on_counts_its_own_points(asked):
    found, _ = asked(Holed(0.3), DUSTY, COVARIANCE, draws=draws_of(20, SIZE))
    longer, _ = asked(Holed(0.3), DUSTY, COVARIANCE, draws=draws_of(30, SIZE), before=found.chain)
    assert draws_of(10, SIZE) <= longer.report["evaluated"] < found.report["evaluated"]


def test_a_chain_goes_on_only_under_the_density_it_was_drawn_from(asked):
    found, _ = asked(about(DUSTY, COVARIANCE), DUSTY, COVARIANCE, draws=draws_of(20, SIZE))
    longer, _ = asked(about(DUSTY, COVARIANCE), DUSTY, COVARIANCE, draws=draws_of(30, SIZE), before=found.chain)
    assert np.array_equal(longer.chain.z[:, :20], found.chain.z)
    with pytest.raises(InputError, match="no longer the one") as refused:
        asked(about(DUSTY, 1.01 * COVARIANCE), DUSTY, COVARIANCE, draws=draws_of(30, SIZE), before=found.chain)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("what", "other"),
    [("disc", 1), ("clock", 600.0), ("clock", "unknown"), ("exposure", "free"), ("exposure", 0.25),
     ("response", "sigma_sdmerill"), ("seed", 2)],
)  # fmt: skip
def test_all_that_is_chosen_is_part_of_what_a_chain_is_of(what, other):
    chosen = {"disc": None, "clock": None, "exposure": "relative", "response": "nikon_5100", "seed": 1}
    one, changed = (identity([], (), **with_it) for with_it in (chosen, chosen | {what: other}))
    assert [name for name in one if one[name] != changed[name]] == [what]


def test_a_chain_is_of_its_priors_and_of_the_clock_that_was_said():
    one = identity([], prior.ATMOSPHERE[:1], None, 600.0, "relative", "nikon_5100", 1)
    assert one["clock"] == 600.0
    assert one["priors"] != identity([], (), None, 600.0, "relative", "nikon_5100", 1)["priors"]


def test_chains_are_sorted_by_ensemble(asked):
    found, _ = asked(about(DUSTY, COVARIANCE), DUSTY, COVARIANCE, draws=draws_of(20, SIZE))
    kept = found.chain.z[:, found.diagnosis.burn_in :]
    assert np.array_equal(by_ensemble(found.z[..., 2]), kept[..., 2])


@dataclass(frozen=True)
class Erring:
    """What a beginning wants of a `Likelihood`."""

    errors: tuple
    carried_at: np.ndarray | None = None
    carried_with: np.ndarray | None = None

    def carried(self, z, amplitudes):
        return replace(self, carried_at=z, carried_with=amplitudes)

    def with_errors(self, errors):
        return replace(self, errors=errors)


def test_a_beginning_comes_back_from_numbers():
    rivals = tuple(Optimum(np.full(3, x), 2.5, True, 5, (x + 2.0) * np.eye(3), ()) for x in (-1.0, 1.0))
    ridge = (Optimum(np.full(3, 2.0), 3.5, True, 4, 5.0 * np.eye(3), ()),)
    optimum = Optimum(np.arange(3.0), 1.5, True, 7, np.eye(3), (1.5, 2.5), 2, rivals, ridge)
    before = Errors(np.ones((4, 1, 1)), np.ones((4, 2)), 1)
    fitted = replace(before, independent=0.7, smooth=0.2, chromatic=0.05, outlying=np.array([1.0, 2.0, 1.0, 1.0]))
    prepared, found = Erring((before,)), Erring((fitted,), np.array([0.5, -1.0, 2.0]), np.array([[0.1, 0.04, 0.3]]))
    for draws in (None, 0, draws_of(10, SIZE)):
        numbers = {name: np.asarray(value) for name, value in beginning(optimum, found, draws).items()}
        same, likelihood, given = begun(numbers, prepared)
        assert given == draws
        assert np.array_equal(same.z, optimum.z) and np.array_equal(same.information, optimum.information)
        assert (same.cost, same.converged, same.steps, same.costs) == (1.5, True, 7, (1.5, 2.5))
        assert same.not_finite == 2
        for one, other in zip([*same.rivals, *same.ridge], [*rivals, *ridge], strict=True):
            assert np.array_equal(one.z, other.z) and np.array_equal(one.information, other.information)
            assert one.cost == other.cost
        assert np.array_equal(likelihood.carried_at, found.carried_at)
        assert np.array_equal(likelihood.carried_with, found.carried_with)
        assert np.array_equal(likelihood.errors[0].scale, fitted.scale)
        assert np.array_equal(likelihood.errors[0].amplitudes, fitted.amplitudes)
