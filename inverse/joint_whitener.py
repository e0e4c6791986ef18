"""Whitening of the residuals of several photographs, some of whose errors are shared (`inverse.shared_errors`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inverse.noise import Errors
from inverse.whitener import Whitener, shrinking


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
        scaled, taken, along = self._parts(coordinates)
        back = (self.shrink / taken_off(self.shrink) * along.T).T
        return np.concatenate([
            part + one.basis @ (one.shrink / taken_off(one.shrink) * own.T).T + basis @ back
            for one, basis, part, own in zip(self.each, self.bases, scaled, taken, strict=True)
        ])  # fmt: skip

    def inverse(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The inverse of the covariance times columns, of each photograph (datum, column).

        - `parts`: of each photograph (datum, column), the columns the same for all.
        """
        scaled, taken, along = self._parts(self.coordinates(parts))
        back = (taken_off(self.shrink) * along.T).T
        return [
            one.alone.transposed(part - one.basis @ (taken_off(one.shrink) * own.T).T - onto.T @ back)
            for one, onto, part, own in zip(self.each, self.along, scaled, taken, strict=True)
        ]

    def _parts(self, coordinates: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray]:
        """Those of each photograph's data, those that its own errors take off, and those that shared ones do."""
        sizes = [*(len(one.basis) for one in self.each), *(one.shrink.size for one in self.each)]
        *found, along = np.split(coordinates, np.cumsum(sizes))
        return found[: len(self.each)], found[len(self.each) :], along

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
