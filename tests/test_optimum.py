"""Of several ends the most probable is taken, not the one whose misfits are small against large errors."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from eclipsejax.errors import InputError
from inverse import prior
from inverse.noise import Errors
from inverse.optimum import STARTS, best, improbability, roughly, starts

TOP = [parameter.name for parameter in prior.ATMOSPHERE].index("clouds.top")
LOW, HIGH = -0.7, 1.4  # z of the clouds' top at either end
DATA = 40


@dataclass(frozen=True)
class TwoEnds:
    """As a `Likelihood` whose misfits vanish at two heights of the clouds, and whose errors grow between them.

    - `growth`: of the log of the errors, for each unit of z.
    """

    growth: float
    carried_to: float = 0.0
    lost: bool = False
    parameters: tuple = (*prior.ATMOSPHERE, *prior.PHOTOGRAPH)

    @property
    def errors(self):
        return (Errors(np.full(DATA, self.size(self.carried_to)), np.full((DATA, 1), 1e-6), 1),)

    def size(self, top):
        return 0.05 * np.exp(self.growth * top)

    def carried(self, z):
        return replace(self, carried_to=float(z[TOP]))

    def columns(self, number):
        return np.arange(len(self.parameters))

    def misfits_and_slopes(self, z):
        top = z[TOP]
        weight = np.linspace(0.5, 1.5, DATA)
        slopes = np.zeros((DATA, z.size))
        slopes[:, TOP] = (2 * top - LOW - HIGH) * weight
        # Scatter that no height explains: where errors are larger than that, it is improbably small.
        scatter = min(self.size(LOW), self.size(HIGH)) * np.random.default_rng(1).standard_normal(DATA)
        misfit = (top - LOW) * (top - HIGH) * weight + scatter
        return [(np.full(DATA, np.nan) if self.lost else misfit, slopes)]


def test_starts_are_distinct_and_lead_to_both_ends():
    likelihood = TwoEnds(1.0)
    tops = [roughly(likelihood, start)[1].z[TOP] for start in starts(likelihood)]
    assert len(tops) == len(STARTS) and min(tops) < -0.5 and max(tops) > 1.0


@pytest.mark.parametrize(("growth", "end"), [(1.0, LOW), (-1.0, HIGH)])
def test_the_end_with_smaller_errors_is_the_better_one(growth, end):
    likelihood = TwoEnds(growth)
    ends = [roughly(likelihood, start) for start in starts(likelihood)]
    scores = [improbability(*one) for one in ends]
    tops = np.array([optimum.z[TOP] for _, optimum in ends])
    assert abs(tops[int(np.argmin(scores))] - end) < 0.3
    near = [score for score, top in zip(scores, tops, strict=True) if abs(top - end) < 0.3]
    far = [score for score, top in zip(scores, tops, strict=True) if abs(top - end) > 0.3]
    assert max(near) < min(far) - 20.0  # forty data know the errors' size well enough


def test_photographs_that_are_nowhere_probable_are_refused():
    with pytest.raises(InputError, match="finite probability"):
        best(TwoEnds(1.0, lost=True), [np.zeros((DATA, 1), dtype=int)])
