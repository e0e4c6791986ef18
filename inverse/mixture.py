"""Mixtures of a few wide-tailed bells, fitted to weighed draws: proposals for a posterior that is no Gaussian."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, logsumexp

from inverse.gaussian import Gaussian

BELLS, ROUNDS = 5, 12  # and steps of expectation and maximisation
FREEDOM, WIDER = 8.0, 1.4  # Student's degrees of freedom of the bells, and a margin of their variance
KNOWN = 3.0  # draws a parameter that count as much as all bells together for the covariance of one
# Shares, at first and later, of Laplace's bell wider than it is, and of the prior of z itself, which knows every peak.
OPENING, DEFENCE, STRETCH = (0.25, 0.15), (0.08, 0.07), 2.5
FEWEST = 100.0  # effective draws that a mixture is fitted to


@dataclass(frozen=True)
class Mixture:
    """Student distributions; normal ones where `freedom` is infinite.

    - `shares`: (bell,), sum 1; `bells`: centre and root of the scale matrix of each.
    """

    shares: np.ndarray
    bells: tuple[Gaussian, ...]
    freedom: float

    def draw(self, count: int, random: np.random.Generator | np.random.RandomState) -> np.ndarray:
        """Points (draw, parameter)."""
        size = len(self.bells[0].centre)
        whose = random.choice(len(self.bells), count, p=self.shares)
        deviates = random.standard_normal((count, size))
        if np.isfinite(self.freedom):
            deviates = deviates / np.sqrt(random.chisquare(self.freedom, count) / self.freedom)[:, None]
        z = np.empty((count, size))
        for number, bell in enumerate(self.bells):
            z[whose == number] = bell.at(deviates[whose == number])
        return z

    def each(self, z: np.ndarray) -> np.ndarray:
        """Log densities of the bells, shares counted (bell, draw)."""
        found = []
        for share, bell in zip(self.shares, self.bells, strict=True):
            size, squares = len(bell.centre), np.sum(bell.deviates(z) ** 2, axis=1)
            scale = np.log(share) - np.sum(np.log(np.diag(bell.factor)))
            if np.isfinite(self.freedom):
                whole = gammaln(0.5 * (self.freedom + size)) - gammaln(0.5 * self.freedom)
                scale += whole - 0.5 * size * np.log(self.freedom * np.pi)
                found.append(scale - 0.5 * (self.freedom + size) * np.log1p(squares / self.freedom))
            else:
                found.append(scale - 0.5 * size * np.log(2.0 * np.pi) - 0.5 * squares)
        return np.array(found)

    def log_density(self, z: np.ndarray) -> np.ndarray:
        """(draw,) of points (draw, parameter)."""
        return np.asarray(logsumexp(self.each(z), axis=0))


def about(gaussians: Sequence[Gaussian]) -> Mixture:
    """Laplace's bells, one at each optimum, the same ones wider, and the prior.

    The bells alone will not do: of a bent posterior, or of a peak that no descent found, their draws see what they
    cover, and their weights are tame.
    """
    shares = np.append(_shared(1.0 - sum(OPENING), gaussians), _defence_shares(OPENING, gaussians))
    return Mixture(shares, (*gaussians, *_defence(gaussians)), FREEDOM)


def _defence(gaussians: Sequence[Gaussian]) -> tuple[Gaussian, ...]:
    size = len(gaussians[0].centre)
    wide = (Gaussian(bell.centre, STRETCH * bell.factor) for bell in gaussians)
    return *wide, Gaussian(np.zeros(size), np.eye(size))


def _defence_shares(shares: tuple[float, float], gaussians: Sequence[Gaussian]) -> np.ndarray:
    return np.append(_shared(shares[0], gaussians), shares[1])


def _shared(share: float, gaussians: Sequence[Gaussian]) -> np.ndarray:
    return np.full(len(gaussians), share / len(gaussians))


def tempered(log_ratio: np.ndarray) -> np.ndarray:
    """Weights (draw,), sum 1, of which enough count: the ratio to the power at which they just do, 1 at most."""
    finite = np.where(np.isfinite(log_ratio), log_ratio, -np.inf)

    def weights(power):
        weight = np.exp(power * (finite - finite.max()))
        return weight / weight.sum()

    def enough(power):
        return 1.0 / np.sum(weights(power) ** 2) >= FEWEST

    if enough(1.0):
        return weights(1.0)
    low, high = 0.0, 1.0
    for _ in range(30):
        power = 0.5 * (low + high)
        low, high = (power, high) if enough(power) else (low, power)
    return weights(low)


def fitted(z: np.ndarray, weight: np.ndarray, gaussians: Sequence[Gaussian], random: np.random.Generator) -> Mixture:
    """A mixture that follows weighed draws, with a defence that does not.

    - `z`: (draw, parameter); `weight`: (draw,), sum 1.
    - `gaussians`: Laplace's, of each optimum.
    """
    size, effective = z.shape[1], 1.0 / np.sum(weight**2)
    mean, pooled = _moments(z, weight)
    counts = weight > 0.0
    z, weight = z[counts], weight[counts]
    begin = z[random.choice(len(z), BELLS, p=weight / weight.sum())]
    found = Mixture(np.full(BELLS, 1.0 / BELLS), tuple(Gaussian.about(0.5 * (c + mean), pooled) for c in begin), np.inf)
    for _ in range(ROUNDS):
        log_each = found.each(z)
        belongs = np.exp(log_each - logsumexp(log_each, axis=0)) * weight
        shares = np.maximum(belongs.sum(axis=1), 1e-3)
        bells = []
        for share, member in zip(shares, belongs, strict=True):
            centre, spread = _moments(z, member / max(member.sum(), 1e-300))
            known = share * effective / (share * effective + KNOWN * size)
            bells.append(Gaussian.about(known * centre + (1.0 - known) * mean, known * spread + (1.0 - known) * pooled))
        found = Mixture(shares / shares.sum(), tuple(bells), np.inf)
    wider = tuple(Gaussian(bell.centre, np.sqrt(WIDER) * bell.factor) for bell in found.bells)
    shares = np.append((1.0 - sum(DEFENCE)) * found.shares, _defence_shares(DEFENCE, gaussians))
    return Mixture(shares, (*wider, *_defence(gaussians)), FREEDOM)


def _moments(z: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (parameter,) and covariance (parameter, parameter) of weighed draws."""
    mean = weight @ z
    return mean, (z - mean).T @ (weight[:, None] * (z - mean))
