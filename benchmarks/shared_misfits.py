"""What the misfits of a series have in common from one photograph to the next, and what they leave without it.

Told from the misfits themselves, of whatever model, without the errors that a fit counts with.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.spatial.distance import cdist

from inverse.error_modes import MOON, centred, over_disc

KNOTS = 8  # of the smooth function of the offset
BUMPS = 1.5e-3  # rad: width of the bumps that make the function of the place in the shadow, and how far they are apart
STIFF = 0.3  # variance of the noise by that of a bump's height
TURNS = 10  # of either function in favour of the other
COUNTED = 250  # cells of a photograph, for the covariances
SQUARE = 4.0  # arcmin: side of those that misfits are averaged over
LEAST = 8  # cells of one, of two photographs at least


@dataclass(frozen=True)
class Seen:
    """Cells of one photograph in one channel.

    - `shadow`: place in the shadow [rad] (cell, 2); `moon`: on the Moon [radii] (cell, 2).
    - `log_light`: (cell,).
    """

    shadow: np.ndarray
    moon: np.ndarray
    log_light: np.ndarray

    @property
    def offset(self) -> np.ndarray:
        """From the axis [rad] (cell,)."""
        return np.linalg.norm(self.shadow, axis=1)


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def beside_offset(offset: np.ndarray, log_light: np.ndarray) -> np.ndarray:
    """What the best cubic spline of the offset leaves of the log of the light (cell,)."""
    order = np.argsort(offset)
    x, y = offset[order] + 1e-12 * np.arange(offset.size), log_light[order]
    inner = np.quantile(x, np.linspace(0.0, 1.0, KNOTS)[1:-1])
    left = np.empty_like(y)
    left[order] = y - make_lsq_spline(x, y, np.r_[[x[0]] * 4, inner, [x[-1]] * 4])(x)
    return left


def beside_shadow(photographs: Sequence[Seen]) -> np.ndarray:
    """What is left where one smooth function of the place in the shadow, the same in all, is taken away as well.

    Of the cells of all photographs (cell,), each of which has a spline of the offset of its own besides.
    """
    place = np.concatenate([one.shadow for one in photographs])
    whole = np.concatenate([one.log_light for one in photographs])
    ends = np.cumsum([one.log_light.size for one in photographs])[:-1]
    axes = [np.arange(low, high + BUMPS, BUMPS) for low, high in zip(place.min(axis=0), place.max(axis=0), strict=True)]
    apart = cdist(place, np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2))
    bumps = np.exp(-0.5 * np.square(apart[:, apart.min(axis=0) < BUMPS] / BUMPS))
    known = bumps.T @ bumps + STIFF * np.eye(bumps.shape[1])
    function = np.zeros(whole.size)
    left = whole
    for _ in range(TURNS):
        parts = zip(photographs, np.split(whole - function, ends), strict=True)
        left = np.concatenate([beside_offset(one.offset, part) for one, part in parts])
        change = bumps @ np.linalg.solve(known, bumps.T @ left)
        function, left = function + change, left - change
    return left


def by_place(misfits: Sequence[Seen]) -> list[dict[str, float]]:
    """Means over squares of the shadow: `east`, `north` of the axis [arcmin], `mean`, `spread` of photographs, `cells`.

    - `spread`: standard deviation of the photographs' own means, each of which sees the square elsewhere on the Moon.
    """
    whose = np.repeat(np.arange(len(misfits)), [one.log_light.size for one in misfits])
    value = np.concatenate([one.log_light for one in misfits])
    place = np.concatenate([np.rint(np.degrees(one.shadow) * 60.0 / SQUARE) for one in misfits]).astype(int)
    found = []
    for square in np.unique(place, axis=0):
        here = np.all(place == square, axis=1)
        means = [value[here & (whose == one)].mean() for one in np.unique(whose[here])]
        if len(means) > 1 and here.sum() >= LEAST:
            east, north = (SQUARE * square).tolist()
            numbers = {"mean": float(np.mean(value[here])), "spread": float(np.std(means, ddof=1))}
            found.append({"east": east, "north": north, **numbers, "cells": int(here.sum())})
    return found


def variances(misfits: Sequence[Seen]) -> dict[str, dict[str, float]]:
    """Of misfits, by where two cells are the same, from the products of all pairs of cells (Haseman & Elston 1972).

    `between` photographs, the variance that goes with the place in the shadow and that with the place on the Moon;
    `within` one, where the two are the same, all of it. Correlations fall as in `inverse.noise`.
    """
    chosen = []
    for one in misfits:
        some = np.random.default_rng(len(chosen)).permutation(one.log_light.size)[:COUNTED]
        chosen.append((one.shadow[some] / MOON, one.moon[some], one.log_light[some] - one.log_light.mean()))
    gram, right = np.zeros((2, 2)), np.zeros(2)
    inside, square = 0.0, 0.0
    for number, (shadow, moon, value) in enumerate(chosen):
        for other, (farther, beyond, product) in enumerate(chosen):
            kernels = [centred(over_disc(cdist(*pair))).ravel() for pair in ((shadow, farther), (moon, beyond))]
            products = centred(np.outer(value, product)).ravel()
            if number == other:
                inside, square = inside + kernels[0] @ products, square + kernels[0] @ kernels[0]
            else:
                columns = np.stack(kernels)
                gram, right = gram + columns @ columns.T, right + columns @ products
    shadow, moon = np.linalg.solve(gram, right)
    return {"between": {"shadow": float(shadow), "moon": float(moon)}, "within": {"all": float(inside / square)}}
