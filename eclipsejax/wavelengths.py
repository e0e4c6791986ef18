"""A few wavelengths that stand for the whole spectrum in the colours of the shadow.

The light of the shadow varies with wavelength by orders of magnitude, but always in much the same way: so what lies
between a few wavelengths is a mixture of the nearest of them, with shares fitted once to the spectra of many
atmospheres and offsets. The integral of Sun x Moon x response over the spectrum then is a weighted sum over the few.
Taking the bins' middles instead, 40 of them, errs by 1 % in the blue of the umbra (tests/test_wavelengths.py).
"""

from functools import cache
from importlib.resources import files

import jax.numpy as jnp
import numpy as np

from eclipsejax.moon import Moon
from eclipsejax.response import responses
from eclipsejax.sun import Sun

ENDS = (380.0, 780.0)  # nm
FEW = ("srgb", "nikon_5100")
MANY = 200  # wavelengths of the reference, as in Yapo & Cutler (2009)


def channel_weights(sun: Sun, moon: Moon, response: str, count: int):
    """Wavelengths [nm] and weights (wavelength, channel) that turn irradiance into channels, above the air.

    The uneclipsed Moon has 1 in the second channel: luminance or green.

    - `response`: "srgb", of which the channels are XYZ, or a camera of `response.responses`.
    - `count`: 8, 16, 24 or 48 wavelengths, of which those that the response does not see are left out; 8 (7 of a
      camera) are for the responses of `FEW` and the default Sun alone, where else 16 are taken.
    """
    if count == 8 and response in FEW and sun.spectrum == Sun().spectrum:
        return few_wavelengths(response)
    wavelength, mixture = mixtures(max(count, 16))
    name = "xyz" if response == "srgb" else response
    _, weights = binned_weights(sun, moon, name, MANY)
    seen = np.abs(mixture).T @ responses(name, middles(MANY)) > 0.0  # a camera's filter passes less than the eye
    kept = np.any(seen, axis=1)
    return jnp.asarray(wavelength[kept]), jnp.asarray(mixture[:, kept]).T @ weights


def binned_weights(sun: Sun, moon: Moon, response: str, count: int):
    """Wavelengths [nm] and weights (wavelength, channel), equally spaced from 380 to 780 nm.

    Each weight is the integral of Sun x Moon x response over a bin, on a 0.5 nm grid, so that Fraunhofer lines
    average out; the irradiance is taken at the bin's middle.
    """
    bins = np.linspace(*ENDS, count + 1)
    fine = np.arange(380.25, 780.0, 0.5)
    light = sun.irradiance(jnp.asarray(fine)) * moon.spectrum(jnp.asarray(fine))
    member = np.clip(np.searchsorted(bins, fine) - 1, 0, count - 1)[None, :] == np.arange(count)[:, None]
    weights = jnp.asarray(member, dtype=float) @ (light[:, None] * responses(response, fine))
    return jnp.asarray(middles(count)), weights / jnp.sum(weights[:, 1])


def middles(count: int) -> np.ndarray:
    """Middles of equal bins [nm]."""
    bins = np.linspace(*ENDS, count + 1)
    return 0.5 * (bins[1:] + bins[:-1])


@cache
def few_wavelengths(response: str):
    """Wavelengths [nm] and weights (wavelength, 3) fitted to a response: `tables/make_few_wavelengths.py`.

    Largest errors, over the umbra under atmospheres that are not those of the fit: eight for XYZ 0.1 % of the brightest
    of linear sRGB, seven for a camera 0.3 % of each channel.
    """
    with files("eclipsejax").joinpath(f"tables/few_wavelengths_{response}.csv").open() as lines:
        table = np.loadtxt(lines, delimiter=",", skiprows=3)
    return table[:, 0], table[:, 1:]


@cache
def mixtures(count: int):
    """Wavelengths [nm] and their shares (200, wavelength) in the light at those of `binned_weights`.

    Largest errors of a channel, XYZ or a camera's, over the umbra and penumbra under 60 random atmospheres that are
    not those of the fit: 6e-3 with 16, 7e-4 with 24, 7e-5 with 48; `tables/make_wavelength_mixtures.py` prints them.
    """
    with files("eclipsejax").joinpath("tables/wavelength_mixtures.npz").open("rb") as file, np.load(file) as table:
        return table[f"wavelength_{count}"], table[f"mixture_{count}"]
