"""Options that several commands share, and what they stand for: the air, the site, the camera."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from dataclasses import replace

from eclipsejax import session

FIELD = 1.1e-2  # rad, width of the picture: the Moon is 8.9e-3 to 9.9e-3 wide
SITE = "LAT,LON[,HEIGHT]"


def add_air(command: ArgumentParser) -> None:
    """What is along the Earth's limb; read by `atmosphere`."""
    number = session.number
    air = command.add_argument_group("the air along the Earth's limb")
    either = air.add_mutually_exclusive_group()
    either.add_argument("--clear", action="store_true", help="clear standard air with ozone")
    either.add_argument("--typical", action="store_true", help="clouds, haze, a little dust (default)")
    add = air.add_argument
    add("--alpha", type=number(0, 1e-3), metavar="1/M", help="extinction of dust from 15 to 25 km")
    add("--clouds", type=_clouds, metavar="TOP_KM,COVER", help="such as 8,0.97")
    add("--temperature", type=number(217, 345), metavar="K", help="at the ground; default 288.15")
    add("--pressure", type=number(1e3, 2e5), metavar="PA", help="at the ground; default 101325")


def atmosphere(options: Namespace):
    """The `Atmosphere` of the options of `add_air`."""
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


def add_scattered(command: ArgumentParser) -> None:
    """Whether the limb's scattered light is added; read by `scatterers`."""
    command.add_argument("--scattered", action="store_true", help="add the light that the limb scatters into the umbra")


def scatterers(options: Namespace):
    """The `Scatterers` of the option of `add_scattered`, or None."""
    from eclipsejax.scatterers import Scatterers

    return Scatterers() if options.scattered else None


def add_site(command: ArgumentParser) -> None:
    """Where the camera stands."""
    command.add_argument(
        "--site", type=session.site, metavar=SITE, help="default: from the Earth's centre, without air"
    )


def add_camera(command: ArgumentParser, size: int):
    """Size and roll of the picture and the error wanted, read by `camera`; returns the group, for more options."""
    number = session.number
    group = command.add_argument_group("the camera")
    add = group.add_argument
    add("--size", type=number(8, 4096), default=size, metavar="PIXELS", help=f"default {size}")
    turn = "position angle of the picture's up direction, north through east; default 0"
    add("--roll", type=number(-360, 360), default=0.0, metavar="DEG", help=turn)
    error = "relative error wanted of the light: 1e-2 or 1e-3 (default)"
    add("--tolerance", type=number(1e-3, 1e-1), default=1e-3, metavar="E", help=error)
    return group


def camera(options: Namespace):
    """The `Camera` of the options of `add_camera`, without its exposure."""
    import numpy as np

    from eclipsejax.camera import Camera

    size = round(options.size)
    return Camera(shape=(size, size), scale=FIELD / size, roll=np.radians(options.roll))


def _clouds(text: str) -> tuple[float, float]:
    if text.count(",") != 1:
        raise ArgumentTypeError(f"{text.strip()!r} is not TOP_KM,COVER, such as 8,0.97")
    top, cover = text.split(",")
    return session.number(0, 100)(top), session.number(0, 1)(cover)
