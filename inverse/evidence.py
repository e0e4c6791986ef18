"""Photographs, made ready for a fit: read, placed in time and space, registered, binned."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from eclipsejax.ephemeris import Geometry, geometry, moon_altitude
from eclipsejax.errors import InputError
from eclipsejax.scene import check_eclipsed
from inverse import noise
from inverse.cells import Cells, bin_photo
from inverse.likelihood import Likelihood, photo_model, profile_model, shadow_of
from inverse.photo import Photo, read_photo
from inverse.profile import Profile, read_profile
from inverse.registration import Registration, register

FLOOR = 0.02  # of the disc's median value, and at least three times the noise of the sky: where logs end


LEAST_CELLS = 20  # of the disc; an overexposed crescent above a black umbra leaves some 40


@dataclass(frozen=True)
class Evidence:
    """One photograph or profile.

    - `photo`: what was read; `where`: the geometry of its time; `registration`, `cells`: None for a profile.
    - `site`: latitude, longitude [degrees] and, where given, height [m] of the observer; None for the Earth's centre.
    - `remarks`: sentences for the report.
    """

    photo: Photo | Profile
    where: Geometry
    site: tuple | None
    registration: Registration | None
    cells: Cells | None
    remarks: tuple[str, ...]

    @property
    def name(self) -> str:
        """File name."""
        return Path(self.photo.path).name


def gather(
    paths: Sequence,
    *,
    time: str | Sequence[str] | None,
    site: tuple | list[tuple | None] | None,
    disc: int | list[int | None] | None,
    progress: Callable[[str, int, int], None],
) -> list[Evidence]:
    """Read and register every photograph; the arguments are those of `fit_atmosphere`.

    - `site`, `disc`: of all, or a list with one for each.
    """
    if not paths:
        raise InputError("There is nothing to fit: name at least one photograph.")
    photos = [read_profile(path) if str(path).lower().endswith(".csv") else read_photo(path) for path in paths]
    times = times_of(photos, time)
    sites = site if isinstance(site, list) else [site] * len(photos)
    discs = disc if isinstance(disc, list) else [disc] * len(photos)
    found = []
    for number, item in enumerate(zip(photos, times, sites, discs, strict=True), 1):
        found.append(_place(*item))
        progress("registering", number, len(photos))
    return found


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


def _place(photo: Photo | Profile, utc: str, site: tuple | None, disc: int | None) -> Evidence:
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
        return Evidence(photo, where, site, None, None, tuple(remarks))
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
    return Evidence(photo, where, site, registration, cells, tuple(remarks))


def prepare(evidence: Sequence[Evidence]) -> tuple[Likelihood, list[np.ndarray]]:
    """The likelihood of all photographs, and the low-rank part of each one's covariance."""
    models, data, mask, whiteners, smooth = [], [], [], [], []
    for item in evidence:
        if isinstance(item.photo, Profile):
            usable = np.isfinite(item.photo.value)
            value, sigma = np.where(usable, item.photo.value, 0.0), np.where(usable, item.photo.sigma, 1.0)
            on_disc = np.ones(len(value), dtype=bool)
            position = np.degrees(item.photo.offset)[:, None] * 60.0 / 17.0  # noise.LENGTH is in radii of 15-17'
        else:
            assert item.cells is not None and item.registration is not None
            value, sigma, usable = item.cells.value, item.cells.sigma, item.cells.usable
            on_disc = item.cells.on_disc
            position = np.stack([item.cells.right, item.cells.up], axis=1)
        disc_values = value[on_disc][usable[on_disc]]
        dark = 3.0 * np.median(sigma[usable])
        floor = max(FLOOR * float(np.median(disc_values)), float(dark), 1e-6)
        if item.cells is None:
            model = profile_model(item.photo, item.where, floor)
        else:
            model = photo_model(item.photo, item.registration, item.where, item.cells, floor)
        scale = np.maximum(value, 0.0) + floor
        relative = np.where(on_disc, noise.INDEPENDENT, noise.SKY)[:, None]
        counted = usable.astype(float)
        spread = np.sqrt(relative**2 + (sigma / scale) ** 2)
        modes = noise.smooth_errors(noise.smooth_modes(position[on_disc]), on_disc)
        # Where the floor rules, a relative error of the light is that much smaller in the log.
        modes = modes * (counted * np.maximum(value, 0.0) / scale).ravel()[:, None]
        models.append(model)
        data.append(jnp.asarray(np.log(scale).ravel()))
        mask.append(jnp.asarray(counted.ravel()))
        smooth.append(modes)
        whiteners.append(noise.whitener(spread.ravel(), modes))
    shadow = shadow_of([item.where for item in evidence])
    likelihood = Likelihood(shadow, tuple(models), tuple(data), tuple(mask), tuple(whiteners))
    return likelihood.with_gains(), smooth
