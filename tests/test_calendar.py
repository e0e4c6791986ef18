"""Dates against the standard library and printed Julian days; time scales against printed differences."""

from datetime import date as gregorian

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eclipsejax import calendar
from eclipsejax.errors import InputError


@pytest.mark.parametrize(
    ("date", "number"),
    [
        ((2000, 1, 1), 2451545),
        ((1858, 11, 17), 2400001),
        ((1582, 10, 15), 2299161),
        ((1582, 10, 4), 2299160),
        ((837, 4, 10), 2026872),
        ((333, 1, 27), 1842713),
        ((0, 2, 29), 1721117),
        ((-584, 5, 28), 1507900),
        ((-1000, 7, 12), 1356001),
        ((-4712, 1, 1), 0),
    ],
)
def test_julian_days_of_meeus(date, number):
    assert calendar.day_number(*date) == number
    assert calendar.date(number) == date


@given(st.integers(1_200_000, 3_000_000))
def test_every_day_has_one_date(number):
    assert calendar.day_number(*calendar.date(number)) == number


@given(st.integers(gregorian(1583, 1, 1).toordinal(), gregorian.max.toordinal()))
def test_gregorian_dates_are_those_of_the_standard_library(ordinal):
    day = gregorian.fromordinal(ordinal)
    assert calendar.day_number(day.year, day.month, day.day) == ordinal + 1721425


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("2008-02-21T03:26Z", "2008-02-21T03:26:00Z"),
        ("2008-02-21 03:26:03.25 UTC", "2008-02-21T03:26:03.25Z"),
        ("2008-02-21T00:26:00+02:00", "2008-02-20T22:26:00Z"),
        ("2008-12-31T22:30-0330", "2009-01-01T02:00:00Z"),
        ("1582-10-15T00:00+01:00", "1582-10-04T23:00:00Z"),
        ("-0584-05-28T16:00Z", "-0584-05-28T16:00:00Z"),
        ("2008-02-21T03:59:59.9996Z", "2008-02-21T04:00:00Z"),
    ],
)
def test_time_strings_are_read_and_written(text, canonical):
    assert calendar.write_clock(calendar.read_clock(text)) == canonical


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("2008-02-21T03:26", "no time zone"),
        ("2008-02-21", "no hour"),
        ("21 February 2008", "cannot be read"),
        ("08-02-21T03:26Z", "cannot be read"),
        ("2008-02-30T03:26Z", "no such date"),
        ("2008-13-01T03:26Z", "no such date"),
        ("1582-10-10T03:26Z", "no such date"),
        ("2008-02-21T25:26Z", "no such hour"),
        ("2008-02-21T03:26+19:00", "impossible zone"),
        (20080221, "cannot be read"),
    ],
)
def test_a_malformed_time_is_refused_with_a_sentence(text, sentence):
    with pytest.raises(InputError, match=sentence):
        calendar.read_clock(text)


@pytest.mark.parametrize(("year", "delta_t"), [(1900, -2.7), (1950, 29.15), (1965, 35.73), (1970, 40.18)])
def test_utc_means_ut1_before_leap_seconds(year, delta_t):
    # Delta T of the Astronomical Almanac, page K9; skyfield's splines leave 0.7 s.
    clock = calendar.read_clock(f"{year}-01-01T00:00Z")
    terrestrial = calendar.skyfield_time(clock).tt
    assert (terrestrial - (clock.day - 0.5)) * 86400.0 == pytest.approx(delta_t, abs=0.8)


@pytest.mark.parametrize(
    ("text", "difference"),
    [("1972-06-30T23:00Z", 42.184), ("1999-01-01T00:00Z", 64.184), ("2022-11-08T11:00Z", 69.184)],
)
def test_leap_seconds_are_counted(text, difference):
    clock = calendar.read_clock(text)
    time = calendar.skyfield_time(clock)
    elapsed = time.whole - (clock.day - 0.5) + time.tt_fraction
    assert elapsed * 86400.0 - clock.second == pytest.approx(difference, abs=1e-4)


@pytest.mark.parametrize(
    "text",
    [
        "-0999-07-01T12:00:00Z",
        "1582-10-04T23:59:59Z",
        "1971-12-31T23:59:58Z",
        "1972-01-01T00:00:01Z",
        "2026-03-03T11:33:42Z",
        "2900-01-01T00:00:00Z",
    ],
)
def test_terrestrial_time_and_back(text):
    terrestrial = calendar.skyfield_time(calendar.read_clock(text)).tt
    assert calendar.write_clock(calendar.clocks(np.array([terrestrial]))[0]) == text
