"""The path of refracted sunlight to the distance of the Moon: the rays that fill the umbra, and the caustic in them."""

import jax.numpy as jnp
import numpy as np

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.constants import EARTH_RADIUS, MOON_MEAN_DISTANCE, MOON_RADIUS
from eclipsejax.figures.colour import sunlight_colour, sunlight_wavelengths
from eclipsejax.figures.page import COLOURS, FAINT, GOLD, INK, Plate, panels, styled
from eclipsejax.limb import impact_parameter
from eclipsejax.limb_table import grazing_rays
from eclipsejax.response import encode_srgb, into_gamut

DISTANCE = MOON_MEAN_DISTANCE


def arrival(atmosphere, tangent_height, wavelength, distance=DISTANCE) -> np.ndarray:
    """Distance from the axis at which rays from the Sun's centre arrive [m], (tangent, wavelength).

    The Sun is taken to be infinitely far away; negative: beyond the axis.

    - `tangent_height`: (tangent,) [m]. - `wavelength`: (wavelength,) [nm].
    - `distance`: behind the Earth's centre [m].
    """
    bending, _ = grazing_rays(atmosphere, jnp.asarray(tangent_height), jnp.asarray(wavelength))
    impact = impact_parameter(atmosphere, np.asarray(tangent_height)[:, None], wavelength)
    return np.asarray(impact / np.cos(bending) - distance * np.tan(bending))


@styled
def moon_path_plate() -> Plate:
    """Rays from both limbs to the Moon in the colour that is left of them; where they arrive; the hook at 11 km."""
    atmosphere = Atmosphere()
    plate = Plate("The light's way to the Moon", 11.0, 8.2)
    box = 0.075, 0.53, 0.91, 0.42
    panel = plate.add_axes(box)
    tangent = np.concatenate([np.linspace(0.0, 25e3, 51), np.linspace(26e3, 70e3, 23)])
    wavelength = sunlight_wavelengths()
    depth = grazing_rays(atmosphere, jnp.asarray(tangent), jnp.asarray(wavelength))[1]
    light = sunlight_colour(np.exp(-np.asarray(depth)))
    colour = np.asarray(encode_srgb(into_gamut(0.9 * light / light.max(axis=1, keepdims=True))))
    strength = np.clip(1.0 + 0.22 * np.log10(light.max(axis=1)), 0.2, 1.0)
    start = np.asarray(impact_parameter(atmosphere, tangent, 550.0))
    end = arrival(atmosphere, tangent, np.array([550.0]), 4.2e8)[:, 0]
    for side in (1, -1):
        for y0, y1, rgb, alpha in zip(start, end, colour, strength, strict=True):
            panel.plot([-3e1, 0, 420], [side * y0 / 1e6, side * y0 / 1e6, side * y1 / 1e6],
                       color=rgb, alpha=0.75 * alpha, linewidth=0.9)  # fmt: skip
    squeeze = (450 / (box[2] * plate.get_figwidth())) / (16.4 / (box[3] * plate.get_figheight()))
    for x, radius, face in ((0.0, EARTH_RADIUS, "#27425c"), (DISTANCE / 1e6, MOON_RADIUS, "#8d8d92")):
        turn = np.linspace(0.0, 2 * np.pi, 181)
        width = radius / 1e6 * squeeze  # round on the page
        panel.fill(x + width * np.cos(turn), radius / 1e6 * np.sin(turn), color=face, zorder=3)
    panel.set(xlim=(-30, 420), ylim=(-8.2, 8.2), xlabel="distance behind the Earth  [1000 km]")
    panel.set(ylabel="from the axis  [1000 km]")
    panel.set_title("rays from the Sun's centre that pass at 0 to 70 km, in the colour that clear air leaves of them")
    panel.text(DISTANCE / 1e6, 2.15, "the Moon", color=INK, fontsize=9, ha="center", zorder=4)
    panel.set_facecolor("black")
    panel.grid(False)

    lower = plate.add_gridspec(1, 2, left=0.075, right=0.985, top=0.43, bottom=0.075, wspace=0.2)
    wide, hook = panels(lower)
    for part, heights in ((wide, np.linspace(0.0, 60e3, 301)), (hook, np.linspace(10.6e3, 11.4e3, 321))):
        landing = arrival(atmosphere, heights, np.array(list(COLOURS)))
        for column, (nm, tint) in enumerate(COLOURS.items()):
            part.plot(heights / 1e3, landing[:, column] / 1e3, color=tint, label=f"{nm:.0f} nm")
    wide.axhline(0.0, color=FAINT, linewidth=0.8)
    wide.set(title="where the rays arrive", xlabel="tangent height  [km]", ylabel="from the axis  [km]", xlim=(0, 60))
    wide.annotate("crosses the axis", (2.0, 0.0), (9.0, -600.0), color=FAINT, fontsize=9,
                  arrowprops={"arrowstyle": "-", "color": FAINT})  # fmt: skip
    wide.legend(loc="lower right")
    hook.set(title="the hook at the tropopause", xlabel="tangent height  [km]", xlim=(10.6, 11.4))
    fine = np.linspace(10.6e3, 11.4e3, 1601)
    green = arrival(atmosphere, fine, np.array([550.0]))[:, 0]
    top = int(np.argmax(green * (fine < 11.05e3)))
    low = top + int(np.argmin(green[top : top + 400]))
    hook.axhspan(green[low] / 1e3, green[top] / 1e3, color=GOLD, alpha=0.18, linewidth=0)
    plate.caption = (
        "Each ray is bent where it grazes the Earth, and runs straight on to the Moon. Those near the ground have "
        "lost their blue and green, and cross the axis; those that pass above 25 km keep their colour and fall near "
        "the edge of the umbra, faintly blue from ozone. Earth and Moon are drawn round; the distance is squeezed "
        f"{squeeze:.0f} times. Just below 11 km, where the temperature of the standard atmosphere stops falling, the "
        f"bending rises with height: within {(fine[low] - fine[top]):.0f} m of tangent height the rays turn back by "
        f"{(green[top] - green[low]) / 1e3:.0f} km on the Moon (gold), a caustic that the breadth of the Sun smears."
    )
    return plate
