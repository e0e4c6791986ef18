import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.arc import arc_moments
from tests import oracles

SUN = 4.65e-3  # rad
REGIMES = {  # offset, circle [rad]
    "circle inside the Sun": (2e-3, 1.5e-3),
    "Sun cut by the circle": (8e-3, 7e-3),
    "Sun cut near its edge": (8e-3, 12.6e-3),
    "circle half out": (3e-3, 6e-3),
    "far apart": (20e-3, 4e-3),
    "circle around the Sun": (1e-3, 9e-3),
    "on the axis": (0.0, 3e-3),
    "on the axis, outside": (0.0, 5e-3),
    "origin on the Sun's edge": (SUN, 2e-3),
    "a point": (2e-3, 0.0),
    "a point outside": (9e-3, 0.0),
    "a large Sun": (0.01, 8e-3),
}
moments = jax.jit(lambda offset, circle, sun: arc_moments(offset, circle, sun, 24))


def summed(offset, circle, sun, azimuths=400_000):
    """Azimuth by azimuth: unit vectors to a point of the circle and to the Sun's centre, and the angle between them."""
    phi = 2.0 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    point = np.stack([np.sin(circle) * np.cos(phi), np.sin(circle) * np.sin(phi), np.full_like(phi, np.cos(circle))])
    centre = np.array([np.sin(offset), 0.0, np.cos(offset)])
    sine = np.linalg.norm(np.cross(point.T, centre), axis=1)
    mu = np.sqrt(np.maximum(1.0 - (sine / np.sin(sun)) ** 2, 0.0))
    inside = sine < np.sin(sun)
    return np.array([np.mean(inside * mu**k) * 2.0 * np.pi for k in range(6)])


@pytest.mark.parametrize("regime", REGIMES)
def test_arcs_are_the_sums_over_all_azimuths(regime):
    offset, circle = REGIMES[regime]
    sun = 0.05 if regime == "a large Sun" else SUN
    expected = summed(offset, circle, sun)
    np.testing.assert_allclose(moments(offset, circle, sun), expected, rtol=1e-5, atol=2e-5)
    np.testing.assert_allclose(oracles.arc_moments(offset, circle, sun), expected, rtol=1e-5, atol=2e-5)


def test_arcs_are_those_of_another_quadrature():
    # To 1e-7, up to a thousandth of the Sun's radius from where the circle touches the Sun's edge.
    offsets = np.array([0.5e-3, 3e-3, 4.6e-3, 4.7e-3, 9e-3, 16e-3])
    circles = np.array([0.2, 0.999, 1.001, 1.5, 3.0])
    for offset in offsets:
        circle = np.concatenate([np.abs(offset - SUN) * circles[circles < 3.0], [offset, (offset + SUN) * 0.999]])
        found = jax.vmap(lambda c, offset=offset: moments(offset, c, SUN))(jnp.asarray(circle))
        np.testing.assert_allclose(found, oracles.arc_moments(offset, circle, SUN), rtol=1e-6, atol=1e-6)


def test_length_of_the_arc_is_in_closed_form():
    offset, circle = 9e-3, 7e-3
    cosine = (np.cos(SUN) - np.cos(offset) * np.cos(circle)) / (np.sin(offset) * np.sin(circle))
    assert moments(offset, circle, SUN)[0] == pytest.approx(2.0 * np.arccos(cosine), rel=1e-9)


def test_circle_about_the_centre_has_one_brightness():
    mu = np.sqrt(1.0 - (np.sin(3e-3) / np.sin(SUN)) ** 2)
    np.testing.assert_allclose(moments(0.0, 3e-3, SUN), 2.0 * np.pi * mu ** np.arange(6), rtol=1e-12)


def test_circles_add_up_to_the_sun():
    # Rings over all circles give the whole disc, wherever it stands: 2 pi int mu^k sin(theta) d(theta).
    node, weight = np.polynomial.legendre.leggauss(60)

    def total(offset):
        value = 0.0
        for low, high in ((0.0, abs(offset - SUN)), (abs(offset - SUN), offset + SUN)):
            t = 0.5 * np.pi * (node + 1.0) / 2.0  # the edges of the Sun are square roots of the circle: x = sin^2 t
            x = low + (high - low) * np.sin(t) ** 2
            ring = jax.vmap(lambda c: moments(offset, c, SUN))(jnp.asarray(x)) * np.sin(x)[:, None]
            value = value + (high - low) * (0.25 * np.pi * weight * np.sin(2.0 * t)) @ np.asarray(ring)
        return value

    theta = 0.5 * SUN * (node + 1.0)
    mu = np.sqrt(1.0 - (np.sin(theta) / np.sin(SUN)) ** 2)
    expected = [np.pi * SUN * np.sum(weight * mu**k * np.sin(theta)) for k in range(6)]
    np.testing.assert_allclose(total(0.0), expected, rtol=3e-5)
    for offset in (2e-3, SUN, 11e-3):
        np.testing.assert_allclose(total(offset), expected, rtol=3e-5)


def test_arcs_and_their_slopes_are_finite_at_every_tangency():
    # Touching from inside and outside, one rounding either side; on the axis; circles of no radius.
    pairs = [(o, abs(o - SUN)) for o in (0.0, 2e-3, SUN, 9e-3)] + [(o, o + SUN) for o in (0.0, 2e-3, 9e-3)]
    pairs += [(o, np.nextafter(c, side)) for o, c in pairs for side in (0.0, 1.0)] + [(0.0, 0.0), (9e-3, 0.0)]
    offset, circle = jnp.asarray(pairs).T
    values = jax.jit(jax.vmap(lambda o, c: arc_moments(o, c, SUN, 8)))(offset, circle)
    slopes = jax.jit(
        jax.vmap(jax.jacfwd(lambda o, c, s: arc_moments(o, c, s, 8), argnums=(0, 1, 2)), in_axes=(0, 0, None))
    )
    assert np.all(np.isfinite(values))
    for slope in slopes(offset, circle, SUN):
        assert np.all(np.isfinite(slope))


@pytest.mark.parametrize("regime", ["circle inside the Sun", "Sun cut by the circle", "circle half out"])
def test_arcs_have_the_slopes_that_differences_show(regime):
    start = np.array([*REGIMES[regime], SUN])
    slopes = jax.jit(jax.jacfwd(lambda x: arc_moments(x[0], x[1], x[2], 24)))(start)
    for i in range(3):
        step = np.eye(3)[i]
        expected = oracles.derivative(lambda h, step=step: np.asarray(moments(*(start + h * step))), 0.0, 1e-4)
        np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-6, atol=1e-6 * np.max(np.abs(expected)))
