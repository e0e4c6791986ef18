"""The part of a circle of the sky that lies on the Sun's disc."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.limb import gauss_legendre
from eclipsejax.traced import safe_sqrt


def arc_moments(
    offset: Float[Array, ""],
    circle: Float[Array, "..."],
    sun_radius: Float[Array, ""],
    order: int,
) -> Float[Array, "... 6"]:
    """Integrals of mu^k, k = 0 ... 5, over the azimuth of a circle about the origin, inside the Sun [rad].

    With haversines, q = sin^2(theta/2) of the angle theta between a point of the circle and the Sun's centre:

        q(phi) = sin^2((offset - circle)/2) + sin(offset) sin(circle) sin^2(phi/2),
        mu^2 = (Q - q)(1 - Q - q) / (Q (1 - Q)),    Q = sin^2(sun_radius/2),

    free of cancellation (flat triangles cost 5e-4 at 100'). The square root at the end of the arc is taken away by
    phi = phi_0 sin t. At |circle| = |offset - sun_radius| the integral itself has a logarithmic cusp.

    - `offset`: of the Sun's centre from the origin [rad].
    - `circle`: radius of the circle [rad], not negative.
    - `sun_radius`: [rad].
    - `order`: Gauss-Legendre nodes on half of the arc.
    """
    t, weight = gauss_legendre(order)
    edge = jnp.sin(0.5 * sun_radius) ** 2
    nearest = jnp.sin(0.5 * (offset - circle)) ** 2
    swing = jnp.sin(offset) * jnp.sin(circle)
    inside = edge - nearest

    partial = (inside > 0.0) & (inside < swing)
    half = jnp.arcsin(jnp.sqrt(jnp.where(partial, inside / jnp.where(partial, swing, 1.0), 0.5)))
    end = jnp.where(partial, 2.0 * half, jnp.where(inside > 0.0, jnp.pi, 0.0))[..., None]

    phi = end * jnp.sin(0.5 * jnp.pi * t)
    q = nearest[..., None] + swing[..., None] * jnp.sin(0.5 * phi) ** 2
    mu = safe_sqrt((edge - q) * (1.0 - edge - q) / (edge * (1.0 - edge)))
    weight = weight * jnp.cos(0.5 * jnp.pi * t)
    moments = [jnp.sum(weight) * jnp.ones_like(end[..., 0])]
    power = weight
    for _ in range(5):
        power = power * mu
        moments.append(jnp.sum(power, axis=-1))
    return jnp.pi * end * jnp.stack(moments, axis=-1)
