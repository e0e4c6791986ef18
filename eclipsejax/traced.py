"""How a number becomes a field of a module, and square roots that can be differentiated at zero."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def real(x) -> Array:
    """A number as an array of the working precision.

    Without it a Python float in a field is static: every value compiles anew and its gradient is `None`.
    """
    return jnp.asarray(x, dtype=float)


def safe_sqrt(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Square root, 0 with gradient 0 for x <= 0 (a single `where` would give the gradient NaN there)."""
    positive = x > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), 0.0)
