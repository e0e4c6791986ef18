"""The operator of a fit against the integral it replaces."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.sun import Sun

OFFSET = jnp.asarray(np.radians([0.05, 0.2, 0.35, 0.5, 0.6, 0.66, 0.72, 0.9, 1.15]))
WAVELENGTH = jnp.asarray([450.0, 540.0, 640.0])
DISTANCE, SUN_DISTANCE = jnp.full(OFFSET.shape, 3.7e8), jnp.asarray(1.5e11)
LIMBS = {
    "clear": Atmosphere(haze=None, clouds=None),
    "typical": Atmosphere.typical(),
    "volcanic": Atmosphere(dust=Dust(1e-5), haze=Haze(0.2), clouds=Clouds(5e3, 0.9, 3e3)),
}


@pytest.fixture(scope="module")
def operator():
    return eqx.filter_jit(shadow_operator)(Sun(), OFFSET, DISTANCE, SUN_DISTANCE, WAVELENGTH)


@pytest.mark.parametrize("name", LIMBS)
def test_operator_agrees_with_the_integral(operator, name):
    exact = np.asarray(
        eqx.filter_jit(shadow_irradiance)(
            LIMBS[name], OFFSET, WAVELENGTH, moon_distance=DISTANCE, sun_distance=SUN_DISTANCE, tolerance=1e-3
        )
    )
    error = np.abs(np.asarray(eqx.filter_jit(operator)(LIMBS[name])) / exact - 1)
    assert np.median(error) < 2e-3
    assert error[exact > 1e-6].max() < 2e-2
    assert error.max() < 3e-2  # the blue near the axis, 1e-8 of sunlight


def test_operator_is_exactly_one_outside_the_penumbra_to_a_millionth(operator):
    far = eqx.filter_jit(shadow_operator)(Sun(), jnp.asarray([np.radians(1.4)]), DISTANCE[:1], SUN_DISTANCE, WAVELENGTH)
    assert np.asarray(eqx.filter_jit(far)(Atmosphere())) == pytest.approx(1.0, abs=1e-5)


def test_derivatives_are_those_of_central_differences(operator):
    def light(x):
        limb = eqx.tree_at(
            lambda limb: (limb.air.surface_temperature, limb.dust.extinction, limb.clouds.top),
            Atmosphere.typical(),
            (288.0 + x[0], 1e-6 * (1 + x[1]), 8e3 + 100 * x[2]),
        )
        return jnp.log(operator(limb))

    slopes = np.asarray(jax.jit(jax.jacfwd(light))(jnp.zeros(3)))
    assert np.all(np.isfinite(slopes))
    step, compiled = 0.02, jax.jit(light)
    for index in range(3):
        e = np.eye(3)[index] * step
        difference = (np.asarray(compiled(e)) - np.asarray(compiled(-e))) / (2 * step)
        assert slopes[..., index] == pytest.approx(difference, abs=2e-3 * np.abs(difference).max())
