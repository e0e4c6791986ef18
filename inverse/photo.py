"""A photograph: linear pixels with their variance and masks, and when, where and how it was taken."""

import hashlib
import stat
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from eclipsejax.errors import InputError
from inverse import tone
from inverse.decoded import Decoded
from inverse.exif import Facts
from inverse.filetype import decode

# Electrons that fill a pixel at ISO 100, times 100, and the noise of reading it: from memory, DSLRs of
# 2005-2020 have 20 000 - 60 000 and 2 - 5 electrons, phones fewer. Only the order of magnitude counts:
# stacking, shrinking and the camera's own denoising change it as much, and the fit has an amplitude of its
# own for the noise.
_ELECTRONS_TIMES_ISO = 4e6
_READ_ELECTRONS = 2.0
_UNKNOWN_ISO = 800.0

_ENCODED_SATURATION = 252 / 255  # the shoulder of a tone curve bends the last few codes
_LINEAR_SATURATION = 0.98
_BEYOND = np.float32(1e6)  # full scales, more than any picture has
_BLACK_CODE = 1  # codes 0 and 1 hold whatever was too dark for the file


@dataclass(frozen=True, eq=False)
class Photo:
    """A photograph in linear light. Arrays are (row, column, channel) with channels red, green, blue.

    - `pixels`: float32, linear, 1 = full scale of the file; slightly outside [0, 1] for RAW and FITS.
    - `variance`: float32, of `pixels`, [full scale^2]: rounding, JPEG, photon and read noise (see
      `read_photo`).
    - `usable`: finite in the file (what is not is 0 here), not saturated, not in the black clip.
    - `saturated`: at the top of the scale, channel by channel; `black`: at the bottom of a scale of codes.
    - `tone_curve`: "srgb" for a picture encoded for the eye, whose true curve is the camera's secret;
      "linear".
    - `time`: UTC, ISO with Z, only where the file itself is certain of it; `local_time`: the camera clock,
      without a zone, never to be taken as UTC.
    - `exposure_s` [s], `iso`, `f_number`, `focal_length_mm` [mm], `camera`: as the file states them.
    - `site`: (latitude, longitude) [degrees], north and east positive.
    - `balanced_once`, `balance`: of its white balance, as of `Facts`.
    - `path`, `sha256`, `format` ("JPEG", "PNG", "TIFF", "FITS", "RAW").
    - `primaries`: (3, 3) matrix from linear sRGB to the channels of the file; the identity but for pictures
      with a wide-gamut colour profile (Display P3 of phones), and unknown (the identity) for RAW and FITS.
      `pixels` stay in the file's own channels, so that saturation and noise stay those of one channel each.
    """

    pixels: np.ndarray
    variance: np.ndarray
    usable: np.ndarray
    saturated: np.ndarray
    black: np.ndarray
    tone_curve: str
    time: str | None
    local_time: str | None
    exposure_s: float | None
    iso: float | None
    f_number: float | None
    focal_length_mm: float | None
    camera: str | None
    site: tuple[float, float] | None
    balanced_once: bool | None
    balance: tuple[float, float] | None
    path: str
    sha256: str
    format: str
    primaries: np.ndarray = field(default_factory=lambda: np.eye(3))


def read_photo(path: str | PathLike[str], *, linear: bool | None = None) -> Photo:
    """Reads JPEG, PNG, TIFF, FITS or camera RAW as linear light, the right way up.

    JPEG, PNG and integer TIFF of 8 and 16 bits are decoded from sRGB, or by the curve of their colour
    profile; FITS, RAW, floats and integers of 32 bits are linear. Grey pictures get three equal channels,
    transparent ones a black ground. `InputError`, one sentence, for whatever cannot be used.

    The variance is the sum of: rounding to whole codes (1/12 code^2) and JPEG compression
    (`tone.jpeg_noise`), both carried through the slope of the curve; photon noise, pixel / N with
    N = 4e6 / ISO electrons at full scale (ISO 800 where unknown); read noise of 2 electrons. It is a weight,
    no calibration: on JPEGs of three cameras the scatter from pixel to pixel was 0.25 to 0.8 of it (standard
    deviations), and what their smoothing took away there it left as correlation between neighbours.

    - `linear`: overrides the curve: `True` for a 16-bit TIFF of an astronomical program, `False` for sRGB.
    """
    path = Path(path)
    sha256, head = _identity(path)
    decoded = decode(path, head)
    curve = decoded.curve or (tone.srgb_to_linear if decoded.default == "srgb" else tone.linear)
    if linear is not None:
        curve = tone.linear if linear else tone.srgb_to_linear
    pixels, variance, saturated, clipped = _light(decoded, curve)
    if not (pixels > 0).any(where=~clipped):
        raise InputError(f"{path} is a black image: no pixel is brighter than black, so it shows no Moon.")
    usable = ~(saturated | clipped)
    # Floats that are 0 hold nothing: what is outside a mosaic of pictures, or was not a number.
    black = clipped & (decoded.values.dtype.kind == "u" or decoded.clipped is not None)
    known = decoded.facts
    return Photo(
        *(_upright(array, known.orientation) for array in (pixels, variance, usable, saturated, black)),
        tone_curve="linear" if curve is tone.linear else "srgb",
        **{name: getattr(known, name) for name in Facts.__dataclass_fields__ if name != "orientation"},
        path=str(path),
        sha256=sha256,
        format=decoded.format,
        primaries=decoded.primaries,
    )


def _identity(path: Path) -> tuple[str, bytes]:
    """The sha256 of a file and its first bytes; `InputError` where there is no such file to read."""
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise InputError(f"{path} is a folder: give the photograph itself.")
        if not stat.S_ISREG(mode):
            raise InputError(f"{path} is not a regular file: copy the photograph to a file first.")
        with path.open("rb") as file:
            head = file.read(32)
            file.seek(0)
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    except InputError:  # which is a ValueError
        raise
    except FileNotFoundError:
        raise InputError(f"{path} does not exist: check the name of the photograph.") from None
    except PermissionError:
        raise InputError(f"{path} may not be read: check its permissions.") from None
    except (OSError, ValueError) as error:  # a name too long, a file as a folder, a null byte
        raise InputError(f"{str(path)!r} cannot be opened ({getattr(error, 'strerror', None) or error}).") from None
    if not head:
        raise InputError(f"{path} is empty: fetch the photograph again.")
    return sha256, head


def _light(decoded: Decoded, curve: tone.Curve) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Pixels, variance, saturated and clipped, all (row, column, 3), before the turn upright."""
    values = decoded.values
    shape = (*values.shape[:2], 3)
    electrons = _ELECTRONS_TIMES_ISO / (decoded.facts.iso or _UNKNOWN_ISO)
    rounding, noise, averaged = (
        np.broadcast_to(array, 3) for array in (np.square(decoded.step) / 12, decoded.noise, decoded.averaged)
    )
    if values.dtype.kind == "u":
        # Tables: a code is one of 256 or 65536, and a 24-megapixel picture is 72 million of them.
        codes = np.arange(int(decoded.full_scale) + 1)
        light = curve(codes / decoded.full_scale)
        slope = np.gradient(light)
        values = np.broadcast_to(values, shape)
        pixels, variance = np.empty((2, *shape), dtype=np.float32)
        for i in range(3):
            table = slope**2 * (rounding[i] + noise[i]) + _sensor_noise(light, electrons)
            pixels[..., i] = light.astype(np.float32)[values[..., i]]
            variance[..., i] = table.astype(np.float32)[values[..., i]]
        top = _LINEAR_SATURATION if curve is tone.linear else _ENCODED_SATURATION
        return pixels, variance, values >= top * decoded.full_scale, values <= _BLACK_CODE
    with np.errstate(all="ignore"):  # absurd headers make absurd scales
        scaled = values / np.float32(decoded.full_scale)
    scaled = np.clip(np.where(np.isfinite(scaled), scaled, 0), -_BEYOND, _BEYOND)
    pixels = np.array(np.broadcast_to(curve(scaled), shape), dtype=np.float32)
    # The slope of the curve is left out: what is not linear here has no steps.
    variance = (rounding / decoded.full_scale**2 + _sensor_noise(pixels, electrons)) / averaged
    saturated = scaled >= _LINEAR_SATURATION if decoded.saturated is None else decoded.saturated
    # Not "below 0": once a dark frame is taken away, noise around 0 is honest.
    clipped = (scaled == 0) if decoded.clipped is None else decoded.clipped
    return (
        pixels,
        variance.astype(np.float32),
        np.broadcast_to(saturated, shape),
        np.broadcast_to(clipped, shape),
    )


def _sensor_noise(light: np.ndarray, electrons: float) -> np.ndarray:
    """Variance by photons and by reading, of linear light whose 1 is a number of electrons."""
    return np.maximum(light, 0) / electrons + (_READ_ELECTRONS / electrons) ** 2


def _upright(array: np.ndarray, orientation: int) -> np.ndarray:
    """The array turned as EXIF tag 274 asks: where row 0 and column 0 of the file belong."""
    if orientation >= 5:  # row 0 of the file is a side of the picture
        array = array.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):  # what is now row 0 belongs at the bottom
        array = array[::-1]
    if orientation in (2, 3, 6, 7):  # what is now column 0 belongs at the right
        array = array[:, ::-1]
    return np.ascontiguousarray(array)
