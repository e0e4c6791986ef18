"""Dates as people write them, and Terrestrial Time.

At the edge a time is an ISO string: Julian calendar before 1582-10-15, Gregorian from then on, astronomical
years (year 0 is 1 BC, -1000 is 1001 BC), always with a zone. Inside it is a `Clock`, and for the motion of
Sun and Moon Terrestrial Time (TT) as a Julian date. The difference between TT and the turning Earth, Delta T,
comes from skyfield's bundled tables: measurements, before them the splines of Morrison, Stephenson, Hohenkerk
& Zawilski 2021. Authors differ by 4 s in 1816 and by two minutes in -1000.
"""

import re
from functools import cache
from typing import NamedTuple

import numpy as np

from .errors import InputError

GREGORIAN_START = 2299161  # Julian day number of 1582-10-15
SECONDS_PER_DAY = 86400.0

# 'UTC' means UT1 before this day (1972-01-01), when leap seconds began. From 1960 to 1971 UTC existed, was
# steered by steps and rates, and stayed within 0.2 s of UT1; skyfield's constant TAI - UTC = 10 s would be
# wrong by up to 9 s, its Delta T of those years is by 0.7 s.
LEAP_SECONDS_START = 2441318

_ISO = re.compile(
    r"(?P<year>\d{4}|[+-]\d{1,6})-(?P<month>\d\d)-(?P<day>\d\d)"
    r"(?:[T ](?P<hour>\d\d):(?P<minute>\d\d)(?::(?P<second>\d\d(?:\.\d*)?))?"
    r" ?(?P<zone>Z|UTC|[+-]\d\d:?\d\d)?)?",
    re.IGNORECASE,
)
_EXAMPLE = "write it like 2008-02-21T03:26:00Z (UTC) or 2008-02-21T04:26+01:00"


class Clock(NamedTuple):
    """UTC (UT1 before 1972) as the Julian day number of the date and the seconds since its midnight [s]."""

    day: int
    second: float


def day_number(year: int, month: int, day: int) -> int:
    """Julian day number of a date (the one that begins at its noon). Explanatory Supplement (2013), 15.11."""
    months = 12 * (year + 4800) + month - 3  # counted from a March, so that leap days end the year
    y, m = divmod(months, 12)
    julian = day + (153 * m + 2) // 5 + 365 * y + y // 4 - 32083
    gregorian = julian + 38 - y // 100 + y // 400
    return gregorian if gregorian >= GREGORIAN_START else julian


def date(day: int) -> tuple[int, int, int]:
    """Year, month and day of a Julian day number; the inverse of `day_number`."""
    f = day + 1401
    if day >= GREGORIAN_START:
        f += (4 * day + 274277) // 146097 * 3 // 4 - 38
    e = 4 * f + 3
    h = 5 * (e % 1461 // 4) + 2
    month = (h // 153 + 2) % 12 + 1
    return e // 1461 - 4716 + (14 - month) // 12, month, h % 153 // 5 + 1


def read_clock(text: str, *, date_only: bool = False) -> Clock:
    """The instant that an ISO string names, e.g. `2008-02-21T04:26+01:00` or `-0584-05-22T16:00Z`.

    - `date_only`: a bare date is allowed too and means its midnight, UTC.
    """
    match = _ISO.fullmatch(text.strip()) if isinstance(text, str) else None
    if match is None:
        raise InputError(f"The time {text!r} cannot be read: {_EXAMPLE}.")
    year, month, day = (int(match[name]) for name in ("year", "month", "day"))
    number = day_number(year, month, day) if 1 <= month <= 12 else 0
    if date(number) != (year, month, day):
        raise InputError(
            f"There is no such date as {match['year']}-{match['month']}-{match['day']} "
            "(the calendar is Julian until 1582-10-04, and Gregorian from the next day, 1582-10-15)."
        )
    if match["hour"] is None:
        if date_only:
            return Clock(number, 0.0)
        raise InputError(f"The time {text!r} has no hour: {_EXAMPLE}.")
    hour, minute, second = int(match["hour"]), int(match["minute"]), float(match["second"] or 0.0)
    if hour > 23 or minute > 59 or second >= 60.0:
        raise InputError(f"The time {text!r} has no such hour, minute or second: {_EXAMPLE}.")
    if match["zone"] is None:
        raise InputError(f"The time {text!r} has no time zone, and is not taken for UTC unasked: {_EXAMPLE}.")
    zone = match["zone"].upper().replace(":", "")
    east = 0 if zone in ("Z", "UTC") else int(zone[0] + "1") * (60 * int(zone[1:3]) + int(zone[3:]))
    if abs(east) > 15 * 60:
        raise InputError(f"The time {text!r} has an impossible zone: {_EXAMPLE}.")
    return _normal(number, 3600.0 * hour + 60.0 * (minute - east) + second)


def write_clock(clock: Clock, decimals: int = 3) -> str:
    """ISO string in UTC, rounded to so many decimals of a second, without trailing zeros."""
    day, second = _normal(clock.day, round(clock.second, decimals))
    year, month, day_of_month = date(day)
    minutes, seconds = divmod(second, 60.0)
    hour, minute = divmod(int(minutes), 60)
    shown = f"{seconds:02.0f}"
    if decimals:
        shown = f"{seconds:0{decimals + 3}.{decimals}f}".rstrip("0").rstrip(".")
    sign = "-" if year < 0 else ""
    return f"{sign}{abs(year):04d}-{month:02d}-{day_of_month:02d}T{hour:02d}:{minute:02d}:{shown}Z"


def skyfield_time(clock: Clock):
    """The same instant as a `skyfield.timelib.Time`, which knows TT, Delta T and how the Earth is turned."""
    if clock.day < LEAP_SECONDS_START:
        return timescale().ut1_jd(clock.day - 0.5 + clock.second / SECONDS_PER_DAY)
    since_2000 = clock.day - 2451545
    return timescale().utc(2000, 1, 1 + since_2000, 0, 0, clock.second)  # skyfield carries days into months


def clocks(terrestrial_time: np.ndarray) -> list[Clock]:
    """UTC (UT1 before 1972) of Julian dates in TT, to 0.1 ms.

    After the last leap second known UTC stays TT - 69.184 s, and in the far future is not what UT1 will be.
    """
    time = timescale().tt_jd(np.atleast_1d(terrestrial_time))
    leap_seconds = time.tt >= LEAP_SECONDS_START - 0.5 + 42.16 / SECONDS_PER_DAY  # Delta T of that midnight
    ahead_of_utc = np.where(leap_seconds, np.asarray(time.dut1), 0.0)  # UT1 - UTC [s]
    from_midnight = time.tt + 0.5 - (np.asarray(time.delta_t) + ahead_of_utc) / SECONDS_PER_DAY
    days = np.floor(from_midnight)
    seconds = (from_midnight - days) * SECONDS_PER_DAY
    return [Clock(int(day), float(second)) for day, second in zip(days, seconds, strict=True)]


@cache
def timescale():
    """Skyfield's time scale from the tables bundled with it: nothing is downloaded."""
    from skyfield.api import load

    return load.timescale(builtin=True)


def _normal(day: int, second: float) -> Clock:
    """Seconds brought back into the day."""
    days, second = divmod(second, SECONDS_PER_DAY)
    return Clock(int(day + days), float(second))
