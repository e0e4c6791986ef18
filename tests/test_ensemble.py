"""The sampler samples what it should, stops when it may, and depends on nothing but density, start and seed."""

import emcee
import numpy as np
import pytest

from eclipsejax.errors import InputError
from inverse import ensemble
from inverse.diagnostics import diagnose
from inverse.ensemble import ENSEMBLES, sample, walkers
from inverse.gaussian import Gaussian
from inverse.mixture import Mixture, about
from tests.targets import banana, draws_of, gaussian, half_normal


def normal(size, variance=1.0):
    """Where walkers start."""
    return Gaussian.about(np.zeros(size), variance * np.eye(size))


def variance_ratio(size, seeds):
    """Mean over parameters and seeds of the sampled variance of a unit Gaussian.

    The chain ends by the rule, so that any bias by stopping is in it. Correlated, the fault of the snooker move
    would hide: differential evolution does not care.
    """
    ratios = []
    for seed in seeds:
        chain = sample(gaussian(np.eye(size)), [normal(size, 0.5)], draws=400_000, seed=seed)
        diagnosis = diagnose(chain.z)
        assert diagnosis.converged
        z = chain.z[:, diagnosis.burn_in :].reshape(-1, size)
        ratios.append(np.mean(np.var(z, axis=0)))
    return np.mean(ratios)


@pytest.mark.parametrize(("size", "chains"), [(6, 2), (12, 1)])
def test_variance_of_a_gaussian_is_right_to_two_per_cent(size, chains):
    # Standard error 0.005: each chain is worth 3200 samples of each parameter and more.
    assert variance_ratio(size, range(chains)) == pytest.approx(1.0, abs=0.02)


@pytest.mark.skipif(emcee.__version__ != "3.1.6", reason="the move may have been mended since")
def test_the_snooker_move_would_be_caught(monkeypatch):
    moves = ((emcee.moves.DEMove, {}, 0.8), (emcee.moves.DESnookerMove, {}, 0.2))
    monkeypatch.setattr(ensemble, "MOVES", moves)
    assert variance_ratio(6, range(1)) < 0.96


def test_quantiles_of_a_banana_are_right():
    chain = sample(banana, [normal(2, 0.3)], draws=400_000, seed=2)
    diagnosis = diagnose(chain.z)
    assert diagnosis.converged
    z = chain.z[:, diagnosis.burn_in :].reshape(-1, 2)
    random = np.random.default_rng(0)
    first = random.standard_normal(400_000)
    second = first**2 + random.standard_normal(400_000)
    for level in (0.05, 0.5, 0.95):
        # A share of some 3000 effective samples: standard error 0.004-0.01.
        assert np.mean(z[:, 0] < np.quantile(first, level)) == pytest.approx(level, abs=0.03)
        assert np.mean(z[:, 1] < np.quantile(second, level)) == pytest.approx(level, abs=0.03)


@pytest.fixture(scope="module")
def without_leaps():
    """Steps that differential evolution alone needs for nine parameters."""
    return sample(gaussian(np.eye(9)), [normal(9)], draws=600_000, seed=4).steps


@pytest.mark.parametrize("wide", [0.7, 1.0, 2.0])  # narrower than the density is, as wide, wider
def test_leaps_make_a_chain_shorter_and_change_nothing_of_what_is_drawn(wide, without_leaps):
    proposal = about([normal(9, wide)])
    chain = sample(gaussian(np.eye(9)), [normal(9)], draws=600_000, seed=4, proposal=proposal)
    diagnosis = diagnose(chain.z)
    assert diagnosis.converged and chain.steps < 0.5 * without_leaps
    drawn = chain.z[:, diagnosis.burn_in :].reshape(-1, 9)
    assert np.mean(np.var(drawn, axis=0)) == pytest.approx(1.0, abs=0.03)


def test_a_proposal_that_misses_half_of_the_density_does_no_harm():
    """Its leaps never end in the half that it misses, and hardly ever leave it; the other moves do."""
    density = lambda z: np.logaddexp(-0.5 * np.sum(z**2, axis=1), -0.5 * np.sum((z - 2.0) ** 2, axis=1))
    narrow = Mixture(np.ones(1), (normal(2, 0.5),), np.inf)
    chain = sample(density, [normal(2)], draws=600_000, seed=5, proposal=narrow)
    diagnosis = diagnose(chain.z)
    assert diagnosis.converged
    assert np.mean(chain.z[:, diagnosis.burn_in :].sum(axis=-1) > 2.0) == pytest.approx(0.5, abs=0.03)


def test_walkers_leap_between_peaks_that_they_start_from():
    # A third of the probability 14 standard deviations off: walkers from the higher peak alone hardly ever see it.
    far = np.full(3, 4.0)

    def density(z):
        near = -0.5 * np.sum(z**2, axis=1) / 0.25
        return np.logaddexp(near, np.log(0.5) - 0.5 * np.sum((z - far) ** 2, axis=1) / 0.25)

    starts = [Gaussian.about(centre, 0.25 * np.eye(3)) for centre in (np.zeros(3), far)]
    shares = []
    for some in (starts[:1], starts):
        chain = sample(density, some, draws=draws_of(3000, 3), seed=0)
        shares.append(np.mean(chain.z[:, 300:, :, 0] > 1.5))
    assert shares[0] < 0.02 and shares[1] == pytest.approx(1.0 / 3.0, abs=0.04)


def test_a_density_that_is_zero_somewhere_is_survived():
    # Half of Laplace's Gaussian lies where there is nothing: the walkers start where there is something.
    chain = sample(half_normal, [normal(2)], draws=draws_of(1000, 2), seed=0)
    assert np.all(chain.z[..., 0] > 0) and np.all(np.isfinite(chain.log_posterior))
    assert np.mean(chain.z[..., 0]) == pytest.approx(np.sqrt(2 / np.pi), abs=0.03)


def test_a_density_that_is_zero_everywhere_is_an_error_and_no_endless_search():
    with pytest.raises(InputError, match="no finite number"):
        sample(lambda z: np.full(len(z), -np.inf), [normal(2)], draws=640, seed=0)


def test_a_seed_reproduces_the_chain_and_the_ensembles_differ():
    one, two, other = (sample(banana, [normal(2)], draws=draws_of(30, 2), seed=seed).z for seed in (7, 7, 8))
    assert np.array_equal(one, two) and not np.array_equal(one, other)
    assert one.shape == (ENSEMBLES, 30, walkers(2), 2) and not np.array_equal(one[0], one[1])


@pytest.mark.parametrize("proposal", [None, about([normal(2)])])
def test_ensembles_share_no_move(monkeypatch, proposal):
    """They go on in two threads, and a move of emcee holds the length of its steps, which each run sets anew."""
    found = []

    class Recording(emcee.EnsembleSampler):
        def __init__(self, *given, moves: list, **more):
            found.append([part for move, _ in moves for part in (move, *getattr(move, "others", ()))])
            super().__init__(*given, moves=moves, **more)

    monkeypatch.setattr(emcee, "EnsembleSampler", Recording)
    sample(banana, [normal(2)], draws=draws_of(2, 2), seed=7, proposal=proposal)
    assert len(found) == ENSEMBLES and len({id(move) for moves in found for move in moves}) == sum(map(len, found))


@pytest.mark.parametrize("proposal", [None, about([normal(2)])])
def test_draws_only_end_the_chain(proposal):
    def drawn(steps, **given):
        return sample(banana, [normal(2)], draws=draws_of(steps, 2), seed=7, proposal=proposal, **given)

    short, long = drawn(13), drawn(40)
    assert short.steps == 20 and np.array_equal(short.z, long.z[:, :20])  # whole blocks
    assert not diagnose(short.z).converged
    longer = drawn(40, chain=short)
    assert np.array_equal(longer.z, long.z) and np.array_equal(longer.log_posterior, long.log_posterior)
    assert np.array_equal(longer.accepted, long.accepted)


def test_a_finished_chain_is_left_as_it_is():
    chain = sample(gaussian(np.eye(2)), [normal(2)], draws=400_000, seed=1)
    assert diagnose(chain.z).converged
    assert sample(gaussian(np.eye(2)), [normal(2)], draws=400_000, seed=1, chain=chain) is chain
