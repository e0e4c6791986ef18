"""A density for batches is the density, however many points there are."""

import numpy as np

from inverse.posterior import BATCH, batched


def test_batches_of_any_length_give_what_single_points_give():
    random = np.random.default_rng(0)
    factor = random.standard_normal((3, 3))
    counts = []

    def gaussian(z):
        counts.append(len(z))
        return -0.5 * np.sum((z @ factor.T) ** 2, axis=1)

    density = batched(gaussian)
    for count in (1, BATCH, 2 * BATCH + 5):
        z = random.standard_normal((count, 3))
        np.testing.assert_allclose(density(z), -0.5 * np.sum((z @ factor.T) ** 2, axis=1), rtol=1e-12)
    assert set(counts) == {BATCH}
