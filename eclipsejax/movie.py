"""The film of an eclipse: its instants, and their exposures."""

import numpy as np
from jaxtyping import Float

from eclipsejax.almanac import Eclipse, nearest_eclipse
from eclipsejax.calendar import SECONDS_PER_DAY, Clock, read_clock, write_clock
from eclipsejax.errors import InputError

# Shutter speeds as cameras name them; what they mean are powers of two of a second.
STOPS = "1/8000 1/4000 1/2000 1/1000 1/500 1/250 1/125 1/60 1/30 1/15 1/8 1/4 1/2 1 2 4 8 15 30 60".split()
FASTEST = STOPS.index("1")
SLOWEST = len(STOPS) - 1 - FASTEST
HYSTERESIS = 0.7  # stops that the light must be off before the shutter speed is changed


def eclipse_on(date: str) -> Eclipse:
    """The eclipse of a date (greatest within 36 hours of its noon, for dates are local) or of a time near it."""
    eclipse = nearest_eclipse(date)
    asked, greatest = (read_clock(text, date_only=True) for text in (date, eclipse.greatest))
    noon = 0.5 if len(date.strip().lstrip("+-")) <= len("2010-12-21") else 0.0
    days = greatest.day - asked.day - noon + (greatest.second - asked.second) / SECONDS_PER_DAY
    if abs(days) > 1.5:
        raise InputError(
            f"There is no lunar eclipse on {date.strip()}: the nearest is {eclipse.kind}, greatest at "
            f"{eclipse.greatest}."
        )
    return eclipse


def instants(eclipse: Eclipse, count: int, *, umbral: bool = False) -> list[str]:
    """Times of frames, equally spaced from the first contact to the last (ISO strings, to the second).

    - `umbral`: only while part of the Moon is in the umbra, U1 to U4; else from P1 to P4.
    """
    ends = ("U1", "U4") if umbral else ("P1", "P4")
    if ends[0] not in eclipse.contacts:
        raise InputError(f"The eclipse of {eclipse.greatest} is {eclipse.kind}: it has no umbral phase to be shown.")
    first, last = (read_clock(eclipse.contacts[name]) for name in ends)
    length = (last.day - first.day) * SECONDS_PER_DAY + last.second - first.second
    return [write_clock(Clock(first.day, first.second + x), 0) for x in np.linspace(0.0, length, count)]


def smooth_gains(gains: Float[np.ndarray, " frame"], width: float) -> Float[np.ndarray, " frame"]:
    """Gains that follow those wanted frame by frame without a jump: their logs, averaged with a Gaussian in time.

    - `width`: its standard deviation [frame]. The ends go on as they are.
    """
    reach = int(np.ceil(4.0 * width))
    if reach == 0:
        return gains
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    logs = np.pad(np.log(gains), reach, mode="edge")
    return np.exp(np.convolve(logs, weights / weights.sum(), mode="valid"))


def whole_stops(shutters: Float[np.ndarray, " frame"]) -> Float[np.ndarray, " frame"]:
    """Shutter times in whole powers of two [s], each kept until the light is off by `HYSTERESIS` stops.

    So a photographer brackets an eclipse, from 1/8192 s to 64 s; longer or shorter is not to be had.
    """
    wanted = np.log2(shutters)
    stops = np.empty(len(wanted))
    stop = np.round(wanted[0])
    for frame, value in enumerate(wanted):
        if abs(value - stop) > HYSTERESIS:
            stop = np.round(value)
        stops[frame] = np.clip(stop, -FASTEST, SLOWEST)
    return 2.0**stops


def shutter_text(seconds: float) -> str:
    """A shutter time as cameras write it: powers of two by their usual names, others to two digits."""
    stop = np.log2(seconds)
    if stop == round(stop) and -FASTEST <= stop <= SLOWEST:
        return f"{STOPS[int(stop) + FASTEST]} s"
    return f"{seconds:.2g} s" if seconds >= 0.4 else f"1/{float(f'{1.0 / seconds:.2g}'):.0f} s"
