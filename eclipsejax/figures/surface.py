"""The Moon as a reflector: spectrum, albedo map, and the laws by which its disc is shaded."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from eclipsejax.figures.colour import sunlight_colour, sunlight_wavelengths
from eclipsejax.figures.page import FAINT, GOLD, INK, RED, Plate, photograph, styled
from eclipsejax.moon import LAWS, Moon, lunar_map
from eclipsejax.response import encode_srgb

# Reflectance of the Apollo 16 soil 62231 (Adams & McCord 1973, as retyped in LIME-TBX) and ROLO's composite of soil
# and breccia (Kieffer & Stone 2005) at these wavelengths [nm].
WAVELENGTHS = (400, 450, 500, 550, 600, 650, 700)
SOIL = (0.10331, 0.11740, 0.13049, 0.14196, 0.15204, 0.16168, 0.17002)
COMPOSITE = (0.11833, 0.13327, 0.14640, 0.15766, 0.16778, 0.17776, 0.18661)
NAMES = {"flat": "flat, Yapo & Cutler", "lambert": "Lambert", "lunar-lambert": "lunar-Lambert, McEwen"}
FULL = 0.0  # rad, phase


def shaded_disc(moon: Moon, size: int) -> np.ndarray:
    """Brightness of the full Moon's disc, north up, mean 1, in (size, size) pixels."""
    x = np.linspace(-1.05, 1.05, 2 * size)  # twice as fine, so that the limb is no staircase
    right, up = x[None, :], -x[:, None]
    squared = right**2 + up**2
    towards = np.sqrt(np.maximum(1.0 - squared, 0.0))  # cosine of incidence and of emission
    longitude, latitude = np.arctan2(right + 0 * up, towards), np.arcsin(np.clip(up + 0 * right, -1.0, 1.0))
    light = np.asarray(_light(moon, *(jnp.asarray(value) for value in (towards, longitude, latitude))))
    light = light / light[squared < 1].mean()
    return light.reshape(size, 2, size, 2).mean(axis=(1, 3))


@eqx.filter_jit
def _law(moon, cosine):
    return moon.reflectance(cosine, cosine, FULL)


@eqx.filter_jit
def _light(moon, towards, longitude, latitude):
    return moon.reflectance(towards, towards, FULL) * moon.albedo(longitude, latitude)


@styled
def surface_plate(size: int = 320) -> Plate:
    """Spectrum with its colour, map, and three laws with their profiles.

    - `size`: pixels along a side of each disc.
    """
    plate = Plate("The Moon's surface", 11.0, 6.7)
    spectrum = plate.add_axes((0.06, 0.56, 0.3, 0.38))
    grid = sunlight_wavelengths()
    reflectance = np.asarray(Moon().spectrum(grid))
    spectrum.plot(grid, reflectance, color=INK, label="parabola of this program")
    scale = float(Moon().spectrum(550.0))
    for values, colour, marker, name in ((SOIL, RED, "o", "soil 62231"), (COMPOSITE, GOLD, "s", "ROLO's composite")):
        spectrum.plot(WAVELENGTHS, scale * np.array(values) / values[3], marker, color=colour, markersize=4, label=name)
    spectrum.set(title="reflectance, 1 at 780 nm", xlabel="wavelength  [nm]", ylim=(0.5, 1.03))
    spectrum.legend(loc="lower right", bbox_to_anchor=(1.0, 0.12))
    for place, values, name in ((0.0, np.ones_like(grid), "sunlight"), (0.5, reflectance, "the Moon in it")):
        colour = sunlight_colour(values)
        patch = spectrum.inset_axes((0.02 + 0.49 * place * 2, 0.02, 0.47, 0.1))
        patch.imshow(np.asarray(encode_srgb(0.75 * colour / colour.max()))[None, None], aspect="auto")
        patch.set(xticks=[], yticks=[])
        patch.text(0.5, 0.5, name, transform=patch.transAxes, color="black", fontsize=8, ha="center", va="center")
    chart = plate.add_axes((0.42, 0.56, 0.56, 0.38))
    chart.imshow(
        np.asarray(encode_srgb(np.clip(lunar_map() / 2.4, 0, 1))),
        extent=(-180, 180, -90, 90),
        cmap="gray",
        aspect="auto",
    )
    chart.set(title="relative albedo (Clementine; the near side is in the middle)", xticks=range(-180, 181, 60))
    chart.set(xlabel="longitude  [°]", yticks=(-60, 0, 60))
    chart.grid(False)

    for column, law in enumerate(LAWS):
        panel = plate.add_axes((0.012 + 0.215 * column, 0.07, 0.205, 0.337))
        picture = np.asarray(encode_srgb(np.clip(shaded_disc(Moon(law=law), size) / 2.2, 0, 1)))
        photograph(panel, np.repeat(picture[..., None], 3, axis=-1), NAMES[law])
    profile = plate.add_axes((0.705, 0.085, 0.28, 0.33))
    sine = np.linspace(-0.9999, 0.9999, 801)
    for law, colour in zip(LAWS, (GOLD, FAINT, INK), strict=True):
        value = np.asarray(_law(Moon(law=law), jnp.asarray(np.sqrt(1 - sine**2))))
        profile.plot(sine, value, color=colour, label=NAMES[law])
    profile.set(title="across the full Moon, one albedo", xlabel="distance from the disc's centre  [radii]")
    profile.set(ylim=(0, 1.65))
    profile.legend(loc="lower center")
    plate.caption = (
        "The Moon reflects red light better than blue: an Apollo 16 soil, the standard of lunar spectrophotometry "
        "(Adams & McCord 1973), the parabola through it that colours the pictures here, and the composite that ROLO "
        "uses (Kieffer & Stone 2005; scaled at 550 nm). The full Moon is flat, as bright at the limb as in the "
        "middle. Lambert's law darkens the limb; the paper divides it out again with cos θ / (0.1 + 0.9 cos θ); the "
        "lunar-Lambert law, which the pictures use, does the same for a reason: at full Moon every grain hides its "
        "own shadow."
    )
    return plate
