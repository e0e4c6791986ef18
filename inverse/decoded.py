"""What every reader hands on: the stored numbers and what they stand for; and the limits on their size."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from eclipsejax.errors import InputError
from inverse import tone
from inverse.exif import Facts

MINIMUM_SIDE = 64  # pixels; a smaller picture holds no Moon with a limb worth fitting
MAXIMUM_PIXELS = 150_000_000
BYTES_PER_PIXEL = 40  # at the peak of reading: three channels of pixels, variance, masks, codes


@dataclass(frozen=True)
class Decoded:
    """Pixels as stored and how to read them.

    - `values`: (row, column, 1 or 3), uint8 or uint16 codes, or float32.
    - `default`: the curve that files of this kind have as a rule, "srgb" or "linear".
    - `curve`: from value / full_scale to linear light, where the file names one of its own.
    - `primaries`: as in `Photo`.
    - `step`: quantisation of a value, (3,) or one number; 0 for floats.
    - `noise`: variance of a value by compression, (3,) or one number.
    - `averaged`: samples behind each channel (a green of a Bayer mosaic is the mean of two).
    - `saturated`, `clipped`: masks as `values`, where the reader knows better than the thresholds of
      photo.py.
    """

    values: np.ndarray
    facts: Facts
    format: str
    default: str
    curve: tone.Curve | None = None
    primaries: np.ndarray = field(default_factory=lambda: np.eye(3))
    full_scale: float = 1.0
    step: np.ndarray | float = 1.0
    noise: np.ndarray | float = 0.0
    averaged: np.ndarray | float = 1.0
    saturated: np.ndarray | None = None
    clipped: np.ndarray | None = None


def too_large(path: Path, pixels: int) -> InputError:
    gigabytes = pixels * BYTES_PER_PIXEL / 1e9
    return InputError(
        f"{path} has {pixels / 1e6:.0f} megapixels and would need about {gigabytes:.0f} GB of memory; "
        f"the limit is {MAXIMUM_PIXELS // 10**6} megapixels: crop or shrink it."
    )


def check_size(path: Path, rows: int, columns: int) -> None:
    if rows * columns > MAXIMUM_PIXELS:
        raise too_large(path, rows * columns)
    if min(rows, columns) < MINIMUM_SIDE:
        raise InputError(
            f"{path} has only {columns} x {rows} pixels; at least {MINIMUM_SIDE} x {MINIMUM_SIDE} are needed."
        )
