"""How the numbers of a file stand for light: transfer curves, colour profiles, and the noise of JPEG.

A camera does not write the sRGB curve that its file claims: it bends the shadows and the shoulder to taste.
The curves here undo what the file *says*; what the camera did besides is a nuisance parameter of the fit.
"""

import struct
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.fft import dctn

Curve = Callable[[np.ndarray], np.ndarray]

# Columns are the primaries of sRGB in the D50 space of ICC profiles (IEC 61966-2-1 adapted with Bradford's
# matrix).
_SRGB_TO_D50 = np.array(
    [[0.4360747, 0.3850649, 0.1430804], [0.2225045, 0.7168786, 0.0606169], [0.0139322, 0.0971045, 0.7141733]]
)
_BLOCKS = 2048  # blocks of a JPEG that are looked at


def srgb_to_linear(encoded: np.ndarray) -> np.ndarray:
    """Linear light in [0, 1] from sRGB-encoded values in [0, 1] (IEC 61966-2-1)."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4)


def linear(encoded: np.ndarray) -> np.ndarray:
    """The curve of a file whose numbers are proportional to light."""
    return encoded


def profile(data: bytes | None) -> tuple[Curve | None, np.ndarray]:
    """Transfer curve and primaries of an ICC profile (ICC.1:2010, 10.5, 10.15).

    The curve is `None` where there is no profile or it is not of the curves-and-matrix kind. The (3, 3)
    matrix turns linear sRGB into the file's own linear RGB; the identity for sRGB. Phones write Display P3,
    in which the pure red of sRGB is (0.82, 0.03, 0.02): unheeded, that adds 4 % of green to the deep red of
    an eclipse.
    """
    try:
        if not data or data[16:20] not in (b"RGB ", b"GRAY"):
            return None, np.eye(3)
        count = struct.unpack(">I", data[128:132])[0]
        entries = [struct.unpack(">4sII", data[132 + 12 * i : 144 + 12 * i]) for i in range(min(count, 100))]
        parts = {name: data[start : start + size] for name, start, size in entries}
        curve = _curve(parts[b"rTRC"] if b"rTRC" in parts else parts[b"kTRC"])
        curve = _sound(curve) if curve else None
        if data[16:20] == b"GRAY":
            return curve, np.eye(3)
        columns = [struct.unpack(">3i", parts[name][8:20]) for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
        from_srgb = np.linalg.solve(np.array(columns).T / 65536, _SRGB_TO_D50)
    except (struct.error, KeyError, ValueError, ArithmeticError, np.linalg.LinAlgError):
        return None, np.eye(3)
    # A profile rounds to 1/65536; the sRGB profiles in use differ by up to 0.002 from one another.
    return curve, np.eye(3) if np.abs(from_srgb - np.eye(3)).max() < 4e-3 else from_srgb


def _sound(curve: Curve) -> Curve | None:
    """The curve if it rises from about 0 to 1, `linear` if it is that, `None` if the profile is broken."""
    ramp = np.linspace(0, 1, 257)
    with np.errstate(all="ignore"):
        light = curve(ramp)
    if not (np.isfinite(light).all() and (np.diff(light) >= 0).all() and -0.1 < light[0] < 0.2 < light[-1] < 1.2):
        return None
    return linear if np.abs(light - ramp).max() < 1e-3 else curve


def _curve(data: bytes) -> Curve | None:
    """The curve of one ICC tag, type `curv` or `para`, from encoded to linear values, both in [0, 1]."""
    if data[:4] == b"curv":
        count = struct.unpack(">I", data[8:12])[0]
        if count == 0:
            return linear
        table = np.frombuffer(data, ">u2", count, 12).astype(float)
        if count == 1:
            return lambda encoded: np.maximum(encoded, 0) ** (table[0] / 256)
        return lambda encoded: np.interp(encoded, np.linspace(0, 1, count), table / 65535)
    kind = struct.unpack(">H", data[8:10])[0]
    if data[:4] != b"para" or kind > 4:
        return None
    size = (1, 3, 4, 5, 7)[kind]
    given = [value / 65536 for value in struct.unpack(f">{size}i", data[12 : 12 + 4 * size])]
    # Y = (a X + b)^g + e from X = d on, c X + f below; the lesser kinds leave some of them out.
    g, a, b, c, d, e, f = {
        0: lambda: (*given, 1, 0, 0, 0, 0, 0),
        1: lambda: (*given, 0, -given[2] / given[1], 0, 0),
        2: lambda: (*given[:3], 0, -given[2] / given[1], given[3], given[3]),
        3: lambda: (*given, 0, 0),
        4: lambda: tuple(given),
    }[kind]()
    return lambda x: np.where(x >= d, np.maximum(a * x + b, 0) ** g + e, c * x + f)


def jpeg_noise(
    codes: np.ndarray,
    tables: Mapping[int, Sequence[int]],
    components: Sequence[tuple[int, int, int, int]],
) -> np.ndarray:
    """Variance that JPEG compression added to each channel, shape (3,) [codes^2].

    Each cosine coefficient was rounded to a multiple of its step q: an error of q^2/12 where it survived.
    What fell to 0 is left out: it is mostly noise, and its loss makes the picture better. Coding and
    decoding also round luma and chroma to whole codes. One figure for the whole picture, from blocks that
    are not black sky. On a textured disc without noise of its own this is 0.5 to 1.6 times the true error
    (quality 50 to 100); with noise of 2 codes, and that added, 0.9 to 5 times, since JPEG smooths noise
    away.

    - `codes`: (row, column, 3) uint8 in the order of the file, before any rotation.
    - `tables`: quantisation tables, 64 steps each, by number.
    - `components`: (identifier, horizontal sampling, vertical sampling, table) of each component.
    """
    rows, columns = codes.shape[0] // 16, codes.shape[1] // 16
    blocks = codes[: 16 * rows, : 16 * columns].reshape(rows, 16, columns, 16, -1)
    lit = np.argwhere(blocks[:, 8, :, 8].max(axis=-1) > 8)
    if len(lit) == 0:
        lit = np.argwhere(np.ones((rows, columns)))
    row, column = lit[:: -(-len(lit) // _BLOCKS)].T
    red, green, blue = np.moveaxis(blocks[row, :, column].astype(float), -1, 0)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    planes = [luma, 0.564 * (blue - luma), 0.713 * (red - luma)]  # JFIF 1.02
    errors = [1 / 6, 1 / 6, 1 / 6] if len(components) == 3 else [0.0, 0.0, 0.0]
    for i, (_, across, down, table) in enumerate(components[:3]):
        # Chroma is stored at half size as a rule; its blocks then span 16 pixels.
        down, across = components[0][2] // down, components[0][1] // across
        if table not in tables or down not in (1, 2) or across not in (1, 2):
            continue
        small = planes[i].reshape(len(row), 16 // down, down, 16 // across, across).mean(axis=(2, 4))
        small = small.reshape(len(row), -1, 8, small.shape[2] // 8, 8).swapaxes(2, 3).reshape(-1, 8, 8)
        coefficients = np.asarray(dctn(small, axes=(1, 2), norm="ortho"))
        errors[i] += _rounding_error(coefficients, np.array(tables[table]))
    luma_error, blue_error, red_error = errors
    return np.array(
        [
            luma_error + 1.402**2 * red_error,
            luma_error + 0.344**2 * blue_error + 0.714**2 * red_error,
            luma_error + 1.772**2 * blue_error,
        ]
    )


def _rounding_error(coefficients: np.ndarray, steps: np.ndarray) -> float:
    """Mean squared error of a pixel from rounding (block, 8, 8) coefficients to multiples of 64 steps."""
    step = steps.reshape(8, 8).astype(float)
    kept = (np.abs(coefficients) > step / 2).mean(axis=0)
    kept[0, 0] = 1.0  # the mean of a block is always rounded
    return float((kept * step**2 / 12).mean())
