"""A photograph cut into cells: what the likelihood compares, a few thousand numbers whatever the megapixels.

Every photograph gives the same cells, the useless ones masked: one compilation serves them all.
"""

from dataclasses import dataclass

import numpy as np

CELLS_PER_RADIUS = 20
DISC_MARGIN = 0.96  # of the radius: cells wholly inside it belong to the disc
SKY_INNER, SKY_OUTER = 1.08, 1.5  # of the radius: sky beside the Moon, which knows glare and glow
SKY_CELLS = 200
LEAST_USABLE = 0.9  # of a cell's pixels


@dataclass(frozen=True)
class Cells:
    """Mean linear light of square cells.

    - `right`, `up`: of the cell's pixels, in the mean, from the disc's centre, in radii, along the picture's sides
      (cell,).
    - `value`: mean light [full scale] (cell, 3), or a limit to it; `sigma`: its standard deviation from pixel noise.
    - `usable`: where `value` is a mean (cell, 3).
    - `limit`: 1 where it is a lower limit, since pixels are overexposed; -1 an upper one, since they are black; else 0
      (cell, 3).
    - `on_disc`: (cell,).
    """

    right: np.ndarray
    up: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    usable: np.ndarray
    limit: np.ndarray
    on_disc: np.ndarray


def bin_photo(photo, registration, *, per_radius: int = CELLS_PER_RADIUS) -> Cells:
    """Bin a photograph in linear light, on a grid centred on the disc.

    - `per_radius`: cells along a radius.
    """
    size = registration.radius / per_radius
    half = int(np.ceil(SKY_OUTER * per_radius))
    side = 2 * half
    rows, columns = photo.pixels.shape[:2]
    row = np.arange(rows)
    column = np.arange(columns)
    # Cell edges lie on the disc's centre, so that no cell straddles it unevenly.
    row_cell = np.floor((row - registration.row) / size).astype(int) + half
    column_cell = np.floor((column - registration.column) / size).astype(int) + half
    kept_rows = np.flatnonzero((row_cell >= 0) & (row_cell < side))
    kept_columns = np.flatnonzero((column_cell >= 0) & (column_cell < side))
    window = np.ix_(kept_rows, kept_columns)
    index = (row_cell[kept_rows, None] * side + column_cell[None, kept_columns]).ravel()

    def total(image):
        return np.stack([np.bincount(index, image[..., c].ravel(), side * side) for c in range(3)], axis=1)

    usable, saturated, black = photo.usable[window], photo.saturated[window], photo.black[window]
    shown = photo.pixels[window]
    pixels = np.where(usable, shown, 0.0).astype(float)
    everything = np.bincount(index, minlength=side * side)[:, None]
    count, light = total(usable), total(pixels)
    safe = np.maximum(count, 1)
    mean = light / safe
    scatter = np.maximum(total(pixels**2) / safe - mean**2, 0.0)
    stated = total(np.where(usable, photo.variance[window], 0.0)) / safe
    # JPEG blocks and demosaicking tie some four pixels to one independent one.
    sigma = np.sqrt(np.maximum(scatter, stated) * np.minimum(4.0, safe) / safe)

    middle = (np.arange(side) + 0.5 - half) / per_radius
    corner = np.hypot(*np.meshgrid(middle, middle)).ravel() + np.sqrt(0.5) / per_radius
    on_disc = corner < DISC_MARGIN
    down = _where(row_cell, (row - registration.row) / registration.radius, middle)
    right = _where(column_cell, (column - registration.column) / registration.radius, middle)
    right, up = (axis.ravel() for axis in np.meshgrid(right, -down))
    distance = np.hypot(right, up)
    good = (count >= LEAST_USABLE * everything) & (everything > 0)
    # What is overexposed is at least as bright as the least of it, what is black at most as bright as the most of it.
    over, under = total(saturated), total(black)
    known = ~good & (count + over + under >= LEAST_USABLE * everything)
    limit = np.where(known, np.sign(over) * (under == 0) - np.sign(under) * (over == 0), 0.0)
    least, most = _end(shown, saturated, np.min), _end(shown, black, np.max)
    bound = (light + over * least + under * most) / np.maximum(count + over + under, 1)
    mean = np.where(limit == 0, mean, bound)
    ring = np.flatnonzero((distance > SKY_INNER) & (distance < SKY_OUTER))
    seen = ring[everything[ring, 0] > 0]
    sky = np.resize(seen if seen.size else ring, SKY_CELLS) if seen.size < SKY_CELLS else _spread(seen, SKY_CELLS)
    chosen = np.concatenate([np.flatnonzero(on_disc), sky])
    usable, limit = good[chosen], limit[chosen]
    repeated = slice(on_disc.sum() + seen.size, None)  # only to fill the array
    usable[repeated], limit[repeated] = False, 0.0
    return Cells(right[chosen], up[chosen], mean[chosen], sigma[chosen], usable, limit, on_disc[chosen])


def _where(cell: np.ndarray, place: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Mean place of the pixels of each row of cells (cell,), up to half a pixel from its middle.

    Where a whole number of pixels fits into a cell, all cells are off alike, and the disc with them.

    - `cell`, `place`: of each row of pixels (pixel,); `middle`: of each of cells, where there are no pixels (cell,).
    """
    inside = (cell >= 0) & (cell < middle.size)
    count = np.bincount(cell[inside], minlength=middle.size)
    total = np.bincount(cell[inside], place[inside], middle.size)
    return np.where(count > 0, total / np.maximum(count, 1), middle)


def _end(pixels: np.ndarray, chosen: np.ndarray, extreme) -> np.ndarray:
    """Extreme value of the chosen pixels of each channel (3,); 0 where there are none."""
    each = (pixels[..., c][chosen[..., c]] for c in range(3))
    return np.array([extreme(values) if values.size else 0.0 for values in each])


def _spread(indices: np.ndarray, count: int) -> np.ndarray:
    """`count` of the indices, evenly."""
    return indices[np.linspace(0, indices.size - 1, count).astype(int)]
