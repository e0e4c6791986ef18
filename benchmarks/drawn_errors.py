"""Errors of surface and limb that photographs are drawn with: those a fit counts with, whole and not by a few modes.

Smooth ones lie over the shadow, over the Moon and over the offset from the axis, the same in all photographs of one
eclipse; a part of each photograph is its own, and every patch as large as a cell has errors of itself.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.ndimage import map_coordinates

from inverse import error_modes, noise
from inverse.cells import CELLS_PER_RADIUS
from inverse.error_modes import MOON
from inverse.noise_fit import CENTRES, WIDTHS
from inverse.shared_errors import OF_THE_LIMB, SHARED

# Of grids that fields are drawn on, between lines of which they are straight: a quarter of a cell [radii of the disc];
# and points along their sides.
STEP, SIDE = 0.0125, 1024
RINGS = np.linspace(0.0, 0.04, 1000)  # rad: offsets
SURVIVING = 0.82  # of the independent errors of patches, once the picture is blurred: what is left in a cell


@dataclass(frozen=True)
class Located:
    """Where the pixels of a photograph lie, (row, column) each.

    - `right`, `up`: on its disc [radii]; `east`, `north`: the same by the sky.
    - `shadow`: east and north of the axis [rad].
    """

    right: np.ndarray
    up: np.ndarray
    east: np.ndarray
    north: np.ndarray
    shadow: tuple[np.ndarray, np.ndarray]


def field(random: np.random.Generator, correlation) -> np.ndarray:
    """A Gaussian field of variance 1 on a grid that closes on itself, by its spectrum.

    - `correlation`: of a distance [radii].
    """
    white = np.fft.rfft2(random.standard_normal((SIDE, SIDE)))
    return np.fft.irfft2(white * _amplitudes(correlation), s=(SIDE, SIDE))


@cache
def _amplitudes(correlation) -> np.ndarray:
    """Roots of the spectrum of a correlation."""
    away = STEP * np.minimum(np.arange(SIDE), SIDE - np.arange(SIDE))
    return np.sqrt(np.maximum(np.fft.rfft2(correlation(np.hypot(away[:, None], away))).real, 0.0))


@cache
def _of_rings() -> np.ndarray:
    """Root of the covariance of errors of the offset (ring, ring)."""
    kernel = np.exp(-np.abs(RINGS[:, None] - RINGS) / error_modes.RADIAL)
    return np.linalg.cholesky(kernel + 1e-9 * np.eye(RINGS.size))


def rough(distance: np.ndarray) -> np.ndarray:
    """Correlation of smooth errors at a distance [radii]."""
    return np.exp(-distance / error_modes.LENGTH)


def _broad(distance: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * np.square(distance / error_modes.BROAD))


def at(field: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Of a field, at places [radii]."""
    return map_coordinates(field, [y / STEP % SIDE, x / STEP % SIDE], order=1, mode="grid-wrap")


class Smooth:
    """Smooth errors of variance 1, of all channels or of one."""

    def __init__(self, random: np.random.Generator):
        self.of_shadow, self.of_moon = field(random, rough), field(random, rough)
        self.of_offset = _of_rings() @ random.standard_normal(RINGS.size)

    def __call__(self, seen: Located) -> np.ndarray:
        limb = at(self.of_shadow, *(axis / MOON for axis in seen.shadow))
        moon = at(self.of_moon, seen.east, seen.north)
        of_offset = np.interp(np.hypot(*seen.shadow), RINGS, self.of_offset)
        over_disc = np.sqrt(OF_THE_LIMB) * limb + np.sqrt(1.0 - OF_THE_LIMB) * moon
        return np.sqrt(0.5) * (over_disc + of_offset)


class DrawnErrors:
    """Those of one eclipse, as large as a fit thinks them beforehand.

    - `share`: of them that photographs get: 0 for photographs without errors, all else the same.
    """

    def __init__(self, random: np.random.Generator, share: float = 1.0):
        self.share = share
        sizes = np.exp(CENTRES + WIDTHS * random.standard_normal(len(CENTRES)))
        _, self.common, self.chromatic, self.uneven = sizes
        self.smooth = [Smooth(random) for _ in range(4)]
        self.broad = [field(random, _broad) for _ in range(4)]

    def of(self, random: np.random.Generator, seen: Located) -> np.ndarray:
        """Errors of the log light of one photograph (row, column, 3)."""
        own = [Smooth(random) for _ in range(4)]
        together, *each = (
            np.sqrt(SHARED) * shared(seen) + np.sqrt(1.0 - SHARED) * alone(seen)
            for shared, alone in zip(self.smooth, own, strict=True)
        )
        broad, *coloured = (at(field, *(axis / MOON for axis in seen.shadow)) for field in self.broad)
        alike = self.common * together + self.uneven * broad
        found = [
            alike + self.chromatic * smooth + noise.COLOURED * self.uneven * colour
            for smooth, colour in zip(each, coloured, strict=True)
        ]
        return self.share * (np.stack(found, axis=-1) + _patches(random, seen) / SURVIVING)


def _patches(random: np.random.Generator, seen: Located) -> np.ndarray:
    """Independent errors of every patch (row, column, 3)."""
    patch = np.floor(np.stack([seen.up, seen.right]) * CELLS_PER_RADIUS).astype(int)
    patch -= patch.min(axis=(1, 2), keepdims=True)
    sides = patch.max(axis=(1, 2)) + 1
    each = noise.RELIEF * random.standard_normal((*sides, 1)) + noise.TINT * random.standard_normal((*sides, 3))
    return each[patch[0], patch[1]]
