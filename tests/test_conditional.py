"""Nuisances under a given limb, where everything is known: linear models with Gaussian errors."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from inverse.conditional import with_nuisances
from inverse.noise import whitener


class Photograph(eqx.Module):
    by_limb: jax.Array
    by_nuisance: jax.Array

    @property
    def parameters(self):
        return range(self.by_nuisance.shape[1])

    def __call__(self, limb, nuisance):
        return self.by_limb @ limb + self.by_nuisance @ nuisance


class Linear(eqx.Module):
    """As a `Likelihood`; the shadow is the limb itself."""

    models: tuple
    data: tuple
    usable: tuple
    whiteners: tuple

    def shadow(self, limb):
        return limb


def test_nuisances_are_drawn_from_their_distribution_under_the_limb():
    random = np.random.default_rng(2)
    shapes = [(7, 2), (5, 1)]
    models = tuple(Photograph(*(jnp.asarray(random.standard_normal((n, k))) for k in (2, size))) for n, size in shapes)
    data = tuple(jnp.asarray(random.standard_normal(n)) for n, _ in shapes)
    usable = (jnp.ones(7).at[3].set(0.0), jnp.ones(5))
    sigma = [random.uniform(0.5, 2.0, n) for n, _ in shapes]
    unit = tuple(whitener(s, 1e-6 * np.eye(s.size, 1)) for s in sigma)
    likelihood, limb = Linear(models, data, usable, unit), np.array([0.7, -1.1])
    normal = jnp.asarray(random.standard_normal((20_000, 3)))
    draw = jax.vmap(lambda one: with_nuisances(likelihood, jnp.asarray(limb), jnp.zeros(3), one))
    z = np.asarray(draw(normal))
    assert np.all(z[:, :2] == limb)
    for block, model, value, used, s in zip((slice(2, 4), slice(4, 5)), models, data, usable, sigma, strict=True):
        slope = np.asarray(model.by_nuisance) * (np.asarray(used) / s)[:, None]
        covariance = np.linalg.inv(np.eye(slope.shape[1]) + slope.T @ slope)
        mean = covariance @ slope.T @ (np.asarray(used) * (value - model.by_limb @ limb) / s)
        np.testing.assert_allclose(z[:, block].mean(axis=0), mean, atol=0.02)
        np.testing.assert_allclose(np.cov(z[:, block].T), covariance.squeeze(), atol=0.02)
