"""The posterior of the limb: a density over the few parameters of the air, which all photographs share.

The nuisances of the photographs are at their best under each limb, found by a few steps (`inverse.secants`) from what
other limbs tell of them (`inverse.nuisance_guess`): where these end leaves log densities 0.02 too low in the mean of
one posterior's draws, and 0.03 at random. The marginal is that times their room (`inverse.room`), which is learnt from
draws of the posterior. To first order about the optimum alone neither would do: tone curve, colour matrix and exposure
bend together, and an interval three times too narrow was seen.
A sampler then sees only the atmosphere. Which points of the Moon a photograph shows, half of the work, is followed to
first order: that changed the log densities of one posterior's draws by 0.02 to 0.5 (rms of nine drawn photographs).
"""

from collections.abc import Callable
from functools import partial
from threading import Lock

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from inverse.error_size import ErrorSize
from inverse.likelihood import LIMB, Likelihood, misfit_of
from inverse.limb_light import Shadow
from inverse.map_estimate import Optimum
from inverse.nuisance_guess import Known
from inverse.observed import Observed
from inverse.photo_model import of_the_view, seen_and_slopes
from inverse.room import Room, log_volume
from inverse.secants import Secants
from inverse.threads import side_by_side

BATCH = 8  # points worked out at once: one compiled shape serves any number of them, and few are repeated for it
SHADOWS = 64  # whose tables a thread works out
AT_ONCE = 128  # whose misfits are whitened together: a matrix product for 16 takes three times as long for each
NEARER = (0.5, 0.0)  # shares of the line's nuisances tried where they are hopeless
STEPS = 8  # of the nuisances after that, at most
SETTLED = 0.2  # fall of the squares that is not worth another step
TRIED, HOPELESS = 2, 50.0  # steps after which a limb is left that promises squares this far above the optimum's
SHORTER = 0.3  # a step that made things worse, when it is tried again
LEARNT = 96  # draws that the nuisances' room is learnt from


class LimbPosterior:
    """Log posterior of the limb up to a constant, the nuisances integrated out, the errors' size not quite known.

    Nuisances are sought from those at the nearest of the optimum, its rivals and the points of its `ridge`, and from
    what points that it learnt from (`explore`) tell of them. As long as their room was not learnt (`learn`), it is
    taken to be the same everywhere.

    - `evaluated`, `not_finite`: at how many points it was asked for, and at how many it was not a finite number.
    """

    def __init__(self, likelihood: Likelihood, optimum: Optimum):
        self.likelihood, self.sizes, self.room = likelihood, ErrorSize(optimum), Room.everywhere_alike()
        self.ends = [Surroundings(likelihood, end) for end in (optimum, *optimum.rivals, *optimum.ridge)]
        self.known = Known.nothing(LIMB, optimum.z.size - LIMB)
        self.evaluated = self.not_finite = 0
        self.counting = Lock()

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Log densities (draw,) of points (draw, parameter); -inf where not finite."""
        return self._log_density(z, self.squares(z))

    def explore(self, z: np.ndarray) -> np.ndarray:
        """The same, and from now on nuisances are sought from what these points tell of them, too."""
        squares, nuisances = self._at_best(z)
        self.known = self.known.with_more(z, nuisances, squares + np.sum(z**2, axis=1))
        return self._log_density(z, squares)

    def _log_density(self, z: np.ndarray, squares: np.ndarray) -> np.ndarray:
        value = self.sizes.log_density(z, squares)
        value = np.where(np.isfinite(value), value + self.room(z), -np.inf)
        with self.counting:
            self.evaluated += value.size
            self.not_finite += int(np.sum(~np.isfinite(value)))
        return value

    def squares(self, z: np.ndarray) -> np.ndarray:
        """Sums of the squared whitened misfits and nuisances, which are at their best (draw,)."""
        return self._at_best(z)[0]

    def learn(self, z: np.ndarray) -> Room:
        """What log densities have more from now on: the nuisances' room, learnt once from draws (draw, parameter)."""
        whole = np.concatenate([z[:LEARNT], self._at_best(z[:LEARNT])[1]], axis=1)
        volumes = list(side_by_side(partial(log_volume, self.likelihood), list(whole)))
        self.room = Room.through(whole[:, :LIMB], np.array(volumes))
        return self.room

    def _at_best(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Squares (draw,) and nuisances (draw, nuisance), found from the `Surroundings` that points are in."""
        compiled = self.evaluated > 0
        tables = partial(batched, partial(_entries, self.likelihood.shadow))
        entries = np.concatenate(list(side_by_side(tables, _pieces(z, SHADOWS), compiled)))
        guess = None if self.known.guess is None else self.known.guess(z)
        nearest = np.argmax([end.limb.log_density(z) for end in self.ends], axis=0)
        parts = [
            (end, which)
            for number, end in enumerate(self.ends)
            for which in _pieces(np.flatnonzero(nearest == number), AT_ONCE)
        ]

        def found(part):
            end, which = part
            return end.at_best(z[which], entries[which], None if guess is None else guess[which])

        squares, nuisances = np.empty(len(z)), np.empty((len(z), self.known.nuisances.shape[1]))
        for (_, which), of_part in zip(parts, side_by_side(found, parts, compiled), strict=True):
            squares[which], nuisances[which] = of_part
        return squares, nuisances


class Surroundings:
    """The posterior about one optimum, or about the best point with some quantities fixed."""

    def __init__(self, likelihood: Likelihood, optimum: Optimum):
        self.likelihood, self.optimum, self.limb = likelihood, optimum, optimum.limb
        slopes = []
        for number, (_, by) in enumerate(likelihood.misfits_and_slopes(optimum.z)):
            everywhere = np.zeros((len(by), optimum.z.size))
            everywhere[:, likelihood.columns(number)] = by
            slopes.append(everywhere[:, LIMB:])
        self.slopes = likelihood.whitener.coordinates(slopes)
        self.signs = np.append(likelihood.whitener.signs, np.ones(self.slopes.shape[1]))
        self.centres = [jnp.asarray(optimum.z[place]) for place in likelihood.places]
        self.seen = [seen_and_slopes(*item) for item in zip(likelihood.models, self.centres, strict=True)]

    def at_best(self, *given) -> tuple[np.ndarray, np.ndarray]:
        """Squares of whitened misfits and nuisances (draw,), and these (draw, nuisance); arguments of `best`."""
        rows = self.best(*given)
        return rows**2 @ self.signs, rows[:, -self.slopes.shape[1] :]

    def best(self, limbs: np.ndarray, entries: np.ndarray, guess: np.ndarray | None = None) -> np.ndarray:
        """`JointWhitener.coordinates` of the misfits, and nuisances at their best, under limbs (draw, parameter).

        Begun with a guess, where it is far too bad with those on the line through the optimum's; without one, where
        those are, with some between. Steps are taken from the best so far, shorter after a bad one, with slopes that
        learn from all of them (`Secants`).

        - `entries`: of the shadow's tables (draw, offset, 1, channel).
        - `guess`: (draw, nuisance), if there is one.
        """
        count, here = self.slopes.shape[1], self.optimum.z[LIMB:]
        hopeless = self.optimum.cost + HOPELESS - np.sum(limbs**2, axis=1)
        line = self.optimum.nuisances(limbs)
        if guess is None:
            first, others = line, [here + part * (line - here) for part in NEARER]
        else:
            first, others = guess, [line]
        best = self._rows(entries, first)
        least = self._finite_squares(best)

        def keep(which, rows):
            """Rows of the draws `which`, where they are better; and whether they are."""
            squares = self._finite_squares(rows)
            better = squares < least[which]
            best[which[better]], least[which[better]] = rows[better], squares[better]
            return better

        for other in others:
            bad = np.flatnonzero(least > hopeless)
            if bad.size:
                keep(bad, self._rows(entries[bad], other[bad]))
        slopes = Secants(self.slopes, self.optimum.information[LIMB:, LIMB:], len(limbs), self.signs[:-count])
        moving, share = np.arange(len(limbs)), np.ones(len(limbs))
        for tried in range(STEPS):
            known = np.where(np.isfinite(best[moving]), best[moving], 0.0)
            gradient = slopes.transposed(moving, known[:, :-count]) + known[:, -count:]
            step = slopes.step(moving, gradient)
            fall = np.sum(gradient * step, axis=1)  # of the squares, were they a parabola
            promising = fall * share[moving] * (2.0 - share[moving]) > SETTLED
            if tried >= TRIED:
                promising &= least[moving] - fall < hopeless[moving]
            moving, move, known = moving[promising], -(share[moving, None] * step)[promising], known[promising]
            if not moving.size:
                break
            rows = self._rows(entries[moving], best[moving, -count:] + move)
            slopes.learn(moving, move, rows[:, :-count] - known[:, :-count])
            share[moving] = np.where(keep(moving, rows), 1.0, SHORTER * share[moving])
        return best

    def _rows(self, entries: np.ndarray, nuisances: np.ndarray) -> np.ndarray:
        """`JointWhitener.coordinates` of the misfits with these nuisances, and the nuisances (draw, coordinate)."""
        one, each = self.likelihood, []
        for number, place in enumerate(one.places):
            known = one.models[number], one.observed[number], one.shadow, self.seen[number], self.centres[number]
            each.append(batched(partial(_misfits, *known), entries, nuisances[:, place - LIMB]).T)
        return np.concatenate([one.whitener.coordinates(each), nuisances.T]).T

    def _finite_squares(self, rows: np.ndarray) -> np.ndarray:
        """Sums of squares (draw,); infinite where not finite."""
        squares = rows**2 @ self.signs
        return np.where(np.isfinite(squares), squares, np.inf)


def _pieces(points: np.ndarray, most: int) -> list[np.ndarray]:
    """Points, or their indices, in pieces of so many at most."""
    return [points[begin : begin + most] for begin in range(0, len(points), most)]


def batched(function: Callable, *values: np.ndarray) -> np.ndarray:
    """What a function compiled for `BATCH` points makes of any number of them, the last of which is repeated."""
    count = len(values[0])
    padded = [np.concatenate([each, np.repeat(each[-1:], -count % BATCH, axis=0)]) for each in values]
    parts = zip(*(np.split(each, len(each) // BATCH) for each in padded), strict=True)
    return np.concatenate([np.asarray(function(*map(jnp.asarray, part))) for part in parts])[:count]


@eqx.filter_jit
def _misfits(
    model, observed: Observed, shadow: Shadow, seen, centre: Float[Array, " nuisance"],
    entries: Float[Array, "draw offset 1 channel"], nuisances: Float[Array, "draw nuisance"],
) -> Float[Array, "draw datum"]:  # fmt: skip
    """Misfits of one photograph for many tables of the shadow, given by their entries, each with its nuisances.

    - `seen`: of `seen_and_slopes` at the nuisances `centre`.
    """
    view = of_the_view(model)

    def one(log_light, nuisance):
        shown = jax.tree.map(lambda at, by: at + jnp.tensordot((nuisance - centre)[view], by, axes=1), *seen)
        return misfit_of(model, observed, shadow.table(log_light), shown, nuisance)

    return jax.vmap(one)(entries, nuisances)


@eqx.filter_jit
def _entries(shadow: Shadow, limb: Float[Array, "draw parameter"]):
    """Entries of the shadow's tables (draw, offset, 1, channel)."""
    return jax.vmap(lambda z: shadow(z).log_light)(limb)
