"""The best of several optima, each with the errors that a photograph has there.

Errors are those of the light, and a camera makes errors of its values of them: their covariance hangs on what is
fitted. It stands still in a descent, for the size of the errors is not known so well that thousands of cells may tell
a tone curve by it; and so descents and errors take turns. That leads to several ends, some of them where errors are
large and every misfit is small against them. The best end is the one where the photographs are most probable, the
determinant of the covariance counted: among ends that differ by hundreds, its coarse knowledge is enough.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from eclipsejax.errors import InputError
from inverse import prior
from inverse.likelihood import Likelihood
from inverse.map_estimate import Optimum, descend, quadratic
from inverse.noise_fit import fitted_errors

# z of some quantities: high clouds in cold air and low ones in warm look alike.
STARTED = ("clouds.top", "dust.extinction", "air.surface_temperature")
STARTS = ((0.0, 0.0, 0.0), (-0.8, -1.0, 1.2), (-0.5, 1.0, 1.0), (1.5, 1.0, -1.2))
BRIGHTNESS = frozenset(["gain", "white_balance.red", "white_balance.blue", "camera.glare", "camera.veil"])
ROUGH = 1e-3  # relative change of the cost at which descents end that are only compared
ROUGH_TURNS, TURNS = 2, 3  # of descents and errors, from each start and from the best
STAGES = len(STARTS) + TURNS


def best(
    likelihood: Likelihood, neighbours: Sequence[np.ndarray], report: Callable[[int], None] = lambda done: None
) -> tuple[Optimum, Likelihood]:
    """The best optimum, and the likelihood with errors as large as the photographs say (`inverse.noise_fit`).

    - `neighbours`: of the cells of each photograph, as `fitted_errors` takes them.
    - `report`: called with the number of `STAGES` done.
    """
    ends = []
    for number, start in enumerate(starts(likelihood), 1):
        ends.append(roughly(likelihood, start))
        report(number)
    costs = tuple(improbability(*end) for end in ends)
    if not np.isfinite(min(costs)):
        raise InputError(
            "No limb and no camera gives these photographs a finite probability: check that they show this eclipse."
        )
    lost = sum(optimum.not_finite for _, optimum in ends)
    likelihood, optimum = ends[int(np.argmin(costs))]
    for number in range(TURNS):
        likelihood = likelihood.carried(optimum.z)
        each = zip(
            likelihood.errors, likelihood.misfits_and_slopes(optimum.z), likelihood.observed, neighbours, strict=True
        )
        likelihood = replace(likelihood, errors=tuple(
            fitted_errors(errors, misfit, slopes, np.asarray(observed.measured), around)
            for errors, (misfit, slopes), observed, around in each
        ))  # fmt: skip
        optimum = descend(likelihood, optimum.z)
        lost += optimum.not_finite
        report(len(STARTS) + number + 1)
    return replace(optimum, costs=costs, not_finite=lost), likelihood


def starts(likelihood: Likelihood) -> list[np.ndarray]:
    """Vectors z (parameter,), everything else at the middle of its prior."""
    names = [parameter.name for parameter in prior.ATMOSPHERE]
    found = np.zeros((len(STARTS), len(likelihood.parameters)))
    found[:, [names.index(name) for name in STARTED]] = STARTS
    return list(found)


def roughly(likelihood: Likelihood, z: np.ndarray) -> tuple[Likelihood, Optimum]:
    """Near the end that a start leads to; only how bright the picture is moves at first, which its errors hang on."""
    bright = np.array([i for i, parameter in enumerate(likelihood.parameters) if parameter.name in BRIGHTNESS])
    lost, optimum = 0, None
    for free in [bright] * ROUGH_TURNS + [None] * ROUGH_TURNS:
        likelihood = likelihood.carried(z)
        optimum = descend(likelihood, z, ROUGH, free)
        z, lost = optimum.z, lost + optimum.not_finite
    assert optimum is not None
    return likelihood, replace(optimum, not_finite=lost)


def improbability(likelihood: Likelihood, optimum: Optimum) -> float:
    """Minus twice the log posterior at an optimum with the errors there, up to a constant; infinite where not known."""
    if not np.isfinite(optimum.cost):
        return np.inf
    there = likelihood.carried(optimum.z)
    return quadratic(there, optimum.z).cost + sum(errors.log_determinant for errors in there.errors)
