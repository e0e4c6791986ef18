"""The shadow as an image, read as CosmoScout VR reads it."""

import jax.numpy as jnp
import numpy as np
import pytest
import tifffile

from eclipsejax import cli
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS
from eclipsejax.errors import InputError
from eclipsejax.limb_sectors import along_limb
from eclipsejax.scattered import scattered_irradiance
from eclipsejax.scatterers import Scatterers
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.sun import Sun
from eclipsejax.sunlight import umbra_edge
from eclipsejax.texture import colours, place, shadow_texture, three_wavelengths
from tests.test_peers import ARCMIN, CosmoScoutAir, CosmoScoutSun

CHANNELS = three_wavelengths(680.0, 550.0, 440.0)


def looked_up(texture, sun, distance, offset, sun_distance):
    """Light at distances [m] and angles [rad] from the shadow's axis, both at the Earth's centre.

    As a shader finds it, from vectors between the bodies: nothing is shared with the making of the texture.
    """
    earth = np.zeros(2)
    sun_place = np.array([-sun_distance, 0.0])
    point = np.stack([distance * np.cos(offset), distance * np.sin(offset)], axis=-1)

    def direction_and_radius(body, radius):
        far = np.linalg.norm(body - point, axis=-1)
        return (body - point) / far[:, None], np.arcsin(radius / far)

    to_earth, earth_radius = direction_and_radius(earth, EARTH_RADIUS)
    to_sun, sun_radius = direction_and_radius(sun_place, float(sun.radius))
    separation = 2.0 * np.arcsin(0.5 * np.linalg.norm(to_earth - to_sun, axis=-1))
    u = sun_radius / (earth_radius + sun_radius)
    v = 1.0 - separation / (earth_radius + sun_radius)
    # Linear between texel centres, clamped at the edges.
    x, y = (np.clip(coordinate * n - 0.5, 0.0, n - 1.001) for coordinate, n in ((u, len(texture)), (v, len(texture))))
    column, row = x.astype(int), y.astype(int)
    right, down = (x - column)[:, None], (y - row)[:, None]
    upper = (1 - right) * texture[row, column] + right * texture[row, column + 1]
    lower = (1 - right) * texture[row + 1, column] + right * texture[row + 1, column + 1]
    return (1 - down) * upper + down * lower


@pytest.fixture(scope="module")
def typical():
    return shadow_texture(Atmosphere.typical(), channels=CHANNELS)


def test_light_read_from_the_texture_is_that_of_the_shadow(typical):
    random = np.random.default_rng(0)
    distance = random.uniform(3.55e8, 4.05e8, 300)
    offset = random.uniform(0.0, 0.024, 300)
    exact = shadow_irradiance(Atmosphere.typical(), offset, CHANNELS.wavelength, moon_distance=distance)
    exact = np.asarray(exact)
    read = looked_up(typical, Sun(), distance, offset, ASTRONOMICAL_UNIT)
    shadow = exact[:, 1] < 0.999
    error = np.abs(read / exact - 1.0)[shadow]
    from_edge = np.abs(offset - umbra_edge(distance, ASTRONOMICAL_UNIT, float(Sun().radius)))[shadow]
    # What remains is the linear interpolation of the layout: the umbra's edge moves by two rows a column.
    assert np.max(error[from_edge > 4 * ARCMIN]) < 0.12 and np.max(error) < 0.25
    assert np.median(error) < 1e-3


def test_texels_are_where_a_shader_looks_for_them():
    u, separation = np.meshgrid(np.linspace(0.19, 0.24, 5), np.linspace(0.05, 0.95, 5))
    distance, offset = place(jnp.asarray(u.ravel()), jnp.asarray(separation.ravel()), Sun(), ASTRONOMICAL_UNIT)
    # A texture that holds its own coordinates.
    n = 64
    v, across = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n, indexing="ij")
    coordinates = np.stack([across, v, v], axis=-1)
    read = looked_up(coordinates, Sun(), np.asarray(distance), np.asarray(offset), ASTRONOMICAL_UNIT)
    np.testing.assert_allclose(read[:, 0], u.ravel(), atol=1e-9)
    np.testing.assert_allclose(read[:, 1], 1.0 - separation.ravel(), atol=1e-9)


def test_their_model_gives_their_table(shared):
    table = np.loadtxt(shared / "reference" / "cosmoscout" / "earthShadow_384400km.csv", delimiter=",")
    inside = (table[:, 0] > 1.0) & (table[:, 0] < 40.0)
    arcmin, theirs = table[inside, 0], table[inside, 1:4]
    sun = CosmoScoutSun()
    texture = shadow_texture(
        CosmoScoutAir(), distances=(3.844e8, 3.844e8), channels=CHANNELS, sun=sun, sun_distance=1e15
    )
    ours = looked_up(texture, sun, np.full(len(arcmin), 3.844e8), arcmin * ARCMIN, 1e15)
    # Red and green: the largest differences are 0.7 %. The blue of theirs is mostly scattered light, ours is direct.
    np.testing.assert_allclose(ours[:, :2], theirs[:, :2], rtol=0.01)


def test_sunlight_is_white_and_what_air_leaves_of_it_red():
    wavelength, weights = colours(Sun())
    np.testing.assert_allclose(weights.sum(axis=0), 1.0)
    red, green, blue = np.exp(-((500.0 / wavelength) ** 4)) @ weights
    assert red > 1.2 * green > 1.2 * blue > 0.0


def test_scattered_light_is_added_on_the_axis():
    one = {"distances": (3.844e8, 3.844e8), "size": 64, "channels": CHANNELS}
    plain, glowing = (shadow_texture(Atmosphere(), **one, scatterers=given) for given in (None, Scatterers()))
    column = 64 * 55 // 256
    distance, offset = place(jnp.asarray((column + 0.5) / 64), jnp.asarray(0.5 / 64), Sun(), ASTRONOMICAL_UNIT)
    expected = scattered_irradiance(Atmosphere(), offset, CHANNELS.wavelength, moon_distance=distance)
    np.testing.assert_allclose((glowing - plain)[-1, column, 2], expected[0, 2], rtol=1e-2)


def test_air_that_differs_along_the_limb_is_refused():
    with pytest.raises(InputError, match="no angle about the axis"):
        shadow_texture(along_limb([Atmosphere()] * 4))


def test_distances_inside_the_earth_are_refused():
    with pytest.raises(InputError, match="two Earth radii"):
        shadow_texture(Atmosphere(), distances=(1e6, 4e8))


def test_the_command_writes_floats_with_the_axis_last(capsys, tmp_path):
    path = tmp_path / "shadow.tif"
    air = ["--clear", "--wavelengths", "680,550,440", "--moon-distance", "384400"]
    assert cli.main(["texture", "-o", str(path), *air]) == 0
    assert "256 x 256 texels" in capsys.readouterr().out
    texture = tifffile.imread(path)
    assert texture.shape == (256, 256, 3) and texture.dtype == np.float32
    axis, edge = texture[-1, 55], texture[0, 55]
    assert axis[0] > 10 * axis[1] > 100 * axis[2] > 0.0 and np.all((0.9 < edge) & (edge <= 1.0))
    assert cli.main(["texture", "-o", str(path), "--wavelengths", "680,550"]) == 2
    assert "R,G,B" in capsys.readouterr().err
