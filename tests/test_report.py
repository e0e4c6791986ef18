"""The pictures of a report: that they show what they say, are small, and touch no global state of matplotlib."""

from dataclasses import replace

import jax
import matplotlib
import numpy as np
import pytest
from PIL import Image

from eclipsejax.almanac import nearest_eclipse
from eclipsejax.camera import Camera, pixel_at
from eclipsejax.ephemeris import geometry
from inverse import prior
from inverse.comparison_plot import brightening, residual
from inverse.corner_plot import shown_quantities
from inverse.profile_plot import umbra_radius
from inverse.registration import Registration
from inverse.report import text_report, write_pictures
from inverse.result import Estimate, Fit, PhotoFit

ARCMIN = np.pi / 180 / 60
RADIUS = 15.6  # of the disc [arcmin]
UTC = "2015-09-28T01:40:00Z"  # half in the umbra


def shadow(offset):
    """A made-up shadow, (..., 3), against offset [arcmin]: a copper umbra to 42', a penumbra to 74'."""
    umbra = 2e-3 * np.exp((offset[..., None] - 42) / np.array([11.0, 8.0, 9.0])) * np.array([3.0, 0.8, 0.45])
    penumbra = np.clip((offset[..., None] - 41.5) / 32, 0, 1) ** 2.2
    return umbra + penumbra


def surface(right, up):
    """A made-up Moon: a bright disc with three maria."""
    seas = ((-0.35, 0.4, 0.3), (0.3, 0.35, 0.22), (0.45, 0.0, 0.18))
    dark = sum(np.exp(-(((right - x) ** 2 + (up - y) ** 2) / size**2)) for x, y, size in seas)
    return 1.15 * (1 - 0.5 * np.clip(dark, 0, 1)) * (1 - 0.1 * (right**2 + up**2))


def photograph(centre=(30.0, 16.0), exposure=60.0, seed=0, utc=UTC, mirror=False, wrong=0.05) -> PhotoFit:
    """A disc whose centre is `centre` arcmin from the axis (right, up), exposed for its umbra, and a model beside it."""
    random = np.random.default_rng(seed)

    def light(right, up):
        offset = np.hypot(centre[0] + RADIUS * right, centre[1] + RADIUS * up)
        clean = exposure * shadow(offset) * surface(right, up)[..., None] * (np.hypot(right, up) < 1)[..., None]
        return offset, clean + 2e-4 * exposure

    def seen(clean, right):
        tilt = 1 + wrong * right[..., None] * np.array([1.0, 2.0, 3.0])
        return np.clip(clean * tilt * (1 + 0.05 * random.standard_normal(clean.shape)), 0, 1)

    line = np.linspace(-1.3, 1.3, 240)
    right, up = np.meshgrid(line, -line)
    _, picture = light(right, up)
    image = seen(picture, right)
    image[:, 225:] = np.nan  # the frame ends
    grid = np.arange(-0.975, 1, 0.05)
    x, y = (axis.ravel() for axis in np.meshgrid(grid, grid))
    x, y = x[np.hypot(x, y) < 0.93], y[np.hypot(x, y) < 0.93]
    offset, clean = light(x, y)
    observed = seen(clean, x)
    registration = Registration(500.0, 700.0, 240.0, np.radians(25.0), mirror, 0.9, 0.3, 0.8, "maria", 0.7)
    band = clean * np.exp(np.array([-0.06, 0.06]))[:, None, None]
    return PhotoFit(
        name="IMG_8742.jpg", utc=utc, registration=registration, offset=offset * ARCMIN, on_disc=np.ones(x.size, bool),
        usable=observed < 0.97, observed=observed, predicted=np.minimum(clean, 1.0), albedo=surface(x, y), band68=band,
        image=image, model_image=np.minimum(picture, 1.0),
    )  # fmt: skip


def fake_fit(photos=None, sampled=True) -> Fit:
    """A fit whose posterior is the prior of the limb, narrowed and correlated."""
    random = np.random.default_rng(1)
    size = len(prior.ATMOSPHERE)
    narrow = np.array([0.15, 0.7, 0.95, 0.6, 0.5, 0.8, 0.7, 0.9])
    z = random.standard_normal((16 if sampled else 1, 400, size))
    z[..., 3] = 0.8 * z[..., 4] + 0.6 * z[..., 3]
    z = narrow * z + np.array([1.2, 0.3, 0.1, -0.4, 0.5, 0.0, 0.2, -0.2])
    before = random.standard_normal((4000, size))
    estimates, draws, prior_draws = {}, {}, {}

    def add(name, unit, values, priors, informed):
        middle, sd = float(np.median(values)), float(values.std())
        ends = [tuple(np.quantile(values, level).tolist()) for level in ((0.16, 0.84), (0.025, 0.975))]
        wide = tuple(np.quantile(priors, (0.025, 0.975)).tolist())
        worth = (310.0, 42.0) if sampled else (None, None)
        estimates[name] = Estimate(name, unit, middle, sd, middle, *ends, wide, informed, *worth)
        draws[name], prior_draws[name] = values, priors

    for index, parameter in enumerate(prior.ATMOSPHERE):
        one = jax.jit(parameter.value)
        values, priors = np.asarray(one(z[..., index])), np.asarray(one(before[..., index]))
        add(parameter.name, parameter.unit, values, priors, 1 - narrow[index] ** 2)
    dust = draws["dust.extinction"], prior_draws["dust.extinction"]
    add("stratospheric_optical_depth", "-", 1e4 * dust[0], 1e4 * dust[1], estimates["dust.extinction"].informed)
    density = [d["air.surface_pressure"] / d["air.surface_temperature"] * 3.4e-4 for d in (draws, prior_draws)]
    add("air.density_18km", "kg/m3", *density, 0.6)
    estimates["1.gain"] = replace(estimates["clouds.top"], name="1.gain", unit="ln")
    return Fit(
        estimates, draws, prior_draws, (photograph(),) if photos is None else photos,
        {"converged": np.bool_(True), "costs_of_starts": np.array([3.0, 2.0]), "sampler": None},
        (
            "IMG_8742.jpg: no site is known, so the observer was put at the Earth's centre; the Moon's parallax (up to "
            "a degree) then tilts the map by as much: give --site LAT,LON.",
            "Prior-dominated, the photograph says less than the prior: air.surface_pressure, ozone.column_du.",
        ),
        {"eclipsejax": "0", "seed": 0, "photographs": [{"name": "IMG_8742.jpg"}]},
        random.standard_normal(z.shape[:2]) if sampled else None,
    )  # fmt: skip
