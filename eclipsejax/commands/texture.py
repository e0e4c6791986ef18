"""`eclipsejax texture`: the shadow as an image for other people's renderers."""

from argparse import ArgumentTypeError, Namespace
from pathlib import Path

from eclipsejax import session
from eclipsejax.commands import options as shared
from eclipsejax.commands.output import check_writable, whole_file

SUFFIXES = (".tif", ".tiff")
DEEP = 1.8e6  # m, a little more than the Moon's radius


def add_to(commands) -> None:
    """Describe the command to the parser."""
    command = commands.add_parser(
        "texture",
        help="write the shadow as a lookup image for CosmoScout VR",
        description="Write the Earth's shadow as a float TIFF in the layout of CosmoScout VR's eclipse shadow maps: "
        "fraction of sunlight against apparent radii and separation of Earth and Sun. It is right for points as far "
        "from the Earth as the Moon; nearer and farther ones repeat the nearest column.",
    )
    command.set_defaults(action=_texture)
    number, add = session.number, command.add_argument
    add("-o", dest="output", required=True, type=Path, metavar="FILE", help=", ".join(SUFFIXES))
    distance = "of the Moon's centre, for one eclipse; default: from any perigee to any apogee"
    add("--moon-distance", type=number(1e5, 1e6), metavar="KM", help=distance)
    three = "light at three wavelengths, such as CosmoScout's own 680,550,440; default: linear sRGB"
    add("--wavelengths", type=_wavelengths, metavar="R,G,B", help=three)
    add("--size", type=number(16, 4096), default=256, metavar="PIXELS", help="default 256")
    error = "relative error wanted of the light: 1e-2, 1e-3 (default), 1e-4 or 1e-5"
    add("--tolerance", type=number(1e-5, 1e-1), default=1e-3, metavar="E", help=error)
    shared.add_air(command)
    shared.add_scattered(command)


def _wavelengths(text: str) -> tuple[float, ...]:
    parts = text.split(",")
    if len(parts) != 3:
        raise ArgumentTypeError(f"{text.strip()!r} is not R,G,B in nanometres, such as 680,550,440")
    return tuple(session.number(300, 1000)(part) for part in parts)


def _texture(options: Namespace) -> None:
    check_writable(options.output, SUFFIXES, "texture")
    session.start()
    import tifffile

    from eclipsejax.texture import MOON_DISTANCES, shadow_texture, three_wavelengths

    distances, centre = MOON_DISTANCES, options.moon_distance
    if centre is not None:
        distances = (1e3 * centre - DEEP, 1e3 * centre)
    texture = shadow_texture(
        shared.atmosphere(options),
        distances=distances,
        size=round(options.size),
        channels=options.wavelengths and three_wavelengths(*options.wavelengths),
        scatterers=shared.scatterers(options),
        tolerance=options.tolerance,
    )
    rows, columns, _ = texture.shape
    red, green, blue = texture[-1, columns * 55 // 256]
    with whole_file(options.output) as path:
        tifffile.imwrite(path, texture, photometric="rgb")
    print(f"Wrote {options.output}: {columns} x {rows} texels, light on the axis {red:.2g}, {green:.2g}, {blue:.2g}.")
