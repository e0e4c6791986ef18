"""A grazing ray marched step by step through the air: the method of the paper, and our reference for speed and error.

Yapo & Cutler (2009, section on refraction) step the ray equation

    d/dl (n dx/dl) = grad n

in small straight pieces, with the gradient of the refractive index by finite differences. Nothing of the medium's
symmetry is used on the way, so the march costs a thousand steps where the quadrature of `limb` costs a hundred
nodes, and its error falls only with the first power of the step. Rays start at their tangent point and run
outwards; the other half is the mirror image.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.traced import real

GRADIENT_SPAN = 10.0  # m, over which the paper takes differences of the refractive index


def stepped(index, position, momentum, step, span=GRADIENT_SPAN):
    """(position, momentum) one straight piece further along a ray of any medium; momentum is n dx/dl.

    - `index`: refractive index [-] at a position (2,) [m].
    - `step`: length of the piece [m].
    - `span`: over which differences of the index are taken [m].
    """
    reach = 0.5 * span * jnp.eye(2)
    ahead, behind = jax.vmap(index)(position + reach), jax.vmap(index)(position - reach)
    momentum = momentum + step * (ahead - behind) / span
    return position + step * momentum / index(position), momentum


def march_ray(atmosphere, tangent_height, wavelength, step=1000.0) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """(bending angle [rad], optical depth [-]) of a whole grazing ray, by stepping.

    Tangent height [m] and wavelength [nm] broadcast. With steps of 1 km the bending is right to 2e-3 and the
    optical depth to 6e-4 from the ground to 30 km, and ten times better with 100 m. Differentiable forwards only
    (`jax.jvp`): the number of steps depends on the ray.

    - `atmosphere`: anything with `refractivity`, `extinction` and `breaks`; vacuum above the last of these.
    - `step`: length of a piece [m].
    """
    return _march(atmosphere, real(tangent_height), real(wavelength), real(step))


@eqx.filter_jit
def _march(atmosphere, tangent_height, wavelength, step):
    def one(tangent_height, wavelength):
        return _march_one(atmosphere, tangent_height, wavelength, step)

    return jnp.vectorize(one)(tangent_height, wavelength)


def _march_one(atmosphere, tangent_height, wavelength, step):
    """In the plane of the ray: x along it at the tangent point, y upwards, the Earth's centre as origin."""
    top = atmosphere.breaks[-1]

    def altitude(position):
        return jnp.sqrt(jnp.sum(position**2)) - EARTH_RADIUS

    def index(position):
        return 1.0 + atmosphere.refractivity(altitude(position), wavelength)

    def extinction(position):
        return atmosphere.extinction(altitude(position), wavelength)

    def advance(state):
        position, momentum, absorbed, density = state
        position, momentum = stepped(index, position, momentum, step)
        onward = extinction(position)
        return position, momentum, absorbed + 0.5 * step * (density + onward), onward

    start = jnp.stack([jnp.zeros_like(tangent_height), EARTH_RADIUS + tangent_height])
    momentum = index(start) * jnp.asarray([1.0, 0.0])
    state = start, momentum, jnp.zeros_like(tangent_height), extinction(start)
    _, momentum, absorbed, _ = jax.lax.while_loop(lambda state: altitude(state[0]) < top, advance, state)
    return -2.0 * jnp.arctan2(momentum[1], momentum[0]), 2.0 * absorbed
