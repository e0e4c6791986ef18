"""From a spectrum to three numbers to a picture: observer and camera responses, sRGB and its encoding.

Tables and matrices are numpy, made once outside jit; the encodings are jax.numpy and differentiable.
"""

from functools import cache
from importlib.resources import files
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, UInt8

from eclipsejax.errors import InputError

# Linear sRGB from CIE 1931 XYZ, white D65: IEC 61966-2-1:1999, with the standard's own four decimals.
SRGB_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])

# Luminance of linear sRGB, the Y row of the inverse (ITU-R BT.709).
LUMINANCE = (0.2126, 0.7152, 0.0722)

TABLES = {
    "xyz": "cie1931_2deg_5nm.csv",
    "nikon_5100": "camera_sensitivity_nikon_5100_npl.csv",
    "sigma_sdmerill": "camera_sensitivity_sigma_sdmerill_npl.csv",
}

# Below this an sRGB value is linear: 0.0031308 in light, 0.04045 in code.
LINEAR_LIGHT, LINEAR_CODE = 0.0031308, 0.04045


def wavelengths(count: int = 200) -> Float[np.ndarray, " wavelength"]:
    """The reference grid, 380-780 nm in equal steps [nm]: 200 as in Yapo & Cutler 2009."""
    return np.linspace(380.0, 780.0, count)


def trapezoid_weights(wavelength: Float[np.ndarray, " wavelength"]) -> Float[np.ndarray, " wavelength"]:
    """Weights that integrate a spectrum over an ascending grid [nm]."""
    step = np.diff(np.asarray(wavelength, dtype=float))
    return 0.5 * (np.concatenate([[0.0], step]) + np.concatenate([step, [0.0]]))


def gauss_wavelengths(
    count: int, start: float = 380.0, stop: float = 780.0
) -> tuple[Float[np.ndarray, " wavelength"], Float[np.ndarray, " wavelength"]]:
    """Gauss-Legendre wavelengths [nm] and weights [nm] for an integral from `start` to `stop` [nm]."""
    node, weight = np.polynomial.legendre.leggauss(count)
    return start + 0.5 * (stop - start) * (node + 1), 0.5 * (stop - start) * weight


def responses(name: str | Path, wavelength: Float[ArrayLike, " wavelength"]) -> Float[np.ndarray, "wavelength 3"]:
    """Three spectral responses at the given wavelengths, cubic in the 5 nm tables, zero outside them [-].

    Colour matching functions are scaled as the CIE has them (peak of y-bar 1), cameras to a peak of 1 in
    their strongest channel; "srgb" is the matrix of IEC 61966-2-1 applied to "xyz": it has negative lobes.

    - `name`: "xyz" (CIE 1931, 2 degrees), "srgb", "nikon_5100", "sigma_sdmerill" (both measured at NPL), the
      name of any other set in colour-science, or the path of a CSV file: wavelength [nm] and three columns.
    - `wavelength`: [nm].
    """
    from scipy.interpolate import CubicSpline

    grid, table = _table("xyz" if name == "srgb" else name)
    wavelength = np.asarray(wavelength, dtype=float)
    inside = (wavelength >= grid[0]) & (wavelength <= grid[-1])
    # The spline swings a little below zero where a response ends; no sensor does.
    value = np.maximum(CubicSpline(grid, table)(np.clip(wavelength, grid[0], grid[-1])), 0.0)
    value = np.where(inside[:, None], value, 0.0)
    return value @ SRGB_FROM_XYZ.T if name == "srgb" else value


@cache
def _table(name: str | Path) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(name, Path) or str(name).endswith(".csv"):
        return _read_table(Path(name))
    if name in TABLES:
        return _read_table(files("eclipsejax").joinpath("tables", TABLES[name]))
    import colour

    for collection in (colour.MSDS_CMFS, colour.MSDS_CAMERA_SENSITIVITIES):
        if name in collection:
            return np.asarray(collection[name].wavelengths), np.asarray(collection[name].values)
    known = ", ".join(["srgb", *TABLES])
    raise InputError(f"There is no spectral response {name!r}: take {known} or the path of a CSV table.")


def _read_table(source) -> tuple[np.ndarray, np.ndarray]:
    try:
        with source.open() as lines:
            table = np.loadtxt(lines, delimiter=",")
        if table.ndim != 2 or table.shape[1] != 4 or (np.diff(table[:, 0]) <= 0).any():
            raise ValueError
    except (OSError, ValueError) as error:
        raise InputError(
            f"The response table {source} cannot be read: give a CSV file of ascending wavelength [nm] and"
            " three responses, with comments after #."
        ) from error
    return table[:, 0], table[:, 1:]


@cache
def srgb_from_camera(name: str | Path) -> Float[np.ndarray, "3 3"]:
    """From a camera's channels to linear sRGB, both white in daylight, so that rows sum to 1.

    Least squares over the 24 fields of the chart of ISO 17321-1 in D65; rms 0.010 for the Nikon D5100.

    - `name`: of the camera, as of `responses`.
    """
    from colour import SDS_COLOURCHECKERS, SDS_ILLUMINANTS

    wavelength = np.arange(380.0, 785.0, 5.0)
    along = lambda spectrum: np.interp(wavelength, spectrum.wavelengths, spectrum.values)
    chart = np.array([along(field) for field in SDS_COLOURCHECKERS["ISO 17321-1"].values()])
    daylight = along(SDS_ILLUMINANTS["D65"])[:, None]
    weights = [responses(one, wavelength) * daylight for one in (name, "srgb")]
    camera, wanted = (chart @ weight / weight.sum(axis=0) for weight in weights)
    others = camera[:, [0, 2]] - camera[:, [1]]
    (red, blue), *_ = np.linalg.lstsq(others, wanted - camera[:, [1]], rcond=None)
    return np.stack([red, 1.0 - red - blue, blue], axis=1)


def linear_from_xyz(xyz: Float[ArrayLike, "... 3"]) -> Float[Array, "... 3"]:
    """Linear sRGB of CIE 1931 XYZ (Y = 1 for white); negative where the colour lies outside the gamut."""
    return jnp.asarray(xyz) @ SRGB_FROM_XYZ.T


def encode_srgb(linear: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    """Code value of linear light, both with full scale 1: IEC 61966-2-1. Linear below 0.0031 and below 0."""
    linear = jnp.asarray(linear)
    curved = linear > LINEAR_LIGHT
    power = jnp.where(curved, linear, 1.0) ** (1 / 2.4)
    return jnp.where(curved, 1.055 * power - 0.055, 12.92 * linear)


def decode_srgb(code: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    """Linear light of a code value, both with full scale 1: the inverse of `encode_srgb` (to 3e-8)."""
    code = jnp.asarray(code)
    curved = code > LINEAR_CODE
    power = ((jnp.where(curved, code, 1.0) + 0.055) / 1.055) ** 2.4
    return jnp.where(curved, power, code / 12.92)


def into_gamut(linear: Float[ArrayLike, "... 3"]) -> Float[Array, "... 3"]:
    """Linear sRGB moved into [0, 1] along the line to the grey of its luminance, which it keeps.

    The umbra is redder than the sRGB primary (green and blue negative). Plain clipping would add light to
    those channels, brighten the pixel and turn its hue; mixing in just enough grey changes saturation only.
    Highlights fade to white likewise. Luminances outside [0, 1] become black and white.
    """
    linear = jnp.asarray(linear)
    grey = jnp.clip(linear @ jnp.asarray(LUMINANCE, dtype=linear.dtype), 0.0, 1.0)[..., None]
    lowest = jnp.min(linear, axis=-1, keepdims=True)
    highest = jnp.max(linear, axis=-1, keepdims=True)
    below, above = lowest < 0.0, highest > 1.0
    # Share of the colour difference that fits; grey lies between the extremes, except where it was clipped.
    room_below = jnp.where(below, grey / jnp.where(below, jnp.maximum(grey - lowest, 1e-30), 1.0), 1.0)
    room_above = jnp.where(above, (1 - grey) / jnp.where(above, jnp.maximum(highest - grey, 1e-30), 1.0), 1.0)
    share = jnp.minimum(room_below, room_above)
    return jnp.clip(grey + share * (linear - grey), 0.0, 1.0)


def display(image: Float[ArrayLike, "row column 3"], gain: float = 1.0) -> np.ndarray:
    """Picture to look at, uint8 sRGB: `gain` x linear sRGB, brought `into_gamut` and encoded; NaN is black.

    - `gain`: 1 shows the mean full Moon at full scale; an umbra needs 1e3 to 1e5.
    """
    return np.asarray(displayed(jnp.asarray(image), jnp.asarray(gain, dtype=float)))


@jax.jit
def displayed(image: Float[Array, "row column 3"], gain: Float[Array, ""]) -> UInt8[Array, "row column 3"]:
    """`display`, compiled: each of its operations by itself would take longer than all in one."""
    linear = jnp.nan_to_num(gain * image, nan=0.0)
    return jnp.round(255.0 * encode_srgb(into_gamut(linear))).astype(jnp.uint8)


def bright_gain(
    image: Float[np.ndarray, "row column 3"], share: float = 99.0, level: float = 0.8, *, digits: int | None = 2
) -> float:
    """Gain for `display` that shows the bright part of a linear picture near full scale; 1 for a black one [-].

    - `share`: percentile of the lit pixels, each by its brightest channel, that is brought to `level` [full scale].
    - `digits`: to which the gain is rounded, so that it can be told and given again; None for all.
    """
    brightest = image.max(axis=-1)
    lit = brightest[brightest > 0.0]
    gain = level / float(np.percentile(lit, share)) if lit.size else 1.0
    return gain if digits is None else float(f"{gain:.{digits}g}")
