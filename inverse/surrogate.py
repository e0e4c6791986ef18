"""A posterior that costs microseconds: interpolated between points where the real one was worked out.

What is interpolated are not log densities but the misfits behind them, in the few directions that they move in over
the posterior (principal components): those are nearly straight in the parameters, their squares are not. The chain is
drawn from the interpolated posterior, and its draws are weighed by the real one, so that what remains of the error of
interpolation is corrected, and seen in the weights.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import KDTree

from inverse.chain import Chain
from inverse.diagnostics import Diagnosis, diagnose
from inverse.ensemble import sample
from inverse.gaussian import Gaussian
from inverse.importance import LARGEST_K, Importance, weighed
from inverse.posterior import LimbPosterior

FIRST, MORE = 900, 900  # points worked out: about Laplace's Gaussian, then along each chain
STRETCH = 1.4  # of the Gaussian that the first are drawn from
ROUNDS = 5
COMPONENTS = 40  # at most
LEFT_OUT = 1e-2  # of the squared misfit, mean over the points, that components may leave out
SCOUT, CHAIN_DRAWS = 48_000, 192_000  # draws of the chains that refine it, and at most of the one that counts
WEIGHED = 2000  # of a chain's draws
STRAY, WALL = 1.5, 10.0  # times the largest usual distance between points; steepness of the density beyond


@dataclass(frozen=True)
class Surrogate:
    """Log posterior of the limb, interpolated.

    - `log_density`: of points and their squares (`LimbPosterior.log_density`).
    - `gaussian`: Laplace's; `points`: where the posterior was worked out, in its deviates.
    - `misfits`: interpolates components of the misfit, and last the square of what they leave out.
    """

    log_density: Callable[[np.ndarray, np.ndarray], np.ndarray]
    gaussian: Gaussian
    points: KDTree
    reach: float
    """How far from the nearest of the points it is believed."""
    misfits: RBFInterpolator

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Log densities (draw,) of points (draw, parameter); falling off where there are no points near."""
        places = self.gaussian.deviates(z)
        *components, rest = self.misfits(places).T
        away = np.maximum(self.points.query(places)[0] / self.reach - 1.0, 0.0)
        squares = np.sum(np.square(components), axis=0) + np.maximum(rest, 0.0)
        return self.log_density(z, squares) - WALL * away**2


def surrogate(z: np.ndarray, misfits: np.ndarray, gaussian: Gaussian, log_density: Callable) -> Surrogate:
    """Interpolate between points.

    - `z`: (point, parameter); `misfits`: whitened, whose squares make the `log_density` (point, datum).
    - `gaussian`: in whose deviates distances are measured.
    - `log_density`: of `Surrogate`.
    """
    first = misfits.mean(axis=0)
    along = first / max(np.linalg.norm(first), 1e-300)
    moving = misfits - np.outer(misfits @ along, along)
    # Eigenvectors of the small product: the data are many times the points.
    value, vector = np.linalg.eigh(moving @ moving.T)
    value, vector = value[::-1], vector[:, ::-1]
    left_out = (value.sum() - np.cumsum(value)) / len(z)
    count = min(COMPONENTS, int(np.searchsorted(-left_out, -LEFT_OUT)) + 1, int(np.sum(value > 1e-12 * value[0])))
    components = np.column_stack([misfits @ along, vector[:, :count] * np.sqrt(value[:count])])
    rest = np.sum(misfits**2, axis=1) - np.sum(components**2, axis=1)
    places = gaussian.deviates(z)
    targets = np.column_stack([components, rest])
    tree = KDTree(places)
    reach = STRAY * float(np.quantile(tree.query(places, k=2)[0][:, 1], 0.99))
    return Surrogate(log_density, gaussian, tree, reach, RBFInterpolator(places, targets, kernel="cubic", degree=2))


@dataclass(frozen=True)
class Interpolated:
    """Draws from the posterior by way of its surrogate.

    - `weighed`: the chain's draws, weighed by the real posterior.
    - `chain`, `diagnosis`: of the surrogate.
    - `points`: where the real posterior was worked out, all in all.
    """

    weighed: Importance
    chain: Chain
    diagnosis: Diagnosis
    points: int

    @property
    def trusted(self) -> bool:
        """Whether the ensembles agree and the weights are well-behaved: their length they need not show as well."""
        return self.weighed.trusted and self.diagnosis.agreed


def interpolated(
    posterior: LimbPosterior,
    gaussian: Gaussian,
    *,
    seed: int,
    report: Callable[[int, int], None] = lambda done, most: None,
) -> Interpolated:
    """Sample a posterior through a surrogate, refined where its chain goes, until the weights can be trusted.

    - `gaussian`: Laplace's.
    """
    random, size = np.random.default_rng(seed), len(gaussian.centre)
    z = gaussian.at(STRETCH * random.standard_normal((FIRST, size)))
    misfits = posterior.misfits(z)
    found, points = None, len(z)
    long = False
    for number in range(1, ROUNDS + 1):
        known = np.isfinite(misfits).all(axis=1)
        fast = surrogate(z[known], misfits[known], gaussian, posterior.log_density)
        long = long or number == ROUNDS
        chain = sample(fast, [gaussian], draws=CHAIN_DRAWS if long else SCOUT, seed=seed + number)
        diagnosis = diagnose(chain.z)
        drawn = random.permutation(chain.z[:, diagnosis.burn_in :].reshape(-1, size))[:WEIGHED]
        fresh = posterior.misfits(drawn)
        points += len(drawn)
        exact = posterior.log_density(drawn, np.sum(fresh**2, axis=1))
        found = Interpolated(weighed(drawn, exact, fast(drawn), random), chain, diagnosis, points)
        report(number, ROUNDS)
        if found.trusted and long:  # draws of a short chain were narrower than a bent posterior by 11 %
            break
        long = found.weighed.k_hat < LARGEST_K
        # A walker that stood still is one point, not two.
        new = np.sort(np.unique(drawn, axis=0, return_index=True)[1])[:MORE]
        z, misfits = np.concatenate([z, drawn[new]]), np.concatenate([misfits, fresh[new]])
    assert found is not None
    return found
