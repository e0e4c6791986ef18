"""Photographs of a simulated camera: one Moon at many shutter speeds, mid-eclipse, an eclipse that was to come."""

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.camera import Exposure
from eclipsejax.figures.page import Plate, row, styled
from eclipsejax.figures.picture import darkness, moment, photographed, pictures, scene, shutter
from eclipsejax.figures.worlds import PARTIAL, SITE, TOTAL

F_NUMBER, ISO = 8.0, 800.0  # the paper names shutter speeds only
SHUTTERS = (1 / 125, 1 / 20, 1 / 6, 1 / 2, 1.5)  # s, on 2008-02-21 at 04:12:44 UTC
PREDICTED = (("2010-12-21T07:22:17Z", 0.8), ("2010-12-21T07:40:21Z", 1.0), ("2010-12-21T08:16:56Z", 1.5))


def exposure(seconds: float) -> Exposure:
    """Of the series of the paper, with the f-number and ISO chosen here."""
    return Exposure(shutter_s=seconds, f_number=F_NUMBER, iso=ISO)


@styled
def exposures_plate(size: int = 320) -> Plate:
    """The partial phase of 2008-02-21 at the paper's five shutter speeds.

    - `size`: pixels along a side of each picture.
    """
    plate = Plate("2008 February 21: one Moon, five exposures", 12.5, 3.0)
    image = pictures(scene(PARTIAL, SITE, size=size), [Atmosphere.typical()])[0]
    shots = [(photographed(image, exposure(t)), shutter(t), "") for t in SHUTTERS]
    row(plate, shots, top=0.9, bottom=0.02, margin=0.008)
    plate.caption = (
        f"The Moon on {moment(PARTIAL)} from Troy, New York ({SITE[0]} N, {-SITE[1]} W), leaving the umbra, at the "
        f"paper's shutter speeds, here f/{F_NUMBER:g} and ISO {ISO:g}. The camera blurs by 4 arcsec, scatters 0.2 % "
        "of the light, adds photon and read noise, and clips each channel at full scale: the crescent is right at "
        "1/125 s and lost when the umbra appears. Typical limb."
    )
    return plate


@styled
def mid_eclipse_plate(size: int = 320) -> Plate:
    """Mid-eclipse of 2008-02-21, clear and typical, photographed alike.

    - `size`: pixels along a side of each picture.
    """
    plate = Plate("2008 February 21: mid-eclipse", 9.0, 4.9)
    limbs = {"clear air": Atmosphere(), "typical: clouds, haze, a little dust": Atmosphere.typical()}
    images = pictures(scene(TOTAL, SITE, size=size), limbs.values())
    seconds = 1.5
    shots = [
        (photographed(image, exposure(seconds)), name, darkness(image))
        for name, image in zip(limbs, images, strict=True)
    ]
    row(plate, shots, top=0.93, bottom=0.06)
    plate.caption = (
        f"{moment(TOTAL)} from Troy, {shutter(seconds)}, f/{F_NUMBER:g}, ISO {ISO:g}. Dimming as seen through the air "
        "there. The northern limb is deepest in the umbra. A clear limb all around the Earth is brighter than any "
        "eclipse measured between 1990 and 2022; clouds and haze dim the middle of the shadow more than its edge."
    )
    return plate


@styled
def prediction_plate(size: int = 320) -> Plate:
    """The paper's prediction of 2010-12-21: three times, three exposures.

    - `size`: pixels along a side of each picture.
    """
    plate = Plate("2010 December 21, as predicted", 10.0, 3.9)
    shots = []
    for utc, seconds in PREDICTED:
        image = pictures(scene(utc, SITE, size=size), [Atmosphere.typical()])[0]
        shots.append((photographed(image, exposure(seconds)), f"{utc[11:19]} UTC", shutter(seconds)))
    row(plate, shots, top=0.92, bottom=0.075)
    plate.caption = (
        f"The eclipse that the paper foretold, at its times and exposures, from Troy, New York, f/{F_NUMBER:g}, ISO "
        f"{ISO:g}, typical limb. The second is seconds before totality (07:40:49 UTC), the last mid-eclipse."
    )
    return plate
