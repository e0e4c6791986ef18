"""Sampling with independent ensembles of walkers until what they say can be believed."""

from collections.abc import Callable, Sequence

import emcee
import numpy as np
from scipy.stats import chi2

from eclipsejax.errors import InputError
from inverse.chain import Chain
from inverse.diagnostics import diagnose, long_enough
from inverse.gaussian import Gaussian
from inverse.mixture import Mixture
from inverse.threads import side_by_side

# Differential evolution; never emcee 3.1.6's snooker move, whose samples are up to 40 % too narrow.
MOVES = ((emcee.moves.DEMove, {}, 0.9), (emcee.moves.DEMove, {"gamma0": 1.0}, 0.1))
ENSEMBLES = 2
FEWEST = 20  # walkers of each: 32 have the same autocorrelation time, and cost 60 % more for more samples than needed
BLOCK = 10  # steps; a chain has whole blocks. A kill costs one, or a fiftieth of the chain where that is more
LEAPS = 9  # steps of each block in which walkers leap to draws of a proposal instead, where there is one
FIRST_CHECK, CHECK_GROWTH = 200, 1.1  # steps; each check at so many times those of the last, to `BLOCK`

START_LEVEL = 0.999  # share of a Gaussian posterior that walkers start within
START_ROUNDS = 50

Density = Callable[[np.ndarray], np.ndarray]


def walkers(size: int) -> int:
    """Walkers of each ensemble for so many parameters: differences of either half of them go in every direction."""
    return max(FEWEST, 2 * size + 2)


def settings() -> dict:
    """What a chain depends on besides posterior and seed."""
    moves = [[move.__name__, options, weight] for move, options, weight in MOVES]
    leaps = f"{LEAPS} of {BLOCK}"
    return {"emcee": emcee.__version__, "moves": moves, "leaps": leaps, "ensembles": ENSEMBLES, "fewest": FEWEST}


def sample(
    density: Density,
    gaussians: Sequence[Gaussian],
    *,
    draws: int,
    seed: int,
    proposal: Mixture | None = None,
    chain: Chain | None = None,
    keep: Callable[[Chain], None] = lambda chain: None,
    report: Callable[[int, int], None] = lambda done, most: None,
) -> Chain:
    """Sample until every criterion of `diagnostics.diagnose` is met; now and then they are looked at.

    The chain depends on the density, the Gaussians, the proposal and the seed alone: not on `draws`, which only ends
    it, nor on whether it was interrupted.

    - `density`: log densities (draw,) of points (draw, parameter).
    - `gaussians`: that the walkers start from, one for each peak. No walker crosses the valley between two of them by
      small steps, but one leaps it by the difference of two others that stand on either side.
    - `draws`: of all walkers together, at most, burn-in included; the last block is done in full.
    - `proposal`: nearly the density. Walkers leap to draws of it, wherever they stand, and by differential evolution
      they go where it has too few.
    - `chain`: to go on with.
    - `keep`: called with the chain so far, now and then, for storing it.
    - `report`: called with steps done and steps at most.
    """
    size = len(gaussians[0].centre)
    count = walkers(size)
    most = BLOCK * -(-draws // (ENSEMBLES * count * BLOCK))
    # Each has moves of its own: emcee keeps the length of a step in them, and the ensembles go on in two threads.
    samplers = [
        emcee.EnsembleSampler(count, size, density, moves=_moves(proposal), vectorize=True) for _ in range(ENSEMBLES)
    ]
    if chain is None:
        seeds = np.random.SeedSequence(seed).generate_state(ENSEMBLES)
        states = [_start(density, gaussians, np.random.RandomState(int(one))) for one in seeds]
        nothing = np.zeros((ENSEMBLES, 0, count, size))
        chain = Chain(nothing, nothing[..., 0], np.zeros(ENSEMBLES), tuple(state.random_state for state in states))
    else:
        parts = zip(chain.z[:, -1], chain.log_posterior[:, -1], chain.random, strict=True)
        states = [emcee.State(z, log_prob=value, random_state=random) for z, value, random in parts]
    stored = chain.steps
    report(chain.steps, most)
    while chain.steps < most and not _finished(chain):
        states = list(side_by_side(lambda part: _advanced(*part), list(zip(samplers, states, strict=True))))
        chain = _joined(chain, samplers, states)
        if chain.steps - stored >= max(BLOCK, chain.steps // 50):
            keep(chain)
            stored = chain.steps
        report(chain.steps, most)
    if stored < chain.steps:
        keep(chain)
    return chain


def _finished(chain: Chain) -> bool:
    """Whether to stop here: a function of the chain alone, so that resuming changes nothing."""
    check = FIRST_CHECK
    while check < chain.steps:
        check = BLOCK * round(check * CHECK_GROWTH / BLOCK)
    return check == chain.steps and long_enough(chain.z) and diagnose(chain.z).converged


def _start(density: Density, gaussians: Sequence[Gaussian], random: np.random.RandomState) -> emcee.State:
    """Walkers drawn from Gaussians, from each as many, but for points that the density itself all but rules out.

    Along a thin curved ridge most of Laplace's draws lie far beside it: a posterior of eight parameters held walkers
    there for 500 steps, 20 below the best in log density.
    """
    size = len(gaussians[0].centre)
    count = walkers(size)
    z, value, depth = np.zeros((0, size)), np.zeros(0), np.zeros(0)
    for _ in range(START_ROUNDS):
        normal = random.standard_normal((count, size))
        fresh = np.empty_like(normal)
        for first, gaussian in enumerate(gaussians):  # by turns: whichever are left out below, they are of all
            fresh[first :: len(gaussians)] = gaussian.at(normal[first :: len(gaussians)])
        z, value = np.concatenate([z, fresh]), np.concatenate([value, density(fresh)])
        with np.errstate(invalid="ignore"):
            depth = np.where(np.isfinite(value), value.max() - value, np.inf)
        if np.sum(depth < 0.5 * chi2.ppf(START_LEVEL, size)) >= count:
            break
    if not np.isfinite(value.max()):
        raise InputError(
            "The posterior is no finite number anywhere near its optimum, so that nothing can be drawn from it: "
            "take --draws 0 for Laplace's approximation, and send the photograph with a bug report."
        )
    # The likely ones in the order in which they were drawn; then, if those are too few, the least unlikely.
    chosen = np.argsort(np.maximum(depth, 0.5 * chi2.ppf(START_LEVEL, size)), kind="stable")[:count]
    return emcee.State(z[chosen], log_prob=value[chosen], random_state=random.get_state())


def _moves(proposal: Mixture | None) -> list[tuple]:
    """`MOVES` with their shares; where there is a proposal to leap to, in the steps that leaps leave."""
    moves = [(move(**options), weight) for move, options, weight in MOVES]
    return moves if proposal is None else [(_Leaping(proposal, moves), 1.0)]


class _Leaping(emcee.moves.Move):
    """Of each block of steps first the leaps, wherever walkers stand, then other moves.

    All leaps of a block are drawn and looked at together: of 180 points each costs less than half of what it costs of
    20 (a photograph's posterior on two cores).
    """

    def __init__(self, proposal: Mixture, others: list[tuple]):
        self.proposal, self.step = proposal, 0
        self.others, self.shares = zip(*others, strict=True)

    def propose(self, model, state):
        """One step of all walkers, as emcee asks for it: the state after it, and who moved (walker,)."""
        if self.step == 0:
            ahead = self.proposal.draw(LEAPS * len(state.coords), model.random)
            value, _ = model.compute_log_prob_fn(ahead)
            self.ahead = list(zip(np.split(ahead, LEAPS), np.split(value, LEAPS), strict=True))
        step, self.step = self.step, (self.step + 1) % BLOCK
        if step >= LEAPS:
            return model.random.choice(self.others, p=self.shares).propose(model, state)
        there, value = self.ahead[step]
        odds = self.proposal.log_density(state.coords) - self.proposal.log_density(there)
        accepted = np.log(model.random.rand(len(there))) < value - state.log_prob + odds
        return self.update(state, emcee.State(there, log_prob=value), accepted), accepted


def _advanced(sampler: emcee.EnsembleSampler, state: emcee.State) -> emcee.State:
    """The state a block later; the sampler holds the steps."""
    sampler.reset()
    for later in sampler.sample(state, iterations=BLOCK):
        state = later
    return state


def _joined(chain: Chain, samplers, states) -> Chain:
    z = np.stack([sampler.get_chain() for sampler in samplers])
    value = np.stack([sampler.get_log_prob() for sampler in samplers])
    return Chain(
        np.concatenate([chain.z, z], axis=1),
        np.concatenate([chain.log_posterior, value], axis=1),
        chain.accepted + np.array([sampler.backend.accepted.sum() for sampler in samplers]),
        tuple(state.random_state for state in states),
    )
