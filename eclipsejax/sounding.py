"""Dry air from a table of altitude, temperature and pressure: a radiosonde, a reanalysis, a model atmosphere.

Temperature is linear in geopotential height between levels, as in the U.S. Standard Atmosphere. The pressures of the
table are kept as they are, and ln p falls between two levels as hydrostatic air of that temperature would let it,

    ln p(H) = ln p_0 - w C(H),   C(H) = int dH / T from the level below,   w = -(ln p_1 - ln p_0) / C(H_1),

so that a table in hydrostatic equilibrium is met exactly (w is then g M / R), and what little another one departs
from it (moisture, rounding) is spread over its layers. Every level is a break of the profile, and each one makes
every ray dearer: tables are thinned to the levels that matter.
"""

from importlib.resources import files
from os import PathLike
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from eclipsejax.air import HYDROSTATIC, DryAir, geopotential, layer_column
from eclipsejax.errors import InputError
from eclipsejax.sounding_levels import checked, refuse_ducts, table_levels
from eclipsejax.spectra import ciddor_refractivity, rayleigh_cross_section
from eclipsejax.traced import real

AFGL = ("us_standard", "tropical", "midlatitude_summer", "midlatitude_winter", "subarctic_summer", "subarctic_winter")
COLUMNS = ("altitude_m", "temperature_k", "pressure_pa")


class Sounding(DryAir):
    """Dry air with the temperatures and pressures of a few levels; serves wherever `Air` does.

    As given here every level is kept. Between levels: see the module. Below the first the lowest layer goes on, above
    the last the air is isothermal. Moisture is not known: at the ground in the tropics that makes the refractivity some
    0.4 % too large. Outside `jit` a bad table, or one with a duct, is refused; inside nothing is checked.

    - `levels`: geometric altitudes, ascending [m].
    - `temperatures`: [K].
    - `pressures`: [Pa].
    - `refraction`, `scattering`: multipliers of the refractivity and of Rayleigh scattering [-].
    """

    levels: Float[Array, " level"] = eqx.field(converter=real)
    temperatures: Float[Array, " level"] = eqx.field(converter=real)
    pressures: Float[Array, " level"] = eqx.field(converter=real)
    refraction: Float[Array, ""] = eqx.field(converter=real, default=1.0)
    scattering: Float[Array, ""] = eqx.field(converter=real, default=1.0)

    def __check_init__(self):
        shapes = self.levels.shape, self.temperatures.shape, self.pressures.shape
        if not shapes[0] == shapes[1] == shapes[2] or len(shapes[0]) != 1 or shapes[0][0] < 2:
            raise InputError(
                f"A sounding needs as many temperatures and pressures as altitudes, 2 or more, not {shapes}."
            )
        if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(self)):
            columns = (np.asarray(column, dtype=float) for column in (self.levels, self.temperatures, self.pressures))
            refuse_ducts(*checked(*columns), float(self.refraction))

    @classmethod
    def from_table(cls, altitude, temperature, pressure, *, tolerance: float = 1e-3, count: int = 24) -> "Sounding":
        """The air of a table of any number of levels, thinned to what matters, continued to the sea and aloft.

        Starting from both ends, the level is added at which the density between the levels so far is most in error,
        until no error is above `tolerance`; then those that are needed least are dropped. The error is that of the
        density, relative to itself plus a hundredth of the ground's. Below the table air cools upwards by 6.5 K/km;
        above it temperature goes on to that of the U.S. Standard Atmosphere at 47 km or, 5 km above the last level
        at least, at its next layer.

        - `altitude`, `temperature`, `pressure`: geometric [m], ascending; [K]; [Pa].
        - `tolerance`: of the density [-]; 1e-3 keeps 11 to 21 levels of the AFGL atmospheres, and the light
          in the umbra of clear air to 0.7 % at 550 nm and 3 % at 400 nm. 1e-4 keeps the light through a table of
          standard air in steps of 25 m to 1e-4. Rays lowest within a step of a kink between two levels, such as a
          tropopause, are then bent up to 0.6 % wrong: where in the step it lies no table says.
        - `count`: most levels to keep of the table, whatever the error.
        """
        columns = (np.asarray(column, dtype=float) for column in (altitude, temperature, pressure))
        return cls(*table_levels(*columns, tolerance=tolerance, count=count))

    @classmethod
    def from_csv(cls, path: str | PathLike[str], *, tolerance: float = 1e-3, count: int = 24) -> "Sounding":
        """`from_table` of a CSV file whose first row names altitude_m, temperature_k and pressure_pa; other columns
        and lines that begin with # are passed over."""
        path = Path(path)
        try:
            lines = [line.strip() for line in path.read_text(encoding="utf-8-sig").splitlines()]
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "it is no text"
            raise InputError(f"The sounding {path} cannot be read ({reason}): give a CSV file.") from None
        rows = [line.split(",") for line in lines if line and not line.startswith("#")]
        header = [name.strip().lower() for name in rows[0]] if rows else []
        if not set(COLUMNS) <= set(header):
            raise InputError(f"{path} lacks a column: its first row must name {', '.join(COLUMNS)}.")
        try:
            table = [[float(row[header.index(name)]) for name in COLUMNS] for row in rows[1:]]
        except (ValueError, IndexError):
            raise InputError(f"{path} has a row without a number in {', '.join(COLUMNS)}: leave it out.") from None
        try:
            return cls.from_table(*np.reshape(table, (-1, 3)).T, tolerance=tolerance, count=count)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @classmethod
    def afgl(cls, name: str, *, tolerance: float = 1e-3, count: int = 24) -> "Sounding":
        """One of the six model atmospheres of Anderson et al. (1986), AFGL-TR-86-0110; the names are in `AFGL`."""
        if name not in AFGL:
            raise InputError(f"There is no AFGL atmosphere {name!r}: take one of {', '.join(AFGL)}.")
        with (files("eclipsejax") / "tables" / "atmosphere_profiles_afgl1986.csv").open() as lines:
            table = np.loadtxt(lines, delimiter=",")
        first = 1 + 5 * AFGL.index(name)
        return cls.from_table(1e3 * table[:, 0], table[:, first + 1], table[:, first], tolerance=tolerance, count=count)

    def _state(self, altitude: Float[Array, ""]) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Temperature [K] and log of the pressure [Pa]."""
        heights, log_pressures = geopotential(self.levels), jnp.log(self.pressures)
        thickness = jnp.diff(heights)
        lapses = jnp.diff(self.temperatures) / thickness
        weights = -jnp.diff(log_pressures) / layer_column(thickness, self.temperatures[:-1], lapses)
        lapses = jnp.append(lapses, 0.0)
        weights = jnp.append(weights, HYDROSTATIC)
        height = geopotential(altitude)
        layer = jnp.sum(height >= heights[1:])
        above = height - heights[layer]
        column = layer_column(above, self.temperatures[layer], lapses[layer])
        return self.temperatures[layer] + lapses[layer] * above, log_pressures[layer] - weights[layer] * column

    def coefficient(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Rayleigh scattering cross-section [m^2], times `scattering`."""
        return self.scattering * rayleigh_cross_section(wavelength)

    def dispersion(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Refractivity at 15 C and 1013.25 hPa [-], times `refraction`; Ciddor (1996)."""
        return self.refraction * ciddor_refractivity(wavelength)

    @property
    def surface_temperature(self) -> Float[Array, ""]:
        """Temperature at sea level [K]."""
        return self.temperature(jnp.zeros(()))

    @property
    def surface_pressure(self) -> Float[Array, ""]:
        """Pressure at sea level [Pa]."""
        return self.pressure(jnp.zeros(()))

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        """The levels, and 5 km, which halves a wide layer of dense air [m]."""
        return jnp.append(self.levels, 5e3)
