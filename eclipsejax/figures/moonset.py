"""A Moon that sets in eclipse: reddened, dimmed and flattened by the observer's own air."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.ephemeris import geometry, moon_altitude
from eclipsejax.figures.page import COLOURS, FAINT, INK, Plate, panels, photograph, styled
from eclipsejax.figures.picture import pictures, scene, shown, zenith_up
from eclipsejax.response import bright_gain
from eclipsejax.sky import Sky, air_mass

MADRID = (40.42, -3.70)
SETTING = tuple(f"2022-05-16T{time}:00Z" for time in ("03:30", "04:10", "04:35", "04:47", "04:54"))


@eqx.filter_jit
def _seen(sky, altitude):
    """Apparent altitude [rad], air mass, flattening and transmission at the wavelengths of `COLOURS`."""
    light = sky.transmission(jnp.asarray(list(COLOURS)), altitude[:, None])
    return sky.apparent_altitude(altitude), air_mass(altitude), sky.flattening(altitude), light


@styled
def moonset_plate(size: int = 320) -> Plate:
    """The eclipsed Moon of 2022-05-16 setting at Madrid, and Young's air mass.

    - `size`: pixels along a side of each picture.
    """
    plate = Plate("The eclipsed Moon sets", 12.5, 6.3)
    altitudes = [float(np.degrees(moon_altitude(geometry(utc, *MADRID)))) for utc in SETTING]
    # One call for the curves and for the five dots.
    height = np.linspace(0.0, 15.0, 301)
    apparent, mass, squeezed, light = (
        np.split(np.asarray(values), [height.size])
        for values in _seen(Sky(), jnp.radians(np.concatenate([height, altitudes])))
    )
    rows = plate.add_gridspec(1, 5, left=0.008, right=0.992, top=0.945, bottom=0.5, wspace=0.04)
    for panel, utc, above in zip(panels(rows), SETTING, np.degrees(apparent[1]), strict=True):
        view = scene(utc, MADRID, size=size, roll=zenith_up(utc, MADRID))
        image = pictures(view, [Atmosphere.typical()])[0]
        gain = bright_gain(image)
        photograph(panel, shown(image, gain), f"{utc[11:16]} UTC, at {above:.1f}°", f"brightened {gain:,.0f} ×")

    lower = plate.add_gridspec(1, 3, left=0.05, right=0.985, top=0.38, bottom=0.085, wspace=0.2)
    left, middle, right = panels(lower)
    left.plot(height, mass[0], color=INK)
    left.plot(altitudes, mass[1], "o", color=FAINT, markersize=5)
    left.set(title="air mass, Young 1994", xlabel="true altitude  [°]", ylim=(0, 34), xlim=(0, 15))
    for column, (nm, colour) in enumerate(COLOURS.items()):
        middle.semilogy(height, light[0][:, column], color=colour, label=f"{nm:.0f} nm")
    middle.set(title="light that comes down", xlabel="true altitude  [°]", ylim=(1e-7, 1), xlim=(0, 15))
    middle.legend(loc="lower right")
    right.plot(height, squeezed[0], color=INK)
    right.plot(altitudes, squeezed[1], "o", color=FAINT, markersize=5)
    right.set(title="height of the disc over its breadth", xlabel="true altitude  [°]", ylim=(0.8, 1.01), xlim=(0, 15))
    plate.caption = (
        f"Totality of 2022-05-16 from Madrid ({MADRID[0]} N, {-MADRID[1]} W), the zenith up; apparent altitudes. The "
        "light comes back through the observer's own air, which takes the blue first (Young's air mass, haze of "
        "optical depth 0.1, ozone), and the Moon turns redder and fainter until it is lost at the horizon. Refraction "
        f"lifts the lower limb more than the upper: at {np.degrees(apparent[1][-1]):.1f}° the disc is "
        f"{100 * (1 - squeezed[1][-1]):.0f} % less high than broad. The light of dawn is not drawn."
    )
    return plate
