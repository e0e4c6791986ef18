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
from jaxtyping import Array, Float

from inverse import noise
from inverse.cells import CELLS_PER_RADIUS

# Relative error of the model where it meets a limit: on the disc, and of the sky beside it.
ERROR_ON_DISC = float(np.hypot(noise.COMMON, noise.CHROMATIC))
ERROR_OF_SKY = noise.SKY
# These errors are the same for neighbours: all cells within a correlation length know of a limit as much as one does.
SHARE = (1.0 / CELLS_PER_RADIUS / noise.LENGTH) ** 2
KEPT = 8.0  # errors: from here on a limit is kept, to the last digit


class Observed(eqx.Module):
    """Of one photograph or profile, in log value above its floor.

    - `value`: measured, or the limit (datum,).
    - `measured`: 1 where it counts as a measurement, else 0 (datum,).
    - `limit`: 1 where it is a lower limit, -1 where an upper one, else 0 (datum,).
    - `error`: standard deviation of the model's error where there is a limit (datum,).
    """

    value: Float[Array, " datum"]
    measured: Float[Array, " datum"]
    limit: Float[Array, " datum"]
    error: Float[Array, " datum"]

    def misfit(self, predicted: Float[Array, " datum"]) -> Float[Array, " datum"]:
        """Data minus model (datum,), and 0 where nothing is known; as large as they cost where there are limits.

        To be divided by `noise`'s sigma for limits, whose square is `error`^2 / `SHARE`.
        """
        missed = self.value - predicted
        above = jnp.minimum(-self.limit * missed / self.error, KEPT)
        broken = self.limit * self.error * jnp.sqrt(-2.0 * log_ndtr(above))
        return jnp.where(self.limit == 0, self.measured * missed, broken)

    @property
    def sigma(self) -> np.ndarray:
        """What misfits at limits are to be divided by; 1 elsewhere (datum,)."""
        return np.where(np.asarray(self.limit) == 0, 1.0, np.asarray(self.error) / np.sqrt(SHARE))


def observed(value: np.ndarray, usable: np.ndarray, limit: np.ndarray, on_disc: np.ndarray) -> Observed:
    """From log values (cell, 3), of which `usable` are measured and `limit` say what else is known (cell, 3)."""
    error = np.where(on_disc, ERROR_ON_DISC, ERROR_OF_SKY)[:, None] * np.ones(value.shape)
    return Observed(*(jnp.asarray(array.ravel(), dtype=float) for array in (value, usable, limit, error)))
