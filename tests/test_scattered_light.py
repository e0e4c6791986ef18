"""The light that a fit takes for scattered, against what the air scatters."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.constants import MOON_MEAN_DISTANCE
from eclipsejax.moon import Moon
from eclipsejax.scattered import scattered_irradiance
from eclipsejax.sun import Sun
from eclipsejax.wavelengths import channel_weights
from inverse import prior
from inverse.scattered_light import TERMS, log_scattered, table

OFFSET = np.radians([20.0 / 60.0])
DUST = [one.name for one in prior.ATMOSPHERE].index("dust.extinction")


def told(z, distance):
    return log_scattered(prior.values(prior.ATMOSPHERE, z), distance)


@pytest.fixture(scope="module")
def scattered():
    """Log of what `eclipsejax.scattered` gives, for parameters z and the Moon's distance."""
    wavelength, weights = channel_weights(Sun(), Moon(), "nikon_5100", 24)

    @eqx.filter_jit
    def light(z, distance):
        found = scattered_irradiance(prior.atmosphere(z), OFFSET, wavelength, moon_distance=distance)
        return jnp.log(found[0] @ weights / weights.sum(axis=0))

    return light


def test_light_is_what_limbs_of_the_prior_scatter(scattered):
    random = np.random.default_rng(7)
    limbs = random.standard_normal((150, len(prior.ATMOSPHERE)))
    distances = MOON_MEAN_DISTANCE * random.uniform(0.945, 1.055, len(limbs))
    off = np.array([scattered(z, d) - told(z, d) for z, d in zip(jnp.asarray(limbs), distances, strict=True)])
    assert np.abs(off.mean(axis=0)).max() < 0.01
    assert np.sqrt(np.mean(off**2, axis=0)).max() < 0.04
    assert np.quantile(np.abs(off), 0.98) < 0.1


@pytest.mark.parametrize("dust", [-30.0, -2.0, 0.0, 1.5, 3.0])
def test_light_follows_dust(scattered, dust):
    """From clear air to the darkest dust, the typical limb's slope by dust as well."""
    z = jnp.zeros(len(prior.ATMOSPHERE)).at[DUST].set(dust)
    np.testing.assert_allclose(told(z, MOON_MEAN_DISTANCE), scattered(z, MOON_MEAN_DISTANCE), atol=0.04)
    step = 0.2
    ahead, behind = z.at[DUST].add(step), z.at[DUST].add(-step)
    expected = (scattered(ahead, MOON_MEAN_DISTANCE) - scattered(behind, MOON_MEAN_DISTANCE)) / (2 * step)
    slope = jax.jacfwd(told)(z, MOON_MEAN_DISTANCE)[:, DUST]
    np.testing.assert_allclose(slope, expected, atol=0.08)


def test_more_dust_than_the_table_has_changes_nothing():
    z = jnp.zeros(len(prior.ATMOSPHERE)).at[DUST].set(4.0)
    np.testing.assert_allclose(told(z, MOON_MEAN_DISTANCE), told(z.at[DUST].set(9.0), MOON_MEAN_DISTANCE), rtol=1e-12)


def test_table_has_every_term_at_every_level():
    extinction, coefficients = table()
    assert np.all(np.diff(extinction) > 0) and coefficients.shape == (len(extinction), len(TERMS), 3)
