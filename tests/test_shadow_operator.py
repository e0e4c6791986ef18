"""The operator against the integral that it replaces."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.shadow_operator import COUNTS, counts_for, shadow_operator
from eclipsejax.sun import Sun
from eclipsejax.traced import slopes

SUN_DISTANCE = jnp.asarray(1.5e11)
DISTANCES = jnp.asarray([3.56e8, 4.07e8])
WAVELENGTH = jnp.asarray([390.0, 450.0, 540.0, 640.0])
# Totality: the axis, both tangencies of a circle with the Sun (its radius is 15.95') and between. Partiality: the
# umbra's edge, and the penumbra's.
SUN_RADIUS = np.arcsin(6.957e8 / 1.5e11)
RANDOM = np.random.default_rng(1).uniform(0.0, 0.0093, (2, 19))
TANGENT = SUN_RADIUS * np.array([1.0, 1.0 + 1e-15, 1.0 - 1e-15])
OFFSETS = np.sort(np.stack([np.concatenate([[0.0, 1e-6], TANGENT, RANDOM[0]]), 0.006 + np.resize(RANDOM[1], 24)]))
LIMBS = {
    "clear": Atmosphere(),
    "typical": Atmosphere.typical(),
    "volcanic": Atmosphere(dust=Dust(3e-5), haze=Haze(0.2)),
    "cold": Atmosphere(air=Air(250.0, 95e3), dust=Dust(4.7e-6), clouds=Clouds(5e3, 0.9, 2e3)),
    "hot": Atmosphere(air=Air(310.0, 105e3), dust=Dust(1e-6), clouds=Clouds(12e3, 0.7, 1e3)),
}

prepared = eqx.filter_jit(shadow_operator)
applied = eqx.filter_jit(lambda operator, atmosphere: operator(atmosphere))


@eqx.filter_jit
def exact(atmosphere, offset, distance):
    return shadow_irradiance(
        atmosphere, offset, WAVELENGTH, moon_distance=distance, sun_distance=SUN_DISTANCE, tolerance=1e-6
    )


@pytest.fixture(scope="module", params=COUNTS)
def tolerance_and_operator(request):
    return request.param, prepared(Sun(), OFFSETS, DISTANCES, SUN_DISTANCE, WAVELENGTH, tolerance=request.param)


@pytest.mark.parametrize("name", LIMBS)
def test_operator_keeps_its_tolerance_at_every_point(tolerance_and_operator, name):
    tolerance, operator = tolerance_and_operator
    found = np.asarray(applied(operator, LIMBS[name]))
    for row, offset, distance in zip(found, OFFSETS, DISTANCES, strict=True):
        expected = np.asarray(exact(LIMBS[name], offset, distance))
        error = np.abs(row / expected - 1)[expected > 1e-12]
        assert error.max() < tolerance


def test_the_cheapest_setting_that_serves_is_taken():
    assert counts_for(0.5) == COUNTS[1e-2]
    assert counts_for(5e-3) == COUNTS[1e-3]
    with pytest.raises(ValueError, match="tolerance"):
        counts_for(1e-9)


def test_outside_the_penumbra_all_sunlight_is_left():
    far = prepared(Sun(), jnp.radians(jnp.asarray([[1.35, 1.4]])), DISTANCES[:1], SUN_DISTANCE, WAVELENGTH)
    np.testing.assert_allclose(applied(far, Atmosphere.typical()), 1.0, rtol=2e-5)


def changed(x):
    """A limb and its derivatives by surface temperature, pressure, dust and its top, clouds and haze."""
    return eqx.tree_at(
        lambda limb: (
            limb.air.surface_temperature,
            limb.air.surface_pressure,
            limb.dust.extinction,
            limb.dust.top,
            limb.clouds.top,
            limb.haze.optical_depth,
        ),
        Atmosphere.typical(),
        (
            288.0 + x[0],
            1e5 * (1 + 0.01 * x[1]),
            1e-6 * (1 + x[2]),
            25e3 + 100 * x[3],
            8e3 + 100 * x[4],
            0.1 + 0.1 * x[5],
        ),
    )


def test_derivatives_are_those_of_central_differences():
    operator = prepared(Sun(), OFFSETS[:1], DISTANCES[:1], SUN_DISTANCE, WAVELENGTH, tolerance=1e-4)
    light = lambda x: jnp.log(operator(changed(x))[0])
    along = jax.jit(lambda x, direction: jax.jvp(light, (x,), (direction,)))
    for unit in np.eye(6):
        value, slope = (np.asarray(part) for part in along(jnp.zeros(6), unit))
        step = 0.02 * unit
        difference = (np.asarray(along(step, unit)[0]) - np.asarray(along(-step, unit)[0])) / 0.04
        assert np.all(np.isfinite(slope))
        # The difference sees caustics cross the edges of cells; the derivative is the integral's to the tolerance.
        assert slope == pytest.approx(difference, abs=2e-3 * np.abs(difference).max())
        assert np.all(np.isfinite(value))


def test_reverse_derivatives_agree_with_forward_ones():
    operator = prepared(Sun(), OFFSETS[:1], DISTANCES[:1], SUN_DISTANCE, WAVELENGTH, tolerance=1e-2)
    total = lambda x: jnp.sum(jnp.log(operator(changed(x))))
    backward = np.asarray(jax.jit(jax.grad(total))(jnp.zeros(6)))
    forward = np.asarray(jax.jit(jax.jacfwd(total))(jnp.zeros(6)))
    np.testing.assert_allclose(backward, forward, rtol=1e-9, atol=1e-9 * np.abs(forward).max())


def test_slopes_are_those_of_the_jacobian_at_once():
    operator = prepared(Sun(), OFFSETS[:1], DISTANCES[:1], SUN_DISTANCE, WAVELENGTH, tolerance=1e-2)
    light = lambda x: jnp.log(operator(changed(x)))
    value, apart = jax.jit(lambda x: slopes(light, list(x)))(jnp.zeros(6))
    together = np.moveaxis(np.asarray(jax.jit(jax.jacfwd(light))(jnp.zeros(6))), -1, 0)
    np.testing.assert_allclose(apart, together, rtol=1e-9, atol=1e-9 * np.abs(together).max())
    np.testing.assert_allclose(value, jax.jit(light)(jnp.zeros(6)), rtol=1e-9)


def test_what_dims_has_no_derivative_of_arcs():
    """Dust's derivative must be worked out without a derivative of any ray's bending."""
    operator = prepared(Sun(), OFFSETS[:1], DISTANCES[:1], SUN_DISTANCE, WAVELENGTH, tolerance=1e-2)
    light = lambda x: operator(changed(x))

    lines = lambda index: str(jax.make_jaxpr(partial(by_one, light, index))(jnp.zeros(()))).count("\n")
    assert lines(2) < 0.8 * lines(0)  # dust, temperature


def by_one(light, index, x):
    numbers = [jnp.zeros(())] * 6
    of_one = lambda one: light([*numbers[:index], one, *numbers[index + 1 :]])
    return jax.jvp(of_one, (x,), (jnp.ones(()),))
