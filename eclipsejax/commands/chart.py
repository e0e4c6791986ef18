"""`eclipsejax chart`: the course of one eclipse, and how the Moon's disc stands in the sky."""

from argparse import Namespace
from pathlib import Path

from eclipsejax import session
from eclipsejax.commands import options as shared
from eclipsejax.commands.output import check_writable, whole_file

SUFFIXES = (".png",)
COLUMNS = "{:9} {:20} {:>8} {:>8} {:>7} {:>10} {:>9} {:>7} {:>7}"
HEADING = ("", "UTC", "altitude", "azimuth", "radius", "libration:", "latitude", "axis", "tilt")


def add_to(commands) -> None:
    """Describe the command to the parser."""
    command = commands.add_parser(
        "chart",
        help="print and draw the course of an eclipse, and the Moon's libration",
        description="Print, for each contact of an eclipse and for its middle, where the Moon stands in the sky "
        "[degrees, without refraction], its radius [arcmin], its libration (selenographic longitude and latitude "
        "of the disc's centre), and how far its north pole is turned from celestial north (axis, eastwards) and "
        "from the zenith (tilt, leftwards) [degrees]. With -o, draw the Moon's way through the shadow, and its disc.",
    )
    command.set_defaults(action=_chart)
    add = command.add_argument
    add("date", metavar="DATE", help="of the eclipse, such as 2008-02-21; see eclipsejax list")
    add("-o", dest="output", type=Path, metavar="FILE", help=", ".join(SUFFIXES))
    shared.add_site(command)


def _chart(options: Namespace) -> None:
    from eclipsejax.movie import eclipse_on

    if options.output is not None:
        check_writable(options.output, SUFFIXES, "chart")
    eclipse = eclipse_on(options.date)
    session.start()
    import numpy as np

    from eclipsejax.almanac import in_order
    from eclipsejax.aspect import aspect
    from eclipsejax.constants import MOON_RADIUS
    from eclipsejax.ephemeris import geometry

    site = options.site or ()
    geometry(eclipse.greatest, *site)  # refuses what is no site, before anything is printed
    print(
        f"{eclipse.kind}, umbral magnitude {eclipse.umbral_magnitude:.3f}, "
        f"penumbral {eclipse.penumbral_magnitude:.3f}, gamma {eclipse.gamma:.3f}"
    )
    print(COLUMNS.format(*HEADING))
    for name, utc in in_order(eclipse).items():
        where = geometry(utc, *site)
        seen = aspect(where)
        radius = np.arcsin(MOON_RADIUS / np.linalg.norm(where.moon - where.observer))
        angles = np.degrees([seen.altitude, seen.azimuth, 60.0 * radius, *seen[:4]])
        cells = [
            "-" if np.isnan(x) else f"{x:.{digits}f}" for x, digits in zip(angles, (1, 1, 2, 2, 2, 1, 1), strict=True)
        ]
        print(COLUMNS.format(name, utc, *cells))
    if options.output is not None:
        from eclipsejax.figures.chart import chart_plate

        with whole_file(options.output) as path:
            path.write_bytes(chart_plate(eclipse, site).png())
        print(f"Wrote {options.output}.")
