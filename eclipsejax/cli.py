"""The command `eclipsejax`: lists eclipses, renders one. Heavy modules load only where they are used."""

import os
import re
from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from eclipsejax import session
from eclipsejax.errors import InputError

FIELD = 1.1e-2  # rad, width of the picture: the Moon is 8.9e-3 to 9.9e-3 wide
BRIGHT = 0.8  # of full scale, for the brightest channel of the brightest hundredth of the disc

SITE = "LAT,LON[,HEIGHT]"
KINDS = ("total", "partial", "penumbral")
SUFFIXES = (".png", ".tif", ".tiff")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return session.run("eclipsejax", partial(_command, arguments))


def _command(arguments: Sequence[str] | None) -> None:
    options = _parser().read(arguments)
    options.action(options)


def _parser() -> session.Arguments:
    parser = session.Arguments(prog="eclipsejax", description="Lunar eclipses: when they are, and what they look like.")
    commands = parser.add_subparsers(required=True, metavar="list | render")
    _add_list(commands)
    _add_render(commands)
    return parser


def _add_list(commands) -> None:
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
    add("stop", metavar="STOP", help="the same; not included")
    add("--site", type=session.site, metavar=SITE, help="add the altitude of the Moon there")
    add("--kind", choices=KINDS, help="only eclipses of this kind")


def _add_render(commands) -> None:
    command = commands.add_parser(
        "render",
        help="render a picture of an eclipse",
        description="Render the eclipsed Moon at a time, as PNG or as linear 16-bit TIFF (sRGB primaries).",
    )
    command.set_defaults(action=_render)
    number = session.number
    add = command.add_argument
    add("utc", metavar="UTC", help="time with its zone, such as 2008-02-21T03:26Z")
    add("-o", dest="output", required=True, type=Path, metavar="FILE", help=", ".join(SUFFIXES))
    add("--site", type=session.site, metavar=SITE, help="default: from the Earth's centre, without air")

    air = command.add_argument_group("the air along the Earth's limb")
    either = air.add_mutually_exclusive_group()
    either.add_argument("--clear", action="store_true", help="clear standard air with ozone")
    either.add_argument("--typical", action="store_true", help="clouds, haze, a little dust (default)")
    add = air.add_argument
    add("--alpha", type=number(0, 1e-3), metavar="1/M", help="extinction of dust from 15 to 25 km")
    add("--clouds", type=_clouds, metavar="TOP_KM,COVER", help="such as 8,0.97")
    add("--temperature", type=number(217, 345), metavar="K", help="at the ground; default 288.15")
    add("--pressure", type=number(1e3, 2e5), metavar="PA", help="at the ground; default 101325")

    add = command.add_argument_group("the camera").add_argument
    add("--size", type=number(8, 4096), default=512, metavar="PIXELS", help="default 512")
    turn = "position angle of the picture's up direction, north through east; default 0"
    add("--roll", type=number(-360, 360), default=0.0, metavar="DEG", help=turn)
    add("--exposure", type=number(1e-6, 1e4), metavar="SECONDS", help="such as 4 or 1/60")
    add("--f-number", type=number(0.1, 1e3), metavar="N", help="with --exposure")
    add("--iso", type=number(1, 1e7), metavar="N", help="with --exposure")
    brightness = "instead of an exposure: 1 shows the full Moon at full scale; default: what shows this Moon"
    add("--gain", type=number(1e-6, 1e12), metavar="X", help=brightness)
    error = "relative error wanted of the light: 1e-2, 1e-3 (default), 1e-4 or 1e-6"
    add("--tolerance", type=number(1e-5, 1e-1), default=1e-3, metavar="E", help=error)


def _list(options: Namespace) -> None:
    from eclipsejax.almanac import CONTACTS, eclipses

    start, stop = _date(options.start), _date(options.stop)
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
    if not re.fullmatch(r"[+-]?\d{1,4}", text):
        return text
    year = int(text)
    return f"{'-' if year < 0 else ''}{abs(year):04d}-01-01"


def _clouds(text: str) -> tuple[float, float]:
    if text.count(",") != 1:
        raise ArgumentTypeError(f"{text.strip()!r} is not TOP_KM,COVER, such as 8,0.97")
    top, cover = text.split(",")
    return session.number(0, 100)(top), session.number(0, 1)(cover)


def _render(options: Namespace) -> None:
    _check_writable(options.output)
    shot = (options.exposure, options.f_number, options.iso)
    if any(x is not None for x in shot) and (None in shot or options.gain is not None):
        raise InputError("--exposure, --f-number and --iso belong together, without --gain: give all three or none.")
    session.start()
    import equinox as eqx
    import numpy as np

    from eclipsejax.camera import Camera, Exposure
    from eclipsejax.render import render
    from eclipsejax.response import display, into_gamut
    from eclipsejax.scene import Scene

    size = round(options.size)
    camera = Camera(shape=(size, size), scale=FIELD / size, roll=np.radians(options.roll))
    scene = Scene.at(options.utc.strip(), *(options.site or ()), camera=camera)
    image = np.asarray(eqx.filter_jit(render)(scene, _atmosphere(options), tolerance=options.tolerance))

    if options.exposure is not None:
        gain = float(Exposure(*shot).scale()[0])
        print(f"A full Moon would be at {gain:.3g} of full scale.")
    else:
        gain = options.gain or _bright_gain(image)
        print(f"The Moon is brightened {f'{gain:,.0f}' if gain >= 10 else f'{gain:g}'} times.")

    try:
        if options.output.suffix.lower() == ".png":
            from PIL import Image

            Image.fromarray(display(image, gain)).save(options.output)
        else:
            import tifffile

            linear = np.round(65535 * np.asarray(into_gamut(gain * image))).astype(np.uint16)
            tifffile.imwrite(options.output, linear, photometric="rgb")
    except OSError as error:
        raise InputError(f"{options.output} cannot be written ({error}): choose another place.") from None
    print(f"Wrote {options.output}: {scene.geometry.utc}, {size} x {size} pixels.")


def _check_writable(path: Path) -> None:
    """Before the work, not after it."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"The picture {path} has no known format: end its name in {', '.join(SUFFIXES)}.")
    touched = path if path.exists() else path.parent
    if path.is_dir() or not path.parent.is_dir() or not os.access(touched, os.W_OK):
        raise InputError(f"The picture {path} cannot be written: name a file in a folder that exists and is writable.")


def _atmosphere(options: Namespace):
    from eclipsejax.air import Air
    from eclipsejax.atmosphere import Atmosphere, Dust

    limb = Atmosphere() if options.clear else Atmosphere.typical()
    surface = {"surface_temperature": options.temperature, "surface_pressure": options.pressure}
    parts: dict[str, object] = {"air": Air(**{name: x for name, x in surface.items() if x is not None})}
    if options.alpha is not None:
        parts["dust"] = Dust(extinction=options.alpha)
    if options.clouds is not None and limb.clouds is not None:
        top, cover = options.clouds
        parts["clouds"] = replace(limb.clouds, top=1e3 * top, cover=cover)
    return replace(limb, **parts)


def _bright_gain(image) -> float:
    """Gain that shows the bright part of the disc, of two digits, so that it can be given as --gain again."""
    import numpy as np

    brightest = image.max(axis=-1)
    lit = brightest[brightest > 0.0]
    return float(f"{BRIGHT / np.percentile(lit, 99):.2g}") if lit.size else 1.0
