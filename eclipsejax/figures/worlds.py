"""The paper's worlds: an Earth without air, with air that only bends, that bends and scatters; and with dust."""

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Ozone
from eclipsejax.dust_of_brightness import dusty
from eclipsejax.figures.page import Plate, row, styled
from eclipsejax.figures.picture import airless, darkness, moment, pictures, scene, shown
from eclipsejax.response import bright_gain

SITE = (42.73, -73.68)  # Troy, upstate New York
TOTAL, PARTIAL = "2008-02-21T03:26:00Z", "2008-02-21T04:12:44Z"
PARTIAL_GAIN = 2.5  # of the partial phase
ALPHAS = (0.0, 4.7e-6, 1.0e-5)  # 1/m, the paper's


def worlds() -> dict[str, Atmosphere]:
    """From nothing to clear standard air, one process after the other; all of one structure."""
    none = Ozone(column_du=0.0)
    return {
        "no air": Atmosphere(Air(refraction=0.0, scattering=0.0), none),
        "refraction": Atmosphere(Air(scattering=0.0), none),
        "refraction, scattering": Atmosphere(Air(), none),
        "refraction, scattering, ozone": Atmosphere(),
    }


@styled
def worlds_plate(size: int = 320) -> Plate:
    """Four worlds in totality, all brightened alike, and in the partial phase.

    - `size`: pixels along a side of each picture.
    """
    plate = Plate("Four worlds", 11.0, 6.5)
    total = pictures(scene(TOTAL, SITE, size=size, sky=airless()), worlds().values())
    gain = bright_gain(total[2])
    partial = pictures(scene(PARTIAL, SITE, size=size, sky=airless()), worlds().values())
    below = [darkness(image) for image in total]
    row(plate, zip((shown(image, gain) for image in total), worlds(), below, strict=True), top=0.935, bottom=0.52)
    bright = (shown(image, PARTIAL_GAIN) for image in partial)
    row(plate, zip(bright, [""] * 4, [""] * 4, strict=True), top=0.44, bottom=0.02)
    plate.caption = (
        f"Above, the Moon of {moment(TOTAL)} from Troy, New York, without the air there, brightened {gain:,.0f} times "
        "in all four pictures. Without air nothing reaches it. Air that only bends fills the umbra with white light, "
        "which overexposes here; Rayleigh scattering leaves the red of it; ozone takes yellow and orange as well and "
        "turns the bright edge bluish. The numbers say by how much the whole Moon is dimmed. Below, "
        f"{moment(PARTIAL)}, brightened {PARTIAL_GAIN:g} times: air hardly matters to the part that the Sun still "
        "lights, but softens the edge."
    )
    return plate


@styled
def dust_plate(size: int = 320) -> Plate:
    """Dust of three extinctions, brightened alike and each as it needs.

    - `size`: pixels along a side of each picture.
    """
    plate = Plate("Dust in the stratosphere", 8.4, 6.7)
    typical = Atmosphere.typical()
    assert typical.clouds is not None
    images = pictures(scene(TOTAL, SITE, size=size, sky=airless()), [dusty(typical, alpha) for alpha in ALPHAS])
    gain = bright_gain(images[0])
    titles = ["α = 0" if alpha == 0 else f"α = {alpha:.1e} m$^{{-1}}$" for alpha in ALPHAS]
    upper = [(shown(image, gain), title, darkness(image)) for image, title in zip(images, titles, strict=True)]
    row(plate, upper, top=0.935, bottom=0.525)
    gains = [bright_gain(image) for image in images]
    lower = [(shown(image, g), "", f"brightened {g:,.0f} times") for image, g in zip(images, gains, strict=True)]
    row(plate, lower, top=0.465, bottom=0.055)
    plate.caption = (
        f"The Moon of {moment(TOTAL)} from Troy, without the air there, under the typical limb (clouds to "
        f"{typical.clouds.top / 1e3:g} km, haze) with grey dust between 15 and 25 km. Above, all brightened "
        f"{gain:,.0f} times, below each as it needs. Dust dims what is left, the middle most, because the rays that "
        "pass above it reach only the rim of the umbra. The values are the paper's; 1.0e-5 /m is a vertical optical "
        "depth of 0.1, as after a great eruption."
    )
    return plate
