"""A few figures that this program must reproduce on any machine, against what it gave when they were written down.

Each stands for a stage: a ray, the shadow, the almanac. They are no proof of the physics, which `tests/` has;
they tell a broken installation, processor or compile cache from a good one, in seconds.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from .almanac import CONTACTS, eclipses
from .atmosphere import Atmosphere
from .calendar import SECONDS_PER_DAY, read_clock
from .limb import bending_angle, optical_depth
from .shadow import shadow_irradiance

ARCMIN = np.pi / 180.0 / 60.0
OFFSETS = np.array([0.0, 20.0, 40.0, 60.0])  # arcmin: axis, umbra, its edge, penumbra
LIGHT = (6.3258e-4, 6.4205e-4, 1.8289e-3, 6.3815e-1)
CONTACT_TIMES = ("01:32:09", "02:27:56", "03:29:07", "04:53:59", "05:55:11", "06:50:53")


@dataclass(frozen=True)
class Check:
    """One figure: what it should be, what it is, and how far apart they may be, in `unit`."""

    name: str
    unit: str
    figure: float
    got: float
    tolerance: float

    @property
    def passed(self) -> bool:
        """Whether it is what it should be; what is not a number never is."""
        return bool(abs(self.got - self.figure) <= self.tolerance)


def selftest() -> Iterator[Check]:
    """The checks, one after the other; whatever is raised in one of them is its failure, got NaN."""
    clear = Atmosphere()
    (bent,) = _tried(lambda: np.ravel(bending_angle(clear, 0.0, 550.0)) / ARCMIN, 1)
    yield Check("bending of a ray at the ground", "'", 66.0226, float(bent), 0.007)
    (depth,) = _tried(lambda: np.ravel(optical_depth(clear, 10e3, 550.0)), 1)
    yield Check("optical depth of a ray at 10 km", "-", 3.0554, float(depth), 0.003)
    light = _tried(lambda: np.asarray(shadow_irradiance(clear, OFFSETS * ARCMIN, 650.0, tolerance=1e-3))[:, 0], 4)
    for offset, figure, got in zip(OFFSETS, LIGHT, light, strict=True):
        yield Check(f"light at {offset:.0f}' from the axis, 650 nm", "-", figure, float(got), 2e-3 * figure)
    found = _tried(_contacts, 6)
    for name, clock, got in zip(CONTACTS, CONTACT_TIMES, found, strict=True):
        yield Check(f"contact {name} of 2022-05-16, after 0 h", "s", _seconds(f"2022-05-16T{clock}Z"), float(got), 2.0)


def _tried(values: Callable[[], np.ndarray], count: int) -> np.ndarray:
    """So many numbers; NaN for whatever could not be computed."""
    try:
        found = np.asarray(values(), dtype=float)
    except Exception:  # of a broken library, anything
        return np.full(count, np.nan)
    return found if found.shape == (count,) else np.full(count, np.nan)


def _contacts() -> np.ndarray:
    (eclipse,) = eclipses("2022-05-01", "2022-06-01")
    return np.array([_seconds(eclipse.contacts[name]) for name in CONTACTS])


def _seconds(utc: str) -> float:
    """Since the midnight that began 2022-05-16 [s]."""
    clock = read_clock(utc)
    return (clock.day - 2459716) * SECONDS_PER_DAY + clock.second
