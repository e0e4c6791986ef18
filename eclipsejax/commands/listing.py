"""`eclipsejax list`: the eclipses between two dates."""

import re
from argparse import Namespace

from eclipsejax import session
from eclipsejax.commands.options import SITE
from eclipsejax.errors import InputError

KINDS = ("total", "partial", "penumbral")
YEAR = r"[+-]?\d{1,4}"


def add_to(commands) -> None:
    """Describe the command to the parser."""
    command = commands.add_parser(
        "list",
        help="print the eclipses between two dates",
        description="Print the lunar eclipses from START until before STOP: greatest eclipse, least distance "
        "of the Moon from the shadow's axis in Earth radii (gamma), magnitudes, and when the Moon enters and "
        "leaves the penumbra (P1, P4) and the umbra (U1, U4), and totality begins and ends (U2, U3). Times "
        "are UTC, before 1972 UT1; the calendar is Julian until 1582-10-04; years -1000 to 2998.",
    )
    command.set_defaults(action=_list)
    add = command.add_argument
    add("start", metavar="START", help="year (2000, -584), date or time")
    add("stop", metavar="STOP", nargs="?", help="the same; not included. Without it, the year START is listed")
    add("--site", type=session.site, metavar=SITE, help="add the altitude of the Moon there")
    add("--kind", choices=KINDS, help="only eclipses of this kind")


def _list(options: Namespace) -> None:
    from eclipsejax.almanac import CONTACTS, eclipses

    start, stop = _date(options.start), _date(options.stop or _next_year(options.start))
    if start == stop:
        raise InputError(f"START and STOP are both {start}, and STOP is not included: leave it out for the whole year.")
    found = [eclipse for eclipse in eclipses(start, stop) if options.kind in (None, eclipse.kind)]
    if not found:
        print(f"No {options.kind or 'lunar'} eclipse from {start} until before {stop}.")
        return
    columns = "{:21} {:9} {:>6} {:>7} {:>7}  " + 6 * " {:>8}"
    heading = columns.format("greatest (UTC)", "kind", "gamma", "umbral", "penumb.", *CONTACTS)
    if options.site:
        session.start()
        _altitudes(found[0], options.site)  # refuses what is no site, before anything is printed
        place = ", ".join(f"{value:g}" for value in options.site)
        heading += f"\nSecond lines: altitude of the Moon at {place} [degrees]; 'below': it is below horizon."
    print(heading)
    for eclipse in found:
        depth = (eclipse.gamma, eclipse.umbral_magnitude, eclipse.penumbral_magnitude)
        times = [eclipse.contacts.get(name, "-")[-9:].rstrip("Z") for name in CONTACTS]
        print(columns.format(eclipse.greatest, eclipse.kind, *(f"{x:.3f}" for x in depth), *times))
        if options.site:
            heights = _altitudes(eclipse, options.site)
            cells = [heights.get(name, "") for name in CONTACTS]
            print(columns.format(f"  {heights['greatest']}", "", "", "", "", *cells).rstrip())


def _altitudes(eclipse, site: tuple[float, ...]) -> dict[str, str]:
    from math import degrees

    from eclipsejax.ephemeris import local_circumstances

    altitudes = local_circumstances(eclipse, *site)
    return {name: f"{degrees(x):.1f}" if x > 0.0 else "below" for name, x in altitudes.items()}


def _date(text: str) -> str:
    """A bare year means its first day."""
    text = text.strip()
    if not re.fullmatch(YEAR, text):
        return text
    year = int(text)
    return f"{'-' if year < 0 else ''}{abs(year):04d}-01-01"


def _next_year(text: str) -> str:
    if not re.fullmatch(YEAR, text.strip()):
        raise InputError(f"STOP is missing: after {text!r}, which is no year, give the date before which to end.")
    return str(int(text) + 1)
