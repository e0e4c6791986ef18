"""Moon and Sun near each of the 9,629 lunar eclipses from -1000 to 2998, and the almanac of those eclipses.

Places come from Chebyshev series fitted to JPL's DE440 (1550-2650) and DE406 (outside) over 4.5 hours on
either side of greatest eclipse (`tables/make_eclipse_chebyshev.py`); they follow the ephemerides to 3 cm
(Moon) and 1 m (Sun). Contact times follow the almanac convention (Danjon's shadow), which has its own radii
of Earth, Moon and Sun and is not used for light.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from . import constants
from .calendar import SECONDS_PER_DAY, Clock, clocks, day_number, read_clock, skyfield_time, write_clock
from .errors import InputError

FIRST_DAY, LAST_DAY = day_number(-1000, 1, 1), day_number(2999, 1, 1)  # the table ends before the last
ECLIPTIC_NORTH = np.array([0.0, -0.3977771559, 0.9174820621])  # J2000; it moves by 0.4 degrees in 3000 years
CONTACTS = ("P1", "U1", "U2", "U3", "U4", "P4")


@dataclass(frozen=True)
class Eclipse:
    """One lunar eclipse, geocentric. Times are ISO strings in UTC (UT1 before 1972), to the second."""

    kind: str
    """`penumbral`, `partial` or `total`."""
    greatest: str
    """When the Moon's centre is nearest the axis of the shadow."""
    gamma: float
    """That least distance in equatorial radii of the Earth; positive: the Moon passes north of the axis."""
    umbral_magnitude: float
    """Fraction of the Moon's diameter inside the umbra at greatest eclipse; negative outside it."""
    penumbral_magnitude: float
    """The same for the penumbra."""
    contacts: dict[str, str]
    """Start and end in the penumbra (P1, P4), in the umbra (U1, U4), of totality (U2, U3), if any."""


class Table(NamedTuple):
    """The embedded series: `greatest` (eclipse,) in TT Julian dates, `half_width` [day] of the fits, and the
    coefficients of geocentric geometric places (term, eclipse, 3), ICRS axes [m]."""

    greatest: np.ndarray
    half_width: float
    moon: np.ndarray
    sun: np.ndarray


class Places(NamedTuple):
    """Apparent geocentric places (..., 3), ICRS axes [m], and how fast they change [m/s]."""

    moon: np.ndarray
    sun: np.ndarray
    moon_velocity: np.ndarray
    sun_velocity: np.ndarray


@cache
def table() -> Table:
    with (
        files("eclipsejax").joinpath("tables/eclipse_chebyshev_de440_de406.npz").open("rb") as file,
        np.load(file, allow_pickle=False) as stored,
    ):
        return Table(
            stored["t0_tt_jd"],
            float(stored["half_width_days"]),
            1e3 * np.moveaxis(stored["moon_km"], 1, 0),
            1e3 * np.moveaxis(stored["sun_km"], 1, 0),
        )


def places(eclipse: np.ndarray | int, days: np.ndarray | float) -> Places:
    """Apparent places of Moon and Sun at `days` [day, TT] from greatest eclipse of the numbered eclipses.

    Apparent: the geocentric vector one light time ago, which holds light time and the aberration by the
    Earth's motion together (planetary aberration); within 1e-3 arcsec of the full reduction.
    """
    moon, moon_velocity = _retarded(table().moon[:, eclipse], days, light_time=1.3)
    sun, sun_velocity = _retarded(table().sun[:, eclipse], days, light_time=499.0)
    return Places(moon, sun, moon_velocity, sun_velocity)


def eclipses(start: str, stop: str) -> list[Eclipse]:
    """Lunar eclipses whose greatest phase is not before `start` but before `stop` (ISO dates or times)."""
    first, last = (instant(read_clock(text, date_only=True), text).tt for text in (start, stop))
    if first > last:
        raise InputError(f"The start {start} is later than the stop {stop}: exchange them.")
    return _described(np.arange(*np.searchsorted(table().greatest, (first, last))))


def nearest_eclipse(utc: str) -> Eclipse:
    """The lunar eclipse whose greatest phase is nearest to a time or date (ISO string)."""
    number, _ = nearest(instant(read_clock(utc, date_only=True), utc))
    return _described(np.array([number]))[0]


def in_order(eclipse: Eclipse) -> dict[str, str]:
    """Times of the contacts and of greatest eclipse by name, from the first to the last."""
    named = [*eclipse.contacts.items()]
    middle = len(named) // 2
    return dict([*named[:middle], ("greatest", eclipse.greatest), *named[middle:]])


def instant(clock: Clock, text: str):
    """Skyfield's time for a clock that lies in the span of the table (its very end may be named, as a stop).

    - `text`: what the user wrote, for the message.
    """
    if not Clock(FIRST_DAY, 0.0) <= clock <= Clock(LAST_DAY, 0.0):
        raise InputError(f"The time {text} is outside the table of eclipses: give a year from -1000 to 2998.")
    return skyfield_time(clock)


def nearest(time) -> tuple[int, float]:
    """Number of the nearest eclipse in the table, and a skyfield time since its greatest phase [day, TT]."""
    greatest = table().greatest
    later = int(np.clip(np.searchsorted(greatest, time.tt), 1, len(greatest) - 1))
    number = later if greatest[later] - time.tt < time.tt - greatest[later - 1] else later - 1
    # In this order the difference keeps more digits than a Julian date has (40 microseconds).
    return number, float((time.whole - greatest[number]) + time.tt_fraction)


def _retarded(coefficients: np.ndarray, days, light_time: float) -> tuple[np.ndarray, np.ndarray]:
    """Series (term, ..., 3) and its rate [1/s] one light time before `days`.

    - `light_time`: first guess [s]; one correction of an error of 10 % is exact to a metre.
    """
    days, half_width = np.asarray(days, dtype=float), table().half_width

    def argument(delay):
        return ((days - delay / SECONDS_PER_DAY) / half_width)[..., None]

    place = chebyshev.chebval(argument(light_time), coefficients, tensor=False)
    delayed = argument(np.linalg.norm(place, axis=-1) / constants.SPEED_OF_LIGHT)
    slope = chebyshev.chebder(coefficients, axis=0) / (half_width * SECONDS_PER_DAY)
    return (
        chebyshev.chebval(delayed, coefficients, tensor=False),
        chebyshev.chebval(delayed, slope, tensor=False),
    )


def shadow_circles(moon: np.ndarray, sun: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Separation of the Moon's centre from the shadow's axis, and radii of umbra, penumbra and Moon [rad].

    Danjon (1951) enlarges the Moon's parallax by 1/100 for the atmosphere: penumbra 1.01 pi_M + pi_S + s_S,
    umbra 1.01 pi_M + pi_S - s_S.
    """
    earth = constants.ALMANAC_EARTH_RADIUS
    moon_distance, sun_distance = np.linalg.norm(moon, axis=-1), np.linalg.norm(sun, axis=-1)
    separation = np.arctan2(np.linalg.norm(np.cross(moon, -sun), axis=-1), np.sum(moon * -sun, axis=-1))
    shadow = constants.DANJON_ENLARGEMENT * np.arcsin(earth / moon_distance) + np.arcsin(earth / sun_distance)
    solar = np.arcsin(constants.ALMANAC_SUN_RADIUS / sun_distance)
    lunar = np.arcsin(constants.ALMANAC_MOON_RATIO * earth / moon_distance)
    return separation, shadow - solar, shadow + solar, lunar


def _contact_days(numbers: np.ndarray) -> np.ndarray:
    """Time of each contact from greatest eclipse [day], (eclipse, contact); meaningless where there is none.

    Bisection: from greatest eclipse to the end of the fit the Moon leaves every circle around the axis once.
    """
    side = np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])
    penumbral = np.array([True, False, False, False, False, True])
    touching = np.array([1.0, 1.0, -1.0, -1.0, 1.0, 1.0])  # the Moon from outside (+), from inside (-)
    numbers = np.broadcast_to(numbers[:, None], (len(numbers), len(side)))
    low, high = np.zeros(numbers.shape), np.full(numbers.shape, table().half_width)
    for _ in range(32):  # 4 microseconds
        middle = 0.5 * (low + high)
        here = places(numbers, side * middle)
        separation, umbra, penumbra, moon = shadow_circles(here.moon, here.sun)
        inside = separation < np.where(penumbral, penumbra, umbra) + touching * moon
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return side * 0.5 * (low + high)


def _described(numbers: np.ndarray) -> list[Eclipse]:
    """The almanac's account of the numbered eclipses."""
    greatest = table().greatest[numbers]
    here = places(numbers, np.zeros(len(numbers)))
    separation, umbra, penumbra, moon = shadow_circles(here.moon, here.sun)
    umbral_magnitude = (umbra + moon - separation) / (2.0 * moon)
    penumbral_magnitude = (penumbra + moon - separation) / (2.0 * moon)
    along = np.sum(here.moon * here.sun, axis=-1) / np.sum(here.sun**2, axis=-1)
    from_axis = here.moon - along[:, None] * here.sun
    gamma = np.linalg.norm(from_axis, axis=-1) / constants.ALMANAC_EARTH_RADIUS
    gamma = np.copysign(gamma, from_axis @ ECLIPTIC_NORTH)
    instants = np.column_stack([greatest, greatest[:, None] + _contact_days(numbers)])
    texts = [write_clock(clock, 0) for clock in clocks(instants.ravel())]

    described = []
    for k, magnitude in enumerate(umbral_magnitude):
        kind = "total" if magnitude >= 1.0 else "partial" if magnitude > 0.0 else "penumbral"
        happening = {"total": CONTACTS, "partial": ("P1", "U1", "U4", "P4"), "penumbral": ("P1", "P4")}[kind]
        at_greatest, *at_contacts = texts[7 * k : 7 * (k + 1)]
        contacts = {name: text for name, text in zip(CONTACTS, at_contacts, strict=True) if name in happening}
        described.append(
            Eclipse(kind, at_greatest, float(gamma[k]), float(magnitude), float(penumbral_magnitude[k]), contacts)
        )
    return described
