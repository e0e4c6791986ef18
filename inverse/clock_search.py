"""What a camera's clock was wrong by, from where the Earth's shadow lies on the Moon in its photographs.

The maria tell which way up each photograph is, whatever the time; the shadow then lies on the Moon as at one time of
the eclipse only (`shadow_fit`). Photographs keep their distances in time, and the time of all of them is searched: over
the eclipse in steps of minutes, then finer about the best.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from eclipsejax.almanac import Eclipse, nearest_eclipse
from eclipsejax.calendar import SECONDS_PER_DAY, Clock, read_clock, write_clock
from eclipsejax.ephemeris import geometry
from eclipsejax.errors import InputError
from eclipsejax.moon import Moon
from inverse.disc_search import Circle
from inverse.exposures import log_exposures
from inverse.orientation import Orientation, disc_cells, orientation
from inverse.photo import Photo
from inverse.photo_model import FREE_EXPOSURE
from inverse.shadow_fit import View, misfit, shadow_profile

STEP = 300.0  # s: of the search over the eclipse; the light of the umbra's edge is 2' wide, which it passes in 4 min
FINER = ((60.0, 5), (15.0, 4))  # s, and steps to either side
ELEMENTS = 30  # independent data, however many photographs: what is wrong with the model they have in common
EDGE = 30.0  # s: by which the place of the umbra's edge is not known
LEAST = 600.0  # s: between times that are not one
ALIKE = 3.0  # of the log-likelihood: a rival that is twenty times less likely
WORTH_A_LOOK = 12.0  # the same before the finer steps
WORST = 600.0  # s: error of a time that is no use
LEAST_QUALITY = 0.1  # of the orientation by the maria, which is enough; and with which no other is tried
SURE_QUALITY = 0.3
OF_ANOTHER_NIGHT = 1.5  # days between the date and the eclipse: zones, and clocks that are a day wrong
BY_CHANCE = 0.15  # ln: haze and altitude change from one photograph to the next, as stated exposures do not


@dataclass(frozen=True)
class Correction:
    """What to add to the times of a camera's clock for UTC, and its standard error [s]."""

    seconds: float
    error: float

    def sentence(self, name: str, utc: str, ahead: bool) -> str:
        """What was found, for the report.

        - `name`, `utc`: of the first photograph, and its time as corrected.
        - `ahead`: whether to say what the clock was wrong by.
        """
        side = "behind" if self.seconds > 0 else "ahead of"
        wrong = f"; the clock was {in_words(abs(self.seconds))} {side} UTC" if ahead else ""
        return f"By the shadow's place on the Moon {name} was taken at {utc} (+-{in_words(self.error)}){wrong}."


def correction(
    photos: Sequence[Photo],
    circles: Sequence[Circle],
    times: Sequence[str],
    sites: Sequence[tuple | None],
    width: float | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Correction:
    """Search for the correction of one clock. Raises `InputError` where the photographs do not tell it.

    - `circles`: the discs; `times`: of each photograph by that clock, ISO, as if it were UTC.
    - `sites`: as for `geometry`; None for the Earth's centre.
    - `width`: standard deviation of the clock's error [s]; None if only the day is believed.
    """
    clocks = [read_clock(text) for text in times]
    eclipse = nearest_eclipse(times[0])
    first, last = bounds(clocks, eclipse, width, photos[0].path)
    views = upright(photos, circles, sites, eclipse)
    kept = [clock for clock, view in zip(clocks, views, strict=True) if view is not None]
    views = [view for view in views if view is not None]
    if not views:
        raise InputError(
            f"{photos[0].path}: the maria cannot be seen, and without them the shadow does not tell the time: give the "
            "time in UTC, such as --time 2022-05-16T04:06:00Z, without --clock."
        )
    shadow, moon = shadow_profile(eclipse), Moon()

    def tried(trials: np.ndarray, done: int = 0) -> np.ndarray:
        """The misfit for corrections [s]."""
        found = []
        for number, seconds in enumerate(trials, 1):
            wheres = [geometry(later(clock, seconds), *view.site) for clock, view in zip(kept, views, strict=True)]
            found.append(misfit(views, wheres, shadow, moon))
            progress(done + number, total)
        return np.array(found)

    def likely(trials, misfits, least: float):
        """Log-likelihood with the prior, of data as good as the least misfit says that they are."""
        believed = 0.0 if width is None else -0.5 * (trials / width) ** 2
        return -0.5 * ELEMENTS * np.log(misfits / least) + believed

    trials = np.linspace(first, last, max(3, int(np.ceil((last - first) / STEP)) + 1))
    finer = sum(2 * steps + 1 for _, steps in FINER)
    total = trials.size + finer
    misfits = tried(trials)
    coarse = likely(trials, misfits, misfits.min())
    peaks = [k for k in range(trials.size) if coarse[k] == coarse[max(0, k - 1) : k + 2].max()]
    peaks = sorted((k for k in peaks if coarse[k] > coarse.max() - WORTH_A_LOOK), key=lambda k: -coarse[k])
    starts = [trials[k] for n, k in enumerate(peaks) if all(abs(trials[k] - trials[j]) > LEAST for j in peaks[:n])]
    total = trials.size + finer * len(starts)
    found = [
        _refined(start, width, likely, lambda finer_trials, n=n: tried(finer_trials, trials.size + finer * n))
        for n, start in enumerate(starts)
    ]
    progress(total, total)
    least = min(misfit for _, misfit in found)
    values = [float(likely(one.seconds, misfit, least)) for one, misfit in found]
    order = np.argsort(values)[::-1]
    check_sure([found[k][0] for k in order if values[k] > max(values) - ALIKE], clocks[0], photos[0].path)
    return found[order[0]][0]


def _refined(start: float, width: float | None, likely, tried) -> tuple[Correction, float]:
    """The best near a start, and its misfit: a parabola through the misfits of finer steps, as fine as they need be."""
    best, least, error = start, np.inf, np.inf
    for step, steps in FINER:
        trials = best + step * np.arange(-steps, steps + 1)
        misfits = tried(trials)
        likelihood = likely(trials, misfits, misfits.min())
        top = int(np.argmax(likelihood))
        near = (likelihood > likelihood[top] - 2.0) | (np.abs(np.arange(trials.size) - top) < 2)
        bend, slope, _ = np.polyfit(trials[near] - trials[top], misfits[near], 2)
        best, least, error = trials[top], misfits[top], np.inf
        if bend > 0:
            prior = 0.0 if width is None else width**-2
            information = ELEMENTS * bend / least + prior
            move = -(0.5 * ELEMENTS * slope / least + best * prior) / information
            best, error = best + np.clip(move, -step, step), information**-0.5
        if error > 2.0 * step:
            break
    return Correction(float(best), float(np.hypot(error, EDGE))), float(least)


def check_sure(alike: Sequence[Correction], clock: Clock, name: str) -> None:
    """`InputError` where other corrections are about as likely as the best, which is the first, or that is no use."""
    best = alike[0]
    time = later(clock, best.seconds, 0)
    advice = f"give a time that is nearer to the right one, such as --time {time}, and its error, such as --clock 300"
    if len(alike) > 1:
        times = " as well as ".join(later(clock, one.seconds, 0) for one in alike[:2])
        raise InputError(f"By the shadow's place on the Moon {name} may have been taken at {times}: {advice}.")
    if best.error > WORST:
        raise InputError(
            f"The shadow's place on the Moon in {name} does not tell the time to {in_words(WORST)}: {advice}."
        )


def bounds(clocks: Sequence[Clock], eclipse: Eclipse, width: float | None, name: str) -> tuple[float, float]:
    """The least and the largest correction [s] with which all photographs are of the eclipse."""
    start, greatest, end = (
        read_clock(text) for text in (eclipse.contacts["P1"], eclipse.greatest, eclipse.contacts["P4"])
    )
    since = [seconds_since(clock, start) for clock in clocks]
    first, last = -min(since), seconds_since(end, start) - max(since)
    if abs(seconds_since(clocks[0], greatest)) > OF_ANOTHER_NIGHT * SECONDS_PER_DAY:
        raise InputError(
            f"{name} is dated {write_clock(clocks[0])[:10]}, and the nearest eclipse was greatest at "
            f"{eclipse.greatest}: give the date of the eclipse, such as --time {eclipse.greatest[:10]}."
        )
    if first > last:
        raise InputError(
            f"The photographs were taken over {in_words(max(since) - min(since))}, and the eclipse of "
            f"{eclipse.greatest[:10]} lasted {in_words(seconds_since(end, start))}: leave out those that are not of it."
        )
    if width is not None:
        first, last = max(first, -3.0 * width), min(last, 3.0 * width)
    if width is not None and first > last:
        raise InputError(
            f"No time within {in_words(3.0 * width)} of {write_clock(clocks[0], 0)} is one of the eclipse from "
            f"{eclipse.contacts['P1']} to {eclipse.contacts['P4']}: check --time, or give --clock unknown."
        )
    return first, last


def upright(photos, circles, sites, eclipse: Eclipse) -> list[View | None]:
    """The photographs the right way up by their maria, whatever the time; None where those cannot be seen."""
    found: list[View | None] = []
    for photo, circle, site, exposed in zip(photos, circles, sites, log_exposures(photos), strict=True):
        here = tuple(site or ())
        best: Orientation | None = None
        # With the shadow at a wrong place the maria are seen a little less well; seldom too badly.
        for utc in (eclipse.greatest, eclipse.contacts["P1"], eclipse.contacts["P4"]):
            one = orientation(photo, circle, geometry(utc, *here), Moon())
            if "maria" in one.source and one.quality > (LEAST_QUALITY if best is None else best.quality):
                best = one
            if best is not None and best.quality > SURE_QUALITY:
                break
        if best is None:
            found.append(None)
            continue
        cells, across = disc_cells(photo, circle)
        width = FREE_EXPOSURE if exposed.camera is None else float(np.hypot(exposed.width, BY_CHANCE))
        found.append(View(cells, across, best.roll, best.mirror, exposed.relative, width, here))
    return found


def later(clock: Clock, seconds: float, decimals: int = 3) -> str:
    """ISO string of a time so many seconds later."""
    return write_clock(Clock(clock.day, clock.second + seconds), decimals)


def in_words(seconds: float) -> str:
    """A span of time as people say it: 2 h 25 min, 20 min, 45 s."""
    minutes = round(seconds / 60.0)
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    hours, minutes = divmod(minutes, 60)
    return " ".join(part for part in (f"{hours} h" if hours else "", f"{minutes} min" if minutes else "") if part)


def seconds_since(clock: Clock, start: Clock) -> float:
    """From one time to another [s]."""
    return (clock.day - start.day) * SECONDS_PER_DAY + clock.second - start.second
