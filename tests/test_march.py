import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.atmosphere import Atmosphere, Haze
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.march import march_ray
from tests.test_limb import Shells, rays

TANGENTS = np.array([0.0, 3e3, 9e3, 15e3, 20e3, 30e3])


def test_marched_rays_converge_to_the_quadrature():
    # First order: a quarter of the step, a quarter of the error.
    atmosphere = Atmosphere(haze=Haze(optical_depth=0.1))
    bending, depth = rays(atmosphere, TANGENTS)
    errors = []
    for step in (4000.0, 1000.0, 250.0):
        marched = march_ray(atmosphere, TANGENTS, 550.0, step)
        errors.append([np.abs(marched[0] / bending - 1), np.abs(marched[1] / depth - 1)])
    coarse, middle, fine = np.max(errors, axis=2)
    assert np.all(middle < [2.1e-3, 6.3e-4])
    np.testing.assert_allclose(middle[0] / fine[0], 4.0, rtol=0.2)
    assert np.all(fine < middle) and np.all(middle < coarse)


def test_marched_rays_are_straight_where_nothing_refracts():
    shell = Shells(jnp.asarray(0.0), jnp.asarray([0.0, 50e3]), jnp.asarray([1e-5]))
    tangent = np.array([0.0, 10e3, 40e3])
    bending, depth = march_ray(shell, tangent, 500.0, 100.0)
    chord = np.sqrt((EARTH_RADIUS + 50e3) ** 2 - (EARTH_RADIUS + tangent) ** 2)
    assert np.all(np.asarray(bending) == 0.0)
    np.testing.assert_allclose(depth, 2e-5 * chord, atol=2e-5 * 100.0)  # the last step ends outside


def test_marched_rays_can_be_differentiated_forwards():
    def bending(scale):
        atmosphere = Atmosphere(haze=Haze(optical_depth=0.1))
        return march_ray(atmosphere, scale * TANGENTS, 550.0, 1000.0)[0]

    slope = jax.jvp(bending, (1.0,), (1.0,))[1]
    expected = (bending(1.0 + 1e-4) - bending(1.0 - 1e-4)) / 2e-4
    np.testing.assert_allclose(slope[1:], expected[1:], rtol=0.05)
