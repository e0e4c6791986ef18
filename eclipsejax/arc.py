"""The part of a circle of the sky that lies on the Sun's disc."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.limb import clustered, gauss_legendre
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
    end = arc_end(offset, circle, sun_radius)[..., None]
    phi = end * jnp.sin(0.5 * jnp.pi * t)
    moments = _powers(weight * jnp.cos(0.5 * jnp.pi * t), _mu(offset, circle[..., None], sun_radius, phi))
    return jnp.pi * end * moments


def sector_moments(
    offset: Float[Array, ""],
    circle: Float[Array, "..."],
    sun_radius: Float[Array, ""],
    order: int,
    *,
    apart: Float[Array, "..."],
    half_width: float,
) -> Float[Array, "... 6"]:
    """`arc_moments` weighted with a sector of azimuth: 1 at its middle, falling linearly to 0 at its ends [rad].

    The arc is cut where the weight has kinks; 6 nodes are right to 1e-4, 10 to 1e-6 (tests/test_limb_sectors.py).

    - `apart`: azimuth between the middle of the sector and the Sun's centre [rad].
    - `half_width`: of the sector, at most pi / 2 [rad].
    - `order`: nodes between two cuts.
    """
    # Sun and circle are the same on either side of the Sun's centre: fold the sector onto azimuths from 0 to pi.
    apart = jnp.abs(jnp.mod(apart + jnp.pi, 2.0 * jnp.pi) - jnp.pi)
    before, after = jnp.abs(apart - half_width), jnp.pi - jnp.abs(jnp.pi - apart - half_width)
    # It reaches over the Sun's centre, or over the point opposite, or neither: then one piece of three has no width.
    over, around = apart < half_width, apart > jnp.pi - half_width
    inner = jnp.where(over, before, jnp.where(around, after, apart))
    first, last = jnp.where(over, 0.0, before), jnp.where(around, jnp.pi, after)
    cuts = jnp.stack([first, jnp.minimum(apart, inner), jnp.maximum(apart, inner), last], axis=-1)
    cuts = jnp.minimum(cuts, arc_end(offset, circle, sun_radius)[..., None])
    node, weight = clustered(order)
    phi = cuts[..., :-1, None] + jnp.diff(cuts)[..., None] * node  # (..., piece, node)
    share = sum(
        jnp.maximum(1.0 - away / half_width, 0.0)
        for away in (
            jnp.abs(phi - apart[..., None, None]),
            phi + apart[..., None, None],
            2.0 * jnp.pi - phi - apart[..., None, None],
        )
    )
    weight = weight * share * jnp.diff(cuts)[..., None]
    flat = (*phi.shape[:-2], -1)
    return _powers(weight.reshape(flat), _mu(offset, circle[..., None], sun_radius, phi.reshape(flat)))


def arc_end(offset, circle, sun_radius):
    """Azimuth from the Sun's centre at which a circle leaves the Sun: 0 if it is outside, pi if inside [rad]."""
    edge = jnp.sin(0.5 * sun_radius) ** 2
    inside = edge - jnp.sin(0.5 * (offset - circle)) ** 2
    swing = jnp.sin(offset) * jnp.sin(circle)
    partial = (inside > 0.0) & (inside < swing)
    half = jnp.arcsin(jnp.sqrt(jnp.where(partial, inside / jnp.where(partial, swing, 1.0), 0.5)))
    return jnp.where(partial, 2.0 * half, jnp.where(inside > 0.0, jnp.pi, 0.0))


def _mu(offset, circle, sun_radius, phi):
    """Cosine of the emergence angle at azimuths from the Sun's centre [-]."""
    edge = jnp.sin(0.5 * sun_radius) ** 2
    q = jnp.sin(0.5 * (offset - circle)) ** 2 + jnp.sin(offset) * jnp.sin(circle) * jnp.sin(0.5 * phi) ** 2
    return safe_sqrt((edge - q) * (1.0 - edge - q) / (edge * (1.0 - edge)))


def _powers(weight, mu):
    """Sums of weight mu^k, k = 0 ... 5, over the last axis, in its place."""
    weight = jnp.broadcast_to(weight, mu.shape)
    moments = [jnp.sum(weight, axis=-1)]
    for _ in range(5):
        weight = weight * mu
        moments.append(jnp.sum(weight, axis=-1))
    return jnp.stack(moments, axis=-1)
