"""The observer's air, through which the Moon is seen: reddening, lifting and flattening on the return path.

The optical depth of each constituent is its vertical optical depth times an air mass of its own: Young's
for the well mixed gas, larger near the horizon for the low haze, smaller for the high ozone. At an altitude
of 4 degrees the three are 11.9, 13.3 and 9.2, at the horizon 32, 54 and 12. Light scattered by the sky is not
included.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from eclipsejax.constants import DOBSON_UNIT, EARTH_RADIUS, STANDARD_PRESSURE
from eclipsejax.spectra import ozone_cross_section, rayleigh_cross_section
from eclipsejax.traced import real

# True altitude [rad] at which a body, lifted by refraction, stands on the horizon: below it the Moon has set,
# and air mass and refraction stay at the value they have there.
SET = -0.6 * 0.017453292519943295

OZONE_HEIGHT = 22e3  # m, mean height of the layer (Bird & Riordan 1986)
HAZE_SCALE_HEIGHT = 1.5e3  # m, as in `atmosphere.Haze` and in Schaefer's air mass

# Molecules of dry air above 1 m^2 per pascal, N_A / (M g): Bodhaine et al. 1999, with their molar mass at 360
# ppm CO2 and gravity at the mass-weighted height of the air (5.5 km) above latitude 45.
MOLECULES_PER_PASCAL = 6.0221367e23 / (28.9649e-3 * 9.78917)


class Sky(eqx.Module):
    """Clear air above the observer."""

    pressure: Float[Array, ""] = eqx.field(default=STANDARD_PRESSURE, converter=real)
    """Reduced to sea level, as weather reports give it [Pa]."""
    temperature: Float[Array, ""] = eqx.field(default=283.15, converter=real)
    """At the site; used by refraction only [K]."""
    aerosol_optical_depth: Float[Array, ""] = eqx.field(default=0.1, converter=real)
    """Vertical, at 550 nm, above sea level [-]."""
    angstrom: Float[Array, ""] = eqx.field(default=1.3, converter=real)
    """Exponent of its decrease with wavelength [-]."""
    ozone_du: Float[Array, ""] = eqx.field(default=300.0, converter=real)
    """Vertical column of ozone [DU]."""
    height: Float[Array, ""] = eqx.field(default=0.0, converter=real)
    """Of the site above sea level, which thins the gas and the haze above it [m]."""

    def transmission(
        self, wavelength: Float[ArrayLike, "..."], altitude: Float[ArrayLike, "..."]
    ) -> Float[Array, "..."]:
        """Fraction of the light that comes down [-]; arguments as in `transmission`."""
        return transmission(
            wavelength,
            altitude,
            pressure=self.pressure,
            aerosol_optical_depth=self.aerosol_optical_depth,
            angstrom=self.angstrom,
            ozone_du=self.ozone_du,
            height=self.height,
        )

    def apparent_altitude(self, altitude: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
        """Altitude at which a body at the true `altitude` is seen [rad]."""
        return jnp.asarray(altitude) + refraction(
            altitude, pressure=station_pressure(self.pressure, self.height), temperature=self.temperature
        )

    def flattening(self, altitude: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
        """Apparent over true height of a small disc at the true `altitude` [rad]; 0.83 when it sets [-]."""
        altitude = real(altitude)
        return jax.jvp(self.apparent_altitude, (altitude,), (jnp.ones_like(altitude),))[1]


def air_mass(altitude: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    """Air along the line of sight over that in the vertical [-]; 31.73 at the true horizon.

    Young 1994, Applied Optics 33, 1108; for the standard atmosphere. It takes the *true* altitude: formulae
    of apparent altitude (Kasten & Young 1989) give 38 at their own horizon, where this one gives 38 too.

    - `altitude`: true, airless [rad]; below -0.6 degrees the Moon has set and the value stays.
    """
    c = jnp.sin(jnp.maximum(jnp.asarray(altitude), SET))
    return ((1.002432 * c + 0.148386) * c + 0.0096467) / (((c + 0.149864) * c + 0.0102963) * c + 0.000303978)


def ozone_air_mass(altitude: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    """Ozone along the line of sight over that in the vertical [-], as a thin shell at 22 km.

    At the horizon 12, where the well mixed gas has 32. `altitude` as in `air_mass`.
    """
    c = jnp.sin(jnp.maximum(jnp.asarray(altitude), SET))
    rise = OZONE_HEIGHT / EARTH_RADIUS
    return (1 + rise) / jnp.sqrt(c**2 + rise * (2 + rise))


def haze_air_mass(altitude: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    """Haze along the line of sight over that in the vertical [-]; 81 at the apparent horizon.

    Schaefer 1993, Vistas in Astronomy 36, 311, for a scale height of 1.5 km, at the altitude as refracted by
    the standard atmosphere; within 2 % of the integral along straight lines. `altitude` as in `air_mass`.
    """
    altitude = jnp.maximum(jnp.asarray(altitude), SET)
    c = jnp.sin(altitude + refraction(altitude))
    return 1 / (c + 0.0123 * jnp.exp(-24.5 * c))


def station_pressure(pressure: Float[ArrayLike, ""], height: Float[ArrayLike, ""]) -> Float[Array, ""]:
    """Pressure at the site [Pa] for one at sea level [Pa] and a height [m], by the standard troposphere."""
    return jnp.asarray(pressure) * (1.0 - 2.25577e-5 * jnp.asarray(height)) ** 5.25588


def transmission(
    wavelength: Float[ArrayLike, "..."],
    altitude: Float[ArrayLike, "..."],
    *,
    pressure: Float[ArrayLike, ""] = STANDARD_PRESSURE,
    aerosol_optical_depth: Float[ArrayLike, ""] = 0.1,
    angstrom: Float[ArrayLike, ""] = 1.3,
    ozone_du: Float[ArrayLike, ""] = 300.0,
    height: Float[ArrayLike, ""] = 0.0,
) -> Float[Array, "..."]:
    """Fraction of the Moon's light that reaches the observer [-]; `wavelength` and `altitude` broadcast.

    Keywords as the fields of `Sky`.

    - `wavelength`: [nm].
    - `altitude`: true, airless [rad].
    """
    wavelength = jnp.asarray(wavelength)
    molecules = MOLECULES_PER_PASCAL * station_pressure(pressure, height)
    rayleigh = molecules * rayleigh_cross_section(wavelength)
    haze = aerosol_optical_depth * jnp.exp(-jnp.asarray(height) / HAZE_SCALE_HEIGHT)
    haze = haze * (wavelength / 550.0) ** (-jnp.asarray(angstrom))
    ozone = jnp.asarray(ozone_du) * DOBSON_UNIT * ozone_cross_section(wavelength)
    depth = rayleigh * air_mass(altitude) + haze * haze_air_mass(altitude) + ozone * ozone_air_mass(altitude)
    return jnp.exp(-depth)


def refraction(
    altitude: Float[ArrayLike, "..."],
    *,
    pressure: Float[ArrayLike, ""] = STANDARD_PRESSURE,
    temperature: Float[ArrayLike, ""] = 283.15,
) -> Float[Array, "..."]:
    """How much higher a body appears than it is [rad].

    Saemundsson 1986 (Sky & Telescope 72, 70), the inverse of Bennett 1982, as Meeus has it (*Astronomical
    Algorithms*, chapter 16), proportional to the density at the site. Larger than an integration through the
    standard atmosphere by 3 to 9 arcsec above 3 degrees and by 42 (2 %) at the horizon, where real days
    differ by more.

    - `altitude`: true, airless [rad]; below -0.6 degrees the Moon has set and the value stays.
    - `pressure`, `temperature`: at the site [Pa], [K].
    """
    degrees = jnp.rad2deg(jnp.maximum(jnp.asarray(altitude), SET))
    argument = jnp.deg2rad(degrees + 10.3 / (degrees + 5.11))
    arcminutes = 1.02 / jnp.tan(argument) + 0.0019279
    density = (jnp.asarray(pressure) / 101000.0) * (283.0 / jnp.asarray(temperature))
    return jnp.deg2rad(arcminutes / 60.0) * density
