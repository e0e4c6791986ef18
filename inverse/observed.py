"""What a photograph says of the log values of its cells: their size, or only a limit to it.

A cell that is overexposed is at least as bright as the brightest value the file holds, one that is black at most as
bright as the darkest. Such a limit is censored data (Tobin 1958): with Phi the normal distribution and u the log value
above the limit, in errors, it adds -2 log Phi(u) to the cost. Next to nothing where the model keeps it, and the square
of the misfit where the model breaks it.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Float, Int

from inverse import error_modes, noise
from inverse.cells import CELLS_PER_RADIUS

LEAST_ERROR = noise.RELIEF  # of the model where it meets a limit
# Its errors are the same for neighbours: all cells within a correlation length know of a limit as much as one does.
SHARE = (1.0 / CELLS_PER_RADIUS / error_modes.LENGTH) ** 2
KEPT = 8.0  # errors: from here on a limit is kept, to the last digit


class Observed(eqx.Module):
    """Of one photograph or profile, in log value above its floor.

    - `value`: measured, or the limit (datum,).
    - `measured`: 1 where it counts as a measurement, else 0 (datum,).
    - `limit`: 1 where it is a lower limit, -1 where an upper one, else 0 (datum,).
    - `error`: standard deviation of the model's error, which counts where there is a limit (datum,).
    - `excess`: its mean (datum,).
    - `limited`: numbers of those that have a limit; and one that no datum has, up to a power of two (limited,).
    """

    value: Float[Array, " datum"]
    measured: Float[Array, " datum"]
    limit: Float[Array, " datum"]
    error: Float[Array, " datum"]
    excess: Float[Array, " datum"]
    limited: Int[Array, " limited"]

    def misfit(self, predicted: Float[Array, " datum"]) -> Float[Array, " datum"]:
        """Data minus model, 0 where nothing is known, and roots of what limits cost where they are broken (datum,)."""
        missed = self.value - self.excess - predicted
        at = jnp.minimum(self.limited, self.limit.size - 1)  # of them alone: what a limit costs takes long to work out
        above = jnp.minimum(-self.limit[at] * missed[at] / self.error[at], KEPT)
        broken = self.limit[at] * jnp.sqrt(-2.0 * SHARE * log_ndtr(above))
        return (self.measured * missed).at[self.limited].set(broken, mode="drop")

    def with_error(self, error: np.ndarray, excess: np.ndarray | float = 0.0) -> "Observed":
        """The same with another `error` (datum,), or as much as there is at least, and `excess` (datum,)."""
        every = np.ones(self.value.shape)
        found = tuple(jnp.asarray(value * every) for value in (np.maximum(error, LEAST_ERROR), excess))
        return eqx.tree_at(lambda data: (data.error, data.excess), self, found)


def observed(value: np.ndarray, usable: np.ndarray, limit: np.ndarray, error: np.ndarray) -> Observed:
    """From log values (cell, 3), of which `usable` are measured and `limit` say what else is known (cell, 3).

    - `error`: as of `Observed`.
    """
    known = (jnp.asarray(array.ravel(), dtype=float) for array in (value, usable, limit))
    none = jnp.zeros(value.size)
    limited = np.flatnonzero(limit)
    # Each size is compiled anew, and so there are few.
    room = min(1 << (max(limited.size, 1) - 1).bit_length(), value.size)
    limited = np.pad(limited, (0, room - limited.size), constant_values=value.size)
    return Observed(*known, error=none, excess=none, limited=jnp.asarray(limited)).with_error(error)
