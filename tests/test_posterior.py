"""The sampler samples what it should: a Gaussian's mean and variance, and the same chain for the same seed."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from inverse.posterior import sample


class Gaussian(eqx.Module):
    factor: jnp.ndarray

    def __call__(self, z):
        return -0.5 * jnp.sum((self.factor @ z) ** 2)


def correlated(size):
    random = np.random.default_rng(size)
    factor = np.eye(size) + 0.4 * np.tril(random.standard_normal((size, size)), -1)
    return Gaussian(jnp.asarray(factor)), np.linalg.inv(factor.T @ factor)


@pytest.mark.parametrize("size", [3, 8])
def test_variance_of_a_gaussian_is_right(size):
    density, covariance = correlated(size)
    chain = sample(density, np.zeros(size), 0.5 * covariance, steps=4000, seed=1)
    z = chain.z.reshape(-1, size)
    ratio = np.diag(np.cov(z.T)) / np.diag(covariance)
    # emcee's snooker move would give 0.66 at six dimensions. Standard error of the mean ratio here: 0.01-0.02.
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.06)
    assert np.abs(z.mean(axis=0) / np.sqrt(np.diag(covariance))).max() < 0.15
    assert chain.converged and chain.effective_samples.min() > 400


def test_a_seed_reproduces_the_chain():
    density, covariance = correlated(3)
    one, two, other = (sample(density, np.zeros(3), covariance, steps=50, seed=seed).z for seed in (7, 7, 8))
    assert np.array_equal(one, two) and not np.array_equal(one, other)


def test_a_density_that_is_not_finite_somewhere_is_survived():
    class Half(eqx.Module):
        scale: jnp.ndarray

        def __call__(self, z):
            return jnp.where(z[0] > 0, -0.5 * jnp.sum((z / self.scale) ** 2), -jnp.inf)

    chain = sample(Half(jnp.asarray(1.0)), np.array([0.8, 0.0]), 0.04 * np.eye(2), steps=2000, seed=0)
    assert np.all(chain.z[..., 0] > 0)
    assert np.mean(chain.z[..., 0]) == pytest.approx(np.sqrt(2 / np.pi), abs=0.1)
