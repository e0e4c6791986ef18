"""Of several ends the best is taken, and errors are as large as the photograph says there."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from eclipsejax.errors import InputError
from inverse import optimum as module
from inverse import prior
from inverse.joint_whitener import joint_whitener
from inverse.noise import Errors
from inverse.optimum import STARTS, best, roughly, starts

TOP, COVER = ([parameter.name for parameter in prior.ATMOSPHERE].index(f"clouds.{name}") for name in ("top", "cover"))
LOW, HIGH = -0.7, 1.4  # z of the clouds' top, or cover, at either end
DATA = 40
SCATTER = 2.0  # times the errors


@dataclass(frozen=True)
class Observed:
    measured: np.ndarray


@dataclass(frozen=True)
class TwoEnds:
    """As a `Likelihood` whose misfits vanish at two heights of the clouds, at one of them less well.

    - `worse`: end, and what it misses by.
    - `along`: number of the quantity that has two ends; `height`: of what lies between them.
    """

    worse: tuple[float, float]
    lost: bool = False
    along: int = TOP
    height: float = 1.0
    errors: tuple = (Errors(np.full((DATA, 1, 1), 0.05**2), np.full((DATA, 1), 1e-6), 1),)
    parameters: tuple = (*prior.ATMOSPHERE, *prior.PHOTOGRAPH)
    observed: tuple = (Observed(np.ones(DATA)),)
    carried_at: np.ndarray | None = None

    def carried(self, z):
        return replace(self, carried_at=z)

    def with_errors(self, errors):
        return replace(self, errors=tuple(errors))

    @property
    def whitener(self):
        return joint_whitener(self.errors)

    def columns(self, number):
        return np.arange(len(self.parameters))

    def misfits_and_slopes(self, z):
        top = z[self.along]
        weight = self.height * np.linspace(0.5, 1.5, DATA)
        end, miss = self.worse
        other = LOW + HIGH - end
        slopes = np.zeros((DATA, z.size))
        misfit = (top - LOW) * (top - HIGH) * weight
        slopes[:, self.along] = (2 * top - LOW - HIGH) * weight
        misfit[::2] += miss * (top - other) / (end - other)
        slopes[::2, self.along] += miss / (end - other)
        scatter = SCATTER * 0.05 * np.random.default_rng(1).standard_normal(DATA)
        return [(np.full(DATA, np.nan) if self.lost else misfit + scatter, slopes)]


NEIGHBOURS = [np.arange(DATA)[:, None]]


def test_starts_are_distinct_and_lead_to_both_ends():
    likelihood = TwoEnds((LOW, 0.0))
    tops = [roughly(likelihood, start).z[TOP] for start in starts(likelihood)]
    assert len(tops) == len(STARTS) and min(tops) < -0.5 and max(tops) > 1.0


@pytest.mark.parametrize(("worse", "end"), [(HIGH, LOW), (LOW, HIGH)])
def test_the_end_that_misses_less_is_taken(worse, end):
    optimum, likelihood = best(TwoEnds((worse, 0.3)), NEIGHBOURS)
    assert optimum.z[TOP] == pytest.approx(end, abs=0.2)
    assert max(optimum.costs) > min(optimum.costs) + 20.0
    assert likelihood.errors[0].independent == pytest.approx(SCATTER, rel=0.3)
    assert likelihood.carried_at is not None
    assert likelihood.carried_at[TOP] == pytest.approx(optimum.z[TOP], abs=0.1)


@pytest.mark.parametrize(("worse", "count"), [(0.0, 1), (0.3, 0)])
def test_an_end_is_kept_where_it_may_hold_a_share(worse, count):
    """As good as the best, it is a rival; some forty errors worse, it is forgotten."""
    optimum, _ = best(TwoEnds((HIGH, worse)), NEIGHBOURS)
    assert len(optimum.rivals) == count
    assert all(abs(end.z[TOP] - optimum.z[TOP]) == pytest.approx(HIGH - LOW, abs=0.2) for end in optimum.rivals)


def test_a_better_end_that_no_start_leads_to_is_found_along_the_ridge(monkeypatch):
    """All start at clouds' middle cover; between the ends lies what no descent climbs."""
    likelihood = TwoEnds((LOW, 0.1), along=COVER, height=0.1)
    assert all(roughly(likelihood, start).z[COVER] < -0.3 for start in starts(likelihood))
    optimum, _ = best(likelihood, NEIGHBOURS)
    assert optimum.z[COVER] == pytest.approx(HIGH, abs=0.2)
    monkeypatch.setattr(module, "BESIDE", -np.inf)
    assert best(likelihood, NEIGHBOURS)[0].z[COVER] < -0.3


def test_photographs_that_are_nowhere_probable_are_refused():
    with pytest.raises(InputError, match="finite probability"):
        best(TwoEnds((LOW, 0.0), lost=True), NEIGHBOURS)
