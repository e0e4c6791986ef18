"""The posterior of the limb by the cheapest way that can be trusted: Laplace's Gaussian, importance, ensembles."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.special import softmax

from eclipsejax.errors import InputError
from inverse.camera_colours import colour_matrix_of
from inverse.chain import Chain
from inverse.diagnostics import Diagnosis, diagnose
from inverse.ensemble import ENSEMBLES, sample, settings
from inverse.error_size import ErrorSize
from inverse.importance import Importance, importance
from inverse.likelihood import LIMB, Likelihood
from inverse.map_estimate import Optimum
from inverse.mixture import Mixture, fitted
from inverse.posterior import LimbPosterior
from inverse.ridge import BESIDE

FITTED = ("independent", "smooth", "chromatic", "uneven", "outlying")  # of the `Errors`
OTHERS, END = ("rivals", "ridge"), ("z", "cost", "information")  # of an `Optimum`, and what is asked for of them
MOST_DRAWS = 256_000
LAPLACE_DRAWS = 400
LEAPT = 1.0  # k-hat below which weights have a mean: walkers leap to draws like the weighed ones


@dataclass(frozen=True)
class Answer:
    """Draws of the limb's parameters, and how they came about.

    - `method`: "laplace", "laplace+psis" or "emcee".
    - `z`: (chain, draw, parameter), burn-in removed; the walkers of one ensemble follow each other.
    - `log_posterior`: (chain, draw); None for Laplace's Gaussian.
    - `weighed`: the importance sampling; None for Laplace's Gaussian alone.
    - `chain`, `diagnosis`: of the ensembles, where they were needed.
    - `evaluated`, `not_finite`: points at which the posterior was asked for, and at which it was no finite number and
      taken as zero. A chain that is gone on with counts its own run alone.
    """

    method: str
    z: np.ndarray
    log_posterior: np.ndarray | None = None
    weighed: Importance | None = None
    chain: Chain | None = None
    diagnosis: Diagnosis | None = None
    evaluated: int = 0
    not_finite: int = 0

    @property
    def report(self) -> dict[str, Any]:
        """For `Fit.diagnostics`."""
        found: dict[str, Any] = {
            "method": self.method, "psis": None, "sampler": None,
            "evaluated": self.evaluated, "not_finite": self.not_finite,
        }  # fmt: skip
        if self.weighed is not None:
            found["psis"] = {"k_hat": _finite(self.weighed.k_hat), "effective_samples": self.weighed.effective_samples}
        if self.chain is not None and self.diagnosis is not None:
            found["sampler"] = {
                "steps": self.chain.steps,
                "burn_in": self.diagnosis.burn_in,
                "ensembles": self.chain.z.shape[0],
                "walkers": self.chain.z.shape[2],
                "acceptance": self.chain.acceptance,
                "longest_autocorrelation_time": float(self.diagnosis.autocorrelation_time.max()),
                "change_over_last_doubling": self.diagnosis.change,
                "r_hat": _finite(self.diagnosis.r_hat),
                "ess_bulk": self.diagnosis.ess_bulk,
                "ess_tail": self.diagnosis.ess_tail,
                "converged": self.diagnosis.converged,
                "unmet": list(self.diagnosis.unmet),
            }
        return found


def answer(
    likelihood: Likelihood,
    optimum: Optimum,
    *,
    draws: int | None,
    seed: int,
    before: Chain | None,
    keep: Callable[[Chain], None],
    progress: Callable[[str, int, int], None],
) -> Answer:
    """Draw from the posterior about an optimum.

    Importance sampling, from Laplace's Gaussians of the optima and along the `ridge` on (`inverse.importance`), where
    k-hat comes below 0.7: of a posterior that is one-sided, beside zero dust, its proposals know the prior's side as
    well. From its draws the posterior learns the nuisances' room, whatever comes after. Then ensembles, from all peaks;
    where k-hat is below 1, with leaps to draws like the weighed ones, among which they choose as exactly as among any.

    - `draws`, `seed`: those of `fit_atmosphere`.
    - `before`: a chain to go on with.
    - `keep`, `progress`: called with the chain so far; with stage, what is done, and of how much.
    """
    if draws == 0:
        return Answer("laplace", gaussians(optimum).draw(LAPLACE_DRAWS, np.random.default_rng(seed))[None])
    density = LimbPosterior(likelihood, optimum)
    found = _drawn(density, optimum, draws, seed, before, keep, progress)
    return replace(found, evaluated=density.evaluated, not_finite=density.not_finite)


def gaussians(optimum: Optimum) -> Mixture:
    """Laplace's, of an optimum and its rivals, in the shares of their masses, and of every size of the errors."""
    ends = (optimum, *optimum.rivals)
    each = [ErrorSize(end).laplace for end in ends]
    shares = softmax([end.log_mass for end in ends])
    return Mixture(
        np.concatenate([share * one.shares for share, one in zip(shares, each, strict=True)]),
        tuple(bell for one in each for bell in one.bells), np.inf,
    )  # fmt: skip


def _drawn(
    density: LimbPosterior, optimum: Optimum, draws: int | None, seed: int, before, keep, progress
) -> Answer:  # fmt: skip
    """The `answer` where Laplace's Gaussian alone is not enough."""
    peaks = [end.limb for end in (optimum, *optimum.rivals)]
    bells = [*peaks, *(end.limb for end in optimum.ridge if end.cost < optimum.cost + BESIDE)]
    weighed = importance(
        density.explore,
        bells,
        seed=seed,
        learn=density.learn,
        report=lambda done, most: progress("weighing", done, most),
    )
    if before is not None:
        check_same_density(density, before)
    elif draws is None and weighed.trusted:
        return Answer("laplace+psis", weighed.z[None], weighed.log_posterior[None], weighed)
    proposal = None
    if weighed.k_hat < LEAPT:
        z, times = np.unique(weighed.z, axis=0, return_counts=True)
        proposal = fitted(z, times / times.sum(), bells, np.random.default_rng(seed))
    chain = sample(
        density, peaks, draws=draws or MOST_DRAWS, seed=seed, proposal=proposal, chain=before, keep=keep,
        report=lambda done, most: progress("sampling", done, most),
    )  # fmt: skip
    diagnosis = diagnose(chain.z)
    z = np.moveaxis(chain.z[:, diagnosis.burn_in :], 1, 2)  # (ensemble, walker, step, parameter)
    value = np.moveaxis(chain.log_posterior[:, diagnosis.burn_in :], 1, 2)
    together = z.shape[0] * z.shape[1]
    return Answer(
        "emcee", z.reshape(together, -1, LIMB), value.reshape(together, -1), weighed, chain, diagnosis
    )  # fmt: skip


def _finite(value: float) -> float | None:
    """JSON has no infinity."""
    return value if np.isfinite(value) else None


def by_ensemble(values: np.ndarray) -> np.ndarray:
    """Values (chain, draw) of an `Answer` by emcee as (ensemble, step, walker)."""
    return np.moveaxis(values.reshape(ENSEMBLES, -1, values.shape[-1]), 1, 2)


def check_same_density(density, chain: Chain) -> None:
    """`InputError` unless the density at the last points of a chain is what it was there."""
    for z, value in zip(chain.z[:, -1], chain.log_posterior[:, -1], strict=True):
        if not np.allclose(density(z), value, rtol=1e-9, atol=1e-6):
            raise InputError(
                "The posterior is no longer the one that the chain was drawn from (another version of the program or "
                "of a library): leave out --resume to begin anew."
            )


def identity(
    evidence, parameters, disc: int | list[int | None] | None, clock: float | str | None, exposure: float | str,
    response: str, seed: int,
) -> dict[str, Any]:  # fmt: skip
    """What a chain depends on, for `chain.Record`."""
    return {
        "photographs": [item.photo.sha256 for item in evidence],
        "time": [item.where.utc for item in evidence],
        "site": [item.site for item in evidence],
        "disc": disc,
        "clock": clock,
        "exposure": exposure,
        "response": [response, colour_matrix_of(response).tolist()],
        "seed": seed,
        "priors": [list(parameter[:5]) for parameter in parameters],
        "sampler": settings(),
        "versions": {name: version(name) for name in ("eclipsejax", "jax", "numpy")},
    }


def beginning(optimum: Optimum, likelihood: Likelihood, draws: int | None) -> dict[str, Any]:
    """What a chain begins from, in numbers: kept with it, so that it goes on from exactly there."""
    found = {
        f"error.{number}.{name}": getattr(one, name) for number, one in enumerate(likelihood.errors) for name in FITTED
    }
    assert likelihood.carried_at is not None
    ends = {
        f"{kind}.{what}": np.array([getattr(end, what) for end in getattr(optimum, kind)])
        for kind in OTHERS
        for what in END
    }
    own = {name: value for name, value in vars(optimum).items() if name not in OTHERS}
    return {
        **own, **ends, **found, "carried_at": likelihood.carried_at, "carried_with": likelihood.carried_with,
        "draws": -1 if draws is None else draws,
    }  # fmt: skip


def begun(numbers: Mapping[str, Any], likelihood: Likelihood) -> tuple[Optimum, Likelihood, int | None]:
    """Optimum, likelihood and draws from what `beginning` made.

    - `likelihood`: as it was before the fit.
    """
    optimum = Optimum(
        np.asarray(numbers["z"]), float(numbers["cost"]), bool(numbers["converged"]), int(numbers["steps"]),
        np.asarray(numbers["information"]), tuple(float(cost) for cost in numbers["costs"]),
        int(numbers["not_finite"]),
    )  # fmt: skip
    others = {}
    for kind in OTHERS:
        ends = zip(*(numbers[f"{kind}.{what}"] for what in END), strict=True)
        others[kind] = tuple(
            replace(optimum, z=np.asarray(z), cost=float(cost), information=np.asarray(wide)) for z, cost, wide in ends
        )
    optimum = replace(optimum, **others)
    likelihood = likelihood.carried(np.asarray(numbers["carried_at"]), np.asarray(numbers["carried_with"]))
    fitted = tuple(
        replace(one, **{name: numbers[f"error.{number}.{name}"] for name in FITTED})
        for number, one in enumerate(likelihood.errors)
    )
    draws = int(numbers["draws"])
    return optimum, likelihood.with_errors(fitted), None if draws < 0 else draws
