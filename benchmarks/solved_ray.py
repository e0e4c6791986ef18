"""A grazing ray by an adaptive solver of differential equations: the equation of rays in Cartesian coordinates.

    d/dl (n dx/dl) = grad n

with diffrax, from the tangent point to the top of the air. The solver knows nothing of spheres, of Bouguer's
invariant or of the breaks of the profile, at which its steps shrink by themselves.
"""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix
from jaxtyping import Array, Float

from eclipsejax.constants import EARTH_RADIUS

UNIT = 1e5  # m, so that one tolerance suits places and directions


@eqx.filter_jit
def solved_ray(
    atmosphere, tangent_height, wavelength, tolerance: float | Array = 1e-12
) -> tuple[Float[Array, "..."], ...]:
    """(bending angle [rad], optical depth [-], impact parameter where the ray leaves [m]).

    Tangent height [m] and wavelength [nm] broadcast. With the default tolerance bending and depth are right to 1e-9
    from the ground to 80 km (tests/test_peers.py).

    - `tolerance`: relative, of each step; absolute it is 1e-4 of that, for rays at 80 km turn by 1e-7 only.
    """

    def one(tangent_height, wavelength):
        return _solve(atmosphere, tangent_height, wavelength, tolerance)

    return jnp.vectorize(one)(jnp.asarray(tangent_height, dtype=float), jnp.asarray(wavelength, dtype=float))


def _solve(atmosphere, tangent_height, wavelength, tolerance):
    def altitude(place):
        x, y = UNIT * place[0], UNIT * place[1] + tangent_height
        return jnp.sqrt(x**2 + (EARTH_RADIUS + y) ** 2) - EARTH_RADIUS

    def index(place):
        return 1.0 + atmosphere.refractivity(altitude(place), wavelength)

    def slope(length, state, args):
        place, momentum = state[:2], state[2:4]
        absorbed = UNIT * atmosphere.extinction(altitude(place), wavelength)
        return jnp.concatenate([momentum / index(place), jax.grad(index)(place), absorbed[None]])

    def below_the_top(t, y, args, **_):
        return altitude(y[:2]) - atmosphere.breaks[-1]

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(slope),
        diffrax.Dopri8(),
        t0=0.0,
        t1=30.0,
        dt0=0.01,
        y0=jnp.stack([0.0, 0.0, index(jnp.zeros(2)), 0.0, 0.0]),
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=1e-4 * tolerance),
        event=diffrax.Event(below_the_top, optimistix.Newton(1e-7, 1e-7)),
        max_steps=20000,
    )
    assert solution.ys is not None
    x, y, across, down, depth = solution.ys[-1]
    impact = jnp.abs((UNIT * y + EARTH_RADIUS + tangent_height) * across - UNIT * x * down)
    return -2.0 * jnp.arctan2(down, across), 2.0 * depth, impact
