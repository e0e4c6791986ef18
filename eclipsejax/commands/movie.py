"""`eclipsejax movie`: a whole eclipse as a film."""

import signal
import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Iterable, Iterator
from pathlib import Path

from eclipsejax import session
from eclipsejax.commands import options as shared
from eclipsejax.commands.output import check_writable, whole_file
from eclipsejax.errors import InputError

SUFFIXES = (".mp4", ".gif")
METER = 64  # pixels of the picture with which the light is metered
METERED, BRIGHT = 95.0, 0.7  # its brightest twentieth, seldom a thin crescent, is above this level [full scale]
SMOOTH = 240.0  # s, standard deviation of the Gaussian that smooths an automatic exposure
SET = -0.01  # rad, true altitude of a Moon that refraction still shows on the horizon
F_NUMBER, ISO = 5.6, 1600.0


def add_to(commands) -> None:
    """Describe the command to the parser."""
    command = commands.add_parser(
        "movie",
        help="film a whole eclipse",
        description="Film an eclipse from its first contact to its last, as MP4 or GIF, with time and exposure in each "
        "frame. From a site, frames with the Moon below the horizon are left out. Ctrl-C keeps the frames made so far.",
    )
    command.set_defaults(action=_movie)
    number, add = session.number, command.add_argument
    add("date", metavar="DATE", help="of the eclipse, such as 2010-12-21; see eclipsejax list")
    add("-o", dest="output", required=True, type=Path, metavar="FILE", help=", ".join(SUFFIXES))
    add("--umbral", action="store_true", help="only while the Moon is in the umbra, U1 to U4; default: P1 to P4")
    add("--frames", type=number(2, 1e5), default=240, metavar="N", help="default 240")
    add("--fps", type=number(1, 120), default=24, metavar="N", help="frames a second; default 24")
    shared.add_site(command)
    shared.add_air(command)
    shared.add_scattered(command)
    add = shared.add_camera(command, size=512).add_argument
    brightness = "auto (default) follows the light smoothly, stops in whole stops as a photographer would"
    add("--exposure", type=_exposure, default="auto", metavar="auto|stops|SECONDS", help=brightness)
    add("--f-number", type=number(0.1, 1e3), default=F_NUMBER, metavar="N", help=f"default {F_NUMBER:g}")
    add("--iso", type=number(1, 1e7), default=ISO, metavar="N", help=f"default {ISO:g}")


def _exposure(text: str) -> str | float:
    if text.strip() in ("auto", "stops"):
        return text.strip()
    try:
        return session.number(1e-6, 1e4)(text)
    except ArgumentTypeError as error:
        raise ArgumentTypeError(f"{error}; it may also be auto or stops") from None


def _movie(options: Namespace) -> None:
    from eclipsejax.movie import eclipse_on, instants, shutter_text
    from eclipsejax.movie_file import check_writer, write_movie

    check_writable(options.output, SUFFIXES, "film")
    check_writer(options.output)
    options.size = 2 * round(options.size / 2)  # what H.264 takes
    eclipse = eclipse_on(options.date)
    session.start()

    times, geometries = _visible(instants(eclipse, round(options.frames), umbral=options.umbral), options.site)
    print(f"The eclipse is {eclipse.kind}, greatest at {eclipse.greatest}. Working out the shadow.", file=sys.stderr)
    shutters, frames = _filmed(times, geometries, options)
    stopped = _Stop()
    with stopped, whole_file(options.output) as path:
        count = write_movie(path, stopped.until(_counted(frames, len(times))), options.fps)
        if stopped.asked:  # a film that was there stays as it is
            options.output = options.output.with_stem(options.output.stem + "-partial")
            path.replace(options.output)
    size = f"{options.size} x {options.size}"
    exposures = " to ".join(dict.fromkeys(shutter_text(x) for x in (min(shutters), max(shutters))))
    print(
        f"Wrote {options.output}: {count} frames of {size} pixels, {times[0]} to {times[count - 1]}, "
        f"{exposures} at f/{options.f_number:g}, ISO {options.iso:g}."
    )
    if stopped.asked:
        raise KeyboardInterrupt


def _visible(times: list[str], site: tuple[float, ...] | None):
    """The times at which the Moon is up, and their geometries."""
    from eclipsejax.ephemeris import geometry, moon_altitude

    here = [(utc, geometry(utc, *(site or ()))) for utc in times]
    up = [(utc, where) for utc, where in here if moon_altitude(where) > SET]
    if not up:
        raise InputError("The Moon is below the horizon there for the whole eclipse: choose another site, or none.")
    if len(up) < len(here):
        print(f"The Moon is up in {len(up)} of {len(here)} frames, from {up[0][0]} to {up[-1][0]}.", file=sys.stderr)
    return [utc for utc, _ in up], [where for _, where in up]


def _filmed(times: list[str], geometries: list, options: Namespace):
    """Shutter times [s], and an iterator over the frames."""
    from dataclasses import replace

    import jax.numpy as jnp
    import numpy as np

    from eclipsejax.calendar import SECONDS_PER_DAY
    from eclipsejax.camera import Camera, Exposure
    from eclipsejax.movie import shutter_text, smooth_gains, whole_stops
    from eclipsejax.movie_file import captioned
    from eclipsejax.response import bright_gain
    from eclipsejax.scene import Scene
    from eclipsejax.sequence import developed, pictured, sequence
    from eclipsejax.sky import Sky

    sky = None if options.site is None else Sky(height=options.site[2] if len(options.site) == 3 else 0.0)
    scene = Scene(geometries[0], camera=shared.camera(options), sky=sky, scatterers=shared.scatterers(options))
    pictures = sequence(scene, geometries, shared.atmosphere(options), tolerance=options.tolerance)
    full_moon = float(Exposure(1.0, options.f_number, options.iso).scale()[0])  # signal in one second

    if isinstance(options.exposure, float):
        shutters = np.full(len(times), options.exposure)
    else:
        coarse = replace(scene, camera=Camera(shape=(METER, METER), scale=shared.FIELD / METER))
        metered = (np.asarray(pictured(pictures, replace(coarse, geometry=where))) for where in geometries)
        wanted = [bright_gain(image, METERED, BRIGHT, digits=None) for image in metered]
        first, last = (
            float(np.asarray(where.clock) @ [SECONDS_PER_DAY, 1.0]) for where in (geometries[0], geometries[-1])
        )
        width = SMOOTH * (len(times) - 1) / max(last - first, 1.0)
        shutters = smooth_gains(np.asarray(wanted), width) / full_moon
        if options.exposure == "stops":
            shutters = whole_stops(shutters)

    def frames():
        for utc, where, shutter in zip(times, geometries, shutters, strict=True):
            frame = developed(pictures, replace(scene, geometry=where), jnp.asarray(shutter * full_moon))
            shot = f"{shutter_text(shutter)}  f/{options.f_number:g}  ISO {options.iso:g}"
            yield captioned(np.asarray(frame), f"{utc[:-1].replace('T', ' ')} UT", shot)

    return shutters, frames()


def _counted(frames: Iterable, total: int) -> Iterator:
    """The frames, with a bar on a terminal, else a line at each quarter."""
    if sys.stderr.isatty():
        from tqdm import tqdm

        yield from tqdm(frames, total=total, unit="frame", leave=False)
        return
    for number, frame in enumerate(frames, 1):
        yield frame
        if 4 * number // total > 4 * (number - 1) // total:
            print(f"Frame {number} of {total}.", file=sys.stderr)


class _Stop:
    """Takes the first Ctrl-C for a wish to stop after the frame at hand; the second one interrupts."""

    def __init__(self):
        self.asked = False

    def __enter__(self):
        self.before = signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(self, *_):
        signal.signal(signal.SIGINT, self.before)

    def _ask(self, *_):
        self.asked = True
        signal.signal(signal.SIGINT, self.before)

    def until(self, frames: Iterable) -> Iterator:
        for frame in frames:
            yield frame
            if self.asked:
                return
