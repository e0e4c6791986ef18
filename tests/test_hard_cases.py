"""Where formulas end, and anywhere in the prior: values and gradients that are finite and right.

One compiled program gives the light at one point in one colour and its gradient with respect to everything; whatever
is asked for here runs through it.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone
from eclipsejax.constants import ASTRONOMICAL_UNIT, ATMOSPHERE_TOP, EARTH_RADIUS, SUN_RADIUS
from eclipsejax.limb import grazing_ray, impact_parameter, medium
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.sun import Sun
from eclipsejax.traced import ascending
from inverse import prior
from tests import oracles
from tests.test_limb import oracle

TOLERANCE = 1e-3
CHUNK = 32  # cases in a run of the program
SUN = float(np.arcsin(SUN_RADIUS / ASTRONOMICAL_UNIT))
PERIGEE, APOGEE = 3.56e8, 4.07e8


class Case(NamedTuple):
    """One point in one shadow in one colour."""

    atmosphere: Atmosphere = Atmosphere.typical()
    offset: float = 0.0
    moon_distance: float = 3.844e8
    wavelength: float = 550.0
    sun_radius: float = SUN_RADIUS
    sun_distance: float = ASTRONOMICAL_UNIT


def light(case):
    return shadow_irradiance(
        case.atmosphere,
        case.offset,
        case.wavelength,
        sun=Sun(radius=case.sun_radius),
        moon_distance=case.moon_distance,
        sun_distance=case.sun_distance,
        tolerance=TOLERANCE,
    )[0, 0]


@jax.jit
def run(cases):
    return jax.lax.map(jax.value_and_grad(light), cases)


def stacked(cases):
    return jax.tree.map(lambda *leaves: np.array(leaves, dtype=float), *cases)


def lit(cases):
    """Light (case,) and gradients, a `Case` of arrays, of a list of cases or of a `Case` of arrays."""
    cases = stacked(cases) if isinstance(cases, list) else cases
    count = len(cases.offset)
    parts = []
    for start in range(0, count, CHUNK):
        chosen = np.arange(start, start + CHUNK) % count
        parts.append(jax.device_get(run(jax.tree.map(lambda leaf, chosen=chosen: np.asarray(leaf)[chosen], cases))))
    value, gradient = jax.tree.map(lambda *leaves: np.concatenate(leaves)[:count], *parts)
    return value, gradient


def assert_finite(value, gradient):
    assert np.all(np.isfinite(value))
    for leaf in jax.tree.leaves(gradient):
        assert np.all(np.isfinite(leaf)), np.flatnonzero(~np.isfinite(leaf))


def beside(x):
    """One rounding below, the number itself, one rounding above."""
    return [np.nextafter(x, -np.inf), x, np.nextafter(x, np.inf)]


DUSTY = Atmosphere(
    air=Air(293.0, 99e3), dust=Dust(3e-6, 14e3, 23e3), haze=Haze(0.2, 1.8e3), clouds=Clouds(6e3, 0.8, 2e3)
)


EDGES = np.unique(np.asarray(DUSTY.breaks))
HARD_TANGENTS = np.array([*np.ravel([beside(z) for z in EDGES]), 1e-9, 1e-3, 119.999e3, 121e3, 1e6])


@eqx.filter_jit
def rays(atmosphere, tangent):
    """(bending angle, optical depth) of each ray, and their derivative along its height and all of the atmosphere."""

    def one(atmosphere, z):
        bending, columns = grazing_ray(medium(atmosphere, 550.0), atmosphere.breaks, z)
        return jnp.stack([bending, columns[0]])

    along = jax.tree.map(jnp.ones_like, atmosphere)
    return jax.vmap(lambda z: jax.jvp(one, (atmosphere, z), (along, jnp.ones_like(z))))(tangent)


def sky_angles(tangent, distance=3.844e8):
    """psi of rays in `DUSTY` by their tangent heights, which must be among `HARD_TANGENTS`."""
    bending = np.asarray(rays(DUSTY, HARD_TANGENTS)[0])[[np.argmax(HARD_TANGENTS == z) for z in tangent], 0]
    impact = np.asarray(impact_parameter(DUSTY, tangent, 550.0))
    return np.arcsin(impact / distance) + np.arcsin(impact / ASTRONOMICAL_UNIT) - bending


# The offset


def test_at_every_tangency_light_is_finite_and_does_not_jump():
    # Where the Sun's edge passes the axis, and where it touches, from within or without, the circle of a ray that
    # grazes a break: there pieces of the integral begin and end.
    psi = sky_angles(EDGES)
    touching = np.unique(np.abs(np.concatenate([psi + SUN, psi - SUN, [0.0, SUN, 1e-12]])))
    offset = np.array([beside(x) for x in touching if x > 0.0])
    value, gradient = lit([Case(DUSTY, x) for x in np.ravel(offset)])
    assert_finite(value, gradient)
    value = value.reshape(-1, 3)
    np.testing.assert_allclose(value[:, [0, 2]], value[:, [1, 1]], rtol=1e-9)
    # Chosen among them: near the axis, in the umbra, at its edge, in the penumbra.
    chosen = [1, touching.size // 4, touching.size // 2, -2]
    limb = oracle(DUSTY, 550.0)
    darkening = np.asarray(Sun().limb_darkening_coefficients(550.0))
    expected = oracles.irradiance(limb, offset[chosen, 1], darkening, rays=150, step=0.13)
    np.testing.assert_allclose(value[chosen, 1], expected, rtol=TOLERANCE)


def test_on_the_axis_light_is_finite_and_level():
    value, gradient = lit([Case(DUSTY, x) for x in (0.0, 1e-300, 1e-12, 1e-9, 1e-7)])
    assert_finite(value, gradient)
    np.testing.assert_allclose(value, value[0], rtol=1e-6)
    assert gradient.offset[0] == 0.0


def test_beyond_the_penumbra_light_is_whole_and_answers_to_nothing():
    top = EARTH_RADIUS + ATMOSPHERE_TOP
    cases = []
    for distance in (PERIGEE, APOGEE):
        edge = np.arcsin(top / distance) + np.arcsin(top / ASTRONOMICAL_UNIT) + SUN
        cases += [Case(DUSTY, x, distance) for x in (edge + 1e-14, edge + 1e-9, edge + 1e-3, 0.1, 1.0, 1.5)]
    value, gradient = lit(cases)
    assert np.all(value == 1.0)
    assert all(np.all(leaf == 0.0) for leaf in jax.tree.leaves(gradient))
    inside, gradient = lit([Case(DUSTY, edge * (1.0 - 1e-15), APOGEE), Case(DUSTY, edge - 1e-7, APOGEE)])
    assert_finite(inside, gradient)
    np.testing.assert_allclose(inside, 1.0, atol=TOLERANCE)


# The air


@pytest.mark.parametrize("distance", [PERIGEE, APOGEE])
def test_air_that_does_not_refract_casts_the_shadow_of_straight_rays(distance):
    # Absorbing and scattering air about a ball, and then the ball alone.
    offset = np.array([9.5e-3, 11.5e-3, 12.6e-3, 14e-3, 17e-3, 20e-3])
    darkening = np.asarray(Sun().limb_darkening_coefficients(550.0))
    still = eqx.tree_at(lambda a: a.air.refraction, DUSTY, 0.0)
    value, gradient = lit([Case(still, x, distance) for x in offset])
    assert_finite(value, gradient)
    expected = oracles.irradiance(oracle(still, 550.0), offset, darkening, distance=distance, rays=150, step=0.13)
    np.testing.assert_allclose(value, expected, rtol=TOLERANCE, atol=1e-12)
    vacuum = Atmosphere(air=Air(refraction=0.0, scattering=0.0), ozone=Ozone(0.0))
    value, gradient = lit([Case(vacuum, x, distance) for x in (0.0, *offset)])
    assert_finite(value, gradient)
    assert value[0] == 0.0
    expected = [oracles.eclipsed_by_a_ball(x, darkening, distance=distance) for x in offset]
    np.testing.assert_allclose(value[1:], expected, rtol=TOLERANCE, atol=1e-9)


@pytest.mark.parametrize(("temperature", "pressure"), [(220.0, 110e3), (330.0, 80e3)])
def test_light_is_right_through_the_coldest_and_the_warmest_air(temperature, pressure):
    atmosphere = eqx.tree_at(lambda a: a.air, DUSTY, Air(temperature, pressure))
    offset, distance = np.array([0.0, 5e-3, 11.9e-3, 16e-3]), PERIGEE if temperature < 300 else APOGEE
    darkening = np.asarray(Sun().limb_darkening_coefficients(550.0))
    value, gradient = lit([Case(atmosphere, x, distance) for x in offset])
    assert_finite(value, gradient)
    expected = oracles.irradiance(oracle(atmosphere, 550.0), offset, darkening, distance=distance, rays=150, step=0.13)
    np.testing.assert_allclose(value, expected, rtol=TOLERANCE)


def test_the_ends_of_every_quantity_are_finite_and_ordered():
    airs = [Air(t, p) for t in (217.0, 220.0, 330.0, 345.0) for p in (80e3, 110e3)]
    dusts = [Dust(0.0), Dust(1e-3), Dust(1e-2, 0.0, 60e3), Dust(1e-3, 15e3, 15e3)]
    others = [
        Atmosphere(ozone=Ozone(0.0), clouds=Clouds(0.0, 1.0, 1.0)),
        Atmosphere(ozone=Ozone(2000.0), haze=Haze(100.0, 8e3)),
        Atmosphere(clouds=Clouds(30e3, 1.0, 1.0)),
        Atmosphere(haze=Haze(0.0, 100.0)),
    ]
    atmospheres = [
        *(Atmosphere(air=air, dust=dust) for air in airs for dust in dusts[:2]),
        *(Atmosphere(dust=dust) for dust in dusts),
        *others,
    ]
    offset = (0.0, 4e-3, 11.8e-3, 14e-3)
    value, gradient = lit([Case(atmosphere, x) for atmosphere in atmospheres for x in offset])
    assert_finite(value, gradient)
    assert np.all((value >= 0.0) & (value <= 1.0))
    value = value.reshape(-1, len(offset))
    clear, dusty = value[0:16:2], value[1:16:2]
    assert np.all(dusty <= clear) and np.all(dusty[:, 2:] < clear[:, 2:])
    # Optical depths in the thousands on every ray below 60 km: nothing is left in the umbra.
    assert np.all(value[18, :2] < 1e-30)


def test_derivatives_at_the_hard_points_are_those_of_differences():
    psi = sky_angles(EDGES[[0, 4]])
    points = [(0.0, PERIGEE), (SUN, APOGEE), (SUN - psi[0], 3.844e8), (SUN + psi[1], 3.844e8)]
    fields = {
        "surface_temperature": (lambda c: c.atmosphere.air.surface_temperature, 1.0),
        "surface_pressure": (lambda c: c.atmosphere.air.surface_pressure, 300.0),
        "alpha": (lambda c: c.atmosphere.dust.extinction, 2e-7),
        "dust base": (lambda c: c.atmosphere.dust.base, 50.0),
        "moon": (lambda c: c.moon_distance, 1e6),
    }
    # All of the differences at once: the program takes many cases.
    cases = [Case(DUSTY, *point) for point in points]
    steps = np.array([1.0, 0.5, 0.25])
    for field, step in fields.values():
        for h in step * np.concatenate([steps, -steps]):
            moved = [eqx.tree_at(field, Case(DUSTY, *point), replace_fn=lambda x, h=h: x + h) for point in points]
            cases += moved
    value, gradient = lit(cases)
    value = value[len(points) :].reshape(len(fields), 2, 3, len(points))
    for (name, (field, step)), (ahead, behind) in zip(fields.items(), value, strict=True):
        a, b, c = (ahead - behind) / (2.0 * step * steps[:, None])
        ab, bc = (4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0
        expected = (16.0 * bc - ab) / 15.0
        np.testing.assert_allclose(field(gradient)[: len(points)], expected, rtol=2e-3, err_msg=name)


# The Sun


def test_a_vanishing_sun_is_a_point():
    # Every ray that reaches the point, by tangent heights on a fine grid: E = T a (1/D + 1/D_s)^2 / (psi dpsi/da),
    # with the sines that make it exact.
    distance, sun_distance = 3.844e8, ASTRONOMICAL_UNIT
    atmosphere = eqx.tree_at(lambda a: a.dust.extinction, DUSTY, 0.0)
    limb = oracle(atmosphere, 550.0)
    breaks = limb.breaks()
    offset = np.array([3e-3, 9.1e-3, 13.3e-3, 16.6e-3])
    expected = np.zeros(offset.size)
    for lower, upper in zip(breaks[:-1], breaks[1:], strict=True):
        u = np.linspace(0.0, np.sqrt(upper - lower), 400)
        tangent = np.maximum(upper - u**2, lower)
        bending, depth = oracles.grazing_ray(limb, tangent, 0.13)
        impact = (oracles.RADIUS + tangent) * (1.0 + limb.air(tangent)[0])
        psi = oracles.CubicSpline(u, np.arcsin(impact / distance) + np.arcsin(impact / sun_distance) - bending)
        lift, thick = oracles.CubicSpline(u, impact - oracles.RADIUS), oracles.CubicSpline(u, depth)
        for i, here in enumerate(offset):
            for sign in (-1.0, 1.0):
                for root in psi.solve(sign * here, extrapolate=False):
                    sine = (oracles.RADIUS + lift(root)) / distance
                    ring = sine / (distance * np.sqrt(1.0 - sine**2)) * abs(lift(root, 1) / psi(root, 1))
                    transmission = np.exp(-thick(root)) * limb.transmission(upper - root**2)
                    expected[i] += ring * transmission / np.sin(here)
    apart = np.sqrt(distance**2 + sun_distance**2 + 2.0 * distance * sun_distance * np.cos(offset))
    expected *= (apart / sun_distance) ** 2
    value, gradient = lit([Case(atmosphere, x, sun_radius=1e5) for x in offset])
    assert_finite(value, gradient)
    np.testing.assert_allclose(value, expected, rtol=TOLERANCE)
    # Smaller still, and on the axis, where the light of a point has no bound.
    tiny, gradient = lit([Case(atmosphere, x, sun_radius=radius) for x in (0.0, *offset) for radius in (1e4, 1e3, 1.0)])
    assert_finite(tiny, gradient)


# Rays


def test_rays_at_all_edges_are_finite_and_right():
    value, slope = rays(DUSTY, HARD_TANGENTS)
    assert_finite(value, slope)
    above = HARD_TANGENTS > ATMOSPHERE_TOP
    assert np.all(value[above] == 0.0) and np.all(slope[above] == 0.0)
    inside = (HARD_TANGENTS >= 0.0) & (HARD_TANGENTS < ATMOSPHERE_TOP - 1.0)
    # At an edge the slow integral needs a nudge upwards: its edges are others by rounding.
    nudged = np.where(
        np.min(np.abs(HARD_TANGENTS[:, None] - EDGES), axis=1) < 1e-6, HARD_TANGENTS + 1e-6, HARD_TANGENTS
    )
    expected = np.transpose(oracles.grazing_ray(oracle(DUSTY, 550.0), nudged[inside]))
    np.testing.assert_allclose(value[inside], expected, rtol=1e-7)


def test_single_precision_keeps_the_light_to_a_part_in_fifty_thousand():
    offset = np.array([0.0, 1e-3, SUN, 8e-3, 11.9e-3, 12.5e-3, 16e-3, 21e-3, 24e-3])
    for atmosphere in (DUSTY, Atmosphere()):
        expected = lit([Case(atmosphere, x) for x in offset])[0]
        with jax.enable_x64(False):
            rounded = jax.tree.map(lambda leaf: np.asarray(leaf, dtype=np.float32), atmosphere)
            single = np.asarray(shadow_irradiance(rounded, offset, [550.0], tolerance=TOLERANCE))[:, 0]
        assert single.dtype == np.float32
        np.testing.assert_allclose(single, expected, rtol=2e-5)


# The whole prior

ABSORBERS = (
    lambda a: a.air.scattering,
    lambda a: a.ozone.column_du,
    lambda a: a.dust.extinction,
    lambda a: a.haze.optical_depth,
    lambda a: a.clouds.cover,
    lambda a: a.clouds.top,
)


def random_cases(count, seed):
    """Atmospheres from the prior of a fit, points anywhere in the shadow of any Moon, colours from violet to red."""
    generator = np.random.default_rng(seed)
    z = generator.normal(size=(count, len(prior.ATMOSPHERE)))
    uniform = generator.uniform(size=(4, count))
    return Case(
        atmosphere=jax.jit(jax.vmap(prior.atmosphere))(z),
        offset=0.026 * uniform[0],
        moon_distance=PERIGEE + (APOGEE - PERIGEE) * uniform[1],
        wavelength=380.0 + 400.0 * uniform[2],
        sun_radius=np.full(count, SUN_RADIUS),
        sun_distance=ASTRONOMICAL_UNIT * (0.983 + 0.034 * uniform[3]),
    )


@pytest.mark.parametrize(("count", "seed"), [(300, 1), pytest.param(10_000, 2, marks=pytest.mark.slow)])
def test_any_atmosphere_of_the_prior_gives_light_that_absorbers_dim(count, seed):
    cases = random_cases(count, seed)
    value, gradient = lit(cases)
    assert_finite(value, gradient)
    assert np.all((value >= 0.0) & (value <= 1.0))
    for absorber in ABSORBERS:
        # But for the last digits of light that passes above the absorber. The nodes move with the top of the clouds, so
        # that derivative has the quadrature's error: 3.5e-7 of the light at most in 10,000 draws.
        slack = TOLERANCE if absorber is ABSORBERS[-1] else 1e-12
        assert np.all(absorber(gradient.atmosphere) * absorber(cases.atmosphere) <= slack * value)


def test_much_more_absorber_is_never_brighter():
    cases = random_cases(24, 3)
    value = lit(cases)[0]
    for absorber in ABSORBERS[:4]:
        more = eqx.tree_at(lambda c, absorber=absorber: absorber(c.atmosphere), cases, replace_fn=lambda x: 1.5 * x)
        assert np.all(lit(more)[0] <= value)


@pytest.mark.parametrize("seed", [4, 5, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(6, 106))])
def test_no_light_is_lost_but_what_the_limb_keeps(seed):
    # Refraction only moves light about: what is missing from the shadow, summed over the Moon's plane, is what the
    # disc of the Earth and the air and clouds on its rim take out of the beam. (Rays are inclined: 2e-4.)
    drawn = random_cases(1, seed)
    atmosphere = jax.tree.map(lambda leaf: float(leaf[0]), drawn.atmosphere)
    distance, wavelength = np.ravel(drawn.moon_distance)[0], np.ravel(drawn.wavelength)[0]
    top = EARTH_RADIUS + ATMOSPHERE_TOP
    edge = float(np.arcsin(top / distance) + np.arcsin(top / ASTRONOMICAL_UNIT)) + SUN
    umbra = float(np.arcsin(EARTH_RADIUS / distance)) - SUN
    cuts = np.array([0.0, 0.85 * umbra, umbra, 1.2 * umbra, edge])
    node, weight = np.polynomial.legendre.leggauss(CHUNK // 4)
    offset = cuts[:-1, None] + np.diff(cuts)[:, None] * 0.5 * (node + 1.0)
    measure = 2.0 * np.pi * distance**2 * np.sin(offset) * 0.5 * np.diff(cuts)[:, None] * weight
    found = lit([Case(atmosphere, x, distance, wavelength) for x in np.ravel(offset)])[0]
    missing = np.sum(np.ravel(measure) * (1.0 - found))
    limb = oracle(
        Atmosphere(*(getattr(atmosphere, name) for name in ("air", "ozone", "dust", "haze", "clouds"))), wavelength
    )
    z = np.unique(np.concatenate([np.linspace(0.0, 120e3, 2000), limb.breaks()]))
    impact = (oracles.RADIUS + z) * (1.0 + limb.air(z)[0])
    blocked = 1.0 - np.exp(-oracles.grazing_ray(limb, z, 0.13)[1]) * limb.transmission(z)
    taken = np.pi * impact[0] ** 2 + 2.0 * np.pi * np.trapezoid(impact * blocked, impact)
    widened = (distance + oracles.AU) / oracles.AU  # the beam of one point of the Sun diverges
    assert missing == pytest.approx(taken * widened**2, rel=3e-4)


def test_numbers_are_put_in_order_with_their_derivatives():
    x = jnp.asarray([3.0, -1.0, 2.0, 2.0, 7.0])
    np.testing.assert_array_equal(ascending(x), [-1.0, 2.0, 2.0, 3.0, 7.0])
    np.testing.assert_array_equal(jax.jacobian(ascending)(x), np.eye(5)[[1, 2, 3, 0, 4]])
    assert jnp.isnan(ascending(x.at[4].set(jnp.nan))[0])
