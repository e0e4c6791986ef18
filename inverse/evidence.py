"""Photographs, made ready for a fit: read, placed in time and space, registered, binned."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from numbers import Real
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.spatial import KDTree

from eclipsejax.ephemeris import Geometry, geometry, moon_altitude
from eclipsejax.errors import InputError
from eclipsejax.scene import check_eclipsed
from eclipsejax.traced import real
from inverse import noise, prior
from inverse.cells import Cells, bin_photo
from inverse.exposures import Exposed, log_exposures
from inverse.likelihood import Likelihood, places
from inverse.limb_light import shadow_of
from inverse.observed import observed
from inverse.photo import Photo, read_photo
from inverse.photo_model import photo_model, profile_model, seen
from inverse.profile import Profile, read_profile
from inverse.registration import Registration, register

FLOOR = 0.02  # of the disc's median value, and at least three times the noise of the sky: where logs end
LEAST_CELLS = 20  # of the disc; an overexposed crescent above a black umbra leaves some 40


@dataclass(frozen=True)
class Evidence:
    """One photograph or profile.

    - `photo`: what was read; `where`: the geometry of its time; `registration`, `cells`: None for a profile.
    - `site`: latitude, longitude [degrees] and, where given, height [m] of the observer; None for the Earth's centre.
    - `one_clock`: whether its time is that of its camera's clock, right or wrong, as for the others of that camera.
    - `remarks`: sentences for the report.
    """

    photo: Photo | Profile
    where: Geometry
    site: tuple | None
    registration: Registration | None
    cells: Cells | None
    one_clock: bool
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
    progress: Callable[[str, int, int], None],
) -> list[Evidence]:
    """Read and register every photograph; the arguments are those of `fit_atmosphere`."""
    if not paths:
        raise InputError("There is nothing to fit: name at least one photograph.")
    photos = [read_profile(path) if str(path).lower().endswith(".csv") else read_photo(path) for path in paths]
    times = times_of(photos, time)
    one_clock = len(photos) > 1 and (time is None or isinstance(time, str) or len(time) == 1)
    sites, discs = _each(site, len(photos), "Sites"), _each(disc, len(photos), "Discs")
    for one in sites:
        _check_site(one)
    found = []
    for number, item in enumerate(zip(photos, times, sites, discs, strict=True), 1):
        found.append(_place(*item, one_clock))
        progress("registering", number, len(photos))
    return found


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
        start = _instant(time[0])
        return [_iso(start + (_instant(text) - first)) for text in clocks]
    for photo in photos:
        if photo.time is None:
            local = getattr(photo, "local_time", None)
            says = f"only its camera's clock, {local}, without a time zone" if local else "no time"
            raise InputError(f"{photo.path} holds {says}: give the time in UTC, such as --time 2022-05-16T04:06:00Z.")
    return [str(photo.time) for photo in photos]


def _instant(text) -> datetime:
    return datetime.fromisoformat(str(text).replace("Z", "")).replace(tzinfo=None)


def _iso(instant: datetime) -> str:
    return (instant + timedelta(0)).isoformat() + "Z"


def _place(photo: Photo | Profile, utc: str, site: tuple | None, disc: int | None, one_clock: bool) -> Evidence:
    remarks = []
    site = site or getattr(photo, "site", None)
    if site is None and isinstance(photo, Photo):
        remarks.append(
            f"{Path(photo.path).name}: no site is known, so the observer was put at the Earth's centre; the Moon's "
            "parallax (up to a degree) then tilts the map by as much: give --site LAT,LON."
        )
    where = geometry(utc, *(site or ()))
    check_eclipsed(where)
    if site is not None and float(moon_altitude(where)) < np.radians(-1.0):
        raise InputError(
            f"At {where.utc} the Moon is {-np.degrees(float(moon_altitude(where))):.0f} degrees below the horizon of "
            f"{site[0]:g}, {site[1]:g}: check the time (UTC) and the site (north and east are positive)."
        )
    if isinstance(photo, Profile):
        return Evidence(photo, where, site, None, None, False, tuple(remarks))
    registration = register(photo, where, disc=disc)
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
    return Evidence(photo, where, site, registration, cells, one_clock, tuple(remarks))


def prepare(evidence: Sequence[Evidence]) -> Likelihood:
    """The likelihood of all photographs, with the errors that they are thought to have beforehand."""
    exposures = log_exposures([item.photo for item in evidence])
    models, data, sources = [], [], []
    for item, exposure in zip(evidence, exposures, strict=True):
        if isinstance(item.photo, Profile):
            usable = np.isfinite(item.photo.value)
            value, sigma = np.where(usable, item.photo.value, 0.0), np.where(usable, item.photo.sigma, 1.0)
            limit, on_disc = np.zeros(value.shape), np.ones(len(value), dtype=bool)
            floor = floor_of(value, sigma, usable, on_disc)
            model = profile_model(item.photo, item.where, floor)
            offset = item.photo.offset
            position = (offset / 4.6e-3)[:, None]  # in radii of the Moon
        else:
            assert item.cells is not None and item.registration is not None
            value, sigma, usable = item.cells.value, item.cells.sigma, item.cells.usable
            limit, on_disc = item.cells.limit, item.cells.on_disc
            floor = floor_of(value, sigma, usable, on_disc)
            model = photo_model(item.photo, item.registration, item.where, item.cells, floor)
            offset = np.asarray(seen(model, jnp.zeros(len(model.parameters)))[0].offset)
            position = np.stack([item.cells.right, item.cells.up], axis=1)
        gain, width = real(exposure.relative), real(exposure.width)
        models.append(eqx.tree_at(lambda model: (model.gain, model.exposure_width), model, (gain, width)))
        scale = np.maximum(value, 0.0) + floor
        relative = np.where(on_disc, noise.INDEPENDENT, noise.SKY)
        data.append(observed(np.log(scale), usable, limit, on_disc))
        pixels = np.where(usable, sigma / scale, data[-1].sigma.reshape(usable.shape))
        sources.append(noise.Sources(pixels, relative, noise.modes_of(position, offset, on_disc), usable))
    shadow = shadow_of([item.where for item in evidence])
    shared = [keys_of(item, exposure) for item, exposure in zip(evidence, exposures, strict=True)]
    likelihood = Likelihood(shadow, tuple(models), tuple(data), tuple(sources), places(shared, models))
    groups: dict[object, list[int]] = {}
    for number, keys in enumerate(shared):
        groups.setdefault(keys.get("gain", number), []).append(number)
    likelihood = likelihood.centred(list(groups.values()))
    return likelihood.carried(np.zeros(len(likelihood.parameters)))


def floor_of(value: np.ndarray, sigma: np.ndarray, usable: np.ndarray, on_disc: np.ndarray) -> float:
    """Where the logs of a photograph's values end [full scale]."""
    typical = float(np.median(value[on_disc][usable[on_disc]]))
    return max(FLOOR * typical, 3.0 * float(np.median(sigma[usable])), 1e-6)


def keys_of(item: Evidence, exposure: Exposed) -> dict[str, object]:
    """What a photograph shares with others that have the same keys: nuisances by name."""
    if exposure.camera is None:
        return {}
    keys: dict[str, object] = {name: (name, exposure.camera) for name in prior.OF_CAMERA}
    if item.one_clock:
        keys["clock"] = ("clock", exposure.camera)
    return keys
