"""A posterior whose errors are of a size that is not quite known: the mean, over sizes, of the posteriors with each.

Errors are as large as the camera of the optimum makes those of the light, and the optimum has bent to them; their
amplitudes are fitted. Estimates from drawn photographs stray exp(`MEAN` +- `SPREAD`) times as far as one size says
(python -m benchmarks.error_sizes --count 96): intervals of one size that claim 95 % hold 93.6 %.

How much the misfits scatter does not choose among the sizes (the posterior is cut there: Plummer 2015, Statistics and
Computing 25, 37): most of them are of cells by themselves, whose errors are counted generously, and whose scatter says
little of the smooth ones that mislead. So each posterior is divided by its own mass: Laplace's, from the optimum.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

from inverse.gaussian import Gaussian
from inverse.map_estimate import Optimum
from inverse.mixture import Mixture

MEAN, SPREAD = 0.03, 0.15  # of the log size: what errors are by what they are thought to be
NODE, WEIGHT = np.polynomial.hermite_e.hermegauss(5)
SIZE = np.exp(MEAN + SPREAD * NODE)
SHARE = WEIGHT / WEIGHT.sum()


@dataclass(frozen=True)
class ErrorSize:
    """The limb's log density with errors of every `SIZE`, the nuisances' priors of the same.

    - `optimum`: with errors of size 1, whose Gaussian gives each posterior its mass.
    """

    optimum: Optimum

    @cached_property
    def laplace(self) -> Mixture:
        """Laplace's Gaussians, one for each size, in their shares."""
        bells = (Gaussian.about(centre, np.linalg.inv(precision)) for centre, precision, _ in self._each)
        return Mixture(SHARE, tuple(bells), np.inf)

    def log_density(self, z: np.ndarray, squares: np.ndarray) -> np.ndarray:
        """Log densities (draw,), up to a constant; -inf where not finite.

        - `z`: (draw, parameter); `squares`: sums of the squared whitened misfits and nuisances there (draw,).
        """
        log_mass = np.array([mass for *_, mass in self._each])
        above = squares - (self.optimum.cost - np.sum(self.optimum.limb.centre**2))
        value = logsumexp(np.log(SHARE) - log_mass - 0.5 * above[:, None] / SIZE**2, axis=1)
        value = value - 0.5 * np.sum(z**2, axis=1)
        return np.where(np.isfinite(value), value, -np.inf)

    @cached_property
    def _each(self) -> list[tuple[np.ndarray, np.ndarray, float]]:
        """Of the posterior with each size: centre, precision, and log mass of exp(-above / 2 size^2 - z^2 / 2)."""
        centre, factor = self.optimum.limb.centre, self.optimum.limb.factor
        prior = np.eye(len(centre))
        known = np.linalg.inv(factor @ factor.T) - prior  # by the photographs
        found = []
        for size in SIZE:
            precision = known / size**2 + prior
            pull = (size**-2 - 1.0) * centre  # at size 1 alone the photographs hold the prior at the optimum
            moved = np.linalg.solve(precision, pull)
            log_mass = 0.5 * (pull @ moved - centre @ centre - np.linalg.slogdet(precision)[1])
            found.append((centre + moved, precision, float(log_mass)))
        return found
