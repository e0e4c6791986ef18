"""The path of refracted sunlight to the distance of the Moon: the rays that fill the umbra, and the caustic in them."""

import numpy as np

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.constants import EARTH_RADIUS, MOON_MEAN_DISTANCE, MOON_RADIUS
from eclipsejax.figures.colour import sunlight_colour
from eclipsejax.figures.limb_rays import columns, limb_rays
from eclipsejax.figures.page import COLOURS, FAINT, GOLD, INK, Plate, panels, styled
from eclipsejax.response import encode_srgb, into_gamut

DISTANCE = MOON_MEAN_DISTANCE


@styled
def moon_path_plate() -> Plate:
    """Rays from both limbs to the Moon in the colour that is left of them; where they arrive; the hook at 11 km."""
    atmosphere = Atmosphere()
    plate = Plate("The light's way to the Moon", 11.0, 8.2)
    box = 0.075, 0.53, 0.91, 0.42
    panel = plate.add_axes(box)
    rays = limb_rays(atmosphere)
    green = columns([550.0])[0]
    drawn = np.concatenate([np.arange(0, 101, 2), np.arange(104, rays.height.size, 8)])
    light = sunlight_colour(np.exp(-rays.depth[drawn]))
    colour = np.asarray(encode_srgb(into_gamut(0.9 * light / light.max(axis=1, keepdims=True))))
    strength = np.clip(1.0 + 0.22 * np.log10(light.max(axis=1)), 0.2, 1.0)
    start, end = rays.impact[drawn, green], rays.arrival(4.2e8)[drawn, green]
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
    near = limb_rays(atmosphere, 10.6e3, 11.4e3)
    for part, some in ((wide, rays), (hook, near)):
        landing = some.arrival(DISTANCE) / 1e3
        for (nm, tint), column in zip(COLOURS.items(), columns(COLOURS), strict=True):
            part.plot(some.height / 1e3, landing[:, column], color=tint, label=f"{nm:.0f} nm")
    wide.axhline(0.0, color=FAINT, linewidth=0.8)
    wide.set(title="where the rays arrive", xlabel="tangent height  [km]", ylabel="from the axis  [km]", xlim=(0, 60))
    wide.annotate("crosses the axis", (2.0, 0.0), (9.0, -600.0), color=FAINT, fontsize=9,
                  arrowprops={"arrowstyle": "-", "color": FAINT})  # fmt: skip
    wide.legend(loc="lower right")
    hook.set(title="the hook at the tropopause", xlabel="tangent height  [km]", xlim=(10.6, 11.4))
    landing = near.arrival(DISTANCE)[:, green] / 1e3
    crest = int(np.argmax(landing * (near.height < 11.01e3)))
    hollow = crest + int(np.argmin(landing[crest:]))
    hook.axhspan(landing[hollow], landing[crest], color=GOLD, alpha=0.18, linewidth=0)
    plate.caption = (
        "Each ray is bent where it grazes the Earth, and runs straight on to the Moon. Those near the ground have "
        "lost their blue and green, and cross the axis; those that pass above 25 km keep their colour and fall near "
        "the edge of the umbra, faintly blue from ozone. Earth and Moon are drawn round; the distance is squeezed "
        f"{squeeze:.0f} times. Just below 11 km, where the temperature of the standard atmosphere stops falling, the "
        f"bending rises with height: within {near.height[hollow] - near.height[crest]:.0f} m of tangent height the "
        f"rays turn back by {landing[crest] - landing[hollow]:.0f} km on the Moon (gold), a caustic that the breadth "
        "of the Sun smears."
    )
    return plate
