"""How a number becomes a field of a module, a short sort, and square roots that can be differentiated at zero."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def real(x) -> Array:
    """A number as an array of the working precision.

    Without it a Python float in a field is static: every value compiles anew and its gradient is `None`.
    """
    return jnp.asarray(x, dtype=float)


def ascending(x: Float[Array, " number"]) -> Float[Array, " number"]:
    """Up to some thousand numbers in ascending order; if one is not a number, the first of the result is not.

    By counting how many are smaller, and not by `jnp.sort`: XLA cannot write every program that sorts to disk
    ("`LessThan` is not serializable"), and neither JAX's cache nor `programs` could keep it.
    """
    index = np.arange(x.size)
    before = (x[None, :] < x[:, None]) | ((x[None, :] == x[:, None]) & (index[None, :] < index[:, None]))
    place = jnp.sum(before, axis=1)
    return jnp.sum(jnp.where(place[None, :] == index[:, None], x[None, :], 0.0), axis=1)


def safe_sqrt(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Square root, 0 with gradient 0 for x <= 0 (a single `where` would give the gradient NaN there)."""
    positive = x > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), 0.0)
