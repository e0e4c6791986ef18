import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from scipy.integrate import quad

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone
from eclipsejax.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS
from eclipsejax.errors import InputError
from eclipsejax.limb import bending_angle, medium, optical_depth
from eclipsejax.limb_sectors import along_limb
from eclipsejax.scattered import scattered_irradiance, sun_spread
from eclipsejax.scatterers import Scatterers, higher_orders, rayleigh_forward
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.shadow_table import tabulator
from eclipsejax.spectra import ciddor_refractivity, rayleigh_cross_section
from eclipsejax.sun import Sun
from eclipsejax.twilight import COUNTS, Counts, limb_brightness, ways
from tests import oracles, scattered_oracle
from tests.test_limb import oracle
from tests.test_peers import ARCMIN, CosmoScoutAir, CosmoScoutSun
from tests.test_shadow import darkening

ONCE = Scatterers(higher_orders=0.0)
RICH = Atmosphere(
    air=Air(293.0, 99e3),
    dust=Dust(3e-6, 14e3, 23e3),
    haze=Haze(0.2, 1.8e3),
    clouds=Clouds(6e3, 0.8, 2e3),
)
OFFSETS = np.array([0.0, 6e-3, 12e-3])
WAVELENGTHS = np.array([440.0, 600.0, 700.0])
DISTANCE = 3.844e8


def scattered(atmosphere, offset=OFFSETS, wavelength=WAVELENGTHS, scatterers=ONCE):
    """Always asked for in one shape: every new one would be compiled anew."""
    padded = np.resize(offset, OFFSETS.shape), np.resize(wavelength, WAVELENGTHS.shape)
    found = scattered_irradiance(atmosphere, *padded, scatterers=scatterers)
    return np.asarray(found)[: len(offset), : len(wavelength)]


# Against slow integration, another program, another model


@pytest.mark.parametrize(
    ("atmosphere", "wavelength", "offset"),
    [(Atmosphere(), 440.0, 0.0), (RICH, 600.0, 6e-3), (Atmosphere.typical(), 700.0, 12e-3)],
    ids=["clear", "rich", "typical"],
)
def test_scattered_light_is_that_of_marched_rays(atmosphere, wavelength, offset):
    # 0.3 to 0.5 %, about the error of the oracle's steps; 1.6 % in clear air at 700 nm, where the ground's edge shines.
    limb = oracle(atmosphere, wavelength)
    density = np.asarray(jax.vmap(atmosphere.air.profile)(jnp.arange(0.0, 130e3, 100.0)))
    depolarisation = 1.5 / float(rayleigh_forward(jnp.asarray(wavelength))) / (2 * np.pi) - 2.0

    def scattering(z, angle):
        air = limb.rayleigh * np.interp(z, np.arange(0.0, 130e3, 100.0), density)
        extinction, base, top = limb.dust
        depth, height = limb.haze
        aerosol = extinction * ((z > base) & (z < top)) + 0.95 * depth / height * np.exp(-z / height)
        return air * scattered_oracle.rayleigh(depolarisation, angle) + aerosol * scattered_oracle.henyey_greenstein(
            0.7, angle
        )

    slow = scattered_oracle.irradiance(limb, darkening(wavelength), offset, scattering, distance=DISTANCE)
    assert scattered(atmosphere, [offset], [wavelength])[0, 0] == pytest.approx(slow, rel=0.01)


@pytest.mark.parametrize("wavelength", [440.0, 700.0])
def test_limb_is_as_bright_as_that_of_sasktran2(wavelength):
    # Straight rays: it does not count that refraction spreads sunlight. Levels of 500 m: 0.1 to 0.3 %.
    pytest.importorskip("sasktran2")
    from eclipsejax.tables.make_higher_orders import DEPRESSION, limb_light

    clear = Atmosphere(air=Air(refraction=0.0), dust=None, haze=None, clouds=None)
    ours = float(brightness(clear, np.array([DEPRESSION]), np.array([wavelength]), COUNTS)[0, 0])
    tangents = np.concatenate([np.arange(0.25, 36.0, 0.75), np.arange(36.5, 70.0, 2.0)]) * 1e3
    assert limb_light(clear, wavelength, DEPRESSION, spacing=500.0, tangents=tangents) == pytest.approx(ours, rel=5e-3)


class ScatteringCosmoScoutAir(CosmoScoutAir):
    """Molecules with the depolarisation of that program; its haze, below 1.2 km, brings nothing to the blue."""

    def forward_scattering(self, altitude, wavelength):
        nodes = np.linspace(360.0, 830.0, 15)
        king = (6.0 + 3.0 * 0.0279) / (6.0 - 7.0 * 0.0279)
        square = (2.0 * ciddor_refractivity(nodes)) ** 2
        molecules = 8.0 / 3.0 * np.pi**3 * square * king / (2.68731e25 * (1e-9 * nodes) ** 4)
        forward = 1.5 / (1.0 + 0.5 * 0.0279) / (4.0 * np.pi)
        return jnp.interp(wavelength, nodes, molecules) * jnp.exp(-altitude / 8e3) * forward


def test_blue_of_the_umbra_is_that_of_cosmoscout(shared):
    # At 440 nm on the axis direct light is a third of theirs. With light scattered once we have 0.962 of theirs, with
    # higher orders up to 1.052, where they count five.
    table = np.loadtxt(shared / "reference" / "cosmoscout" / "earthShadow_384400km.csv", delimiter=",")
    inside = (table[:, 0] > 0.1) & (table[:, 0] < 30.0)
    arcmin, theirs = table[inside, 0], table[inside, 3]
    seen = {"sun": CosmoScoutSun(), "sun_distance": 1e15}
    direct = np.asarray(shadow_irradiance(ScatteringCosmoScoutAir(), arcmin * ARCMIN, [440.0], **seen))[:, 0]
    glow = scattered_irradiance(ScatteringCosmoScoutAir(), arcmin * ARCMIN, [440.0], **seen, scatterers=ONCE)
    more = float(higher_orders(Scatterers(), jnp.asarray(440.0)))
    assert direct[0] < 0.4 * theirs[0]
    np.testing.assert_allclose(direct + np.asarray(glow)[:, 0], theirs, rtol=0.045)
    np.testing.assert_allclose(direct + more * np.asarray(glow)[:, 0], theirs, rtol=0.055)


# Limits


def test_thin_straight_air_has_a_closed_form():
    # All that lies above the horizon of both Sun and Moon shines, undimmed.
    thin = Atmosphere(air=Air(refraction=0.0, scattering=1e-7), ozone=None, dust=None, haze=None, clouds=None)
    beta = np.arcsin((EARTH_RADIUS + 20e3) / DISTANCE) + np.arcsin((EARTH_RADIUS + 20e3) / ASTRONOMICAL_UNIT)

    def shell(z):
        width = 2.0 * np.arccos(EARTH_RADIUS / (EARTH_RADIUS + z)) - beta
        # The integral of cos(e) cos(beta - e) over the directions below which the ground lies.
        return density(z) * (EARTH_RADIUS + z) ** 2 * 0.5 * (np.cos(beta) * width + np.sin(width)) * (width > 0.0)

    def density(z):
        _, pressure, _, _ = oracles.standard_air(z)
        return pressure / (1.380622e-23 * oracles.standard_air(z)[0])

    total = quad(shell, 0.0, 75e3, points=[442.0, 5e3, 11e3, 20e3, 32e3], limit=200)[0]
    amount = 1e-7 * np.asarray(rayleigh_cross_section(WAVELENGTHS)) * np.asarray(rayleigh_forward(WAVELENGTHS))
    expected = 2.0 * np.pi * amount * total / DISTANCE**2 * (1.0 + DISTANCE / ASTRONOMICAL_UNIT) ** 2
    np.testing.assert_allclose(scattered(thin)[0], expected, rtol=5e-3)


def test_thin_air_scatters_in_proportion():
    def thin(amount):
        return Atmosphere(air=Air(scattering=amount), ozone=None, dust=None, haze=None, clouds=None)

    np.testing.assert_allclose(scattered(thin(2e-6)), 2.0 * scattered(thin(1e-6)), rtol=1e-4)


def test_where_nothing_scatters_there_is_no_light_and_a_slope():
    def dark(amount):
        return Atmosphere(Air(scattering=amount), Ozone(0.0), Dust(amount), Haze(amount), Clouds(0.0, 0.0, 1e3))

    assert np.all(np.abs(scattered(dark(0.0))) < 1e-18)
    light, slope = jax.jvp(lambda a: scattered_irradiance(dark(a), OFFSETS, WAVELENGTHS), (0.0,), (1.0,))
    assert np.all(np.isfinite(slope)) and np.all(np.asarray(slope) > 0.0)


def test_no_more_light_than_the_limb_removes_and_scatters_on():
    # What single scattering takes out of the beam, times the phase function and the shadow's solid angle, is a bound.
    clean = Atmosphere(ozone=None, dust=None, haze=None, clouds=None)
    z = np.linspace(0.0, 80e3, 400)
    removed = (
        2 * np.pi * np.trapezoid((EARTH_RADIUS + z) * (1.0 - np.exp(-np.asarray(optical_depth(clean, z, 440.0)))), z)
    )
    bound = removed * float(rayleigh_forward(jnp.asarray(440.0))) / DISTANCE**2
    light = scattered(clean)[0, 0]
    assert 0.05 * bound < light < bound


def test_light_grows_from_the_axis_smoothly():
    offset = np.linspace(0.0, 18e-3, 19)
    light = np.asarray(scattered_irradiance(RICH, offset, WAVELENGTHS))
    assert np.all(np.diff(light, axis=0) > 0.0)
    # Of a smooth even function, the first step is a quarter of the growth over the first two.
    growth = light[1:3] / light[0] - 1.0
    np.testing.assert_allclose(growth[1] / growth[0], 4.0, rtol=0.01)
    assert np.all(np.abs(np.diff(np.log(light), n=3, axis=0)) < 5e-5)


def test_no_cloud_lets_more_light_through():
    cloudy = eqx.tree_at(lambda a: a.clouds, RICH, Clouds(15e3, 1.0, 1e3))
    clear = eqx.tree_at(lambda a: a.clouds, RICH, Clouds(0.0, 0.0, 1e3))
    assert np.all(scattered(cloudy) < scattered(RICH))
    assert np.all(scattered(RICH) < scattered(clear))


def test_higher_orders_add_what_they_say():
    all_orders = scattered(RICH, scatterers=Scatterers())
    np.testing.assert_allclose(all_orders / scattered(RICH), [[1.116, 1.075, 1.056]] * 3, rtol=1e-6)


# Its parts


@eqx.filter_jit
def brightness(atmosphere, depression, wavelength, counts):
    return limb_brightness(atmosphere, ONCE, depression, wavelength, counts)


def test_node_counts_suffice():
    # Dust with sharp edges: 0.7 %, clear air 0.1 %.
    depression = np.radians([-0.3, 0.5, 1.0, 1.8])
    for atmosphere, error in ((Atmosphere(), 3e-3), (RICH, 1.2e-2)):
        many = brightness(atmosphere, depression, WAVELENGTHS, Counts(0.25, 24, 160, 40))
        np.testing.assert_allclose(brightness(atmosphere, depression, WAVELENGTHS, COUNTS), many, rtol=error)


def test_both_ways_from_a_point_make_one_grazing_ray():
    found = eqx.filter_jit(ways)(medium(RICH, 550.0), RICH.ray_breaks, jnp.asarray([12e3, 20e3, 30e3]), COUNTS)
    half = (found.depression.shape[1] - 1) // 2
    tangent = np.asarray(found.lowest)[:, half:]
    depth = (found.columns[:, half:] + found.columns[:, half::-1])[..., 0]
    bending = found.refraction[:, half:] + found.refraction[:, half::-1]
    np.testing.assert_allclose(depth, optical_depth(RICH, tangent, 550.0), rtol=5e-3)
    # Refraction, linear over a shell, to 1.3 %: 0.2', over which the limb's light changes by 0.1 %.
    np.testing.assert_allclose(bending, bending_angle(RICH, tangent, 550.0), rtol=1.5e-2)


def test_spread_of_a_uniform_disc_is_half_its_radius():
    assert float(sun_spread(jnp.asarray([1.0, 0, 0, 0, 0, 0]))) == pytest.approx(0.5, rel=1e-12)
    y, light = scattered_oracle.strip(darkening(440.0))
    expected = np.sqrt(np.trapezoid(y**2 * light, y))
    assert float(sun_spread(jnp.asarray(darkening(440.0)))) == pytest.approx(expected, rel=1e-4)


def test_derivatives_are_central_differences():
    flat, back = ravel_pytree(RICH)

    @jax.jit
    def light(values):
        return jnp.log(scattered_irradiance(back(values), OFFSETS, WAVELENGTHS))

    slope = jax.jit(lambda values, unit: jax.jvp(light, (values,), (unit,))[1])
    for i, unit in enumerate(jnp.eye(flat.size)):
        found = slope(flat, unit)
        step = 1e-5 * float(flat[i])
        difference = (light(flat + step * unit) - light(flat - step * unit)) / (2.0 * step)
        scale = float(jnp.max(jnp.abs(difference)))
        np.testing.assert_allclose(found, difference, rtol=1e-4, atol=1e-4 * scale, err_msg=str(i))


# A limb that differs

NORTHERN_DUST = along_limb([eqx.tree_at(lambda a: a.dust.extinction, RICH, x) for x in (9e-6, 3e-6, 3e-6, 3e-6)])


def around(atmosphere, angles):
    """At one offset and all position angles, (angle, wavelength)."""
    where = {"position_angle": np.asarray(angles), "scatterers": ONCE}
    return np.asarray(scattered_irradiance(atmosphere, np.full(len(angles), 6e-3), WAVELENGTHS, **where))


def test_the_same_air_all_around_scatters_as_the_symmetric_limb_does():
    angles = [0.0, 1.0, 4.0]
    np.testing.assert_allclose(around(along_limb([RICH] * 4), angles), around(RICH, angles), rtol=1e-12)


def test_a_limb_scatters_what_its_parts_do():
    # The mean over all position angles sees each part from everywhere: a quarter of the ring is dusty.
    angles = 2.0 * np.pi * np.arange(16) / 16
    dusty = eqx.tree_at(lambda a: a.dust.extinction, RICH, 9e-6)
    mean = around(NORTHERN_DUST, angles).mean(axis=0)
    parts = around(dusty, angles)[0], around(RICH, angles)[0]
    np.testing.assert_allclose(mean, 0.25 * parts[0] + 0.75 * parts[1], rtol=1e-9)
    assert np.abs(parts[0] / parts[1] - 1.0).min() > 0.05  # or the mean would say nothing


def test_the_dusty_side_of_the_limb_is_seen_best_from_its_own_side():
    # There the Sun stands least deep behind it; east and west are mirror images.
    north, east, south, west = around(NORTHERN_DUST, 0.5 * np.pi * np.arange(4))
    dusty = eqx.tree_at(lambda a: a.dust.extinction, RICH, 9e-6)
    nearer, farther = north - south, around(dusty, [0.0])[0] - around(RICH, [0.0])[0]
    np.testing.assert_array_equal(np.sign(nearer), np.sign(farther))
    np.testing.assert_allclose(east, west, rtol=1e-12)


def test_a_limb_that_differs_needs_a_position_angle():
    with pytest.raises(InputError, match="position_angle"):
        scattered_irradiance(NORTHERN_DUST, OFFSETS, WAVELENGTHS)


# The switch


def test_table_of_the_shadow_adds_it_where_it_is_asked_for():
    offsets, wavelength = jnp.asarray([1e-3, 10e-3]), jnp.asarray(WAVELENGTHS)
    arguments = (Sun(), jnp.asarray(3.8e8), jnp.asarray(ASTRONOMICAL_UNIT), offsets, wavelength, jnp.eye(3))

    @eqx.filter_jit
    def table(scatterers):
        return tabulator(*arguments, tolerance=1e-2, count=12, scatterers=scatterers)(RICH)

    off, on = table(None), table(Scatterers())
    light = np.exp(on.log_light) - np.exp(off.log_light)
    for side, distance in enumerate(np.asarray(on.grid.distances)):
        offset = on.grid.offsets_at(distance)
        expected = scattered_irradiance(RICH, offset, WAVELENGTHS, moon_distance=distance)
        np.testing.assert_allclose(light[:, side], expected, rtol=2e-3)
