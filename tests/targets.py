"""Log densities in NumPy that samplers are tried on; run as a program, it samples one until it is killed."""

import sys
from pathlib import Path

import numpy as np

from inverse.gaussian import Gaussian

SIZE = 3
CENTRE, START = np.zeros(SIZE), 0.5 * np.eye(SIZE)
IDENTITY = {"photographs": ["a"], "seed": 5}


def gaussian(covariance):
    """Of mean zero."""
    precision = np.linalg.inv(covariance)
    return lambda z: -0.5 * np.einsum("ni,ij,nj->n", z, precision, z)


def correlated(size: int) -> np.ndarray:
    """A covariance with variances from 0.01 to 100 and strong correlations."""
    random = np.random.default_rng(size)
    factor = np.linalg.qr(random.standard_normal((size, size)))[0] * np.logspace(-1, 1, size)
    return factor @ factor.T


def banana(z):
    """First parameter standard normal; the second normal about its square, with sd 1."""
    return -0.5 * (z[:, 0] ** 2 + (z[:, 1] - z[:, 0] ** 2) ** 2)


def half_normal(z):
    """Of the first parameter above zero; the others normal."""
    return np.where(z[:, 0] > 0, -0.5 * np.sum(z**2, axis=1), -np.inf)


def draws_of(steps: int, size: int) -> int:
    """That many steps of all walkers."""
    from inverse.ensemble import ENSEMBLES, walkers

    return steps * ENSEMBLES * walkers(size)


def sample_to_file(path: Path, steps: int, chain=None):
    """The chain that the tests of killing and resuming draw."""
    from inverse.chain import Record
    from inverse.ensemble import sample

    return sample(
        gaussian(correlated(SIZE)), [Gaussian.about(CENTRE, START)], draws=draws_of(steps, SIZE), seed=5, chain=chain,
        keep=lambda chain: Record(IDENTITY, {"z": CENTRE, "inflation": 1.0}, chain).write(path),
    )  # fmt: skip


if __name__ == "__main__":
    sample_to_file(Path(sys.argv[1]), 100_000)
