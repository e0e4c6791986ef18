"""Whether an ensemble's samples can be believed: autocorrelation, agreement of ensembles, effective sample sizes.

R-hat compares the ensembles with each other and their first halves with their second: only they are independent, the
walkers of one ensemble propose moves to each other. Effective sample sizes take every walker for a chain, so that a
walker that is stuck apart lowers them. Both are of ranks: Vehtari, Gelman, Simpson, Carpenter & Bürkner 2021.
"""

import warnings
from dataclasses import dataclass

import numpy as np

TIMES_AUTOCORRELATION = 50
LARGEST_CHANGE = 0.05  # of the longest autocorrelation time over the last doubling of the chain
LARGEST_R_HAT = 1.01
LEAST_SAMPLES = 400  # effective, of the middle and of the tails
BURN_IN = 2.0  # autocorrelation times: the walkers start from Laplace's Gaussian, nearly where they belong
WINDOW = 5.0  # autocorrelation times over which correlations are summed
FEWEST_STEPS = 16  # after burn-in, below which nothing can be said


def arviz():
    """ArviZ, without the announcement of its successor, once a day."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz

        return arviz


@dataclass(frozen=True)
class Quality:
    """What the samples of one quantity are worth; infinite R-hat and no samples where there are too few to tell.

    - `r_hat`: the larger of that of the ranks and that of the distances from the median.
    - `ess_bulk`, `ess_tail`: effective samples for the middle, for the 5 and 95 % quantiles.
    """

    r_hat: float
    ess_bulk: float
    ess_tail: float


def quality(values: np.ndarray) -> Quality:
    """Of one quantity's samples (ensemble, step, walker)."""
    ensembles, steps, walkers = values.shape
    if steps < FEWEST_STEPS or not np.ptp(values) > 0.0:
        return Quality(np.inf, 0.0, 0.0)
    az = arviz()
    by_walker = np.moveaxis(values, 1, 2).reshape(ensembles * walkers, steps)
    r_hat = az.rhat(values.reshape(ensembles, steps * walkers), method="rank")
    bulk, tail = (az.ess(by_walker, method=method) for method in ("bulk", "tail"))
    return Quality(float(r_hat), float(bulk), float(tail))


def autocorrelation_time(z: np.ndarray) -> np.ndarray:
    """Integrated autocorrelation time (parameter,) [steps] of samples (ensemble, step, walker, parameter).

    Sokal's window, averaged over the walkers of all ensembles; the number of steps where it cannot be told. Unlike
    emcee's, which takes each walker's own mean away and is 10-20 % too short in a chain of 50 to 80 times, this one
    takes away the mean of all: it is not biased, and walkers that are stuck apart lengthen it.
    """
    _, steps, _, size = z.shape
    if steps < FEWEST_STEPS:
        return np.full(size, float(max(1, steps)))
    deviation = z - z.mean(axis=(0, 1, 2))
    spectrum = np.fft.rfft(deviation, n=2 * steps, axis=1)
    covariance = (
        np.fft.irfft(np.abs(spectrum) ** 2, axis=1)[:, :steps].mean(axis=(0, 2)) / np.arange(steps, 0, -1)[:, None]
    )
    variance = covariance[0]
    moving = variance > 1e-12 * np.maximum(np.max(z**2, axis=(0, 1, 2)), 1e-300)
    summed = 2.0 * np.cumsum(covariance / np.where(moving, variance, 1.0), axis=0) - 1.0
    outside = np.arange(steps)[:, None] >= WINDOW * summed
    time = np.take_along_axis(summed, np.argmax(outside, axis=0)[None], axis=0)[0]
    told = moving & outside.any(axis=0)
    return np.clip(np.where(told, time, steps), 1.0, steps)


@dataclass(frozen=True)
class Diagnosis:
    """What is known of a chain.

    - `burn_in`: steps to leave out at the beginning.
    - `autocorrelation_time`: (parameter,) [steps], after burn-in.
    - `change`: of the longest autocorrelation time from half the chain to all of it, relative.
    - `r_hat`, `ess_bulk`, `ess_tail`: of the worst parameter.
    - `unmet`: the criteria for stopping that are not met, in words.
    """

    burn_in: int
    autocorrelation_time: np.ndarray
    change: float
    r_hat: float
    ess_bulk: float
    ess_tail: float
    unmet: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether every criterion is met."""
        return not self.unmet


def long_enough(z: np.ndarray) -> bool:
    """Whether a chain may meet the criterion of length: the quickest to look at."""
    return z.shape[1] >= TIMES_AUTOCORRELATION * autocorrelation_time(z[:, z.shape[1] // 4 :]).max()


def diagnose(z: np.ndarray) -> Diagnosis:
    """Of a whole chain (ensemble, step, walker, parameter)."""
    steps = z.shape[1]
    burn_in = int(min(np.ceil(BURN_IN * autocorrelation_time(z).max()), steps // 2))
    kept = z[:, burn_in:]
    time = autocorrelation_time(kept)
    longest, before = float(time.max()), float(autocorrelation_time(kept[:, : kept.shape[1] // 2]).max())
    change, length = abs(longest - before) / longest, kept.shape[1] / longest
    each = [quality(kept[..., index]) for index in range(z.shape[-1])]
    r_hat = max(one.r_hat for one in each)
    bulk, tail = min(one.ess_bulk for one in each), min(one.ess_tail for one in each)
    said = {
        f"the chain is {length:.0f} autocorrelation times long, not {TIMES_AUTOCORRELATION}": length
        < TIMES_AUTOCORRELATION,
        f"the autocorrelation time changed by {100 * change:.0f} % over the last doubling": change > LARGEST_CHANGE,
        f"rank R-hat is {r_hat:.3f}, above {LARGEST_R_HAT}": not r_hat <= LARGEST_R_HAT,
        f"{bulk:.0f} effective samples of the middle, not {LEAST_SAMPLES}": not bulk >= LEAST_SAMPLES,
        f"{tail:.0f} effective samples of the tails, not {LEAST_SAMPLES}": not tail >= LEAST_SAMPLES,
    }
    return Diagnosis(
        burn_in, time, change, r_hat, bulk, tail, tuple(words for words, wanting in said.items() if wanting)
    )
