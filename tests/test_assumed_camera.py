"""The light behind a photograph's values, as the camera assumed beforehand would have seen it."""

from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from inverse import prior
from inverse.assumed_camera import LEAST, response
from inverse.camera_colours import ASSUMED_MATRIX
from inverse.photo_model import developed


class OneCamera(eqx.Module):
    """What of a photograph's model its camera is."""

    gain: jnp.ndarray
    exposure_width: jnp.ndarray
    balance: jnp.ndarray
    tint_width: jnp.ndarray
    primaries: jnp.ndarray
    floor: jnp.ndarray
    colours: jnp.ndarray
    tone_curve: str = eqx.field(static=True)

    @property
    def parameters(self):
        return prior.photograph_parameters(self.tone_curve)


def camera(tone_curve="srgb"):
    return OneCamera(
        jnp.asarray(1.7), jnp.asarray(3.0), jnp.zeros(2), jnp.asarray(0.03), jnp.eye(3), jnp.asarray(0.002),
        jnp.asarray(ASSUMED_MATRIX), tone_curve,
    )  # fmt: skip


@dataclass(frozen=True)
class Seen:
    light: np.ndarray
    value: np.ndarray


@pytest.fixture(scope="module")
def seen():
    """Copper to grey cells through the assumed camera, whatever its gain."""
    one = camera()
    random = np.random.default_rng(0)
    light = random.uniform(0.2, 1.0, (60, 1)) * random.uniform(0.9, 1.1, (60, 3)) * np.array([0.4, 0.25, 0.2])
    nuisance = prior.values(one.parameters, jnp.zeros(len(one.parameters)))
    value = developed(eqx.tree_at(lambda m: m.gain, one, jnp.asarray(0.0)), jnp.asarray(light), nuisance)
    return Seen(light, np.asarray(value))


def test_the_response_is_that_of_the_light_that_made_the_values(seen):
    """Light 1 % brighter in one channel changes the log values by what the errors are multiplied with."""
    one = camera()
    nuisance = prior.values(one.parameters, jnp.zeros(len(one.parameters)))
    bare = eqx.tree_at(lambda m: m.gain, one, jnp.asarray(0.0))
    found = response(one, seen.value)
    bright = seen.light > 2 * LEAST * seen.light.max(axis=1, keepdims=True)
    assert bright.all()
    for channel, unit in enumerate(0.01 * np.eye(3)):
        high, low = (
            np.log(np.asarray(developed(bare, jnp.asarray(seen.light * np.exp(sign * unit)), nuisance)) + 0.002)
            for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(found[..., channel], (high - low) / 0.02, rtol=5e-3, atol=2e-3)


def test_colours_err_more_than_brightness_behind_a_matrix(seen):
    found = response(camera(), seen.value)
    alike = np.abs(found.sum(axis=2))
    each = np.linalg.norm(found, axis=2)
    assert np.median(each[:, 2] / alike[:, 2]) > 1.2


def test_without_a_tone_curve_light_and_value_are_the_same_but_for_the_floor(seen):
    found = response(camera("linear"), seen.value)
    np.testing.assert_allclose(found, (seen.value / (seen.value + 0.002))[..., None] * np.eye(3), rtol=1e-12)


def test_black_and_white_cells_have_a_finite_response():
    value = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, 0.3, 0.0], [-0.01, 0.02, 0.0]])
    assert np.isfinite(response(camera(), value)).all()
