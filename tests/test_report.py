"""The pictures of a report: that they show what they say, are small, and touch no global state of matplotlib."""

from dataclasses import replace
from typing import Any

import jax
import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from eclipsejax.almanac import nearest_eclipse
from eclipsejax.camera import Camera, pixel_at
from eclipsejax.ephemeris import geometry
from inverse import prior
from inverse.comparison_plot import brightening, compass, residual
from inverse.corner_plot import corner_plot, shown_quantities
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
    """A disc whose centre is `centre` arcmin from the axis (right, up), and a model of it."""
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
        usable=observed < 0.97, observed=observed, predicted=np.minimum(clean, 1.0),
        noise=1e-3 * clean, albedo=surface(x, y), drawn=band,
        image=image, model_image=np.minimum(picture, 1.0),
    )  # fmt: skip


def between(values, share: float) -> tuple[float, float]:
    low, high = np.quantile(values, (0.5 - 0.5 * share, 0.5 + 0.5 * share))
    return float(low), float(high)


def fake_fit(photos=None, sampled=True) -> Fit:
    """A fit whose posterior is the prior of the limb, narrowed and correlated."""
    random, method = np.random.default_rng(1), "emcee" if sampled else "laplace"
    size = len(prior.ATMOSPHERE)
    narrow = np.array([0.15, 0.7, 0.95, 0.6, 0.5, 0.8, 0.7, 0.9, 0.95])
    z = random.standard_normal((16 if sampled else 1, 400, size))
    z[..., 3] = 0.8 * z[..., 4] + 0.6 * z[..., 3]
    z = narrow * z + np.array([1.2, 0.3, 0.1, -0.4, 0.5, 0.0, 0.2, -0.2, 0.1])
    before = random.standard_normal((4000, size))
    estimates, draws, prior_draws = {}, {}, {}

    def add(name, unit, values, priors, informed):
        middle, sd = float(np.median(values)), float(values.std())
        worth = (310.0, 42.0) if sampled else (None, None)
        estimates[name] = Estimate(
            name, unit, middle, sd, middle, between(values, 0.68), between(values, 0.95), between(priors, 0.95),
            informed, *worth,
        )  # fmt: skip
        draws[name], prior_draws[name] = values, priors

    for index, parameter in enumerate(prior.ATMOSPHERE):
        one = jax.jit(parameter.value)
        values, priors = np.asarray(one(z[..., index])), np.asarray(one(before[..., index]))
        add(parameter.name, parameter.unit, values, priors, 1 - narrow[index] ** 2)
    dust = draws["dust.extinction"], prior_draws["dust.extinction"]
    add("stratospheric_optical_depth", "-", 1e4 * dust[0], 1e4 * dust[1], estimates["dust.extinction"].informed)
    after, first = (3.4e-4 * d["air.surface_pressure"] / d["air.surface_temperature"] for d in (draws, prior_draws))
    add("air.density_18km", "kg/m3", after, first, 0.6)
    estimates["1.gain"] = replace(estimates["clouds.top"], name="1.gain", unit="ln")
    return Fit(
        estimates, draws, prior_draws, (photograph(),) if photos is None else photos,
        {"converged": np.bool_(True), "costs_of_starts": np.array([3.0, 2.0]), "method": method},
        (
            "IMG_8742.jpg: no site is known, so the observer was put at the Earth's centre; the Moon's parallax (up to "
            "a degree) then tilts the map by as much: give --site LAT,LON.",
            "Prior-dominated, the photograph says less than the prior: air.surface_pressure, ozone.column_du.",
        ),
        {"eclipsejax": "0", "seed": 0, "photographs": [{"name": "IMG_8742.jpg"}]},
        random.standard_normal(z.shape[:2]) if sampled else None,
    )  # fmt: skip


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Two photographs and a profile, Laplace only, drawn under settings of the user that would spoil them."""
    profile = replace(photograph(), name="profile.csv", registration=None, image=None, model_image=None)
    odd = replace(photograph(mirror=True, seed=1), name="Mond$_1$ 日食 " + 90 * "x" + ".jpg")
    fit = fake_fit((photograph(), odd, profile), sampled=False)
    spoilt: dict[Any, Any] = {"font.size": 60.0, "figure.facecolor": "black", "text.usetex": True, "savefig.dpi": 5}
    with matplotlib.rc_context(spoilt):
        before, backend = dict(matplotlib.rcParams), matplotlib.get_backend()
        paths = write_pictures(fit, tmp_path_factory.mktemp("report"), {"dust.extinction": 4.7e-6})
        assert dict(matplotlib.rcParams) == before and matplotlib.get_backend() == backend
    return {path.name: path for path in paths}


def test_each_photograph_has_its_pictures_and_a_profile_no_photograph(pictures):
    assert list(pictures) == ["fit-1.png", "profile-1.png", "fit-2.png", "profile-2.png", "profile-3.png", "corner.png"]
    for path in pictures.values():
        with Image.open(path) as picture:
            assert picture.format == "PNG" and 800 <= min(picture.size) and max(picture.size) <= 2000
            # Drawn white in spite of a black style, and not blank.
            corner, spread = np.asarray(picture.convert("RGB"))[-1, -1], np.asarray(picture.convert("L")).std()
            assert corner.tolist() == [255, 255, 255] and spread > 15
        assert path.stat().st_size < 1e6


def test_no_figure_is_left_behind(pictures):
    from matplotlib import pyplot

    assert pictures and pyplot.get_fignums() == []


def test_warnings_stand_where_the_photograph_is(pictures):
    """Their brown is on the page with the photograph, and on a profile's only page."""

    def brown(name):
        with Image.open(pictures[name]) as picture:
            foot = np.asarray(picture.convert("RGB")).astype(int)[-60:]
        return int((np.abs(foot - [0x8A, 0x30, 0x00]).sum(axis=-1) < 60).sum())

    assert brown("fit-1.png") > 300 and brown("profile-3.png") > 300 and brown("profile-1.png") == 0


@pytest.mark.parametrize("mirror", [False, True])
def test_compass_points_where_the_camera_says(mirror):
    roll = np.radians(137.0)
    camera = Camera(roll=roll, mirror=mirror)
    row_0, column_0 = camera.disc_centre()
    for (right, up), direction in zip(compass(roll, mirror), ((0.0, 4e-4), (4e-4, 0.0)), strict=True):
        row, column = pixel_at(camera, *direction)
        np.testing.assert_allclose([right, up], [(column - column_0) / 10, (row_0 - row) / 10], atol=1e-9)


def test_residual_is_the_ratio_on_the_disc_and_nothing_elsewhere():
    random = np.random.default_rng(0)
    model = 0.2 * np.ones((240, 240, 3)) * [1.0, 0.5, 0.25]
    image = np.exp([0.1, -0.2, 0.3]) * model * (1 + 0.02 * random.standard_normal(model.shape))
    image[:60], image[:, :40, 0], image[200:] = 0.99, 0.98, np.nan  # saturated, one channel saturated, out of frame
    found = residual(image, model, 1.3)
    assert found.shape == image.shape
    np.testing.assert_allclose(found[120, 120], [0.1, -0.2, 0.3], atol=0.02)
    assert np.isnan(found[120, 36, 0]) and np.isfinite(found[120, 36, 1:]).all()
    assert np.isnan(found[:60]).all() and np.isnan(found[200:]).all()
    line = np.linspace(-1.3, 1.3, 240)
    assert np.isnan(found[np.hypot(line, line[:, None]) > 1.05]).all()
    # Even over blocks as fine as cells: a sixteenth of the variance of pixels is left.
    assert found[80:160, 80:160, 0].std() < 0.02 / 3


def test_dark_pictures_are_brightened_and_bright_ones_are_not():
    image = photograph(centre=(8, 5), exposure=8.0).image
    assert image is not None and 20 < brightening(image) < 500
    disc = np.sort(np.nanmax(image[:, :220], axis=-1).ravel())
    assert 0.5 < brightening(image) * disc[int(0.97 * disc.size)] < 1
    assert brightening(np.full((50, 50, 3), 0.9)) == 1


@pytest.mark.parametrize("contact", ["U2", "U3"])
def test_umbra_is_the_almanacs(contact):
    """When totality begins or ends, the Moon's far limb is at the edge of the umbra."""
    where = geometry(nearest_eclipse(UTC).contacts[contact])
    moon, antisun = np.asarray(where.moon), -np.asarray(where.sun)
    cosine = moon @ antisun / np.linalg.norm(moon) / np.linalg.norm(antisun)
    limb = np.arcsin(0.2725076 * 6378.137e3 / np.linalg.norm(moon))
    radius = umbra_radius(where.utc)
    assert radius is not None and abs(radius - np.arccos(cosine) - limb) < 0.02 * ARCMIN
    assert umbra_radius("2015-10-15T00:00:00Z") is None


def test_corner_shows_the_dust_once_and_the_best_informed():
    fit = fake_fit()
    shown, left_out = shown_quantities(fit)
    assert len(shown) == 8 and shown[0] == "dust.extinction"
    assert "stratospheric_optical_depth" not in shown + left_out  # the same as alpha
    assert left_out == ["air.surface_pressure", "scattered.amplitude"]  # 0.95 of the prior's width, the most of all
    still = replace(fit, draws={**fit.draws, "clouds.top": np.full_like(fit.draws["clouds.top"], 7e3)})
    assert "clouds.top" not in sum(shown_quantities(still), [])


def test_corner_has_the_optical_depth_above_the_dust_alone():
    fit = fake_fit()
    scattered = replace(fit.estimates["scattered.amplitude"], informed=0.99)
    figure = Figure()
    corner_plot(replace(fit, estimates={**fit.estimates, "scattered.amplitude": scattered}), {}, figure)
    titles = [panel.get_title() for panel in figure.axes]
    assert [title.splitlines()[0][:6] for title in titles if "optical depth" in title] == ["dust α"]
    assert any(title.startswith("scattered light\n$") for title in titles)


def test_text_says_alpha_with_its_optical_depth_then_the_table_then_the_warnings():
    fit = fake_fit()
    text = text_report(fit)
    sentence, table, cautions = text.split("\n\n")
    assert "alpha = 4.2e-06 /m" in sentence and "optical depth of 0.042" in sentence
    assert len(table.splitlines()) == 1 + len(fit.draws)
    assert cautions.count("Warning: ") == 2 and max(map(len, cautions.splitlines())) <= 110
    assert "Warning" not in text_report(replace(fit, warnings=()))
