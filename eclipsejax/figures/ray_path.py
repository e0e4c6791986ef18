"""The path of a ray through any medium in a plane, by the steps of the paper."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.march import GRADIENT_SPAN, stepped


def ray_path(index, position, momentum, step: float, count: int, span: float = GRADIENT_SPAN) -> np.ndarray:
    """Positions along a ray, (count + 1, 2) [m].

    - `index`: function of a position (2,) [m]: refractive index [-]. A plain function, or an `eqx.Partial` of one.
    - `position`: where it starts, (2,) [m].
    - `momentum`: n times its direction there, (2,).
    - `step`, `span`: as in `march.stepped` [m].
    """
    start, direction = jnp.asarray(position, dtype=float), jnp.asarray(momentum, dtype=float)
    path = _path(index, start, direction, jnp.asarray(step), jnp.asarray(span), count)
    return np.concatenate([np.asarray(start)[None], np.asarray(path)])


@eqx.filter_jit
def _path(index, position, momentum, step, span, count):
    def onward(state, _):
        state = stepped(index, state[0], state[1], step, span)
        return state, state[0]

    return jax.lax.scan(onward, (position, momentum), length=count)[1]
