"""Smooth errors that the photographs of one eclipse share.

The limb's errors are the same in all photographs at the same place of the shadow, the map's at the same place of the
Moon. In the series of 2015-09-28 photographs have eight to nine tenths of their misfits' variance in common, most of
it by the place in the shadow (python -m benchmarks.series_2015). Drawn anew for each photograph, such errors would
average out over a series, and make its intervals half as wide.

Within a photograph the two places move together, and the errors have the covariance of `error_modes.smooth_modes`;
between photographs `SHARED` of it is left where both places are the same. The covariance of all data is what each
photograph has for itself, and L L' of the shared modes over all of them: the largest, and those that hold what
estimates lean on (`inverse.leaned_on`). What modes leave out is taken for each photograph's own, and averages out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.linalg import eigh
from scipy.spatial.distance import cdist

from eclipsejax.constants import MOON_RADIUS
from eclipsejax.scene import axis_offset, axis_position_angle, disc_points
from inverse.error_modes import BROAD, MOON, over_disc, over_rings
from inverse.threads import side_by_side

SHARED = 0.8  # of the variance of smooth errors
OF_THE_LIMB = 0.75  # of what is shared over the disc; the rest is the map's
MODES = 80  # the largest, common to the channels, and as many for each
UNEVEN_MODES = 40  # of a limb that is uneven
POINTS = 900  # of all photographs, that the modes are found on
DISTINCT = 1e-6  # of the most variance: patterns that have less of it are made of the others


@dataclass(frozen=True)
class Places:
    """Where the cells of a photograph lie.

    - `disc`: from its centre, east and north [its radii] (cell, 2).
    - `shadow`: from the axis, east and north [rad] (cell, 2).
    - `on_disc`: whether they are (cell,).
    """

    disc: np.ndarray
    shadow: np.ndarray
    on_disc: np.ndarray


Kernel = Callable[[Places, Places], np.ndarray]


@eqx.filter_jit
def _sky(model):
    """East and north of a `PhotoModel`'s cells on the disc [radii] and in the shadow [rad] (cell,) each."""
    left = model.cells.right if model.mirror else -model.cells.right
    sine, cosine = jnp.sin(model.roll), jnp.cos(model.roll)
    east, north = model.cells.up * sine + left * cosine, model.cells.up * cosine - left * sine
    scale = MOON_RADIUS / jnp.linalg.norm(model.geometry.moon - model.geometry.observer)
    position = disc_points(model.geometry, scale * east, scale * north).position
    offset, angle = axis_offset(model.geometry, position), axis_position_angle(model.geometry, position)
    return east, north, offset * jnp.sin(angle), offset * jnp.cos(angle)


def places_of(model) -> Places:
    """Of the cells of a `PhotoModel`, as it was registered."""
    east, north, *shadow = (np.asarray(value) for value in _sky(model))
    return Places(np.stack([east, north], axis=1), np.stack(shadow, axis=1), np.asarray(model.on_disc) > 0)


def covariance(one: Places, other: Places) -> np.ndarray:
    """Of shared smooth errors of variance 1 in cells of two photographs, or of one with itself (cell, cell)."""
    of_moon, of_limb = over_disc(cdist(one.disc, other.disc)), over_disc(cdist(one.shadow, other.shadow) / MOON)
    offset, farther = (np.linalg.norm(places.shadow, axis=1) for places in (one, other))
    of_offset = over_rings(np.abs(offset[:, None] - farther))
    return 0.5 * (OF_THE_LIMB * of_limb + (1.0 - OF_THE_LIMB) * of_moon + of_offset)


def unevenness(one: Places, other: Places) -> np.ndarray:
    """The same of the errors of an uneven limb, which are wholly shared."""
    return np.exp(-0.5 * np.square(cdist(one.shadow, other.shadow) / (BROAD * MOON)))


def shared_modes(photographs: Sequence[Places]) -> list[np.ndarray]:
    """L of the covariance of shared smooth errors, of variance `SHARED` at most: for each photograph (cell, mode)."""
    return [np.sqrt(SHARED) * modes for modes in _modes(photographs, covariance, MODES)]


def uneven_modes(photographs: Sequence[Places]) -> list[np.ndarray]:
    """L of the covariance of errors from an uneven limb, of variance 1: for each photograph (cell, mode)."""
    return _modes(photographs, unevenness, UNEVEN_MODES)


def _modes(photographs: Sequence[Places], kernel: Kernel, most: int) -> list[np.ndarray]:
    """The largest modes of a covariance over all photographs, their mean over each disc taken away (cell, mode).

    Found on some of the cells and carried on to all (Nyström 1930).
    """
    seen = [np.flatnonzero(places.on_disc) for places in photographs]
    step = max(1, -(-sum(map(len, seen)) // POINTS))
    chosen = [_part(places, cells[::step]) for places, cells in zip(photographs, seen, strict=True)]
    points = Places(*(np.concatenate([getattr(one, name) for one in chosen]) for name in ("disc", "shadow", "on_disc")))
    last = len(points.disc) - 1
    values, vectors = eigh(kernel(points, points), subset_by_index=(max(0, last + 1 - most), last))
    onto = vectors / np.sqrt(np.maximum(values, 1e-9 * values.max()))
    found = []
    for places, cells in zip(photographs, seen, strict=True):
        modes = np.zeros((len(places.disc), values.size))
        here = kernel(_part(places, cells), points) @ onto
        modes[cells] = here - here.mean(axis=0)
        found.append(modes)
    return found


def more_modes(
    photographs: Sequence[Places], known: Sequence[np.ndarray], patterns: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Shared smooth errors' modes that are known, and more, with which sums of errors by patterns have their variance.

    Of what is missing, R, and patterns P, R P (P'R P)^(-1/2): P are inducing variables (Quinonero-Candela & Rasmussen
    2005, J. Mach. Learn. Res. 6:1939).

    - `known`: of `shared_modes` (cell, mode) each; `patterns`: (cell, pattern) each.
    """
    every = _along(photographs, patterns)
    held = sum(modes.T @ pattern for modes, pattern in zip(known, patterns, strict=True))
    missing = [whole - modes @ held for whole, modes in zip(every, known, strict=True)]
    variance = np.asarray(sum(pattern.T @ part for pattern, part in zip(patterns, missing, strict=True)))
    size = 1.0 / np.sqrt(np.maximum(np.diag(variance), np.finfo(float).tiny))
    values, vectors = eigh(size[:, None] * variance * size)
    kept = values > DISTINCT * values.max()
    onto = size[:, None] * vectors[:, kept] / np.sqrt(values[kept])
    return [np.concatenate([modes, part @ onto], axis=1) for modes, part in zip(known, missing, strict=True)]


def _along(photographs: Sequence[Places], patterns: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The covariance that shared smooth errors have times patterns, their means over each disc taken away, of each."""
    seen = [np.flatnonzero(places.on_disc) for places in photographs]
    discs = [_part(places, cells) for places, cells in zip(photographs, seen, strict=True)]
    inside = [pattern[cells] - pattern[cells].mean(axis=0) for pattern, cells in zip(patterns, seen, strict=True)]

    def between(pair):
        kernel = SHARED * covariance(discs[pair[0]], discs[pair[1]])
        return kernel @ inside[pair[1]], kernel.T @ inside[pair[0]]

    pairs = [(one, other) for one in range(len(discs)) for other in range(one, len(discs))]
    found = [np.zeros(pattern.shape) for pattern in patterns]
    for (one, other), (here, there) in zip(pairs, side_by_side(between, pairs), strict=True):
        found[one][seen[one]] += here - here.mean(axis=0)
        if other > one:
            found[other][seen[other]] += there - there.mean(axis=0)
    return found


def _part(places: Places, cells: np.ndarray) -> Places:
    return Places(places.disc[cells], places.shadow[cells], places.on_disc[cells])
