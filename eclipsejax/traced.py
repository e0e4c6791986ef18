"""How a number becomes a field of a module, a short sort, roots that can be differentiated at zero, and derivatives."""

from collections.abc import Callable, Sequence

import jax
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


@jax.custom_jvp
def derivative_only(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Zero, with the derivatives of x."""
    return jnp.zeros_like(x)


@derivative_only.defjvp
def _(primals, tangents):
    return jnp.zeros_like(primals[0]), tangents[0]


def slopes(
    function: Callable, numbers: Sequence[Float[Array, ""]], together: Sequence[int] = ()
) -> tuple[Array, Float[Array, "number ..."]]:
    """Value of a function of several numbers, and its derivatives by each.

    Each by itself, so that what a number does not touch is not worked out for it: dust dims light but bends no ray.
    The function must take the numbers apart, not in an array, where they could not be told from one another.

    - `together`: which of the numbers touch the same, and are compiled as one.
    """

    def by(group):
        these = lambda *new: function([dict(zip(group, new, strict=True)).get(i, x) for i, x in enumerate(numbers)])
        along = lambda *moves: jax.jvp(these, tuple(numbers[i] for i in group), moves)
        return jax.vmap(along, out_axes=(None, 0))(*jnp.eye(len(group), dtype=jnp.result_type(*numbers)))

    groups = [[index] for index in range(len(numbers)) if index not in together] + [list(together)] * bool(together)
    values, derivatives = zip(*map(by, groups), strict=True)
    order = np.argsort(np.concatenate(groups))
    return values[0], jnp.concatenate(derivatives)[order]
