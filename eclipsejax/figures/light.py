"""Light in the shadow: what the air lets pass at each height and wavelength, and what of it lands in the umbra."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.constants import ASTRONOMICAL_UNIT, MOON_MEAN_DISTANCE
from eclipsejax.dust_of_brightness import dusty
from eclipsejax.figures.colour import sunlight_colour, sunlight_wavelengths
from eclipsejax.figures.limb_rays import columns, limb_rays
from eclipsejax.figures.page import COLOURS, FAINT, INK, Plate, panels, styled
from eclipsejax.response import LUMINANCE, encode_srgb, into_gamut, responses
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.sun import Sun

ARCMIN = np.pi / 10800  # rad
ALPHA = 4.7e-6  # 1/m, dust of the paper
DASHES = ("-", (0, (5, 2)), (0, (1, 1.5)))
OFFSETS = (0, 15, 30, 42, 60)  # arcmin from the axis, of the spectra


def limbs() -> dict[str, Atmosphere]:
    """The airs that the figures compare; one structure, so that one compilation serves all."""
    return {
        "clear air": Atmosphere(),
        "typical: clouds, haze, a little dust": Atmosphere.typical(),
        f"dust, α = {ALPHA:.1e} /m": dusty(Atmosphere.typical(), ALPHA),
    }


def _through(limb) -> tuple[np.ndarray, np.ndarray]:
    """Tangent heights up to 50 km [m], and what the limb lets pass, (height, wavelength)."""
    rays = limb_rays(limb)
    kept = np.asarray(limb.limb_transmission(jnp.asarray(rays.height)))[:, None]
    low = rays.height <= 50e3
    return rays.height[low], (np.exp(-rays.depth) * kept)[low]


@eqx.filter_jit
def _operator(offset, wavelength):
    distance = jnp.asarray([MOON_MEAN_DISTANCE])
    return shadow_operator(Sun(), offset[None], distance, ASTRONOMICAL_UNIT, wavelength, tolerance=1e-3)


@eqx.filter_jit
def _applied(operator, limb):
    return operator(limb)[0]


@styled
def light_plate() -> Plate:
    """Transmission against tangent height and wavelength; spectra and colours in the shadow."""
    plate = Plate("What the air lets pass", 11.0, 9.6)
    upper = plate.add_gridspec(1, 2, left=0.06, right=0.985, top=0.955, bottom=0.64, wspace=0.17)
    sheet, curves = panels(upper)
    wavelength = sunlight_wavelengths()
    through = {name: _through(limb) for name, limb in limbs().items()}
    height, clear = through["clear air"]
    hues = np.clip(np.asarray(responses("srgb", wavelength)), 0.0, None)
    hues = 0.85 * hues / hues.max()
    picture = encode_srgb(clear[..., None] * hues)
    edges = (wavelength[0], wavelength[-1], 0, 50)
    sheet.imshow(np.asarray(picture), extent=edges, origin="lower", aspect="auto", interpolation="bilinear")
    levels = sheet.contour(wavelength, height / 1e3, clear, [1e-4, 1e-2, 0.1, 0.5, 0.9], colors="white",
                           linewidths=0.7)  # fmt: skip
    sheet.clabel(levels, fmt=lambda value: f"{value:g}", fontsize=8)
    sheet.grid(False)
    sheet.set(
        title="transmission of a grazing ray, clear air", xlabel="wavelength  [nm]", ylabel="tangent height  [km]"
    )

    for (name, (_, passed)), dashes in zip(through.items(), DASHES, strict=True):
        for (nm, colour), column in zip(COLOURS.items(), columns(COLOURS), strict=True):
            label = f"{nm:.0f} nm" if dashes == "-" else None
            curves.semilogx(passed[:, column], height / 1e3, color=colour, linestyle=dashes, label=label)
        curves.plot([], [], color=INK, linestyle=dashes, label=name)
    curves.set(title="transmission", xlim=(1e-6, 1.5), ylim=(0, 50), ylabel="tangent height  [km]")
    curves.legend(loc="upper left")

    offset = np.linspace(0.0, 90.0, 91)
    operator = _operator(jnp.asarray(offset * ARCMIN), jnp.asarray(wavelength))
    light = {name: np.asarray(_applied(operator, limb)) for name, limb in limbs().items()}
    _spectra(plate.add_axes((0.06, 0.335, 0.405, 0.225)), wavelength, offset, light)
    _luminances(plate.add_axes((0.56, 0.335, 0.425, 0.225)), offset, light)
    lower = plate.add_gridspec(3, 1, left=0.06, right=0.985, top=0.245, bottom=0.06, hspace=0.35)
    strips = panels(lower, share=True)
    for panel, (name, values) in zip(strips, light.items(), strict=True):
        colour = sunlight_colour(values)
        bright = np.maximum(colour @ np.asarray(LUMINANCE), 1e-30)
        even = np.asarray(encode_srgb(into_gamut(0.25 * colour / bright[:, None])))
        panel.imshow(even[None], extent=(-0.5, 90.5, 0, 1), aspect="auto", interpolation="bilinear")
        panel.set(yticks=[])
        panel.tick_params(labelbottom=panel is strips[-1])
        panel.grid(False)
        panel.text(89.5, 0.5, name, color="black", fontsize=9, ha="right", va="center")
    strips[0].set_title("colour of the light in the shadow, every part shown equally bright")
    strips[-1].set_xlabel("distance from the axis of the shadow, at the Earth's centre  [arcmin]")
    dim = {name: -np.log2(sunlight_colour(values)[0] @ np.asarray(LUMINANCE)) for name, values in light.items()}
    plate.caption = (
        "Extinction acts by Beer and Lambert's law along each bent ray. Rayleigh scattering takes the blue below 15 "
        "km, ozone the orange (its Chappuis bands, 500 to 700 nm) between 15 and 35 km; clouds and haze take all "
        "colours low down, dust what would pass through the lower stratosphere. Below: light in the shadow at the "
        "Moon's mean distance, relative to full sunlight; on the axis it is weaker by "
        + ", ".join(f"{value:.1f} stops ({name.partition(',')[0].partition(':')[0]})" for name, value in dim.items())
        + ". The rim of the umbra is blue where ozone has taken the red. Light that the air scatters towards the Moon "
        "is not included."
    )
    return plate


def _spectra(panel, wavelength, offset, light) -> None:
    values = light["typical: clouds, haze, a little dust"]
    for at, shade in zip(OFFSETS, np.linspace(0.25, 1.0, len(OFFSETS)), strict=True):
        here = values[np.searchsorted(offset, at)]
        colour = np.asarray(sunlight_colour(here))
        tint = np.asarray(encode_srgb(into_gamut(0.55 * colour / colour.max())))
        panel.semilogy(wavelength, here, color=tint, linewidth=1.2 + shade, label=f"{at}'")
    panel.set(title="spectra in the shadow, typical air", xlabel="wavelength  [nm]", ylabel="of full sunlight")
    panel.set(ylim=(1e-9, 2), xlim=(380, 780))
    for at, where in zip(OFFSETS, panel.get_lines(), strict=True):
        y = where.get_ydata()[-1]
        down = 5 if at == 0 else 0  # off the label of the next
        panel.annotate(f"{at}'", (780, y), (3, -down), textcoords="offset points", color=FAINT, fontsize=8, va="center")


def _luminances(panel, offset, light) -> None:
    for (name, values), dashes in zip(light.items(), DASHES, strict=True):
        luminance = sunlight_colour(values) @ np.asarray(LUMINANCE)
        panel.plot(offset, np.log2(luminance), color=INK, linestyle=dashes, label=name)
    panel.set(title="brightness across the shadow", ylabel="stops; full sunlight 0", xlim=(0, 90), ylim=(-21, 0.5))
    panel.set_xlabel("distance from the axis  [arcmin]")
    panel.legend(loc="lower right")
