"""Light that the limb scatters into the umbra, in the camera's channels, as a function of the limb's parameters.

A fit cannot afford `eclipsejax.scattered` for each limb that it tries, and need not: this light is the same all over
the umbra to a few per cent, and its logarithm a curve over the dust and nearly straight in all else.
"""

from functools import cache
from importlib.resources import files

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.constants import MOON_MEAN_DISTANCE

LITTLE = 3e-7  # 1/m: of less dust than that the light is no longer a matter
TERMS = ("1", "temperature", "ozone", "top", "top^2", "cover", "cover top", "distance")


def log_scattered(value: dict, moon_distance) -> Float[Array, " channel"]:
    """Log of the light 20' from the axis, of sunlight, white on the uneclipsed Moon; `scattered.amplitude` is 1.

    To 2.5 % (rms) over limbs of the prior, 8 % for 99 of 100 of them: `inverse.tables.make_scattered_light`
    prints it, and 4 % (rms) at 40'.

    - `value`: of the limb, by the names of `prior.ATMOSPHERE`.
    - `moon_distance`: from the Earth's centre [m].
    """
    extinction, coefficients = table()
    levels = log_dust(extinction)
    dust = jnp.clip(log_dust(value["dust.extinction"]), levels[0], levels[-1])
    weights = lagrange(dust, levels)
    return jnp.einsum("l,ltc,t->c", weights, coefficients, terms(value, moon_distance))


def terms(value: dict, moon_distance) -> Float[Array, " term"]:
    """What the log of the light is straight in, in the order of `TERMS`."""
    top, cover = jnp.log(value["clouds.top"] / 7e3), value["clouds.cover"] - 0.9
    warmer, ozone = (value["air.surface_temperature"] - 285.0) / 10.0, (value["ozone.column_du"] - 300.0) / 30.0
    farther = jnp.log(moon_distance / MOON_MEAN_DISTANCE)
    return jnp.stack([jnp.ones_like(top), warmer, ozone, top, top**2, cover, cover * top, farther])


def log_dust(extinction):
    """What the log of the light is a smooth curve over."""
    return jnp.log(extinction + LITTLE)


def lagrange(x, nodes) -> Float[Array, " node"]:
    """Weights of the polynomial through values at nodes."""
    others = [jnp.delete(nodes, index) for index in range(len(nodes))]
    return jnp.stack([jnp.prod((x - o) / (node - o)) for node, o in zip(nodes, others, strict=True)])


@cache
def table() -> tuple[np.ndarray, np.ndarray]:
    """Dust [1/m] (level,) and coefficients of the terms (level, term, channel)."""
    text = (files("inverse") / "tables" / "scattered_light.csv").read_text().splitlines()
    rows = [line.split(",") for line in text if not line.startswith("#")][1:]
    values = np.array([[float(row[0]), *map(float, row[2:])] for row in rows]).reshape(-1, len(TERMS), 4)
    return values[:, 0, 0], values[..., 1:]
