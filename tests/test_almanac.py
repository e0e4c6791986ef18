"""The almanac of eclipses against published predictions and the Five Millennium Canon."""

import calendar as calendar_names
import csv

import numpy as np
import pytest

from eclipsejax import almanac, calendar
from eclipsejax.almanac import eclipses, nearest_eclipse
from eclipsejax.errors import InputError

# Contact times read from encyclopaedia pages that copy Espenak's predictions (UTC; after midnight the next
# day). The 2019 and 2022 pages use a predicted Delta T that was 2 to 4 s too long.
PUBLISHED = {
    "2008-02-21": "00:36:34 01:43:17 03:01:09 03:26:03 03:50:55 05:08:45 06:15:37",
    "1992-12-09": "20:57:01 21:59:45 23:07:10 23:44:06 00:21:03 01:28:29 02:31:05",
    "2019-01-21": "02:36:30 03:33:54 04:41:17 05:12:16 05:43:16 06:50:39 07:48:00",
    "2022-05-16": "01:32:07 02:27:53 03:29:03 04:11:28 04:53:56 05:55:07 06:50:48",
    "2022-11-08": "08:02:17 09:09:12 10:16:39 10:59:08 11:41:37 12:49:03 13:56:08",
    "1982-07-06": "04:23:58 05:33:07 06:38:03 07:30:55 08:23:47 09:28:42 10:37:49",
    "1982-12-30": "08:53:27 09:50:48 10:58:43 11:28:44 11:58:46 13:06:41 14:04:01",
}

# Five Millennium Canon of Lunar Eclipses (Espenak & Meeus, NASA): UT1 of greatest eclipse, gamma, umbral
# magnitude, and by how many seconds the Canon's Delta T (rounded, or predicted) may shift it.
CANON = [
    ("1110-05-05T22:58:20Z", 0.0740, 1.7496, 160.0),
    ("1258-05-18T22:35:41Z", 0.3669, 1.1788, 205.0),
    ("1601-12-09T17:56:37Z", 0.5249, 0.9092, 15.0),
    ("1642-04-15T01:51:19Z", 0.1463, 1.5860, 15.0),
    ("1761-05-18T22:11:43Z", 0.2063, 1.4493, 8.0),
    ("1816-06-10T01:14:13Z", -0.3368, 1.2410, 8.0),
    ("1884-10-04T22:02:01Z", 0.1839, 1.5260, 4.0),
    ("1903-04-12T00:12:57Z", 0.4798, 0.9677, 3.0),
    ("1963-12-30T11:06:50Z", -0.2889, 1.3350, 3.0),
    ("1982-07-06T07:30:54Z", -0.0579, 1.7179, 3.0),
    ("1992-06-15T04:56:58Z", -0.6288, 0.6822, 3.0),
    ("2010-12-21T08:16:57Z", 0.3214, 1.2561, 3.0),
    ("2018-07-27T20:21:43Z", 0.1168, 1.6087, 5.0),
    ("2025-03-14T06:58:41Z", 0.3484, 1.1784, 8.0),
]


def seconds_between(later: str, earlier: str) -> float:
    """By how much one ISO string is later than another."""
    after, before = calendar.read_clock(later), calendar.read_clock(earlier)
    return 86400.0 * (after.day - before.day) + after.second - before.second


@pytest.mark.parametrize("day", PUBLISHED)
def test_contact_times_are_the_published_ones(day):
    eclipse = nearest_eclipse(day)
    contacts = eclipse.contacts | {"greatest": eclipse.greatest}
    before_midnight = {"P1", "U1", "U2", "greatest"}
    names = ("P1", "U1", "U2", "greatest", "U3", "U4", "P4")
    for name, clock in zip(names, PUBLISHED[day].split(), strict=True):
        later = day == "1992-12-09" and name not in before_midnight
        of_contact = "1992-12-10" if later else day
        assert abs(seconds_between(contacts[name], f"{of_contact}T{clock}Z")) <= 5.0, name


@pytest.mark.parametrize(("greatest", "gamma", "magnitude", "tolerance"), CANON)
def test_eclipses_are_those_of_the_canon(greatest, gamma, magnitude, tolerance):
    eclipse = nearest_eclipse(greatest)
    assert abs(seconds_between(eclipse.greatest, greatest)) <= tolerance
    assert eclipse.gamma == pytest.approx(gamma, abs=3e-4)
    assert eclipse.umbral_magnitude == pytest.approx(magnitude, abs=4e-4)
    assert eclipse.kind == ("total" if magnitude > 1.0 else "partial")


def test_contacts_agree_with_another_computation(shared):
    with open(shared / "reference" / "eclipse_contacts_computed.csv") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) == 19
    for row in rows:
        eclipse = nearest_eclipse(row["date"] + "T20:00Z")
        # That table's UTC of 1963 counts ten leap seconds that were not there; UT1 then was TT - 34.8 s.
        early = 42.184 - 34.8 if row["date"] == "1963-12-30" else 0.0
        for name in (*almanac.CONTACTS, "max"):
            ours = eclipse.greatest if name == "max" else eclipse.contacts.get(name, "")
            assert bool(ours) == bool(row[name])
            if ours:
                theirs = f"{ours[:10]}T{row[name]}Z"
                assert abs((seconds_between(ours, theirs) - early + 43200) % 86400 - 43200) < 2.5, (row, name)
        assert abs(eclipse.gamma) == pytest.approx(float(row["gamma_abs"]), abs=1e-4)
        assert eclipse.umbral_magnitude == pytest.approx(float(row["umb_mag"]), abs=1e-4)
        assert eclipse.penumbral_magnitude == pytest.approx(float(row["pen_mag"]), abs=1e-4)


def test_durations_are_those_of_the_canon(shared):
    with open(shared / "reference" / "eclipses.csv") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) > 50
    for row in rows:
        eclipse = nearest_eclipse(row["date"])
        for column, first, last in (("pen", "P1", "P4"), ("par", "U1", "U4"), ("tot", "U2", "U3")):
            printed = row[f"dur_{column}_min"]
            if printed and first in eclipse.contacts:
                minutes = seconds_between(eclipse.contacts[last], eclipse.contacts[first]) / 60.0
                assert minutes == pytest.approx(float(printed), abs=0.15), (row["date"], column)


@pytest.mark.slow
def test_the_whole_canon(shared):
    months = list(calendar_names.month_name)
    kinds = {"N": "penumbral", "P": "partial", "T": "total"}
    ours = eclipses("-1000-01-01", "2999-01-01")
    greatest = almanac.table().greatest
    with open(shared / "tables" / "shared_only" / "lunar_eclipses_5mcle_raw.csv") as file:
        for row in csv.DictReader(file):
            year, month, day = row["Calendar Date"].split()
            # One graze of the penumbra, magnitude 0.0004, is none by our ephemeris.
            if not -1000 <= int(year) <= 2998 or float(row["Penumbral Magnitude"]) < 5e-4:
                continue
            hours, minutes, seconds = (float(part) for part in row["Eclipse Time"].split(":"))
            dynamical = calendar.day_number(int(year), months.index(month), int(day)) - 0.5
            dynamical += (hours + (minutes + seconds / 60.0) / 60.0) / 24.0
            number = int(np.argmin(np.abs(greatest - dynamical)))
            assert abs(greatest[number] - dynamical) * 86400.0 < 200.0
            assert ours[number].gamma == pytest.approx(float(row["Gamma"]), abs=5e-4)
            assert ours[number].kind == kinds[row["Eclipse Type"][0]]


def test_eclipses_of_thirty_years():
    found = eclipses("2000-01-01", "2030-01-01")
    # Numbers counted in the Five Millennium Canon.
    kinds = [eclipse.kind for eclipse in found]
    assert {kind: kinds.count(kind) for kind in kinds} == {"total": 29, "partial": 16, "penumbral": 24}
    assert found[0].greatest.startswith("2000-01-21") and found[-1].greatest.startswith("2029-12-20")
    happening = {"total": almanac.CONTACTS, "partial": ("P1", "U1", "U4", "P4"), "penumbral": ("P1", "P4")}
    for eclipse in found:
        assert tuple(eclipse.contacts) == happening[eclipse.kind]
        instants = list(eclipse.contacts.values())
        instants.insert(len(instants) // 2, eclipse.greatest)
        assert instants == sorted(instants)  # ISO strings of these years sort by time
        assert (eclipse.umbral_magnitude >= 1.0) == (eclipse.kind == "total")
        assert (eclipse.umbral_magnitude <= 0.0) == (eclipse.kind == "penumbral")


def test_search_includes_its_start_and_not_its_stop():
    assert len(eclipses("2008-02-21T03:26:00Z", "2008-02-21T03:26:05Z")) == 1
    assert eclipses("2008-02-21T03:26:05Z", "2008-08-16") == []


@pytest.mark.parametrize(("start", "stop"), [("-1001-12-31", "2000-01-01"), ("2000-01-01", "2999-01-02")])
def test_a_search_beyond_the_table_is_refused(start, stop):
    with pytest.raises(InputError, match="from -1000 to 2998"):
        eclipses(start, stop)


def test_a_search_backwards_is_refused():
    with pytest.raises(InputError, match="exchange"):
        eclipses("2010-01-01", "2000-01-01")


def test_the_table_covers_its_span_without_gaps():
    # Eclipse seasons are 173.3 days apart, give or take a lunation, and each has its eclipse.
    greatest = almanac.table().greatest
    assert len(greatest) == 9629
    assert np.diff(greatest).min() > 29.0 and np.diff(greatest).max() < 207.0
