"""The path of a ray through any medium in a plane, by the steps of the paper."""

import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.march import GRADIENT_SPAN, stepped


def ray_path(index, position, momentum, step: float, count: int, span: float = GRADIENT_SPAN) -> np.ndarray:
    """Positions along a ray, (count + 1, 2) [m].

    - `index`: function of a position (2,) [m]: refractive index [-].
    - `position`: where it starts, (2,) [m].
    - `momentum`: n times its direction there, (2,).
    - `step`, `span`: as in `march.stepped` [m].
    """

    def onward(state, _):
        state = stepped(index, state[0], state[1], step, span)
        return state, state[0]

    start = jnp.asarray(position, dtype=float), jnp.asarray(momentum, dtype=float)
    path = jax.lax.scan(onward, start, length=count)[1]
    return np.concatenate([np.asarray(start[0])[None], np.asarray(path)])
