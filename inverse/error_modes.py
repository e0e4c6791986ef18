"""Patterns that errors of photographs have: modes L, whose L L' is the covariance of errors of variance 1.

Few of them hold nearly all the variance of an error that is smooth over the disc. But estimates lean on the patterns
that are thought small, and so on those that modes leave out: against what whole kernels make of the same estimates,
100 smooth and 14 broad ones made standard deviations up to 8 to 20 % too small, these up to 0 to 3 % (three discs, by
`test_estimates_stray_no_farther_than_they_say`).
"""

import numpy as np
from scipy.linalg import eigh
from scipy.spatial.distance import cdist
from scipy.special import erf, i0e, i1e

from inverse.cells import CELLS_PER_RADIUS

MOON = 4.5e-3  # rad: the Moon's radius, as it is on the Earth's shadow
LENGTH = 0.35  # of the disc's radius, about 6 arcmin
RADIAL = 1e-3  # rad: 3.4 arcmin
# Standard deviation, along any line, of what two points of two cells are apart, from what their middles are [radii].
WITHIN = np.sqrt(1.0 / 6.0) / CELLS_PER_RADIUS
MODES = 220  # common to the channels, and as many for each
BROAD = 0.6  # of the disc's radius, the length of an uneven limb's errors: a third of a quadrant of the limb
BROAD_MODES = 24  # of them on one disc
BENT_MODES = 20  # of their squares
BLACK_REACH, BLACK_MODES, BLACK_POINTS = 2.0, 5, 60


def smooth_modes(
    position: np.ndarray, offset: np.ndarray, shared: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """L of the covariance of smooth errors, of variance 1 (cell, mode), and the variance that it leaves out (cell,).

    Half of it exp(-distance / LENGTH) over the disc: rough at every scale, as the misfits of real photographs are.
    Half of it exp(-difference / RADIAL) of the offsets from the shadow's axis: limbs that differ from one another, as
    the Earth's do, wash out every sharp feature that a symmetric one has. The `MODES` with the largest variance; what
    is left of it is independent from cell to cell, and the amplitude of independent errors is fitted. Both are of means
    over cells, of `CELLS_PER_RADIUS`.

    - `position`: on the disc, in its radii (cell, 2); `offset`: (cell,) [rad].
    - `shared`: modes that are known already, and are left out (cell, mode).
    """
    apart = np.linalg.norm(position[:, None] - position, axis=-1)
    farther = np.abs(offset[:, None] - offset)
    covariance = centred(0.5 * over_disc(apart) + 0.5 * over_rings(farther))
    if shared is not None:
        covariance = covariance - shared @ shared.T
    modes = largest_modes(covariance, MODES)
    return modes, np.maximum(np.diag(covariance) - np.sum(modes**2, axis=1), 0.0)


def over_disc(apart: np.ndarray) -> np.ndarray:
    """exp(-distance / LENGTH) between the means over two cells, whose middles are so far apart [radii].

    By the mean distance of their points (Rice 1945), which are taken to lie about the middles as Gauss has it. From one
    cell to the next the errors change by half of what they do from point to point: counted as the latter, temperatures,
    which are seen in fine patterns, had intervals too wide by a tenth.
    """
    square = np.square(0.5 * apart / WITHIN)
    mean = (1.0 + 2.0 * square) * i0e(square) + 2.0 * square * i1e(square)
    return np.exp(-np.sqrt(0.5 * np.pi) * WITHIN * mean / LENGTH)


def over_rings(apart: np.ndarray) -> np.ndarray:
    """exp(-difference / RADIAL) between the means over two cells, whose offsets differ so much [rad]; likewise."""
    within = WITHIN * MOON
    mean = within * np.sqrt(2.0 / np.pi) * np.exp(-0.5 * np.square(apart / within))
    return np.exp(-(mean + apart * erf(apart / within / np.sqrt(2.0))) / RADIAL)


def broad_modes(position: np.ndarray, on_disc: np.ndarray) -> np.ndarray:
    """L of the covariance of errors of variance 1 from an uneven limb (cell, mode), their mean over the disc left out.

    Clouds differ along the limb, and the light of the shadow with them from one side to another: in photographs of
    2015, by a fifth over a few arcminutes, and smoother than `smooth_modes` have it, which take them for improbable.

    - `position`: (cell, 2) [radii of the disc]; `on_disc`: (cell,).
    """
    return _of_disc(largest_modes(centred(_broad(position[on_disc])), BROAD_MODES), on_disc)


def bent_modes(position: np.ndarray, on_disc: np.ndarray) -> np.ndarray:
    """L of the covariance of the squares of broad errors, in units of its root (cell, mode).

    - `position`: (cell, 2) [radii of the disc]; `on_disc`: (cell,).
    """
    return _of_disc(largest_modes(_broad(position[on_disc]) ** 2, BENT_MODES), on_disc)


def _broad(position: np.ndarray) -> np.ndarray:
    """Correlation of an uneven limb's errors (cell, cell)."""
    return np.exp(-0.5 * np.square(cdist(position, position) / BROAD))


def _of_disc(found: np.ndarray, on_disc: np.ndarray) -> np.ndarray:
    """Modes of all cells, of those of the disc: the others have none."""
    modes = np.zeros((on_disc.size, found.shape[1]))
    modes[on_disc] = found
    return modes


def centred(covariance: np.ndarray) -> np.ndarray:
    """The same of what is left where means are taken away, of rows and of columns.

    The mean over the disc is the exposure's and the white balance's to meet, with the glare that goes with it. Errors
    that have it do so instead, and leave a photograph 0.25 brighter than its model in the log.
    """
    return covariance - covariance.mean(axis=0) - covariance.mean(axis=1)[:, None] + covariance.mean()


def largest_modes(covariance: np.ndarray, most: int) -> np.ndarray:
    """L of a covariance (cell, cell), of no more than so many modes (cell, mode)."""
    last = len(covariance) - 1
    values, vectors = eigh(covariance, subset_by_index=(max(0, last + 1 - most), last))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def black_modes(value: np.ndarray, floor: float, usable: np.ndarray, error: float) -> np.ndarray:
    """B: errors of the log of values near black, where a camera cuts off noise, and files have few codes (datum, mode).

    A curve of the value for each channel, smooth over a factor of `BLACK_REACH`: what is wrong with one dark cell is
    wrong with all that are as dark.

    - `value`: (cell, 3), `floor`, and `error`, of `black_error` [full scale]; `usable`: (cell, 3).
    """
    height = np.log(np.maximum(value, 0.0) + floor)
    line = np.linspace(height.min(), height.max(), BLACK_POINTS)
    kernel = np.exp(-np.abs(line[:, None] - line) / np.log(BLACK_REACH))
    curves = largest_modes(kernel, BLACK_MODES).T
    each = np.stack([np.interp(height, line, curve) for curve in curves], axis=-1) * usable[..., None]
    each = each * error / np.exp(height)[..., None]
    return (each[:, :, None] * np.eye(value.shape[1])[..., None]).reshape(value.size, -1)
