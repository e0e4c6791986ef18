"""What the likelihood takes for the shadow and for a photograph."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import geometry
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.sun import Sun
from inverse import prior
from inverse.likelihood import COLOUR_MATRIX, developed, shadow_light, shadow_of


@pytest.mark.parametrize(
    ("utc", "rms", "largest"), [("2022-05-16T04:06:00Z", 0.015, 0.055), ("2022-05-16T03:00:00Z", 0.005, 0.03)]
)
def test_table_of_one_distance_serves_the_depth_of_the_moon(utc, rms, largest):
    # In totality, and with the umbra's edge on the Moon; the nearest point, and the limb.
    where = geometry(utc)
    shadow, limb = shadow_of([where]), jnp.zeros(len(prior.ATMOSPHERE))
    table = shadow_light(shadow, limb)
    operator = eqx.filter_jit(shadow_operator)
    exact = eqx.filter_jit(lambda operator: operator(prior.atmosphere(limb))[0])
    grid, weights = shadow.tabulator.grid, shadow.tabulator.weights
    for depth in (0.0, 0.9):
        distance = jnp.linalg.norm(where.moon) - depth * MOON_RADIUS
        entries = grid.offsets_at(distance)
        offset = jnp.linspace(entries[2], entries[-3], 60)  # on entries of the table, and between
        here = operator(
            Sun(), offset[None], distance[None], jnp.linalg.norm(where.sun), shadow.tabulator.operator.wavelength
        )
        light = np.asarray(exact(here) @ weights)
        error = np.asarray(table(offset, jnp.full(offset.shape, distance))) / light - 1
        assert np.sqrt(np.mean(error**2)) < rms
        assert np.abs(error).max() < largest


def nuisances(**given):
    value = {p.name: p.value(0.0) for p in prior.PHOTOGRAPH + prior.TONE}
    return {name: jnp.asarray(given.get(name.replace(".", "_"), v)) for name, v in value.items()}


def test_a_linear_photograph_is_light_times_gain():
    light = jnp.asarray([[0.1, 0.2, 0.3]])
    out = developed(light, nuisances(gain=np.log(2.0), white_balance_red=0.0), 0.5, jnp.eye(3), "linear")
    assert np.asarray(out) == pytest.approx(2 * np.exp(0.5) * np.asarray(light))


def test_white_stays_white_and_deep_red_stays_positive():
    neutral = nuisances(tone_exponent=1.0, tone_toe=0.0, tone_shoulder=0.0, tone_saturation=1.0)
    white = np.asarray(developed(jnp.full((1, 3), 0.4), neutral, 0.0, jnp.eye(3), "srgb"))[0]
    assert white == pytest.approx(np.full(3, 0.4), rel=2e-3)
    assert COLOUR_MATRIX.sum(axis=1) == pytest.approx(1.0, abs=1e-3)
    red = lambda x: developed(jnp.asarray([[x, 0.01, 0.001]]), neutral, 0.0, jnp.eye(3), "srgb")
    assert np.all(np.asarray(red(0.5)) > 0)
    assert np.all(np.isfinite(np.asarray(jax.jacfwd(red)(0.5))))
