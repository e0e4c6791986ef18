"""Dry air: the U.S. Standard Atmosphere 1976 with the surface temperature and pressure as inputs."""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax import constants
from eclipsejax.spectra import ciddor_refractivity, rayleigh_cross_section
from eclipsejax.traced import real

# U.S. Standard Atmosphere 1976, table 4: geopotential height of the layer bases above the tropopause [m] and lapse
# rates dT/dH [K/m], the troposphere first. Above 84.852 km (geometric 86 km) we go on at constant temperature.
_TROPOPAUSE_TEMPERATURE = 216.65  # K
_BASES = (20e3, 32e3, 47e3, 51e3, 71e3, 84852.05)
_LAPSE_RATES = (-6.5e-3, 0.0, 1e-3, 2.8e-3, 0.0, -2.8e-3, -2e-3, 0.0)
HYDROSTATIC = constants.STANDARD_GRAVITY * constants.MOLAR_MASS_AIR / constants.GAS_CONSTANT  # K/m


def geopotential(altitude):
    """Geopotential height [m] of a geometric altitude [m]."""
    return constants.GEOPOTENTIAL_RADIUS * altitude / (constants.GEOPOTENTIAL_RADIUS + altitude)


def geometric(height):
    """Geometric altitude [m] of a geopotential height [m]."""
    return constants.GEOPOTENTIAL_RADIUS * height / (constants.GEOPOTENTIAL_RADIUS - height)


class DryAir(eqx.Module):
    """Dry air whose temperature and pressure are known at every altitude; what follows from them."""

    @abstractmethod
    def _state(self, altitude: Float[Array, ""]) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Temperature [K] and log of the pressure [Pa]."""

    def temperature(self, altitude: Float[Array, ""]) -> Float[Array, ""]:
        """Temperature [K] (molecular-scale above 80 km)."""
        return self._state(altitude)[0]

    def pressure(self, altitude: Float[Array, ""]) -> Float[Array, ""]:
        """Pressure [Pa]."""
        return jnp.exp(self._state(altitude)[1])

    def density(self, altitude: Float[Array, ""]) -> Float[Array, ""]:
        """Mass density [kg m^-3]."""
        temperature, log_pressure = self._state(altitude)
        return jnp.exp(log_pressure) * (constants.MOLAR_MASS_AIR / constants.GAS_CONSTANT) / temperature

    def density_ratio(self, altitude: Float[Array, ""]) -> Float[Array, ""]:
        """Density relative to 15 C and 1013.25 hPa [-]."""
        temperature, log_pressure = self._state(altitude)
        pressure_ratio = jnp.exp(log_pressure - jnp.log(constants.STANDARD_PRESSURE))
        return pressure_ratio * (constants.STANDARD_TEMPERATURE / temperature)

    def profile(self, altitude: Float[Array, ""]) -> Float[Array, ""]:
        """Number density [m^-3]."""
        return self.number_density(self.density_ratio(altitude))

    def number_density(self, density_ratio: Float[Array, ""]) -> Float[Array, ""]:
        """Number density [m^-3] for a density relative to 15 C and 1013.25 hPa [-]."""
        standard = constants.STANDARD_PRESSURE / (constants.BOLTZMANN * constants.STANDARD_TEMPERATURE)
        return standard * density_ratio


class Air(DryAir):
    """Dry air in hydrostatic equilibrium.

    With the default surface this is the U.S. Standard Atmosphere 1976 to 86 km and isothermal above. Another surface
    temperature keeps the tropospheric lapse rate of 6.5 K/km and moves the tropopause to where the temperature
    meets 216.65 K; the temperatures from 20 km up stay. So a warmer surface lifts all the air above it: +20 K
    raises the density from 15 km up by 14 %. Pressure scales the density everywhere alike.

    - `surface_temperature`: [K], 217 to 345.
    - `surface_pressure`: [Pa].
    - `refraction`, `scattering`: multipliers of the refractivity and of Rayleigh scattering [-]; 0 gives the
      other worlds of Yapo & Cutler (2009).
    """

    surface_temperature: Float[Array, ""] = eqx.field(converter=real, default=constants.STANDARD_TEMPERATURE)
    surface_pressure: Float[Array, ""] = eqx.field(converter=real, default=constants.STANDARD_PRESSURE)
    refraction: Float[Array, ""] = eqx.field(converter=real, default=1.0)
    scattering: Float[Array, ""] = eqx.field(converter=real, default=1.0)

    def _layers(self):
        """Base height [m], base temperature [K], lapse rate [K/m], log of base pressure, one row a layer."""
        lapses = jnp.asarray(_LAPSE_RATES, dtype=float)
        tropopause = (_TROPOPAUSE_TEMPERATURE - self.surface_temperature) / lapses[0]
        bases = jnp.concatenate([jnp.stack([jnp.zeros_like(tropopause), tropopause]), jnp.asarray(_BASES, dtype=float)])
        thickness = jnp.diff(bases)
        temperatures = self.surface_temperature + _accumulate(lapses[:-1] * thickness)
        log_pressures = jnp.log(self.surface_pressure) - HYDROSTATIC * _accumulate(
            layer_column(thickness, temperatures[:-1], lapses[:-1])
        )
        return bases, temperatures, lapses, log_pressures

    def _state(self, altitude: Float[Array, ""]) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Temperature [K] and log of the pressure [Pa]."""
        bases, temperatures, lapses, log_pressures = self._layers()
        height = geopotential(altitude)
        layer = jnp.sum(height >= bases[1:])
        above = height - bases[layer]
        temperature = temperatures[layer] + lapses[layer] * above
        column = layer_column(above, temperatures[layer], lapses[layer])
        return temperature, log_pressures[layer] - HYDROSTATIC * column

    def coefficient(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Rayleigh scattering cross-section [m^2], times `scattering`."""
        return self.scattering * rayleigh_cross_section(wavelength)

    def dispersion(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Refractivity at 15 C and 1013.25 hPa [-], times `refraction`; Ciddor (1996)."""
        return self.refraction * ciddor_refractivity(wavelength)

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        """Altitudes of the layer bases above the ground [m], and 5 km, which halves the widest layer of dense air."""
        return jnp.concatenate([geometric(self._layers()[0][1:]), jnp.asarray([5e3], dtype=float)])


def _accumulate(steps):
    """Running sum that starts from 0."""
    return jnp.concatenate([jnp.zeros(1, dtype=steps.dtype), jnp.cumsum(steps)])


def layer_column(thickness, temperature, lapse, xp=jnp):
    """int dH/T over a layer [m/K] from the temperature at its base: log(1 + y) / lapse, y = lapse thickness /
    temperature, and its limit; `xp` is JAX's or plain NumPy."""
    y = lapse * thickness / temperature
    small = xp.abs(y) < 1e-5
    y_safe = xp.where(small, 1.0, y)
    return thickness / temperature * xp.where(small, 1.0 - y / 2.0 + y**2 / 3.0, xp.log1p(y_safe) / y_safe)
