"""Grazing rays at the heights and wavelengths of the figures: one shape, so that one compilation serves them all."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from eclipsejax.figures.colour import sunlight_wavelengths
from eclipsejax.limb import impact_parameter
from eclipsejax.limb_table import grazing_rays

COUNT = 281  # every 250 m from the ground to 70 km


class LimbRays(NamedTuple):
    """Rays of one atmosphere.

    - `height`: tangent heights, evenly spaced [m].
    - `impact` [m], `bending` [rad], `depth` [-]: (height, wavelength), wavelengths as `sunlight_wavelengths`.
    """

    height: np.ndarray
    impact: np.ndarray
    bending: np.ndarray
    depth: np.ndarray

    def arrival(self, distance: float) -> np.ndarray:
        """Distance from the axis of rays from the Sun's centre [m], (height, wavelength); negative: beyond the axis.

        The Sun is taken to be infinitely far away.

        - `distance`: behind the Earth's centre [m].
        """
        return self.impact / np.cos(self.bending) - distance * np.tan(self.bending)

    def nearest(self, heights) -> np.ndarray:
        """Indices of tangent heights [m]."""
        return np.abs(self.height - np.asarray(heights)[:, None]).argmin(axis=1)


def limb_rays(atmosphere, low: float = 0.0, high: float = 70e3) -> LimbRays:
    """`COUNT` rays between two tangent heights [m]."""
    height = np.linspace(low, high, COUNT)
    traced = _traced(atmosphere, jnp.asarray(height), jnp.asarray(sunlight_wavelengths()))
    return LimbRays(height, *(np.asarray(values) for values in traced))


def columns(wavelengths) -> np.ndarray:
    """Indices of some wavelengths [nm] among `sunlight_wavelengths`."""
    return np.searchsorted(sunlight_wavelengths(), np.asarray(list(wavelengths)))


@eqx.filter_jit
def _traced(atmosphere, height, wavelength):
    return impact_parameter(atmosphere, height[:, None], wavelength), *grazing_rays(atmosphere, height, wavelength)
