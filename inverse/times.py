"""The times of photographs: as given, as their files say, and by how much they may be wrong."""

from collections.abc import Sequence
from datetime import datetime

import numpy as np

from eclipsejax.calendar import read_clock, write_clock
from eclipsejax.errors import InputError
from inverse.photo import Photo
from inverse.profile import Profile

UNKNOWN = "unknown"  # instead of the error of a clock
SEARCHED = 300.0  # s: the error of a clock above which its time is searched, before it is fitted


def times_of(photos: Sequence[Photo | Profile], time: str | Sequence[str] | None) -> list[str]:
    """UTC of each photograph, from what was given and what the files are certain of."""
    if isinstance(time, str):
        time = [time]
    if time and len(time) == len(photos):
        return list(time)
    if time and len(time) != 1:
        raise InputError(
            f"{len(time)} times were given for {len(photos)} photographs: give one for each, or one for the first."
        )
    if time:
        # One time sets the first camera clock; the others follow by what their own clocks say.
        clocks = [getattr(photo, "local_time", None) or getattr(photo, "time", None) for photo in photos]
        for photo, text in zip(photos, clocks, strict=True):
            if text is None:
                raise InputError(f"{photo.path} holds no time of its own: give --time once for each photograph.")
        first = _instant(clocks[0])
        start = _instant(write_clock(read_clock(time[0])))  # in UTC, whatever its zone
        return [_iso(start + (_instant(text) - first)) for text in clocks]
    for photo in photos:
        if photo.time is None:
            local = getattr(photo, "local_time", None)
            says = f"only its camera's clock, {local}, without a time zone" if local else "no time"
            raise InputError(f"{photo.path} holds {says}: give the time in UTC, such as --time 2022-05-16T04:06:00Z.")
    return [str(photo.time) for photo in photos]


def dates_of(photos: Sequence[Photo | Profile], time: str | Sequence[str] | None) -> list[str]:
    """Times of which no more than the day is believed, and how far they are apart, as if they were UTC."""
    if isinstance(time, str):
        time = [time]
    if time:
        # A date alone means its midnight.
        time = [write_clock(read_clock(text, date_only=True)) for text in time]
        return times_of(photos, time)
    by_name = [[getattr(photo, name, None) for photo in photos] for name in ("local_time", "time")]
    times = next((times for times in by_name if all(times)), None)
    if times is None:
        dark = next(photo for photo, one in zip(photos, by_name[0], strict=True) if one is None)
        raise InputError(
            f"{dark.path} holds no time of its camera's clock, and an eclipse is searched near a date: give at least "
            "that, such as --time 2022-05-16."
        )
    return [_iso(_instant(text)) for text in times]


def check_error(clock) -> None:
    """`InputError` unless it is None, a number of seconds or "unknown"."""
    if clock is None or clock == UNKNOWN:
        return
    if isinstance(clock, bool) or not isinstance(clock, int | float) or not 0.0 < clock < np.inf:
        raise InputError(
            f"The clock's error {clock!r} is neither a number of seconds above 0 nor {UNKNOWN!r}: give --clock 600, or "
            f"--clock {UNKNOWN}."
        )


def is_searched(clock: float | str | None) -> bool:
    """Whether a clock with this error is so wrong that its time is searched."""
    return clock is not None and (isinstance(clock, str) or clock > SEARCHED)


def of_one_clock(photos: Sequence[Photo | Profile], clock: float | str) -> list[Photo]:
    """The photographs, if a clock's error can be said of them all; `InputError` if not."""
    series = [photo for photo in photos if isinstance(photo, Photo)]
    if len(series) < len(photos):
        raise InputError(
            "--clock is of photographs: a profile holds distances from the shadow's axis, and no camera's clock; "
            "leave it out, or give the photographs."
        )
    names = sorted({str(photo.camera or "a camera without a name") for photo in series})
    if is_searched(clock) and len(names) > 1:
        raise InputError(
            f"The photographs are of {len(names)} cameras ({', '.join(names)}), each with a clock of its own, and "
            "--clock searches one: fit those of one camera at a time, or give the times in UTC."
        )
    return series


def _instant(text) -> datetime:
    return datetime.fromisoformat(str(text).replace("Z", "")).replace(tzinfo=None)


def _iso(instant: datetime) -> str:
    return instant.isoformat() + "Z"
