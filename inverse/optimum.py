"""The best of the optima that several starts lead to, with errors as large as the photographs say.

Ends are compared by their cost, and so all have to have the same errors: at first those of the camera assumed
beforehand (`inverse.assumed_camera`), then those that the best end carries, with which all are sought anew. Where
another end is far from the best, and wide, the posterior may be there too, as of one in 24 drawn photographs: it is
kept. Twice are errors and ends worked out by turns: to go on until neither changes was tried, and in five of 60 drawn
photographs both ran away, to log posteriors of the truth 12 to 110 below the best.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from eclipsejax.errors import InputError
from inverse import prior
from inverse.likelihood import LIMB, Likelihood
from inverse.map_estimate import CLOSE, Optimum, descend
from inverse.noise_fit import fitted_errors
from inverse.ridge import BESIDE, ridge
from inverse.threads import side_by_side

# z of some quantities: high clouds in cold air and low ones in warm look alike.
STARTED = ("clouds.top", "dust.extinction", "air.surface_temperature")
STARTS = ((0.0, 0.0, 0.0), (-0.8, -1.0, 1.2), (-0.5, 1.0, 1.0), (1.5, 1.0, -1.2))
BRIGHTNESS = frozenset(["gain", "white_balance.red", "white_balance.blue", "camera.glare", "camera.veil"])
ROUGH = 1e-3  # relative change of the cost at which descents end that begin anew, with other errors
STAGES = 3 * len(STARTS) + 2
FURTHER, LOWER = 3, 0.3  # times that an optimum gives way to a better one, at most, and by how much cost that is better
APART = 2.0  # standard deviations between ends that are two
SHARE = 1e-3  # of the posterior at the best end: where there is less, another end is forgotten


def best(
    likelihood: Likelihood, neighbours: Sequence[np.ndarray], report: Callable[[int], None] = lambda done: None
) -> tuple[Optimum, Likelihood]:
    """The best optimum, and the likelihood with errors as large as the photographs say (`inverse.noise_fit`).

    - `neighbours`: of the cells of each photograph, as `fitted_errors` takes them.
    - `report`: called with the number of `STAGES` done.
    """

    def told(found: Iterator[Optimum], before: int) -> list[Optimum]:
        ends = []
        for number, end in enumerate(found, before + 1):
            ends.append(end)
            report(number)
        return ends

    first = told(side_by_side(partial(roughly, likelihood), starts(likelihood), compiled=False), 0)
    likelihood = _with_errors(likelihood, _lowest(first), neighbours)
    ends = told(_anew(likelihood, distinct(first)), len(STARTS))
    likelihood = _with_errors(likelihood, _lowest(ends), neighbours)
    last = told(_anew(likelihood, distinct(ends)), 2 * len(STARTS))
    optimum = descend(likelihood, _lowest(last).z)
    report(3 * len(STARTS) + 1)
    optimum, beside = _lower(likelihood, optimum)
    report(STAGES)
    lost = sum(end.not_finite for end in (*first, *ends, *last, *beside, optimum))
    last += beside
    costs = tuple(end.cost for end in distinct(last))
    return replace(optimum, costs=costs, not_finite=lost, rivals=rivals(optimum, last)), likelihood


def _lower(likelihood: Likelihood, optimum: Optimum) -> tuple[Optimum, list[Optimum]]:
    """The optimum, or a better one that its ridge leads to, with its `ridge`; and all ends found from there.

    Of 60 drawn photographs two have a better one (by 8 and 1 in cost), and 32 have rivals instead of 21.
    """
    ends = []
    for _ in range(FURTHER):
        optimum = replace(optimum, ridge=tuple(ridge(likelihood, optimum)))
        beside = list(_anew(likelihood, [point for point in optimum.ridge if point.cost < optimum.cost + BESIDE]))
        ends += beside
        if min((end.cost for end in beside), default=np.inf) > optimum.cost - LOWER:
            return optimum, ends
        optimum = descend(likelihood, _lowest(beside).z)
    return replace(optimum, ridge=tuple(ridge(likelihood, optimum))), ends


def _anew(likelihood: Likelihood, ends: Sequence[Optimum]) -> Iterator[Optimum]:
    """Descents from ends that had other errors, or less that was free."""
    return side_by_side(lambda end: descend(likelihood, end.z, CLOSE), ends)


def distinct(ends: Sequence[Optimum], count: int | None = None) -> list[Optimum]:
    """The ends, of several beside each other the best: they would lead to the same one again.

    - `count`: of the parameters, the first ones, by which they are told apart; all by default.
    """
    kept: list[Optimum] = []
    for end in sorted(ends, key=lambda end: end.cost):
        if all(_distance(end, other, count) > APART for other in kept):
            kept.append(end)
    return kept


def rivals(optimum: Optimum, ends: Sequence[Optimum]) -> tuple[Optimum, ...]:
    """The ends, each once, whose limbs lie far from an optimum's and may hold a share of the posterior."""
    likely = [end for end in ends if end.log_mass > optimum.log_mass + np.log(SHARE)]
    return tuple(distinct([optimum, *likely], LIMB)[1:])


def _distance(one: Optimum, other: Optimum, count: int | None) -> float:
    """Between the first `count` parameters of two, in standard deviations of their difference."""
    apart = (one.z - other.z)[:count]
    both = (one.covariance + other.covariance)[:count, :count]
    return float(np.sqrt(apart @ np.linalg.solve(both, apart)))


def _lowest(ends: Sequence[Optimum]) -> Optimum:
    """The end of the lowest cost; `InputError` where none is finite."""
    end = min(ends, key=lambda end: end.cost)
    if not np.isfinite(end.cost):
        raise InputError(
            "No limb and no camera gives these photographs a finite probability: check that they show this eclipse."
        )
    return end


def _with_errors(likelihood: Likelihood, end: Optimum, neighbours: Sequence[np.ndarray]) -> Likelihood:
    """The likelihood with the errors that an end carries, as large as its misfits say."""
    likelihood = likelihood.carried(end.z)
    each = zip(likelihood.errors, likelihood.misfits_and_slopes(end.z), likelihood.observed, neighbours, strict=True)
    return likelihood.with_errors([
        fitted_errors(errors, misfit, slopes, np.asarray(observed.measured), around)
        for errors, (misfit, slopes), observed, around in each
    ])  # fmt: skip


def starts(likelihood: Likelihood) -> list[np.ndarray]:
    """Vectors z (parameter,), everything else at the middle of its prior."""
    names = [parameter.name for parameter in prior.ATMOSPHERE]
    found = np.zeros((len(STARTS), len(likelihood.parameters)))
    found[:, [names.index(name) for name in STARTED]] = STARTS
    return list(found)


def roughly(likelihood: Likelihood, z: np.ndarray) -> Optimum:
    """Near the end that a start leads to; only how bright the picture is moves at first."""
    bright = np.array([i for i, parameter in enumerate(likelihood.parameters) if parameter.name in BRIGHTNESS])
    first = descend(likelihood, z, ROUGH, bright)
    optimum = descend(likelihood, first.z, ROUGH)
    return replace(optimum, not_finite=first.not_finite + optimum.not_finite)
