"""The Moon as a reflector: albedo map, reddening spectrum and photometric law.

Everything is relative. The albedo has mean 1 over the near side's disc, the spectrum is 1 at 780 nm, and the
photometric law has mean 1 over the disc at phase zero: the absolute albedo of the Moon is uncertain by 15 %
(Velikodsky et al. 2011) and cancels from a picture whose unit is the uneclipsed Moon.
"""

from functools import cache
from importlib.resources import files

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from eclipsejax.errors import InputError
from eclipsejax.traced import real

LAWS = ("flat", "lambert", "lunar-lambert")

# Parabola in x = (wavelength - 580 nm) / 200 nm through the reflectance of the Apollo 16 soil 62231, the
# standard of lunar spectrophotometry (Adams & McCord 1973), by least squares at the 41 wavelengths 380 (10)
# 780 nm, scaled to 1 at 780 nm. Rms error 1.1e-3, largest 2.8e-3 (relative); a fifth order would gain only
# 0.2e-3. The whole Moon is a little less red: 700 over 400 nm is 1.64 here, 1.58 in ROLO's composite of soil
# and breccia (Kieffer & Stone 2005).
SOIL_62231 = (0.8213, 0.2296, -0.0509)

# Share of Lommel-Seeliger in lunar-Lambert, a cubic in degrees of phase: McEwen 1996, LPSC 27, 841.
MCEWEN = (1.0, -0.019, 0.242e-3, -1.46e-6)

# Mean over the disc of cos / (0.1 + 0.9 cos) at phase zero: 2 int_0^1 mu^2 / (0.1 + 0.9 mu) dmu, closed form.
FLAT_MEAN = 1 / 0.9 - 0.2 / 0.9**2 + 0.02 / 0.9**3 * float(np.log(10.0))

# Cosines below this (0.2 arcsec of tilt) count as below the horizon: no quotient or gradient overflows.
GRAZING = 1e-6

# Floor of the map, so that its logarithm exists; the darkest pixel of the default map has 0.13.
FAINTEST = 1e-6


def disc_weights(shape: tuple[int, int]) -> np.ndarray:
    """Area of each map pixel on the disc seen from far above longitude 0, latitude 0; arbitrary unit."""
    latitude = np.pi * (0.5 - (np.arange(shape[0]) + 0.5) / shape[0])
    longitude = 2 * np.pi * ((np.arange(shape[1]) + 0.5) / shape[1] - 0.5)
    return np.cos(latitude)[:, None] ** 2 * np.maximum(np.cos(longitude), 0.0)


@cache
def lunar_map(columns: int = 1024) -> np.ndarray:
    """Relative luminance of the lunar surface, linear, mean 1 over the near side's disc.

    Shape (columns / 2, columns): row 0 is the north pole, the middle column is longitude 0, east is right.
    The source (2048 x 1024, `tables/moon_SOURCE.md`) is stretched and shows the Moon at larger phase angles
    than an eclipse has: mare and highland differ too much, which `Moon.contrast` softens.

    - `columns`: 2048, or a half, a quarter ... of it; the map is averaged in linear light. One pixel of the
      default 1024 is 10.7 km at the centre of the disc.
    """
    from PIL import Image

    table = files("eclipsejax").joinpath("tables/moon_2048x1024.jpg")
    with table.open("rb") as file, Image.open(file) as image:
        encoded = np.asarray(image.convert("RGB"))
    if columns < 2 or columns % 2 or encoded.shape[1] % columns:
        raise InputError(f"The lunar map cannot have {columns} columns: take 2048, 1024, 512 or so on.")
    code = np.arange(256) / 255.0  # of which there are fewer than pixels
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    red, green, blue = (share * linear for share in (0.2126, 0.7152, 0.0722))
    luminance = red[encoded[..., 0]] + green[encoded[..., 1]] + blue[encoded[..., 2]]
    block = encoded.shape[1] // columns
    luminance = luminance.reshape(columns // 2, block, columns, block).mean(axis=(1, 3))
    luminance /= np.average(luminance, weights=disc_weights(luminance.shape))
    luminance.flags.writeable = False
    return luminance


def log_levels(luminance: np.ndarray, count: int = 256) -> np.ndarray:
    """Log of the mean luminance in each of `count` equal shares of the near side's disc, darkest first.

    The mean over the disc of any power of the luminance follows: exactly for 0 and 1, to 1e-5 for 0.7.
    """
    weights = disc_weights(luminance.shape).ravel()
    order = np.argsort(luminance, axis=None)
    share = np.concatenate([[0.0], np.cumsum(weights[order])])
    integral = np.concatenate([[0.0], np.cumsum(weights[order] * luminance.ravel()[order])])
    edges = np.linspace(0.0, share[-1], count + 1)
    means = np.diff(np.interp(edges, share, integral)) / (share[-1] / count)
    return np.log(np.maximum(means, FAINTEST))


@cache
def _lunar_levels() -> np.ndarray:
    return log_levels(lunar_map())


class Moon(eqx.Module):
    """Reflecting properties of the lunar surface."""

    albedo_map: Float[Array, "latitude longitude"]
    """Relative albedo on an equirectangular grid, laid out as by `lunar_map` [-]."""
    contrast: Float[Array, ""]
    """Exponent of the map [-]. Free fits to two eclipse photographs gave 0.58-0.81."""
    surge: Float[Array, ""]
    """Amplitude B0 of the opposition surge of "lunar-lambert" [-]. With the defaults of `surge` and
    `surge_width` the disc follows ROLO at 549 nm to 0.2 % from 0 to 10 degrees of phase (1.37 times brighter
    at 0 than at 4). Below 1.55 degrees, where eclipses happen, ROLO itself is an extrapolation."""
    surge_width: Float[Array, ""]
    """Angular width h of the surge: half of it is lost at the phase angle 2 h [rad]."""
    log_levels: Float[Array, " level"]
    """Log of the mean albedo in equal shares of the near side's disc, which normalises any contrast [-]."""
    law: str = eqx.field(static=True)
    """Photometric law: "flat", "lambert" or "lunar-lambert"."""

    def __init__(self, albedo_map=None, contrast=0.7, surge=1.44, surge_width=0.047, law: str = "lunar-lambert"):
        """The fields of the same names.

        - `albedo_map`: None for `lunar_map()`. Of any other map only the relative values count: its mean is
          worked out here, on the host.
        """
        if law not in LAWS:
            raise InputError(f"The Moon has no photometric law {law!r}: choose one of {', '.join(LAWS)}.")
        self.albedo_map = real(lunar_map() if albedo_map is None else albedo_map)
        self.contrast = real(contrast)
        self.surge = real(surge)
        self.surge_width = real(surge_width)
        self.log_levels = real(_lunar_levels() if albedo_map is None else log_levels(np.asarray(albedo_map)))
        self.law = law

    def albedo(self, longitude: Float[ArrayLike, "..."], latitude: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
        """Albedo relative to the mean of the near side's disc [-]; bilinear, periodic in longitude.

        - `longitude`, `latitude`: selenographic, east and north positive [rad].
        """
        rows, columns = self.albedo_map.shape
        column = jnp.mod((longitude / (2 * jnp.pi) + 0.5) * columns - 0.5, columns)
        row = jnp.clip((0.5 - latitude / jnp.pi) * rows - 0.5, 0.0, rows - 1.0)
        west, north = jnp.floor(column).astype(int) % columns, jnp.floor(row).astype(int)
        east, south = (west + 1) % columns, jnp.minimum(north + 1, rows - 1)
        across, down = column - jnp.floor(column), row - jnp.floor(row)
        upper = (1 - across) * self.albedo_map[north, west] + across * self.albedo_map[north, east]
        lower = (1 - across) * self.albedo_map[south, west] + across * self.albedo_map[south, east]
        luminance = jnp.maximum((1 - down) * upper + down * lower, FAINTEST)
        # The exponent acts after the interpolation, and the mean over the disc comes from the levels: another
        # contrast costs one power per sample instead of one per map pixel.
        mean = jnp.mean(jnp.exp(self.contrast * self.log_levels))
        return jnp.exp(self.contrast * jnp.log(luminance)) / mean

    def reflectance(
        self,
        incidence_cosine: Float[ArrayLike, "..."],
        emission_cosine: Float[ArrayLike, "..."],
        phase_angle: Float[ArrayLike, "..."],
    ) -> Float[Array, "..."]:
        """Radiance for a given irradiance across the beam, 1 for the mean of the disc at phase zero [-].

        With mu0, mu the cosines of incidence and emission and g the phase angle, and up to a factor,

        - "flat": mu0 / (0.1 + 0.9 mu0), Yapo & Cutler 2009, whose irradiance already holds the cosine;
        - "lambert": mu0;
        - "lunar-lambert": S(g) [2 L(g) mu0 / (mu0 + mu) + (1 - L(g)) mu0], McEwen 1996, flat at full Moon,
          with the surge S of `opposition_surge`. S is grey; ROLO's 0 to 4 degree ratio is 1.5 % larger at
          442 nm and 1 % smaller at 665 nm.

        Zero, with zero gradient, where the Sun or the observer is below the local horizon.

        - `phase_angle`: between the arriving light and the observer [rad]; unused by the first two laws.
        """
        mutual = jnp.greater(incidence_cosine, GRAZING) & jnp.greater(emission_cosine, GRAZING)
        mu0 = jnp.where(mutual, incidence_cosine, 1.0)
        mu = jnp.where(mutual, emission_cosine, 1.0)
        if self.law == "flat":
            shape = mu0 / (0.1 + 0.9 * mu0) / FLAT_MEAN
        elif self.law == "lambert":
            shape = 1.5 * mu0
        else:
            seeliger = jnp.polyval(jnp.array(MCEWEN[::-1]), jnp.rad2deg(phase_angle))
            shape = 2 * seeliger * mu0 / (mu0 + mu) + (1 - seeliger) * mu0
            shape = shape * opposition_surge(phase_angle, self.surge, self.surge_width)
        return jnp.where(mutual, shape, 0.0)

    def spectrum(self, wavelength: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
        """Reflectance relative to that at 780 nm [-]: a parabola through Apollo 16 soil 62231, good to 0.3 %.

        - `wavelength`: [nm]; fitted over 380-780.
        """
        constant, linear, quadratic = SOIL_62231
        x = (jnp.asarray(wavelength) - 580.0) / 200.0
        return constant + x * (linear + x * quadratic)


def opposition_surge(
    phase_angle: Float[ArrayLike, "..."], amplitude: Float[Array, ""], width: Float[Array, ""]
) -> Float[Array, "..."]:
    """Brightening towards opposition by shadow hiding, 1 at phase zero [-].

    [1 + B0 / (1 + tan(g/2) / h)] / (1 + B0): Hapke 1986, Icarus 67, 264. Its cusp at g = 0 is physical.
    """
    tangent = jnp.tan(jnp.asarray(phase_angle) / 2)
    return (1 + amplitude / (1 + tangent / width)) / (1 + amplitude)
