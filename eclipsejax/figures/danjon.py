"""Danjon's scale as a strip: one Moon under five airs, from the bright umbra of clear air to a volcano's dust."""

from dataclasses import replace

import jax.numpy as jnp

from eclipsejax.atmosphere import Atmosphere, Dust
from eclipsejax.figures.page import Plate, row, styled
from eclipsejax.figures.picture import airless, magnitudes_lost, moment, pictures, scene, shown
from eclipsejax.figures.worlds import SITE, TOTAL
from eclipsejax.photometry import FULL_MOON, danjon_number
from eclipsejax.response import bright_gain

# Extinction of the dust [1/m] and its top [m] that give L = 3, 2, 1, 0 to 0.1 in this eclipse; L = 4 is clear air.
DUST = ((1.2e-6, 25e3), (3.6e-6, 30e3), (7.2e-6, 30e3), (1.2e-5, 30e3))
WORDS = ("copper and orange", "brick red", "deep red", "dark, brownish", "almost invisible")


def strip() -> list[Atmosphere]:
    """Airs of L = 4 to 0."""
    typical = Atmosphere.typical()
    return [Atmosphere(), *(replace(typical, dust=Dust(extinction=alpha, top=top)) for alpha, top in DUST)]


@styled
def danjon_plate(size: int = 320) -> Plate:
    """Five airs, brightened alike and each as it needs.

    - `size`: pixels along a side of each picture.
    """
    plate = Plate("Danjon's scale", 12.5, 6.0)
    images = pictures(scene(TOTAL, SITE, size=size, sky=airless()), strip())
    magnitudes = FULL_MOON + jnp.asarray([magnitudes_lost(image) for image in images])
    gain = bright_gain(images[0])
    titles = [
        f"L = {number:.1f}   ({m:+.1f} mag)" for number, m in zip(danjon_number(magnitudes), magnitudes, strict=True)
    ]
    alike = [(shown(image, gain), title, "") for image, title in zip(images, titles, strict=True)]
    row(plate, alike, top=0.945, bottom=0.53, margin=0.008)
    gains = [bright_gain(image) for image in images]
    lines = [f"{words}; brightened {g:,.0f} ×" for words, g in zip(WORDS, gains, strict=True)]
    each = [(shown(image, g), "", line) for image, g, line in zip(images, gains, lines, strict=True)]
    row(plate, each, top=0.485, bottom=0.06, margin=0.008)
    dust = ", ".join(f"{alpha:.2g} /m to {top / 1e3:.0f} km" for alpha, top in DUST)
    plate.caption = (
        f"One Moon ({moment(TOTAL)}, seen without the observer's air) under five airs: clear, then typical clouds and "
        f"haze with grey dust of {dust}, from 15 km up. Above, all brightened {gain:,.0f} times; below, each as it "
        "needs, with what Danjon's scale calls it. L follows from the magnitude of the whole Moon by Vital's relation "
        "m = 4.2 − 3 L + (L/2)². Real dust is not grey and nobody's eye follows a formula: take the strip for a guide."
    )
    return plate
