"""What a photograph's values say of the light, were its camera the one assumed beforehand.

How errors of the light become errors of values hangs on the camera: its contrast, and how much of the red its matrix
takes from the blue. While that is being fitted it cannot hang on the camera that is fitted: an end where errors are
large makes every misfit small, and the determinant that should pay for it counts thousands of cells whose errors are
known to no better than a fifth. So a fit begins with those that the camera at the middle of its prior makes of the
photograph as it is, and then takes those of the best end (`Likelihood.carried`).
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from inverse import prior
from inverse.photo_model import colour_matrix, developed, slopes_by_light

BRIGHTEST = 0.98  # full scale: beyond, the curve is too flat to be followed backwards
LEAST = 0.03  # of the brightest channel: of what a matrix makes less, it made an unknown amount
RAMP = np.geomspace(1e-7, 4.0, 4000)


def response(model, value: np.ndarray) -> np.ndarray:
    """Change of the log values of cells by the log light of each channel (cell, value, light).

    - `model`: a `PhotoModel` or `ProfileModel`; `value`: decoded (cell, 3) [full scale].
    """
    camera = eqx.tree_at(lambda model: model.gain, model, jnp.zeros_like(model.gain))
    return np.asarray(_slopes(camera, jnp.asarray(_light(camera, value))))


def _light(camera, value: np.ndarray) -> np.ndarray:
    """Light of which this camera makes values, both (cell, 3)."""
    if camera.tone_curve == "linear":
        return np.maximum(value, RAMP[0])
    curve, matrix = map(np.asarray, _curve_and_matrix(camera))
    mixed = [np.interp(np.minimum(value[:, channel], BRIGHTEST), curve[:, channel], RAMP) for channel in range(3)]
    light = np.linalg.solve(matrix, np.array(mixed)).T
    return np.maximum(light, LEAST * light.max(axis=1, keepdims=True))


@eqx.filter_jit
def _curve_and_matrix(camera):
    """Values of white light as bright as `RAMP` (step, 3), and what a camera mixes its channels by (3, 3)."""
    nuisance = _middle(camera)
    values = developed(camera, jnp.asarray(RAMP)[:, None] * jnp.ones(3), nuisance)
    return values, camera.primaries @ colour_matrix(camera.colours, nuisance)


@eqx.filter_jit
def _slopes(camera, light):
    return slopes_by_light(camera, light, _middle(camera))


def _middle(camera):
    return prior.values(camera.parameters, jnp.zeros(len(camera.parameters)))
