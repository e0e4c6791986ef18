"""Photographs, made ready for a fit: read, placed in time and space, registered, binned."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.spatial import KDTree

from eclipsejax.calendar import read_clock
from eclipsejax.ephemeris import Geometry, geometry, moon_altitude
from eclipsejax.errors import InputError
from eclipsejax.scene import check_eclipsed
from eclipsejax.traced import real
from inverse import error_modes, noise, prior
from inverse.assumed_camera import response as assumed_response
from inverse.camera_colours import ASSUMED, colour_matrix_of
from inverse.cells import Cells, bin_photo
from inverse.clock_search import correction, later
from inverse.exposures import RELATIVE, Exposed, believed, log_exposures
from inverse.leaned_on import with_shared_errors
from inverse.likelihood import Likelihood, places
from inverse.limb_light import shadow_of
from inverse.observed import observed
from inverse.photo import Photo, read_photo
from inverse.photo_model import photo_model, profile_model, seen
from inverse.profile import Profile, read_profile
from inverse.registration import Registration, oriented, register
from inverse.times import UNKNOWN, check_error, dates_of, is_searched, of_one_clock, times_of

# Where logs end, in errors of black, and in those of the pixels' noise in the least noisy cells. Were it higher, logs
# of dark cells would bend with the light, and errors of the limb, by a half and more, make no Gaussian of them.
FLOOR, OF_NOISE, LEAST_NOISY = 2.0, 3.0, 0.1
LEAST_CELLS = 20  # of the disc; an overexposed crescent above a black umbra leaves some 40
SLACK = 2.0  # width of the prior about the time that was found, in its errors
REACH = 4.0  # widths of that prior which the shadow's table holds, and at least
LEAST_REACH = 400.0  # s


@dataclass(frozen=True)
class Evidence:
    """One photograph or profile.

    - `photo`: what was read; `where`: the geometry of its time; `registration`, `cells`: None for a profile.
    - `site`: latitude, longitude [degrees] and, where given, height [m] of the observer; None for the Earth's centre.
    - `clock`: whose clock its time is by, right or wrong: its "own", the "camera"'s, or one for "all" photographs.
    - `clock_width`: standard deviation of that clock's error [s].
    - `remarks`: sentences for the report.
    """

    photo: Photo | Profile
    where: Geometry
    site: tuple | None
    registration: Registration | None
    cells: Cells | None
    clock: str
    clock_width: float
    remarks: tuple[str, ...]

    @property
    def name(self) -> str:
        """File name."""
        return Path(self.photo.path).name

    def neighbours(self) -> np.ndarray:
        """Numbers of the cells, or bins, that lie around each, itself among them (cell, neighbour)."""
        if self.cells is None:
            assert isinstance(self.photo, Profile)
            position, count = self.photo.offset[:, None], min(3, len(self.photo.offset))
        else:
            position, count = np.stack([self.cells.right, self.cells.up], axis=1), 9
        return np.asarray(KDTree(position).query(position, k=count)[1])


def gather(
    paths: Sequence,
    *,
    time: str | Sequence[str] | None,
    site: tuple[float, ...] | list[tuple[float, ...] | None] | None,
    disc: int | list[int | None] | None,
    clock: float | str | None = None,
    progress: Callable[[str, int, int], None],
) -> list[Evidence]:
    """Read and register every photograph; the arguments are those of `fit_atmosphere`."""
    check_error(clock)
    if not paths:
        raise InputError("There is nothing to fit: name at least one photograph.")
    photos = [read_profile(path) if str(path).lower().endswith(".csv") else read_photo(path) for path in paths]
    times = dates_of(photos, time) if clock == UNKNOWN else times_of(photos, time)
    sites, discs = _each(site, len(photos), "Sites"), _each(disc, len(photos), "Discs")
    for one in sites:
        _check_site(one)
    sites = [one or getattr(photo, "site", None) for one, photo in zip(sites, photos, strict=True)]
    series = [] if clock is None else of_one_clock(photos, clock)
    search = is_searched(clock)
    wheres = [] if search else [_where(*item) for item in zip(times, sites, strict=True)]  # refused before the work
    registered: list[Registration | None] = []
    for number, (photo, one) in enumerate(zip(photos, discs, strict=True), 1):
        registered.append(register(photo, disc=one) if isinstance(photo, Photo) else None)
        progress("registering", number, len(photos))
    together = len(photos) > 1 and (time is None or isinstance(time, str) or len(time) == 1)
    believed = None if isinstance(clock, str) else clock
    whose, width, remarks = "camera" if together else "own", believed or prior.CLOCK, ()
    if search:
        found = correction(
            series, [one.circle for one in registered if one is not None], times, sites, believed,
            lambda done, total: progress("finding the time", done, total),
        )  # fmt: skip
        times = [later(read_clock(text), found.seconds) for text in times]
        wheres = [_where(*item) for item in zip(times, sites, strict=True)]
        whose, width = "all", max(prior.CLOCK, float(round(SLACK * found.error)))
        # Of a clock that is unknown, a time that was given is no more than the date.
        by_clock = time is None or believed is not None
        remarks = (found.sentence(Path(photos[0].path).name, later(read_clock(times[0]), 0.0, 0), by_clock),)
    placed = [_placed(*item, whose, width) for item in zip(photos, registered, wheres, sites, strict=True)]
    placed[0] = replace(placed[0], remarks=remarks + placed[0].remarks)
    return placed


def _each(given, count: int, what: str) -> list:
    """An item for each photograph, of what may be one for all or a list."""
    if not isinstance(given, list):
        return [given] * count
    if len(given) != count:
        raise InputError(f"{what}: {len(given)} for {count} photographs; give one for each, or one for all.")
    return given


def _check_site(site) -> None:
    """`InputError` unless it is None or two or three numbers."""
    if site is None:
        return
    if not isinstance(site, tuple | list) or len(site) not in (2, 3) or not all(isinstance(x, Real) for x in site):
        raise InputError(
            f"The site {site!r} is not (LAT, LON) or (LAT, LON, HEIGHT): give one such tuple for all photographs, or "
            "a list with one for each."
        )


def _where(utc: str, site: tuple | None) -> Geometry:
    """The scene; `InputError` where there is no eclipse, or no Moon."""
    where = geometry(utc, *(site or ()))
    check_eclipsed(where)
    if site is not None and float(moon_altitude(where)) < np.radians(-1.0):
        raise InputError(
            f"At {where.utc} the Moon is {-np.degrees(float(moon_altitude(where))):.0f} degrees below the horizon of "
            f"{site[0]:g}, {site[1]:g}: check the time (UTC) and the site (north and east are positive)."
        )
    return where


def _placed(
    photo: Photo | Profile, registration: Registration | None, where: Geometry, site: tuple | None, clock: str,
    width: float,
) -> Evidence:  # fmt: skip
    """A photograph whose registration has no roll yet, with it; `clock` and `width` are those of `Evidence`."""
    if isinstance(photo, Profile) or registration is None:
        return Evidence(photo, where, site, None, None, "own", width, ())
    remarks = []
    if site is None:
        remarks.append(
            f"{Path(photo.path).name}: no site is known, so the observer was put at the Earth's centre; the Moon's "
            "parallax (up to a degree) then tilts the map by as much: give --site LAT,LON."
        )
    registration = oriented(registration, photo, where)
    cells = bin_photo(photo, registration)
    seen = int((cells.usable.any(axis=1) & cells.on_disc).sum())
    if seen < LEAST_CELLS:
        raise InputError(
            f"{photo.path} leaves only {seen} usable cells of the disc, the rest is over- or underexposed: "
            "take another exposure."
        )
    if registration.roll_from == "assumed north up":
        remarks.append(
            f"{Path(photo.path).name}: neither maria nor shadow fixed the roll of the camera; north up was assumed."
        )
    return Evidence(photo, where, site, registration, cells, clock, width, tuple(remarks))


def prepare(evidence: Sequence[Evidence], exposure: float | str = RELATIVE, response: str = ASSUMED) -> Likelihood:
    """The likelihood of all photographs, with the errors that they are thought to have beforehand.

    - `exposure`, `response`: as of `fit_atmosphere`.
    """
    photos = [item.photo for item in evidence]
    exposures = believed(photos, log_exposures(photos), exposure)
    models, known, sources, values = [], [], [], []
    for item, one in zip(evidence, exposures, strict=True):
        value, sigma, usable, limit, on_disc = _measured(item)
        black = noise.black_error(value, usable, item.photo.tone_curve)
        floor = floor_of(sigma, usable, black)
        if isinstance(item.photo, Profile):
            model = profile_model(item.photo, item.where, floor)
            offset = item.photo.offset
            position = (offset / 4.6e-3)[:, None]  # in radii of the Moon
        else:
            assert item.cells is not None and item.registration is not None
            model = photo_model(
                item.photo, item.registration, item.where, item.cells, floor, item.clock_width,
                one.error or prior.GAIN,
            )  # fmt: skip
            offset = np.asarray(seen(model, jnp.zeros(len(model.parameters)))[0].offset)
            position = np.stack([item.cells.right, item.cells.up], axis=1)
        stated = one.relative, one.width, one.balance, one.tint, colour_matrix_of(response)
        of_camera = lambda model: (
            model.gain, model.exposure_width, model.balance, model.tint_width, model.colours
        )  # fmt: skip
        models.append(eqx.tree_at(of_camera, model, tuple(real(value) for value in stated)))
        scale = np.maximum(value, 0.0) + floor
        relief = np.where(on_disc, noise.RELIEF, noise.SKY)
        pixels = np.where(usable, sigma / scale, 1.0)
        smooth, left = noise.modes_of(position, offset, on_disc)
        broad = bent = np.zeros((on_disc.size, 0))
        if item.cells is not None:
            broad, bent = error_modes.broad_modes(position, on_disc), error_modes.bent_modes(position, on_disc)
        sources.append(noise.Sources(pixels, relief, smooth, left, broad, bent, floor, black, usable, on_disc))
        values.append(value)
        known.append((np.log(scale), usable, limit))
    responses = [assumed_response(*item) for item in zip(models, values, strict=True)]
    errors = [one.errors(value, by) for one, value, by in zip(sources, values, responses, strict=True)]
    data = [observed(*item, error=one.whole) for item, one in zip(known, errors, strict=True)]
    reach = max(LEAST_REACH, REACH * max(item.clock_width for item in evidence))
    shadow = shadow_of([item.where for item in evidence], clock_reach=reach, response=response)
    shared = [keys_of(item, one) for item, one in zip(evidence, exposures, strict=True)]
    likelihood = Likelihood(
        shadow, tuple(models), tuple(data), tuple(sources), tuple(errors), places(shared, models)
    )  # fmt: skip
    groups: dict[object, list[int]] = {}
    for number, (keys, one) in enumerate(zip(shared, exposures, strict=True)):
        if one.error is not None:
            continue
        groups.setdefault(keys.get("gain", number), []).append(number)
    several = [number for number, item in enumerate(evidence) if item.cells is not None]  # a profile shares no errors
    return with_shared_errors(likelihood.centred(list(groups.values())), several, values, responses)


def _measured(item: Evidence) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """`value`, `sigma`, `usable`, `limit` and `on_disc` of `Cells`, of a profile's bins too."""
    if isinstance(item.photo, Profile):
        usable = np.isfinite(item.photo.value)
        value, sigma = np.where(usable, item.photo.value, 0.0), np.where(usable, item.photo.sigma, 1.0)
        return value, sigma, usable, np.zeros(value.shape), np.ones(len(value), dtype=bool)
    assert item.cells is not None
    return item.cells.value, item.cells.sigma, item.cells.usable, item.cells.limit, item.cells.on_disc


def floor_of(sigma: np.ndarray, usable: np.ndarray, black: float) -> float:
    """Where the logs of a photograph's values end [full scale]; `black`: of `noise.black_error`."""
    return max(FLOOR * black, OF_NOISE * float(np.quantile(sigma[usable], LEAST_NOISY)), 1e-6)


def keys_of(item: Evidence, exposure: Exposed) -> dict[str, object]:
    """What a photograph shares with others that have the same keys: nuisances by name."""
    known = exposure.camera is not None
    keys: dict[str, object] = {name: (name, exposure.camera) for name in prior.OF_CAMERA} if known else {}
    if item.clock == "all" or (item.clock == "camera" and known):
        keys["clock"] = ("clock", item.clock if item.clock == "all" else exposure.camera)
    return keys
