"""An uneven limb casts less of a step, a fit none; and the edge of its umbra stays sharp."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import geometry
from inverse import prior
from inverse.limb_light import shadow_of
from inverse.uneven_limb import washing

ARCMIN = np.radians(1 / 60)
OFFSET = np.linspace(-1.0, 55.0, 80) * ARCMIN


def test_parabolas_pass_and_steps_do_not():
    matrix = washing(OFFSET)
    for power in (0, 2):  # the light is even about the axis
        np.testing.assert_allclose(matrix @ OFFSET**power, OFFSET**power, atol=1e-12 * np.abs(OFFSET**power).max())
    for place in (5, 18):  # near the axis too
        step = matrix @ (OFFSET > place * ARCMIN)
        assert np.diff(step).max() < 0.15  # over 0.7'
    edge = (OFFSET > 42 * ARCMIN).astype(float)
    np.testing.assert_allclose((matrix @ edge)[OFFSET > 38.5 * ARCMIN], edge[OFFSET > 38.5 * ARCMIN], atol=0.02)


@pytest.fixture(scope="module")
def light():
    """Offsets, the smoothing of a fit, and log light of a limb by its temperature in prior widths."""
    where = geometry("2022-05-16T04:06:00Z")
    shadow = shadow_of([where])
    grid = shadow.tabulator.grid
    offset = np.asarray(grid.from_axis(jnp.linalg.norm(where.moon) - 0.6 * MOON_RADIUS))
    compiled = eqx.filter_jit(lambda tabulator, z: tabulator(prior.atmosphere(z)).log_light[:, 0])

    def at(temperature):
        z = np.zeros(len(prior.ATMOSPHERE))
        z[1] = temperature
        return np.asarray(compiled(shadow.tabulator, jnp.asarray(z)))

    return offset, np.asarray(shadow.washing), at


def roughness(offset, values):
    """What a curve against the offset has besides its broad course: rms."""
    course = [np.polynomial.Chebyshev.fit(offset, channel, 5)(offset) for channel in values.T]
    return np.sqrt(np.mean((values.T - course) ** 2))


def test_limbs_of_many_temperatures_have_less_of_a_step(light):
    offset, matrix, at = light
    inside = (offset > 6 * ARCMIN) & (offset < 30 * ARCMIN)
    node, weight = np.polynomial.hermite_e.hermegauss(15)
    weight = weight / weight.sum()
    many = np.log(sum(w * np.exp(at(n)) for w, n in zip(weight, node, strict=True)))
    one = at(0.0)
    rough, smooth, uneven = (roughness(offset[inside], curve[inside]) for curve in (one, matrix @ one, many))
    # Temperatures alone, 12 K apart, halve it; the height of the tropopause differs besides.
    assert smooth < uneven < 0.6 * rough
