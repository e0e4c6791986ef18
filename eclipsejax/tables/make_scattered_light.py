"""Writes scattered_light.csv: light scattered into the umbra by the typical limb, for several amounts of dust.

    python -m eclipsejax.tables.make_scattered_light

A fit cannot afford to work it out for each limb that it tries, and need not: it changes by 2 % from the axis to 40',
by 5 % under dust of 4e-6 /m, by a quarter under 1.6e-5 /m (printed below), and by some tens of per cent with clouds and
ozone.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from eclipsejax import session
from eclipsejax.atmosphere import Atmosphere, Dust
from eclipsejax.scattered import scattered_irradiance

TARGET = Path(__file__).parent / "scattered_light.csv"
EXTINCTIONS = (1e-7, 1e-6, 4e-6, 1.6e-5)  # 1/m
OFFSETS = (0.0, 20.0, 40.0)  # arcmin; the one in the middle is kept
WAVELENGTHS = np.arange(380.0, 780.1, 20.0)  # nm

HEADER = """\
# Scattered light 20' from the axis of the Earth's shadow as a fraction of sunlight, by eclipsejax.scattered_irradiance:
# dust [1/m], then wavelengths [nm]; the Moon at its mean distance. Written by make_scattered_light.py.
"""


def main():
    session.start()
    lines = ["extinction," + ",".join(f"{wavelength:g}" for wavelength in WAVELENGTHS)]
    for extinction in EXTINCTIONS:
        air = replace(Atmosphere.typical(), dust=Dust(extinction))
        light = scattered_irradiance(air, np.radians(np.array(OFFSETS) / 60), WAVELENGTHS)
        near, here, far = np.asarray(light)
        print(f"dust {extinction:g} /m: 0' and 40' against 20': {np.ptp([near / here, far / here]):.3f} apart at most")
        lines.append(f"{extinction:g}," + ",".join(f"{value:.3e}" for value in here))
    TARGET.write_text(HEADER + "\n".join(lines) + "\n")
    print(f"Wrote {TARGET.name}")


if __name__ == "__main__":
    main()
