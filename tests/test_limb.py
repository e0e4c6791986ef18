import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import k0e, k1e

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.limb import bending_angle, grazing_ray, impact_parameter, medium, optical_depth
from eclipsejax.spectra import ciddor_refractivity, ozone_cross_section, rayleigh_cross_section
from tests import oracles

ARCMIN = np.pi / 180 / 60


def dusty(**changed) -> Atmosphere:
    """An atmosphere with something of everything."""
    parts = {
        "air": Air(surface_temperature=293.0, surface_pressure=99e3),
        "dust": Dust(extinction=3e-6, base=14e3, top=23e3),
        "haze": Haze(optical_depth=0.2, scale_height=1.8e3),
        "clouds": Clouds(top=6e3, cover=0.8, width=2e3),
    }
    return Atmosphere(**(parts | changed))


def oracle(atmosphere, wavelength) -> oracles.Limb:
    """The same limb for the slow integrals."""
    haze = atmosphere.haze
    return oracles.Limb(
        refractivity=float(ciddor_refractivity(wavelength) * atmosphere.air.refraction),
        rayleigh=float(rayleigh_cross_section(wavelength) * atmosphere.air.scattering),
        ozone=float(ozone_cross_section(wavelength)),
        surface_temperature=float(atmosphere.air.surface_temperature),
        surface_pressure=float(atmosphere.air.surface_pressure),
        column_du=float(atmosphere.ozone.column_du),
        dust=tuple(float(x) for x in (atmosphere.dust.extinction, atmosphere.dust.base, atmosphere.dust.top)),
        haze=(float(haze.optical_depth * haze.coefficient(wavelength)), float(haze.scale_height)),
        clouds=tuple(float(x) for x in jax.tree.leaves(atmosphere.clouds)),
    )


BREAKS = np.asarray(dusty().breaks)[1:-2]
# All tests ask for rays in this one shape: each new one would be compiled anew.
TANGENTS = np.concatenate([[0.0, 1.0, 3e3, 9e3, 17e3, 30e3, 55e3, 80e3], BREAKS - 0.01, BREAKS, BREAKS + 0.01])


def rays(atmosphere, tangent=TANGENTS, wavelength=550.0):
    """Bending angle and optical depth, (2, tangent)."""
    padded = np.resize(tangent, TANGENTS.shape)
    values = [quantity(atmosphere, padded, wavelength) for quantity in (bending_angle, optical_depth)]
    return np.array(values)[:, : len(tangent)]


def test_grazing_ray_at_the_ground_is_bent_by_66_arcminutes():
    assert rays(Atmosphere())[0, 0] / ARCMIN == pytest.approx(66.0226, rel=1e-3)


def test_bending_is_that_of_the_reference(shared):
    table = np.genfromtxt(shared / "reference" / "bending.csv", delimiter=",", skip_header=2, names=True)
    tangent = 1e3 * table["z_tangent_km"]
    for wavelength in (400.0, 450.0, 550.0, 650.0, 700.0):
        bending = rays(Atmosphere(), tangent, wavelength)[0] / ARCMIN
        np.testing.assert_allclose(bending, table[f"bend{wavelength:.0f}_arcmin"], rtol=2e-5, atol=2e-5)
    lift = impact_parameter(Atmosphere(), tangent, 550.0) - EARTH_RADIUS - tangent
    np.testing.assert_allclose(lift, table["b_minus_r_m_550"], rtol=2e-4, atol=0.01)


@pytest.mark.parametrize("temperature", [250.0, 288.15, 310.0])
def test_rays_are_those_of_another_quadrature(temperature):
    # Everywhere, at every break and a centimetre on either side of it, from violet to red. (At a break itself the
    # other quadrature needs a nudge upwards, where the rays are smooth: its break is another by rounding.)
    atmosphere = dusty(air=Air(surface_temperature=temperature, surface_pressure=99e3))
    breaks = np.asarray(atmosphere.breaks)[1:-2]
    tangent = np.concatenate([TANGENTS[:8], breaks - 0.01, breaks, breaks + 0.01])
    nudged = np.where(np.isin(tangent, breaks), tangent + 1e-6, tangent)
    for wavelength in (380.0, 550.0, 780.0):
        expected = oracles.grazing_ray(oracle(atmosphere, wavelength), nudged)
        np.testing.assert_allclose(rays(atmosphere, tangent, wavelength), expected, rtol=1e-9)


@pytest.mark.parametrize("tangent", [0.0, 11018.0, 20e3])
def test_the_other_quadrature_is_right_too(tangent):
    # Adaptive Gauss-Kronrod (QUADPACK) of the textbook integral in t = sqrt(r - r_t), panel by panel.
    limb = oracle(dusty(), 550.0)
    grazed, slope_there = (float(x) for x in limb.air(np.array(tangent)))
    impact = (oracles.RADIUS + tangent) * (1.0 + grazed)

    def integrands(t):
        z = tangent + t**2
        refractivity, slope = (float(x) for x in limb.air(np.array(z)))
        difference = refractivity - grazed if t > 0.05 else slope_there * t**2
        excess = t**2 * (1.0 + refractivity) + (oracles.RADIUS + tangent) * difference
        measure = 2.0 / np.sqrt(excess / t**2 * (excess + 2.0 * impact)) if t > 0 else 0.0
        return -2.0 * impact * measure * slope / (1.0 + refractivity), 2.0 * measure * (oracles.RADIUS + z) * (
            1.0 + refractivity
        ) * float(limb.extinction(np.array(z)))

    ends = np.sqrt(np.maximum(limb.breaks() - tangent, 0.0))
    panels = [(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True) if b > a]
    expected = [
        sum(quad(lambda t: integrands(t)[i], a, b, epsabs=0.0, epsrel=1e-11, limit=200)[0] for a, b in panels)  # noqa: B023
        for i in range(2)
    ]
    np.testing.assert_allclose(np.ravel(oracles.grazing_ray(limb, [tangent])), expected, rtol=1e-9)


class Shells(eqx.Module):
    """Uniform shells with one refractivity, and everything that a user's own atmosphere needs."""

    index: jax.Array
    breaks: jax.Array
    amounts: jax.Array

    def refractivity(self, altitude, wavelength):
        return jnp.full_like(altitude, self.index)

    def extinction(self, altitude, wavelength):
        return self.amounts[jnp.sum(altitude >= self.breaks[1:-1])] * 500.0 / wavelength

    def limb_transmission(self, tangent_height):
        return jnp.ones_like(tangent_height)


@pytest.mark.parametrize("index", [0.0, 1e-3])
def test_rays_in_uniform_shells_are_straight_chords(index):
    # A medium of one index everywhere cannot bend; chords of concentric circles are square roots.
    edges, amounts = np.array([0.0, 10e3, 30e3, 100e3]), np.array([1e-5, 3e-6, 1e-7])
    tangent = np.array([0.0, 5e3, 9999.0, 20e3, 60e3])
    radii = EARTH_RADIUS + np.maximum(edges, tangent[:, None])
    half_chords = np.sqrt(radii**2 - (EARTH_RADIUS + tangent[:, None]) ** 2)
    bending, depth = rays(Shells(jnp.asarray(index), jnp.asarray(edges), jnp.asarray(amounts)), tangent, 500.0)
    np.testing.assert_allclose(bending, 0.0, atol=1e-18)
    np.testing.assert_allclose(depth, 2.0 * np.diff(half_chords, axis=1) @ amounts, rtol=1e-11)


def test_air_that_does_not_refract_lets_light_go_straight():
    still = {"air": Air(refraction=0.0)}
    bending, with_dust = rays(dusty(**still, dust=Dust(extinction=1e-5)))
    assert np.all(bending == 0.0)
    grazed = np.maximum(EARTH_RADIUS + np.array([[15e3], [25e3]]), EARTH_RADIUS + TANGENTS)
    chords = np.sqrt(grazed**2 - (EARTH_RADIUS + TANGENTS) ** 2)
    dust = with_dust - rays(dusty(**still, dust=Dust()))[1]
    np.testing.assert_allclose(dust, 2e-5 * (chords[1] - chords[0]), rtol=1e-9, atol=1e-10)


class Exponential(eqx.Module):
    """Isothermal air under constant gravity."""

    height: jax.Array
    index: jax.Array

    @property
    def breaks(self):
        return jnp.asarray([0.0, 1.5, 4.0, 8.0, 16.0, 32.0]) * self.height

    def refractivity(self, altitude, wavelength):
        return self.index * jnp.exp(-altitude / self.height)

    def extinction(self, altitude, wavelength):
        return 1e-5 * jnp.exp(-altitude / self.height)

    def limb_transmission(self, tangent_height):
        return jnp.ones_like(tangent_height)


@pytest.mark.parametrize("height", [500.0, 8e3, 60e3])
def test_isothermal_air_has_bessel_functions_for_rays(height):
    # With straight rays, x = R / H: column 2 k R e^x K1(x), bending 2 N x e^x K0(x), as the refraction vanishes.
    x = EARTH_RADIUS / height
    bending, depth = rays(Exponential(jnp.asarray(height), jnp.asarray(1e-11)), np.array([0.0]))
    assert depth[0] == pytest.approx(2e-5 * EARTH_RADIUS * k1e(x), rel=1e-7)
    assert bending[0] == pytest.approx(2e-11 * x * k0e(x), rel=1e-7)
    # The first term of which is the textbook's sqrt(2 pi R H) and sqrt(2 pi R / H).
    assert depth[0] == pytest.approx(1e-5 * np.sqrt(2.0 * np.pi * EARTH_RADIUS * height), rel=0.5 / x)


class Foreign:
    """The built-in atmosphere without the product form that the package could exploit."""

    def __init__(self, atmosphere):
        self.refractivity = atmosphere.refractivity
        self.extinction = atmosphere.extinction
        self.limb_transmission = atmosphere.limb_transmission
        self.breaks = atmosphere.breaks


def test_any_object_with_the_four_names_serves_as_an_atmosphere():
    np.testing.assert_allclose(rays(Foreign(dusty())), rays(dusty()), rtol=1e-9, atol=1e-15)


def test_tangent_height_and_wavelength_broadcast():
    atmosphere = Shells(jnp.asarray(1e-3), jnp.asarray([0.0, 9e3]), jnp.asarray([1e-5]))
    table = optical_depth(atmosphere, np.array([0.0, 4e3, 8e3])[:, None], np.array([400.0, 700.0]))
    assert table.shape == (3, 2)
    np.testing.assert_allclose(table[:, 0] / table[:, 1], 700.0 / 400.0)
    assert optical_depth(atmosphere, 4e3, 400.0) == pytest.approx(float(table[1, 0]), rel=1e-13)


def test_single_precision_is_good_to_a_part_in_three_thousand():
    # Worst just below a break, where altitudes a centimetre apart are hardly distinct.
    double = rays(dusty())
    with jax.enable_x64(False):
        single = rays(dusty(), TANGENTS.astype(np.float32))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, double, rtol=3e-4)


# Derivatives

FIELDS = {  # a step of each in its own unit, small enough for the sixth order and large enough for the rounding
    "air.surface_temperature": 2.0,
    "air.surface_pressure": 1e3,
    "air.refraction": 0.05,
    "air.scattering": 0.1,
    "ozone.column_du": 30.0,
    "dust.extinction": 3e-7,
    "dust.base": 60.0,
    "dust.top": 60.0,
    "haze.optical_depth": 0.03,
    "haze.scale_height": 60.0,
    "haze.angstrom": 0.1,
}


def field(name):
    part, leaf = name.split(".")
    return lambda atmosphere: getattr(getattr(atmosphere, part), leaf)


def changed(atmosphere, values):
    """The atmosphere with other values in `FIELDS`."""
    return eqx.tree_at(lambda a: [field(name)(a) for name in FIELDS], atmosphere, list(values))


SLOPE_TANGENTS = np.array([0.0, 4e3, 10.5e3, 13e3, 18e3, 30e3, 55e3])


def both(atmosphere, values, lift):
    """(bending angle, optical depth) at `SLOPE_TANGENTS`, raised by `lift`."""

    def one(tangent):
        here = changed(atmosphere, values)
        bending, columns = grazing_ray(medium(here, 450.0), here.breaks, tangent)
        return jnp.stack([bending, columns[0]])

    return jax.vmap(one, out_axes=1)(SLOPE_TANGENTS + lift)


@eqx.filter_jit
def pushed(atmosphere, point, direction):
    """Values, and their derivative along a direction in (values, lift): one program for all derivatives."""
    return jax.jvp(lambda values, lift: both(atmosphere, values, lift), point, direction)


def field_values(atmosphere):
    return np.array([float(field(name)(atmosphere)) for name in FIELDS])


def test_rays_have_the_derivatives_that_differences_show():
    atmosphere = dusty()
    start, lift = field_values(atmosphere), np.full(SLOPE_TANGENTS.shape, 20.0)
    still = np.zeros(start.shape), np.zeros(lift.shape)
    size = np.abs(pushed(atmosphere, (start, lift), still)[0])
    for i, (name, step) in enumerate(FIELDS.items()):
        unit = np.eye(start.size)[i]
        found = pushed(atmosphere, (start, lift), (unit, still[1]))[1]
        moved = lambda h, unit=unit: np.asarray(pushed(atmosphere, (start + h * unit, lift), still)[0])
        expected = oracles.derivative(moved, 0.0, step)
        # Relative to the derivative, but not to one that is a thousandth of what the field could do.
        error = np.abs(found - expected) / (np.abs(expected) + 1e-3 * size / abs(start[i]))
        assert np.max(error) < 1e-6, name
    found = pushed(atmosphere, (start, lift), (still[0], np.ones(lift.shape)))[1]
    moved = lambda h: np.asarray(pushed(atmosphere, (start, lift + h), still)[0])
    np.testing.assert_allclose(found, oracles.derivative(moved, 0.0, 15.0), rtol=1e-6)


@pytest.mark.parametrize("name", ["on the breaks", "nothing of anything", "above the top"])
def test_derivatives_are_finite_where_something_ends(name):
    atmosphere, lift = dusty(), np.zeros(SLOPE_TANGENTS.shape)
    if name == "on the breaks":
        lift = np.array([*atmosphere.breaks[1:7], 0.0]) - SLOPE_TANGENTS
    elif name == "above the top":
        lift = np.linspace(120e3, 200e3, SLOPE_TANGENTS.size) - SLOPE_TANGENTS
    else:
        atmosphere = dusty(dust=Dust(base=15e3, top=15e3), haze=Haze(), ozone=Ozone(column_du=0.0))
    start = field_values(atmosphere)
    for unit in np.eye(start.size):
        values, slope = pushed(atmosphere, (start, lift), (unit, np.ones(lift.shape)))
        assert np.all(np.isfinite(values)) and np.all(np.isfinite(slope))
        assert name != "above the top" or np.all(values == 0.0)


def test_more_of_anything_never_makes_the_air_clearer():
    depth = rays(dusty())[1]
    for more in (
        dusty(dust=Dust(extinction=6e-6, base=14e3, top=23e3)),
        dusty(haze=Haze(optical_depth=0.4, scale_height=1.8e3)),
        dusty(ozone=Ozone(column_du=500.0)),
        dusty(air=Air(surface_temperature=293.0, surface_pressure=99e3, scattering=1.5)),
    ):
        assert np.all(rays(more)[1] >= depth)
