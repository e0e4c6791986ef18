"""What one molecule of air does to light of one wavelength: refractivity and cross-sections."""

from functools import cache
from importlib.resources import files

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

# Molecules per m^3 at 15 C and 1013.25 hPa (Bodhaine et al. 1999, section 2).
STANDARD_NUMBER_DENSITY = 2.546899e25


def ciddor_refractivity(wavelength: Float[Array, ""]) -> Float[Array, ""]:
    """Refractivity n - 1 [-] of dry air with 450 ppm CO2 at 15 C and 101325 Pa.

    Ciddor (1996), Applied Optics 35, 1566, equation 1; 300-1690 nm, wavelength in vacuum [nm].
    """
    wavenumber_squared = (1e3 / wavelength) ** 2  # um^-2
    return 1e-8 * (5792105.0 / (238.0185 - wavenumber_squared) + 167917.0 / (57.362 - wavenumber_squared))


def king_factor(wavelength: Float[Array, ""]) -> Float[Array, ""]:
    """What the anisotropy of molecules adds to Rayleigh scattering by dry air with 360 ppm CO2, as a factor [-].

    Bates (1984), through Bodhaine et al. (1999), equations 5, 6 and 23.
    """
    um2 = (wavelength * 1e-3) ** 2
    king_nitrogen = 1.034 + 3.17e-4 / um2
    king_oxygen = 1.096 + 1.385e-3 / um2 + 1.448e-4 / um2**2
    carbon_dioxide = 0.036  # per cent by volume
    return (78.084 * king_nitrogen + 20.946 * king_oxygen + 0.934 + carbon_dioxide * 1.15) / (
        78.084 + 20.946 + 0.934 + carbon_dioxide
    )


def rayleigh_cross_section(wavelength: Float[Array, ""]) -> Float[Array, ""]:
    """Rayleigh scattering cross-section of a molecule of dry air with 360 ppm CO2 [m^2].

    Bodhaine, Wood, Dutton & Slusser (1999), J. Atmos. Oceanic Technol. 16, 1854, equations 5, 6, 18-23: refractive
    index of Peck & Reeder (1972) and King factor of Bates (1984). 250-850 nm.
    """
    um2 = (wavelength * 1e-3) ** 2
    index_300ppm = 1e-8 * (8060.51 + 2480990.0 / (132.274 - 1.0 / um2) + 17455.7 / (39.32957 - 1.0 / um2))
    refractivity = index_300ppm * (1.0 + 0.54 * (360e-6 - 300e-6))
    n_squared_less_one = refractivity * (2.0 + refractivity)  # without the cancellation, for float32
    # In the units of micrometres and 1e25 m^-3, so that float32 neither overflows nor underflows on the way.
    polarisability = n_squared_less_one / ((3.0 + n_squared_less_one) * STANDARD_NUMBER_DENSITY * 1e-25)
    return 24.0 * jnp.pi**3 * polarisability**2 / um2**2 * king_factor(wavelength) * 1e-26


@cache
def _ozone_table() -> tuple[np.ndarray, np.ndarray]:
    source = files("eclipsejax") / "tables" / "o3_xsec_brion_malicet_295K_1nm_cm2.csv"
    with source.open() as lines:
        wavelength, cross_section_cm2 = np.loadtxt(lines, delimiter=",").T
    return wavelength, cross_section_cm2 * 1e-4


def ozone_cross_section(wavelength: Float[Array, ""]) -> Float[Array, ""]:
    """Ozone absorption cross-section at 295 K [m^2], linear between 1 nm means of 320-829 nm.

    Malicet et al. (1995) below 345 nm, Brion et al. (1998) above. One temperature serves: from 193 to 293 K it
    changes by 1.5 % at 550-650 nm; the data sets differ by 2-3 %.
    """
    grid, cross_section = _ozone_table()
    return jnp.interp(wavelength, jnp.asarray(grid, dtype=float), jnp.asarray(cross_section, dtype=float))
