"""Smooth errors that the photographs of one eclipse share, and what they make of the joint likelihood.

The limb's errors are the same in all photographs at the same place of the shadow, the map's at the same place of the
Moon. In the series of 2015-09-28 photographs have eight to nine tenths of their misfits' variance in common, most of
it by the place in the shadow (python -m benchmarks.series_2015). Drawn anew for each photograph, such errors would
average out over a series, and make its intervals half as wide.

Within a photograph the two places move together, and the errors have the covariance of `error_modes.smooth_modes`;
between photographs `SHARED` of it is left where both places are the same. The covariance of all data is what each
photograph has for itself, and L L' of the shared modes over all of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.linalg import eigh
from scipy.spatial.distance import cdist

from eclipsejax.constants import MOON_RADIUS
from eclipsejax.scene import axis_offset, axis_position_angle, disc_points
from inverse.error_modes import BROAD, LENGTH, RADIAL
from inverse.noise import Errors
from inverse.whitener import Whitener, shrinking

SHARED = 0.8  # of the variance of smooth errors
OF_THE_LIMB = 0.75  # of what is shared over the disc; the rest is the map's
MODES = 80  # common to the channels, and as many for each
UNEVEN_MODES = 40  # of a limb that is uneven
POINTS = 900  # of all photographs, that the modes are found on
MOON = 4.5e-3  # rad: the Moon's radius, as it is on the Earth's shadow


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
    over_disc = np.exp(-cdist(one.disc, other.disc) / LENGTH)
    over_shadow = np.exp(-cdist(one.shadow, other.shadow) / (LENGTH * MOON))
    offset, farther = (np.linalg.norm(places.shadow, axis=1) for places in (one, other))
    of_offset = np.exp(-np.abs(offset[:, None] - farther) / RADIAL)
    return 0.5 * (OF_THE_LIMB * over_shadow + (1.0 - OF_THE_LIMB) * over_disc + of_offset)


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


def _part(places: Places, cells: np.ndarray) -> Places:
    return Places(places.disc[cells], places.shadow[cells], places.on_disc[cells])


@dataclass(frozen=True)
class JointWhitener:
    """Multiplies the residuals of all photographs together by an inverse root of their covariance.

    - `each`: for what is not shared; `bases`: orthonormal over all photographs, a part for each (datum, rank).
    - `shrink`: as that of `Whitener` (rank,).
    """

    each: tuple[Whitener, ...]
    bases: tuple[np.ndarray, ...]
    shrink: np.ndarray

    @cached_property
    def along(self) -> tuple[np.ndarray, ...]:
        """What takes residuals that `Whitener.alone` has had on to the amplitudes of `bases` (rank, datum)."""
        found = []
        for whitener, basis in zip(self.each, self.bases, strict=True):
            own = whitener.shrink[:, None] * (whitener.basis.T @ basis)
            found.append(np.ascontiguousarray((basis + whitener.basis @ own).T))
        return tuple(found)

    def __call__(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Of residuals of each photograph (datum, column), the columns the same for all."""
        found = self.white(self.coordinates(parts))
        return np.split(found, np.cumsum([len(one.basis) for one in self.each])[:-1])

    @cached_property
    def signs(self) -> np.ndarray:
        """Of the squares of `coordinates`: 1 for each datum, -1 for what errors in common take off (coordinate,)."""
        data = sum(len(whitener.basis) for whitener in self.each)
        taken = sum(whitener.shrink.size for whitener in self.each) + self.shrink.size
        return np.repeat([1.0, -1.0], [data, taken])

    def coordinates(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """What has the squares of whitened residuals, each with its sign, for half the work (coordinate, column).

        - `parts`: residuals of each photograph (datum, column), the columns the same for all.
        """
        scaled = [whitener.alone(part) for whitener, part in zip(self.each, parts, strict=True)]
        pairs = zip(self.each, scaled, strict=True)
        taken = [(taken_off(one.shrink) * (one.basis.T @ part).T).T for one, part in pairs]
        if self.shrink.size:
            along = np.asarray(sum(onto @ part for onto, part in zip(self.along, scaled, strict=True)))
            taken.append((taken_off(self.shrink) * along.T).T)
        return np.concatenate([*scaled, *taken])

    def white(self, coordinates: np.ndarray) -> np.ndarray:
        """The whitened residuals of all photographs, one below the other (datum, column)."""
        sizes = [*(len(one.basis) for one in self.each), *(one.shrink.size for one in self.each)]
        *found, along = np.split(coordinates, np.cumsum(sizes))
        scaled, taken = found[: len(self.each)], found[len(self.each) :]
        back = (self.shrink / taken_off(self.shrink) * along.T).T
        return np.concatenate([
            part + one.basis @ (one.shrink / taken_off(one.shrink) * own.T).T + basis @ back
            for one, basis, part, own in zip(self.each, self.bases, scaled, taken, strict=True)
        ])  # fmt: skip

    def products(self, parts: Sequence[np.ndarray], places: Sequence[np.ndarray], count: int) -> np.ndarray:
        """Of columns with each other, the inverse of the covariance between them (column, column).

        - `parts`: of each photograph (datum, its columns); `places`: which of the `count` columns these are.
        """
        found, along = np.zeros((count, count)), np.zeros((self.shrink.size, count))
        for whitener, onto, part, place in zip(self.each, self.along, parts, places, strict=True):
            found[np.ix_(place, place)] += whitener.products(part)
            if self.shrink.size:
                along[:, place] += onto @ whitener.alone(part)
        return found + along.T @ ((np.square(1.0 + self.shrink) - 1.0)[:, None] * along)


def taken_off(shrink: np.ndarray) -> np.ndarray:
    """Root of the share that a direction's square loses, by `Whitener.shrink`."""
    return np.sqrt(1.0 - np.square(1.0 + shrink))


def joint_whitener(errors: Sequence[Errors]) -> JointWhitener:
    """Of the errors of all photographs."""
    each = tuple(one.own_whitener for one in errors)
    scaled = [whitener(one.shared_modes) for whitener, one in zip(each, errors, strict=True)]
    basis, shrink = shrinking(np.concatenate(scaled))
    ends = np.cumsum([len(part) for part in scaled])[:-1]
    return JointWhitener(each, tuple(np.split(basis, ends)), shrink)


def shared_parts(errors: Sequence[Errors], misfits: Sequence[np.ndarray]) -> list[np.ndarray]:
    """What the misfits of all photographs say of the errors they share: its mean, of each photograph (datum,)."""
    whiteners = [one.own_whitener for one in errors]
    scaled = [whitener(one.shared_modes) for whitener, one in zip(whiteners, errors, strict=True)]
    white = [whitener(misfit) for whitener, misfit in zip(whiteners, misfits, strict=True)]
    known = np.eye(scaled[0].shape[1]) + sum(part.T @ part for part in scaled)
    said = sum(part.T @ misfit for part, misfit in zip(scaled, white, strict=True))
    amplitudes = np.linalg.solve(known, said)
    return [one.shared_modes @ amplitudes for one in errors]
