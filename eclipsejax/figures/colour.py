"""The colour of what is left of sunlight."""

from functools import cache

import jax.numpy as jnp
import numpy as np

from eclipsejax.response import LUMINANCE, responses, trapezoid_weights, wavelengths
from eclipsejax.sun import Sun

COUNT = 81  # every 5 nm


def sunlight_wavelengths() -> np.ndarray:
    """[nm], the last axis of what `sunlight_colour` takes."""
    return wavelengths(COUNT)


@cache
def _weights() -> np.ndarray:
    """From transmission to linear sRGB, (wavelength, 3); unweakened sunlight has the luminance 1."""
    grid = sunlight_wavelengths()
    light = np.asarray(Sun().irradiance(jnp.asarray(grid))) * trapezoid_weights(grid)
    weights = light[:, None] * responses("srgb", grid)
    return weights / (weights.sum(axis=0) @ np.asarray(LUMINANCE))


def sunlight_colour(transmission: np.ndarray) -> np.ndarray:
    """Linear sRGB of sunlight times a transmission, (..., wavelength) to (..., 3); whole sunlight has luminance 1."""
    return np.asarray(transmission) @ _weights()
