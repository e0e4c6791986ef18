"""One compiled program prepares all scenes, one measures them, one differentiates."""

import csv
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax import photometry
from eclipsejax.almanac import nearest_eclipse
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone
from eclipsejax.camera import Camera
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.photometry import danjon_number, field_stops, photometer, pictured_brightness
from eclipsejax.render import FULL_MOON_PHASE, render
from eclipsejax.scene import Scene, axis_offset, disc_points
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.wavelengths import binned_weights
from tests.oracles import derivative

DATA = Path(__file__).parents[1] / "data" / "eclipse_photometry.csv"
DAYS = ("1990-02-09", "2007-03-03", "2008-02-21", "2019-01-21", "2022-11-08")

measured = eqx.filter_jit(lambda disc, atmosphere: disc(atmosphere))
sloped = eqx.filter_jit(eqx.filter_grad(lambda atmosphere, disc: disc(atmosphere).magnitude))


def table_of(path):
    with path.open() as lines:
        return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def limb(ozone=300.0, dust=0.0, haze=0.0, top=0.0, cover=0.0, width=1e3):
    return Atmosphere(ozone=Ozone(ozone), dust=Dust(dust), haze=Haze(haze), clouds=Clouds(top, cover, width))


def scene_on(day):
    return Scene.at(nearest_eclipse(f"{day}T06:00:00Z").greatest)


@pytest.fixture(scope="module")
def discs():
    return {day: photometer(scene_on(day)) for day in DAYS}


@pytest.fixture(scope="module")
def observed():
    return {(row["date"], row["quantity"]): float(row["value"]) for row in table_of(DATA)}


def test_picture_holds_the_light_that_the_photometer_finds(discs):
    camera = Camera(shape=(160, 160), scale=1.1e-2 / 160)
    scene = Scene.at(nearest_eclipse("2008-02-21").greatest, camera=camera)
    picture = eqx.filter_jit(lambda scene, air: render(scene, air, tolerance=1e-2))(scene, Atmosphere.typical())
    seen, expected = pictured_brightness(scene, picture), measured(discs["2008-02-21"], Atmosphere.typical())
    for found, right in zip(jax.tree.leaves(seen), jax.tree.leaves(expected), strict=True):
        assert float(found) == pytest.approx(float(right), abs=0.03)


def observed_dimming(observed, discs, day):
    """Against the full Moon of each source, where it has one."""
    if (day, "dimming") in observed:
        return observed[day, "dimming"]
    standard = day in ("1990-02-09", "2007-03-03")  # mean distances
    return observed[day, "magnitude"] - (photometry.FULL_MOON if standard else float(discs[day].zero))


def test_measured_eclipses_lie_about_the_typical_one_and_below_the_clear_one(discs, observed):
    target = np.array([observed_dimming(observed, discs, day) for day in DAYS])
    clear, typical = (
        np.array([float(measured(discs[day], atmosphere).dimming) for day in DAYS])
        for atmosphere in (Atmosphere(), Atmosphere.typical())
    )
    assert np.all(target - clear > 0.6) and np.all(target - clear < 2.2)
    assert np.abs(typical - target).max() < 0.6
    assert abs(np.mean(typical - target)) < 0.2


def test_disc_is_as_dim_as_an_independent_calculation_says(discs, shared):
    # A uniform disc without opposition surge, grey dust in 15-25 km, opaque clouds below 8 km, 345.75 DU. Ours has
    # maria: it is up to 0.17 mag brighter where the southern highlands are at the bright rim of the umbra (1990,
    # 2008), and up to 0.11 mag fainter where the northern maria are.
    rows = {row["date"]: row for row in table_of(shared / "reference" / "disk_magnitude_reference.csv")}
    cases = {
        "dm_clear": limb(345.75),
        "dm_cloud8": limb(345.75, top=8e3, cover=1.0, width=100.0),
        "dm_tau01": limb(345.75, dust=1e-6),
        "dm_tau01_cloud8": limb(345.75, dust=1e-6, top=8e3, cover=1.0, width=100.0),
        "dm_tau10": limb(345.75, dust=1e-5),
    }
    excess = np.array(
        [
            [float(measured(discs[day], atmosphere).dimming) - float(rows[day][name]) for day in DAYS]
            for name, atmosphere in cases.items()
        ]
    )
    assert np.abs(excess).max() < 0.2
    assert np.abs(excess.mean(axis=1)).max() < 0.05


def test_moon_at_the_edge_of_the_penumbra_is_full(discs):
    scene = Scene.at("2008-02-21T00:37:00Z")
    found = measured(photometer(scene), Atmosphere.typical())
    assert float(found.dimming) == pytest.approx(0.0, abs=0.03)


def test_zero_point_is_that_of_rolo_and_near_what_was_measured(shared, observed):
    rows = table_of(shared / "reference" / "rolo_coefficients.csv")
    row = {name: float(value) for name, value in next(row for row in rows if row["nm"] == "549.1").items()}
    # Kieffer & Stone 2005, equation 10, without libration; phase in radians but for the exponentials, in degrees.
    p1, p2, p3, p4 = 4.06054, 12.8802, -30.5858, 16.7498
    g = np.radians(1.5)
    log_reflectance = sum(row[f"a{k}"] * g**k for k in range(4))
    log_reflectance += row["d1"] * np.exp(-1.5 / p1) + row["d2"] * np.exp(-1.5 / p2)
    log_reflectance += row["d3"] * np.cos((1.5 - p3) / p4)
    assert photometry.FULL_MOON_REFLECTANCE == pytest.approx(np.exp(log_reflectance), abs=1e-4)
    assert photometry.FULL_MOON == pytest.approx(observed["2022-11-08", "magnitude_before"], abs=0.25)


def test_danjon_number_inverts_the_relation_and_keeps_to_its_scale(observed):
    number = np.linspace(0.0, 4.0, 9)
    np.testing.assert_allclose(danjon_number(4.2 - 3.0 * number + (number / 2.0) ** 2), number, atol=1e-12)
    np.testing.assert_allclose(danjon_number(jnp.asarray([-9.0, 9.0])), [4.0, 0.0])
    for day in ("2008-02-21", "2019-01-21"):
        predicted = float(danjon_number(observed[day, "magnitude"]))
        assert predicted == pytest.approx(observed[day, "danjon"], abs=0.25)
    assert np.all(np.isfinite(jax.vmap(jax.grad(danjon_number))(jnp.asarray([-9.0, -3.8, 0.0, 4.2, 9.0]))))


@pytest.mark.parametrize(("part", "name", "step"), [("dust", "extinction", 1e-8), ("clouds", "top", 30.0)])
def test_magnitude_has_the_gradient_that_differences_show(discs, part, name, step):
    disc, atmosphere = discs["2022-11-08"], Atmosphere.typical()
    where = lambda a: getattr(getattr(a, part), name)

    def magnitude(x):
        return float(measured(disc, eqx.tree_at(where, atmosphere, jnp.asarray(x, dtype=float))).magnitude)

    slope = float(where(sloped(atmosphere, disc)))
    assert slope > 0.0
    assert slope == pytest.approx(derivative(magnitude, float(where(atmosphere)), step), rel=1e-3)


def test_finer_samples_see_the_same_disc(discs):
    # Random points, even in area, through the same table: the maria are what even samples could miss.
    scene, disc = scene_on("2022-11-08"), discs["2022-11-08"]
    radius, angle = np.random.default_rng(8).uniform(0.0, 1.0, (2, 40000))
    radius = np.sqrt(radius) * np.arcsin(MOON_RADIUS / float(jnp.linalg.norm(scene.geometry.moon)))
    east, north = (radius * f(2.0 * np.pi * angle) for f in (np.sin, np.cos))
    points = disc_points(scene.geometry, east, north)
    grid = disc.renderer.tabulator.grid
    places = grid.places(axis_offset(scene.geometry, points.position), jnp.linalg.norm(points.position, axis=-1))
    light = eqx.filter_jit(lambda table, places: table(Atmosphere.typical()).at(places))(
        disc.renderer.tabulator, places
    )
    full = scene.moon.reflectance(1.0, 1.0, FULL_MOON_PHASE) / scene.moon.reflectance(1.0, 1.0, 0.0)
    shape = scene.moon.reflectance(points.incidence_cosine, points.emission_cosine, points.phase_angle) / full
    many = light[:, 1] * shape * scene.moon.albedo(points.longitude, points.latitude)
    error = 3.0 * float(jnp.std(many) / jnp.mean(many)) / 200.0
    even = 10.0 ** (-0.4 * measured(disc, Atmosphere.typical()).dimming)
    assert float(even / jnp.mean(many)) == pytest.approx(1.0, abs=error)


def test_fields_are_as_dark_as_the_shadow_there():
    scene, atmosphere = scene_on("2019-01-21"), Atmosphere.typical()
    east, north = np.array([0.0, 0.5, -0.3, 1.2]), np.array([0.0, 0.6, -0.7, 0.0])
    found = np.asarray(field_stops(scene, atmosphere, east, north, response="nikon_5100"))
    assert np.all(np.isnan(found[3])) and found.shape == (4, 3)

    radius = np.tan(np.arcsin(MOON_RADIUS / float(jnp.linalg.norm(scene.geometry.moon))))
    points = disc_points(scene.geometry, radius * east[:3], radius * north[:3])
    weights = binned_weights(scene.sun, scene.moon, "nikon_5100", 40)
    offset, distance = axis_offset(scene.geometry, points.position), jnp.linalg.norm(points.position, axis=-1)
    light = shadow_irradiance(
        atmosphere, offset, weights[0], moon_distance=distance, sun_distance=jnp.linalg.norm(scene.geometry.sun)
    )
    stops = np.log2(light @ weights[1] / weights[1].sum(axis=0))
    cosines = points.incidence_cosine, points.emission_cosine
    surge = scene.moon.reflectance(*cosines, points.phase_angle) / scene.moon.reflectance(*cosines, FULL_MOON_PHASE)
    np.testing.assert_allclose(found[:3], stops + np.log2(surge)[:, None], atol=0.01)
