"""What the air, haze and dust scatter of the light that grazes the limb.

Only light that goes nearly straight on reaches the umbra: it turns by a degree, to which the phase functions here are
flat. So a constituent scatters into the umbra the product of its scattering coefficient and its phase function at 0.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.spectra import king_factor
from eclipsejax.traced import real


class Scatterers(eqx.Module):
    """How haze and dust scatter: Henyey & Greenstein's (1941) phase function, which the air's joins.

    Dust is sulphate: it absorbs nothing, and g = 0.7 is that of droplets of 0.3-0.5 um. Forward, this is 13 times what
    air scatters of the same extinction. Light turns by a degree, to which either function is flat: 0.4 % from 0 to 1
    degree, 1.4 % to 2.

    - `dust_albedo`, `haze_albedo`: scattered part of the extinction [-].
    - `dust_asymmetry`, `haze_asymmetry`: mean cosine of the scattering angle [-].
    - `higher_orders`: multiplier of the light scattered more than once, see `HIGHER_ORDERS` [-].
    """

    dust_albedo: Float[Array, ""] = eqx.field(converter=real, default=1.0)
    dust_asymmetry: Float[Array, ""] = eqx.field(converter=real, default=0.7)
    haze_albedo: Float[Array, ""] = eqx.field(converter=real, default=0.95)
    haze_asymmetry: Float[Array, ""] = eqx.field(converter=real, default=0.7)
    higher_orders: Float[Array, ""] = eqx.field(converter=real, default=1.0)

    def towards(self, atmosphere, altitude, wavelength) -> Float[Array, ""]:
        """Scattered straight on, per unit of length and solid angle [1/(m sr)].

        An atmosphere that is not the package's own has a method `forward_scattering(altitude, wavelength)`.
        """
        if hasattr(atmosphere, "forward_scattering"):
            return atmosphere.forward_scattering(altitude, wavelength)

        def amount(part):
            return part.coefficient(wavelength) * part.profile(altitude)

        total = amount(atmosphere.air) * rayleigh_forward(wavelength)
        if atmosphere.dust is not None:
            total += amount(atmosphere.dust) * self.dust_albedo * henyey_greenstein_forward(self.dust_asymmetry)
        if atmosphere.haze is not None:
            total += amount(atmosphere.haze) * self.haze_albedo * henyey_greenstein_forward(self.haze_asymmetry)
        return total


def rayleigh_forward(wavelength):
    """Phase function of air at 0 degrees [1/sr], 1.5 / (4 pi) less 1.4 % for depolarisation (Chandrasekhar 1960)."""
    king = king_factor(wavelength)
    depolarisation = 6.0 * (king - 1.0) / (3.0 + 7.0 * king)
    return (1.5 + 0.0 * wavelength) / (1.0 + 0.5 * depolarisation) / (4.0 * jnp.pi)


def henyey_greenstein_forward(asymmetry):
    """Phase function at 0 degrees [1/sr]."""
    return (1.0 + asymmetry) / (1.0 - asymmetry) ** 2 / (4.0 * jnp.pi)


# What light scattered more than once adds to that scattered once: sasktran2, spherical successive orders, clear
# standard air with 300 DU of ozone above a ground of albedo 0.3 (`tables/make_higher_orders.py`).
_HIGHER_WAVELENGTHS = (400.0, 440.0, 500.0, 550.0, 600.0, 700.0)  # nm
_HIGHER_ORDERS = (0.123, 0.116, 0.101, 0.087, 0.075, 0.056)


def higher_orders(scatterers: Scatterers, wavelength):
    """Light scattered any number of times, in units of light scattered once [-]."""
    more = jnp.interp(wavelength, jnp.asarray(_HIGHER_WAVELENGTHS), jnp.asarray(_HIGHER_ORDERS))
    return 1.0 + scatterers.higher_orders * more
