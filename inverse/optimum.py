"""The best of the optima that several starts lead to, with errors as large as the photographs say.

Errors are the same for every limb and camera (`inverse.assumed_camera`), so that ends can be compared by their cost.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from eclipsejax.errors import InputError
from inverse import prior
from inverse.likelihood import Likelihood
from inverse.map_estimate import Optimum, descend
from inverse.noise_fit import fitted_errors

# z of some quantities: high clouds in cold air and low ones in warm look alike.
STARTED = ("clouds.top", "dust.extinction", "air.surface_temperature")
STARTS = ((0.0, 0.0, 0.0), (-0.8, -1.0, 1.2), (-0.5, 1.0, 1.0), (1.5, 1.0, -1.2))
BRIGHTNESS = frozenset(["gain", "white_balance.red", "white_balance.blue", "camera.glare", "camera.veil"])
ROUGH = 1e-3  # relative change of the cost at which descents end that are only compared
TURNS = 2  # of errors and descents from the best
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
    optimum = min(ends, key=lambda end: end.cost)
    if not np.isfinite(optimum.cost):
        raise InputError(
            "No limb and no camera gives these photographs a finite probability: check that they show this eclipse."
        )
    lost = sum(end.not_finite for end in ends)
    for number in range(TURNS):
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
    return replace(optimum, costs=tuple(end.cost for end in ends), not_finite=lost), likelihood


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
