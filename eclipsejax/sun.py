"""The Sun: a limb-darkened disc with a spectrum."""

from functools import cache
from importlib.resources import files

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.constants import ASTRONOMICAL_UNIT, SUN_RADIUS
from eclipsejax.traced import real

# Neckel (2005), Solar Physics 229, 13: A_k = c0 + c1/w + c5/w^5 with w in micrometres, below and above 422.57 nm
# (and, by extrapolation, from 380 nm; the fit begins at 385). c5 of A_5 above 422.57 nm is negative: only then do
# the A_k sum to 1.
_SPLIT = 422.57
_BELOW = (
    (0.09900, 0.010643, 0.0),
    (1.96884, -0.010643, -0.009166),
    (-2.80511, 0.0, 0.024873),
    (3.32780, 0.0, -0.029317),
    (-2.17878, 0.0, 0.018273),
    (0.58825, 0.0, -0.004663),
)
_ABOVE = (
    (0.75267, -0.265577, 0.0),
    (0.93874, 0.265577, -0.004095),
    (-1.89287, 0.0, 0.012582),
    (2.42234, 0.0, -0.017117),
    (-1.71150, 0.0, 0.011977),
    (0.49062, 0.0, -0.003347),
)
_SPECTRA = {
    "gueymard": "solar_irradiance_gueymard2004_astmg173.csv",
    "e490": "solar_irradiance_astm_e490_2000.csv",
}
BLACKBODY_TEMPERATURE = 5778.0  # K, as in Yapo & Cutler (2009)


@cache
def _spectrum_table(name: str) -> tuple[np.ndarray, np.ndarray]:
    with (files("eclipsejax") / "tables" / _SPECTRA[name]).open() as lines:
        wavelength, irradiance = np.loadtxt(lines, delimiter=",").T
    return wavelength, irradiance


class Sun(eqx.Module):
    """The Sun.

    - `radius`: [m].
    - `darkening`: multiplier of the limb darkening's departure from a uniform disc [-]; 0 is a uniform disc.
    - `spectrum`: "gueymard" (2004; ASTM G173 extraterrestrial), "e490" (ASTM 2000) or "blackbody" at 5778 K.
    """

    radius: Float[Array, ""] = eqx.field(converter=real, default=SUN_RADIUS)
    darkening: Float[Array, ""] = eqx.field(converter=real, default=1.0)
    spectrum: str = eqx.field(static=True, default="gueymard")

    def __check_init__(self):
        if self.spectrum not in (*_SPECTRA, "blackbody"):
            raise ValueError(f"`spectrum` must be one of {(*_SPECTRA, 'blackbody')}, not {self.spectrum!r}")

    def limb_darkening_coefficients(self, wavelength: Float[Array, ""]) -> Float[Array, "6"]:
        """A_0 ... A_5 of I(mu)/I(1) = sum A_k mu^k."""
        inverse = 1e3 / wavelength  # um^-1
        terms = jnp.stack([jnp.ones_like(inverse), inverse, inverse**5])
        below, above = jnp.asarray(_BELOW, dtype=float), jnp.asarray(_ABOVE, dtype=float)
        coefficients = jnp.where(wavelength < _SPLIT, below @ terms, above @ terms)
        uniform = jnp.zeros_like(coefficients).at[0].set(1.0)
        return uniform + self.darkening * (coefficients - uniform)

    def irradiance(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Spectral irradiance at 1 au outside the atmosphere [W m^-2 nm^-1]."""
        if self.spectrum == "blackbody":
            # Planck's law with the radiation constants of CODATA 2018 in nm, diluted from the surface to 1 au.
            exponent = 1.438776877e7 / (wavelength * BLACKBODY_TEMPERATURE)
            exitance = 3.741771852e20 / (wavelength**5 * jnp.expm1(exponent))
            return exitance * (SUN_RADIUS / ASTRONOMICAL_UNIT) ** 2
        grid, irradiance = _spectrum_table(self.spectrum)
        return jnp.interp(wavelength, jnp.asarray(grid, dtype=float), jnp.asarray(irradiance, dtype=float))


def limb_darkening(sun: Sun, mu, wavelength):
    """Brightness of the Sun's disc relative to its centre, I(mu)/I(1) [-].

    Neckel (2005); 0.01 from Neckel & Labs (1994). `mu`, the cosine of the angle of emergence, and wavelength [nm]
    broadcast.
    """

    def one(mu, wavelength):
        return jnp.polyval(sun.limb_darkening_coefficients(wavelength)[::-1], mu)

    return jnp.vectorize(one)(jnp.asarray(mu, dtype=float), jnp.asarray(wavelength, dtype=float))
