"""Numbers straight from a sensor, proportional to light: FITS, camera RAW. Each needs an optional package."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from eclipsejax.errors import InputError
from inverse.decoded import MAXIMUM_PIXELS, Decoded, check_size, too_large
from inverse.developed import scale_of_floats
from inverse.exif import facts, facts_of_fits, positive, tags_of_file

_MOST_UNITS = 100  # a small packed file can hold millions of empty ones, or one of terabytes
_MOST_SKIPPED = 4e9  # bytes
_SATURATION = 0.95  # of the white level: sensors are linear up to near it, and the last per cent are not


def fits(path: Path) -> Decoded:
    """The first image of a FITS file: (row, column), or (3, row, column) for colour.

    Row 1 is the bottom one, as is the custom, unless ROWORDER says TOP-DOWN. Full scale is SATURATE or
    DATAMAX where given, else the range of the integer type, else 1 or the brightest value of floats.
    """
    try:
        from astropy.io import fits as astropy_fits
    except ImportError:
        raise InputError(f"{path} is FITS, which needs astropy: pip install 'eclipsejax[fits]'.") from None
    # Opened here: astropy leaves a file that it refuses open.
    with path.open("rb") as file, astropy_fits.open(file, memmap=False) as units:
        unit: Any  # astropy annotates it as the list itself
        skipped = 0
        for number, unit in enumerate(units, 1):
            header = unit.header
            shape = tuple(header.get(f"NAXIS{i}", 0) for i in range(header.get("NAXIS", 0), 0, -1))
            if isinstance(unit, astropy_fits.CompImageHDU):
                shape = unit.shape
            if unit.is_image and len(shape) >= 2 and min(shape) > 0:
                break
            skipped += unit.size
            if number == _MOST_UNITS or skipped > _MOST_SKIPPED:
                raise InputError(f"{path} holds no image at its beginning: save the image in a file by itself.")
        else:
            raise InputError(f"{path} holds no image among its {len(units)} FITS units.")
        while len(shape) > 2 and shape[0] == 1:
            shape = shape[1:]
        if len(shape) != 2 and (len(shape) != 3 or shape[0] != 3):
            raise InputError(f"{path} holds an array of shape {shape}; (row, column) or (3, row, column) is needed.")
        check_size(path, *shape[-2:])
        if "BAYERPAT" in header and len(shape) == 2:
            # Which row the pattern counts from differs between programs; a wrong guess swaps the colours.
            raise InputError(f"{path} is a colour mosaic that was not debayered (BAYERPAT): debayer it first.")
        data = np.asarray(unit.data).reshape(shape)
        primary: Any = units[0]
        known = dict(primary.header) | dict(header)
    values = data[..., None] if data.ndim == 2 else np.moveaxis(data, 0, -1)
    if str(known.get("ROWORDER", "")).strip().upper() != "TOP-DOWN":
        values = values[::-1]
    integer = np.issubdtype(values.dtype, np.integer)
    full_scale = positive(known.get("SATURATE", known.get("DATAMAX")), at_most=1e12)
    if full_scale is None and values.dtype.itemsize <= 2 and integer:
        full_scale = float(np.iinfo(values.dtype).max)
    values = values.astype(np.float32)
    if not np.isfinite(values).any():
        raise InputError(f"{path} holds no finite value.")
    return Decoded(
        values,
        facts_of_fits(known),
        "FITS",
        "linear",
        full_scale=full_scale or scale_of_floats(values),
        step=1.0 if integer else 0.0,
    )


def camera_raw(path: Path) -> Decoded:
    """Camera RAW through LibRaw: half the size, each 2 x 2 cell of the mosaic becomes one pixel.

    Black is subtracted channel by channel and the result divided by (white - black); the camera's white
    balance is *not* applied, and no colour matrix is. A channel is saturated from 95 % of white. The
    orientation is applied.

    Verified on synthetic DNG files only; CR2, NEF and their kin are unverified, for want of a sample.
    """
    try:
        import rawpy
    except ImportError:
        raise InputError(f"{path} is camera RAW, which needs rawpy: pip install 'eclipsejax[raw]'.") from None
    with rawpy.RawPy() as raw:
        raw.open_file(str(path))
        sizes = raw.sizes
        if sizes.height * sizes.width > 4 * MAXIMUM_PIXELS:
            raise too_large(path, sizes.height * sizes.width)
        raw.unpack()
        mosaic = raw.raw_type == rawpy.RawType.Flat
        check_size(path, sizes.height // (1 + mosaic), sizes.width // (1 + mosaic))
        sensor = raw.raw_image_visible.copy()  # LibRaw's memory goes with it
        letters, other = raw.color_desc.decode("ascii"), raw.other
        black = np.array(raw.black_level_per_channel, dtype=np.float32)
        white = np.full(4, raw.white_level, dtype=np.float32)
        clip = white
        if raw.camera_white_level_per_channel is not None:  # where each channel of this very picture clips
            stated = np.array(raw.camera_white_level_per_channel, dtype=np.float32)
            clip = np.where(stated > black, np.minimum(stated, white), white)
        top, left = sizes.top_margin, sizes.left_margin
        colours = np.array([[raw.raw_color(top + i, left + j) for j in range(12)] for i in range(12 * mosaic)])
    if mosaic:
        regular = (colours == np.tile(colours[:2, :2], (6, 6))).all()
        if not regular or {letters[colour] for colour in colours.flat} != set("RGB"):
            raise InputError(f"{path} is not a mosaic of 2 x 2 red, green, blue: convert it to a 16-bit TIFF.")
        planes = [(sensor[i::2, j::2], int(colours[i, j])) for i in (0, 1) for j in (0, 1)]
    else:  # demosaiced already: LinearRaw DNG
        planes = [(sensor[..., colour], colour) for colour in range(3)]
    if not (white > black).all():
        raise InputError(f"{path} states a black level above its white level: convert it to a 16-bit TIFF.")

    rows, columns = (min(plane.shape[axis] for plane, _ in planes) for axis in (0, 1))
    channels = ["RGB".index(letters[colour]) for _, colour in planes]
    averaged = np.bincount(channels, minlength=3).astype(np.float32)
    values, step = np.zeros((rows, columns, 3), dtype=np.float32), np.zeros(3, dtype=np.float32)
    saturated, clipped = np.zeros((2, rows, columns, 3), dtype=bool)
    for channel, (plane, colour) in zip(channels, planes, strict=True):
        plane, span = plane[:rows, :columns], white[colour] - black[colour]
        values[..., channel] += (plane - black[colour]) / (span * averaged[channel])
        saturated[..., channel] |= plane >= black[colour] + _SATURATION * (clip[colour] - black[colour])
        clipped[..., channel] |= plane == 0
        step[channel] = 1 / span
    given = facts(tags_of_file(path))
    given = replace(
        given,
        exposure_s=given.exposure_s or positive(other.shutter_speed, at_most=86400.0),
        iso=given.iso or positive(other.iso_speed, at_most=1e7),
        f_number=given.f_number or positive(other.aperture, at_most=1000.0),
        focal_length_mm=given.focal_length_mm or positive(other.focal_length, at_most=1e6),
        orientation=1,  # LibRaw's flip is the same tag, read for every maker
    )
    values, saturated, clipped = (_flipped(array, sizes.flip) for array in (values, saturated, clipped))
    return Decoded(values, given, "RAW", "linear", step=step, averaged=averaged, saturated=saturated, clipped=clipped)


def _flipped(array: np.ndarray, flip: int) -> np.ndarray:
    """LibRaw's flip: bit 1 turns rows end to end, bit 0 columns, then bit 2 swaps the two."""
    array = array[::-1] if flip & 2 else array
    array = array[:, ::-1] if flip & 1 else array
    return array.swapaxes(0, 1) if flip & 4 else array
