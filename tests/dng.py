"""Writer of a small DNG with known sensor values, since no sample of camera RAW can be shipped."""

import struct
from pathlib import Path

import numpy as np
import tifffile

_EXIF_IFD = 34665
RGGB, GRBG, BGGR = b"\0\1\1\2", b"\1\0\2\1", b"\2\1\1\0"


def write_dng(
    path: Path,
    sensor: np.ndarray,
    *,
    black: tuple[int, int, int, int] = (0, 0, 0, 0),
    white: int = 4095,
    pattern: bytes = RGGB,
    orientation: int = 1,
    exif: dict[int, str | tuple[int, int]] | None = None,
) -> None:
    """Writes sensor values as DNG 1.4 (Adobe, 2012).

    - `sensor`: uint16, (row, column) of a 2 x 2 colour mosaic, or (row, column, 3) already demosaiced.
    - `black`: black level of the 2 x 2 cell in reading order (only the first counts without a mosaic).
    - `exif`: tags of the Exif IFD, text or (numerator, denominator).
    """
    mosaic = sensor.ndim == 2
    tags: list[tuple] = [
        (271, "s", 0, "Maker"),
        (272, "s", 0, "Synthetic One"),
        (274, "H", 1, orientation),
        (50706, "B", 4, b"\1\4\0\0"),  # DNGVersion
        (50707, "B", 4, b"\1\1\0\0"),  # DNGBackwardVersion
        (50708, "s", 0, "Maker Synthetic One"),  # UniqueCameraModel
        (50721, "2i", 9, [number for entry in np.eye(3, dtype=int).flat for number in (int(entry), 1)]),
        (50728, "2I", 3, (1, 2, 1, 1, 3, 5)),  # AsShotNeutral: a white balance that the reader must not apply
        (50778, "H", 1, 21),  # CalibrationIlluminant1: D65
        (_EXIF_IFD - 1, "I", 1, 0),  # placeholder: tifffile does not write this tag of the Exif IFD itself
    ]
    if mosaic:
        tags += [
            (33421, "H", 2, (2, 2)),  # CFARepeatPatternDim
            (33422, "B", 4, pattern),  # CFAPattern
            (50710, "B", 3, b"\0\1\2"),  # CFAPlaneColor
            (50711, "H", 1, 1),  # CFALayout: rectangular
            (50713, "H", 2, (2, 2)),  # BlackLevelRepeatDim
            (50714, "H", 4, black),
            (50717, "H", 1, white),
        ]
    else:
        tags += [(50714, "H", 3, black[:1] * 3), (50717, "H", 3, (white,) * 3)]
    tifffile.imwrite(
        path,
        sensor,
        photometric="cfa" if mosaic else "linear_raw",
        extratags=[(*tag, False) for tag in tags],
        metadata=None,
        software=False,
    )
    with path.open("r+b") as file:
        position = file.seek(0, 2)
        file.write(_directory(exif or {}, position))
    with tifffile.TiffFile(path) as file:
        entry = file.pages.first.tags[_EXIF_IFD - 1].offset
    with path.open("r+b") as file:
        file.seek(entry)
        file.write(struct.pack("<HHII", _EXIF_IFD, 4, 1, position))


def _directory(tags: dict[int, str | tuple[int, int]], position: int) -> bytes:
    """A TIFF directory that starts at `position` of a little-endian file."""
    entries, values = b"", b""
    start = position + 2 + 12 * len(tags) + 4
    for tag, value in sorted(tags.items()):
        kind, count = (2, len(value) + 1) if isinstance(value, str) else (5, 1)
        data = value.encode() + b"\0" if isinstance(value, str) else struct.pack("<2I", *value)
        if len(data) <= 4:
            entries += struct.pack("<HHI4s", tag, kind, count, data)
        else:
            entries += struct.pack("<HHII", tag, kind, count, start + len(values))
            values += data
    return struct.pack("<H", len(tags)) + entries + struct.pack("<I", 0) + values
