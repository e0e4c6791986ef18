"""What of the errors of several photographs estimates lean on, held by modes.

Estimates lean on patterns of the light that pass for sure, and so on just those whose errors the largest shared modes
leave out, and which would average out over a series. Of six photographs of one totality these modes alone make standard
deviations of the limb up to 5 % too small, 13 % where errors are large, and the more so the more photographs there are.
So the patterns that estimates lean on get modes of their own, and those that they lean on then, in turn: 27 more each
time. With them none is too small by 1 %; some are too large, by up to 6 and 12 % (`tests/test_leaned_on.py`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inverse import noise
from inverse.likelihood import LIMB, Likelihood
from inverse.shared_errors import Places, more_modes, places_of, shared_modes, uneven_modes

TURNS = 2


def with_shared_errors(
    likelihood: Likelihood, several: Sequence[int], values: Sequence[np.ndarray], responses: Sequence[np.ndarray]
) -> Likelihood:
    """The same, of photographs that have errors of limb and map in common; of one alone it is as it was.

    - `several`: numbers of those.
    - `values`, `responses`: of each, as `noise.Sources.errors` takes them.
    """
    if len(several) < 2:
        return likelihood
    where = [places_of(likelihood.models[number]) for number in several]
    shared, broad = shared_modes(where), uneven_modes(where)

    def sharing() -> Likelihood:
        sources, errors = list(likelihood.sources), list(likelihood.errors)
        for number, places, smooth, uneven in zip(several, where, shared, broad, strict=True):
            sources[number] = _with_modes(sources[number], places, smooth, uneven)
            errors[number] = sources[number].errors(values[number], responses[number])
        return replace(likelihood, sources=tuple(sources)).with_errors(errors)

    for _ in range(TURNS):
        weights = weights_of_light(sharing(), responses)
        shared = more_modes(where, shared, [weights[number] for number in several])
    return sharing()


def _with_modes(sources: noise.Sources, places: Places, shared: np.ndarray, broad: np.ndarray) -> noise.Sources:
    """The same with errors of which these modes (cell, mode) are shared."""
    offset = np.linalg.norm(places.shadow, axis=1)
    smooth, left = noise.modes_of(places.disc, offset, places.on_disc, shared)
    return replace(sources, smooth=smooth, left=left, broad=broad, shared=shared.shape[1])


def weights_of_light(likelihood: Likelihood, responses: Sequence[np.ndarray]) -> list[np.ndarray]:
    """What an error of the log light of a cell, in each channel, moves the estimates of the limb by.

    Of each photograph (cell, channel and estimate), about the middle of the prior.

    - `responses`: change of each log value by the log light of each channel (cell, value, light).
    """
    count = len(likelihood.parameters)
    slopes = [by for _, by in likelihood.misfits_and_slopes(np.zeros(count))]
    columns = [likelihood.columns(number) for number in range(len(slopes))]
    covariance = np.linalg.inv(np.eye(count) + likelihood.whitener.products(slopes, columns, count))[:, :LIMB]
    strays = [-by @ covariance[places] for by, places in zip(slopes, columns, strict=True)]
    found = []
    for weights, by, sources in zip(likelihood.whitener.inverse(strays), responses, likelihood.sources, strict=True):
        usable = np.where(sources.usable[..., None], by, 0.0)
        each = np.einsum("cvl,cve->cle", usable, weights.reshape(*usable.shape[:2], -1))
        found.append(each.reshape(len(usable), -1))
    return found
