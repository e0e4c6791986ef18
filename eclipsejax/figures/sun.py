"""The Sun as a light source: its spectra to choose from, and the darkening of its limb by wavelength."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from eclipsejax.figures.colour import sunlight_colour, sunlight_wavelengths
from eclipsejax.figures.page import BLUE, COLOURS, GOLD, GREEN, INK, RED, Plate, photograph, styled
from eclipsejax.response import encode_srgb, into_gamut
from eclipsejax.sun import BLACKBODY_TEMPERATURE, Sun, limb_darkening
from eclipsejax.wavelengths import ENDS, MANY, middles

SPECTRA = {
    "gueymard": ("Gueymard 2004 (default)", INK),
    "e490": ("ASTM E-490, 2000", BLUE),
    "blackbody": (f"blackbody, {BLACKBODY_TEMPERATURE:.0f} K, as the paper has it", GOLD),
}
LINES = {400.0: "#b39bff", **COLOURS, 780.0: "#b5493f"}


@eqx.filter_jit
def _spectrum(sun, wavelength):
    return sun.irradiance(wavelength)


def binned(name: str) -> np.ndarray:
    """Spectral irradiance at 1 au in the reference's bins of 2 nm [W m^-2 nm^-1]."""
    fine = np.arange(ENDS[0] + 0.25, ENDS[1], 0.5)
    light = np.asarray(_spectrum(Sun(spectrum=name), jnp.asarray(fine)))
    return light.reshape(MANY, -1).mean(axis=1)


def disc(size: int) -> np.ndarray:
    """The Sun's disc in its colours, its centre nearly white, in (size, size) pixels."""
    x = np.linspace(-1.06, 1.06, 2 * size)
    squared = x[None, :] ** 2 + x[:, None] ** 2
    level = np.linspace(0.0, 1.0, 65)  # of mu
    brightness = np.asarray(limb_darkening(Sun(), level[:, None], sunlight_wavelengths()))
    colour = np.asarray(into_gamut(jnp.asarray(sunlight_colour(brightness))))
    mu = np.sqrt(np.maximum(1.0 - squared, 0.0))
    picture = np.stack([np.interp(mu, level, channel) for channel in colour.T], axis=-1)
    picture = np.where(squared[..., None] < 1.0, 0.95 * picture / colour[-1].max(), 0.0)
    return np.asarray(encode_srgb(picture.reshape(size, 2, size, 2, 3).mean(axis=(1, 3))))


@styled
def sun_plate(size: int = 320) -> Plate:
    """Spectra, limb darkening, and the disc.

    - `size`: pixels along a side of the disc.
    """
    plate = Plate("The Sun", 11.0, 6.9)
    spectra = plate.add_axes((0.06, 0.57, 0.92, 0.37))
    wavelength = middles(MANY)
    light = {name: binned(name) for name in SPECTRA}
    for name, (label, colour) in SPECTRA.items():
        spectra.plot(wavelength, light[name], color=colour, label=label, linewidth=1.2)
    spectra.set(title=f"sunlight at 1 au, in {MANY} bins of 2 nm", xlabel="wavelength  [nm]", xlim=ENDS)
    spectra.set(ylabel="[W m$^{-2}$ nm$^{-1}$]", ylim=(0.5, 2.35))
    spectra.legend(loc="upper right")
    curves = plate.add_axes((0.06, 0.09, 0.36, 0.36))
    radius = np.linspace(0.0, 1.0, 301)
    mu = np.sqrt(1.0 - radius**2)
    for nm, colour in LINES.items():
        curves.plot(radius, np.asarray(limb_darkening(Sun(), mu, nm)), color=colour, label=f"{nm:.0f} nm")
    curves.set(title="brightness across the disc", xlabel="distance from its centre  [radii]", ylim=(0.0, 1.05))
    curves.legend(loc="lower left")
    edge = plate.add_axes((0.48, 0.09, 0.22, 0.36))
    grid = np.linspace(*ENDS, 201)
    for at, colour in ((1.0, INK), (0.6, GREEN), (0.2, RED)):
        name = "centre" if at == 1.0 else f"{np.sqrt(1 - at**2):.2f} radii out"
        edge.plot(grid, np.asarray(limb_darkening(Sun(), at, grid)), color=colour, label=name)
    edge.set(title="of the centre's light", xlabel="wavelength  [nm]", ylim=(0.0, 1.05), xlim=ENDS)
    edge.legend(loc="lower right")
    photograph(plate.add_axes((0.74, 0.07, 0.25, 0.25 * 11.0 / 6.9)), disc(size), "in its colours")
    total = {name: float(np.sum(values) * 2.0) for name, values in light.items()}
    plate.caption = (
        "Sun(spectrum=...) takes any of three: the measured ones carry "
        f"{total['gueymard']:.0f} and {total['e490']:.0f} W/m² between 380 and 780 nm, the blackbody "
        f"{total['blackbody']:.0f}. What a picture shows is the ratio to the full Moon under the same Sun, so "
        "they differ little there. The limb is darker, and redder, than the middle (Neckel 2005): at 400 nm its very "
        f"edge has {float(limb_darkening(Sun(), 0.0, 400.0)):.0%} of the centre's light, at 780 nm "
        f"{float(limb_darkening(Sun(), 0.0, 780.0)):.0%}. It matters because the umbra's edge is lit by the Sun's limb "
        "alone."
    )
    return plate
