"""The Sun's arcs on cells of sky angle: the half of the shadow's integral that no air enters.

The irradiance at one point is the integral of F(psi) A(|psi|) over the sky angle psi of the refracted rays: F is
their flux per unit of angle, which knows the air but not where the Sun stands, and A the arc of the circle |psi|
inside the Sun, which knows the Sun but not the air. A is smooth but for square roots where the circle touches the
Sun's edge; so these angles, of all points, are edges of cells, and on every cell A is a combination of a few
functions, square roots at either end among them. The integral is then a sum over cells of the combination's
coefficients times the same moments of F, however rough F is: caustics need no care.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.arc import arc_moments
from eclipsejax.limb import clustered
from eclipsejax.traced import ascending


class SkyCells(eqx.Module):
    """Cells of |psi|, ascending."""

    edges: Float[Array, " edge"]
    """[rad]"""

    @property
    def count(self) -> int:
        """Number of cells."""
        return self.edges.shape[0] - 1

    @classmethod
    def around(cls, offset: Float[Array, " offset"], sun_radius: Float[Array, ""], fill: int) -> "SkyCells":
        """Cells over all |psi| at which the Sun is seen from points at these offsets [rad].

        - `fill`: edges in addition to the touching ones, equally spaced.
        """
        touching = jnp.concatenate([jnp.abs(offset - sun_radius), offset + sun_radius])
        lower = jnp.maximum(jnp.min(offset) - sun_radius, 0.0)
        return cls(ascending(jnp.concatenate([touching, jnp.linspace(lower, jnp.max(touching), fill)])))

    def index(self, psi: Float[Array, "..."]) -> Float[Array, "..."]:
        """Number of the cell in which |psi| lies; -1 below the first, `count` above the last."""
        return jnp.searchsorted(self.edges, jnp.abs(psi), side="right") - 1

    def arcs(
        self, offset: Float[Array, ""], sun_radius: Float[Array, ""], order: int, nodes: int, moments=None
    ) -> Float[Array, "cell function power"]:
        """Coefficients of the arcs of `arc.arc_moments` for one offset [rad] that was given to `around`.

        - `order`: nodes on an arc.
        - `nodes`: angles of a cell to which the functions are fitted, 5 or more.
        - `moments`: other arcs, from circles (...) [rad] to (..., 6).
        """
        node, weight = clustered(nodes)
        lower, upper = self.edges[:-1, None], self.edges[1:, None]
        circle = lower + (upper - lower) * node
        moments = arc_moments(offset, circle, sun_radius, order) if moments is None else moments(circle)
        return jnp.einsum("kn,cnm->ckm", _fit(nodes), moments)


def functions(x: Float[Array, "..."], xp=jnp) -> Float[Array, "... function"]:
    """The functions on a cell, x from 0 at its lower to 1 at its upper edge, in a new last axis.

    - `xp`: JAX's or plain NumPy.
    """
    y = 2.0 * x - 1.0
    return xp.stack([xp.ones_like(y), y, y**2, xp.sqrt(x), xp.sqrt(1.0 - x)], axis=-1)


def _fit(nodes: int) -> Float[Array, "function node"]:
    """From values at `clustered` nodes to the coefficients of the functions, by weighted least squares.

    On the host: a pseudo-inverse inside a program is a call of LAPACK, and the program cannot be kept (`programs`).
    """
    node, weight = clustered(nodes, np)
    root = np.sqrt(weight)[:, None]
    return jnp.asarray(np.linalg.pinv(root * functions(node, np)) * root.T, dtype=float)
