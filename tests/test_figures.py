"""The figures draw what they say: physics of what is drawn, a page that a browser can show."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image
from scipy.integrate import quad

from eclipsejax.almanac import in_order, nearest_eclipse, shadow_circles
from eclipsejax.aspect import aspect
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.camera import Exposure
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.dust_of_brightness import dusty
from eclipsejax.ephemeris import geometry
from eclipsejax.errors import InputError
from eclipsejax.figures import chart, gallery
from eclipsejax.figures.colour import sunlight_colour, sunlight_wavelengths
from eclipsejax.figures.danjon import strip
from eclipsejax.figures.limb_rays import columns, limb_rays
from eclipsejax.figures.page import Plate, photograph, styled
from eclipsejax.figures.picture import (
    BLACK,
    airless,
    darkness,
    magnitudes_lost,
    photographed,
    pictures,
    scene,
    shutter,
    zenith_up,
)
from eclipsejax.figures.refraction import sunlit_path
from eclipsejax.figures.sun import SPECTRA, binned
from eclipsejax.figures.sun import disc as sun_disc
from eclipsejax.figures.surface import shaded_disc
from eclipsejax.figures.tank import BEAMS, FALL, march_error, marched, parabola, tank_index, tank_plate
from eclipsejax.figures.worlds import PARTIAL, SITE, TOTAL, worlds
from eclipsejax.moon import LAWS, Moon
from eclipsejax.photometry import FULL_MOON, danjon_number
from eclipsejax.response import LUMINANCE
from eclipsejax.sun import Sun

SIZE = 48


@pytest.fixture(scope="module")
def totality():
    """Linear pictures of mid-eclipse, by name."""
    airs = worlds() | {f"dust {alpha:g}": dusty(Atmosphere.typical(), alpha) for alpha in (0.0, 4.7e-6, 1.0e-5)}
    airs |= {f"L = {4 - i}": air for i, air in enumerate(strip())}
    return dict(zip(airs, pictures(scene(TOTAL, SITE, size=SIZE, sky=airless()), airs.values()), strict=True))


@pytest.mark.parametrize("beam", BEAMS)
def test_beams_in_the_tank_obey_snell_at_every_height(beam):
    # n cos(slope) is the same all along a ray through level layers: the parabola is checked without its own equation.
    x = np.linspace(0.0, 0.5, 6)
    slope = (parabola(beam[0], beam[1], x + 1e-6) - parabola(beam[0], beam[1], x - 1e-6)) / 2e-6
    index = np.array([float(tank_index((0.0, y))) for y in parabola(beam[0], beam[1], x)])
    np.testing.assert_allclose(index / np.hypot(1.0, slope), index[0] * np.cos(np.radians(beam[1])), rtol=1e-8)


def test_march_through_the_tank_is_of_first_order():
    errors = np.array([march_error(step) for step in (0.02, 0.01, 0.005)])
    np.testing.assert_allclose(errors[:-1] / errors[1:], 2.0, rtol=0.1)
    # Half a step of fall, felt over the whole tank, is what a step by Euler's rule loses: 0.6 m at n = 1.4 or so.
    assert 0.5 < errors[0] / (0.25 * FALL * 0.02 * 0.6 / 1.4**2) < 2.0


def test_marched_beam_ends_inside_the_tank():
    path = marched(*BEAMS[-1], 0.01)
    assert path[-1, 1] > 0.0 and path[0, 0] == 0.0 and np.all(np.diff(path[:, 0]) > 0.0)


def test_drawn_ray_arrives_level_and_leaves_bent():
    rays = limb_rays(Atmosphere())
    bending = float(rays.bending[rays.nearest([5e3]), columns([550.0])][0])
    path = sunlit_path(Atmosphere(), 5e3, 550.0, bending)
    ends = np.diff(path[[0, 1, -2, -1]], axis=0)[[0, 2]]
    slope = np.arctan2(ends[:, 1], ends[:, 0])
    np.testing.assert_allclose(slope, [0.0, -bending], atol=2e-3 * bending)
    height = np.hypot(path[:, 0], path[:, 1] + EARTH_RADIUS) - EARTH_RADIUS
    assert height.min() == pytest.approx(5e3, abs=1.0)


def test_rays_cross_the_axis_below_two_kilometres():
    rays = limb_rays(Atmosphere())
    landing = rays.arrival(3.844e8)[:, columns([550.0])[0]]
    crossing = np.interp(0.0, landing[rays.height < 5e3], rays.height[rays.height < 5e3])
    assert 1.2e3 < crossing < 2.0e3  # the bending is then asin(R / D) = 57'
    assert landing[0] == pytest.approx(-993e3, abs=25e3)  # computed elsewhere, for the Sun at its true distance


def test_whole_sunlight_has_luminance_one_and_red_light_is_red():
    grid = sunlight_wavelengths()
    white, red = sunlight_colour(np.stack([np.ones_like(grid), grid > 620.0]))
    assert white @ np.asarray(LUMINANCE) == pytest.approx(1.0)
    assert red[0] > 5 * abs(red[1]) and red[0] > 5 * abs(red[2])


def test_worlds_grow_darker_and_redder_with_each_process(totality):
    lost = [magnitudes_lost(totality[name]) for name in worlds()]
    assert lost[0] > BLACK and darkness(totality["no air"]) == "black"
    assert lost[1] < lost[2] - 1.0 < lost[3] - 1.0
    redness = [image[..., 0].sum() / image[..., 2].sum() for image in (totality[name] for name in list(worlds())[1:3])]
    assert redness[1] > 3 * redness[0]


def test_clear_air_dims_the_moon_of_2008_by_nine_magnitudes(totality):
    # 9.21 by the reference computation (SCIENCE 7b), for a disc of one albedo and with 0.30 mag for the opposition.
    assert magnitudes_lost(totality["refraction, scattering, ozone"]) == pytest.approx(8.95, abs=0.35)


def test_dust_dims_and_strip_gives_the_numbers_of_danjon(totality):
    lost = [magnitudes_lost(totality[f"dust {alpha:g}"]) for alpha in (0.0, 4.7e-6, 1.0e-5)]
    assert lost[0] < lost[1] - 1.0 < lost[2] - 2.0
    magnitudes = FULL_MOON + np.array([magnitudes_lost(totality[f"L = {4 - i}"]) for i in range(5)])
    np.testing.assert_allclose(danjon_number(magnitudes), [4, 3, 2, 1, 0], atol=0.1)
    # The scale is clipped at its ends: clear air is brighter than L = 4, and the last is not simply black.
    assert -4.1 < magnitudes[0] < -3.8 and magnitudes[4] == pytest.approx(4.2, abs=0.2)


def test_longer_exposures_are_brighter_and_saturate():
    image = pictures(scene(PARTIAL, SITE, size=SIZE), [Atmosphere.typical()])[0]
    shots = [photographed(image, Exposure(shutter_s=t, f_number=8.0, iso=800.0)) for t in (1 / 125, 1 / 6, 1.5)]
    means = [shot.mean() for shot in shots]
    assert means[0] < means[1] < means[2]
    full = [np.mean(shot.min(axis=-1) == 255) for shot in shots]
    assert 0.0 == full[0] < full[1] < full[2]


def test_zenith_is_up_where_the_moon_sets():
    # Flattened along the picture's columns only if the zenith is up.
    site, utc = (40.42, -3.70), "2022-05-16T04:54:00Z"
    image = pictures(scene(utc, site, size=SIZE, roll=zenith_up(utc, site)), [Atmosphere.typical()])[0]
    disc = image.sum(axis=-1) > 0
    tall, broad = (np.ptp(np.nonzero(disc.any(axis=axis))[0]) + 1 for axis in (1, 0))
    assert 0.80 < tall / broad < 0.94  # 0.88, in whole pixels of 40


@pytest.mark.parametrize("date", ["2008-02-21", "2026-08-28", "2016-09-16"])
def test_moon_of_the_chart_touches_the_circles_at_its_contacts(date):
    eclipse = nearest_eclipse(date)
    circles = {"P1": (2, 1), "U1": (1, 1), "U2": (1, -1), "U3": (1, -1), "U4": (1, 1), "P4": (2, 1)}
    assert list(in_order(eclipse)) == [name for name in ("P1", "U1", "U2", "greatest", "U3", "U4", "P4")
                                       if name == "greatest" or name in eclipse.contacts]  # fmt: skip
    for name, utc in eclipse.contacts.items():
        where = geometry(utc)
        radii = shadow_circles(np.asarray(where.moon), np.asarray(where.sun))
        circle, side = circles[name]
        touching = np.degrees(radii[circle] + side * radii[3]) * 60.0
        assert np.hypot(*chart.on_sky(where)) == pytest.approx(touching, abs=0.05)
    first, last = (chart.on_sky(geometry(eclipse.contacts[name])) for name in ("P1", "P4"))
    assert last[0] > first[0]  # eastwards


def test_chart_tells_the_libration_and_draws_the_lines_of_zero():
    where = geometry(TOTAL, *SITE)
    assert chart.told(aspect(where)).startswith("libration 5.2° east, 0.9° north\nlunar north 19.4° east")
    gold = np.ptp(chart.disc(where, 96), axis=-1) > 0.2
    assert 0.01 < gold.mean() < 0.05  # two lines
    assert gold[43:53, 43:53].any() and not gold[:8].any()


def test_spectra_of_the_sun_carry_what_their_tables_say():
    # 2 nm bins from 380 to 780 nm; Planck's law integrated by SciPy's adaptive rule.
    planck, _ = quad(lambda w: float(Sun(spectrum="blackbody").irradiance(w)), 380.0, 780.0)
    total = {name: 2.0 * binned(name).sum() for name in SPECTRA}
    assert total["blackbody"] == pytest.approx(planck, rel=1e-5)
    assert total["gueymard"] == pytest.approx(total["e490"], rel=3e-3)
    disc = sun_disc(64)
    assert disc[32, 32].min() > 0.9 and disc[32, 4, 0] > disc[32, 4, 2] + 0.1  # white, and redder at the limb


@pytest.mark.parametrize("law", LAWS)
def test_discs_of_the_laws(law):
    disc = shaded_disc(Moon(law=law), 64)
    radius = np.hypot(*np.meshgrid(*2 * [np.linspace(-1.05, 1.05, 64)]))
    limb, middle = disc[(radius > 0.9) & (radius < 0.97)].mean(), disc[radius < 0.5].mean()
    assert (limb < 0.6 * middle) if law == "lambert" else (limb > 0.75 * middle)
    assert disc[radius > 1.04].max() == 0.0


def test_shutter_speeds_are_written_as_photographers_do():
    assert [shutter(t) for t in (1 / 125, 1 / 6, 0.5, 1.5)] == ["1/125 s", "1/6 s", "0.5 s", "1.5 s"]


class Page(HTMLParser):
    """What a page shows."""

    def __init__(self, text):
        super().__init__()
        self.pictures, self.words = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag == "img":
            self.pictures.append(dict(attrs)["src"])

    def handle_data(self, data):
        self.words.append(data)


def small(monkeypatch):
    """A gallery of one figure."""
    monkeypatch.setattr(gallery, "plates", lambda size: {"tank": tank_plate})


def test_gallery_is_one_page_that_needs_no_other_file(tmp_path, monkeypatch):
    small(monkeypatch)
    lines = []
    page = gallery.write_gallery(tmp_path / "new" / "folder", size=SIZE, progress=lines.append)
    assert page.name == "index.html" and len(lines) == 1
    with Image.open(page.with_name("tank.png")) as picture:
        assert picture.width > 1000 and picture.info["Title"] == "A laser in sugar water"
    shown = Page(page.read_text(encoding="utf-8"))
    assert len(shown.pictures) == 1 and shown.pictures[0].startswith("data:image/png;base64,")
    assert "half the step, half the error" in " ".join(shown.words)


def test_gallery_in_a_file_is_refused(tmp_path, monkeypatch):
    small(monkeypatch)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="choose another folder"):
        gallery.write_gallery(tmp_path / "file")


def test_every_plate_of_the_gallery_can_be_named_as_a_file():
    assert len(gallery.plates(8)) == 15
    assert all(re.fullmatch(r"[a-z0-9-]+", name) for name in gallery.plates(8))


def test_plates_do_not_touch_the_style_of_the_user():
    import matplotlib

    before = dict(matplotlib.rcParams)

    @styled
    def draw():
        plate = Plate("a", 2, 2)
        photograph(plate.add_axes((0, 0, 1, 1)), np.zeros((4, 4, 3), np.uint8), "title", "below")
        return plate

    assert "<figcaption>" in draw().html()
    assert dict(matplotlib.rcParams) == before
