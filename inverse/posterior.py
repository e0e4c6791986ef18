"""The posterior of the limb: a density over the few parameters of the air, which all photographs share.

The nuisances of the photographs are at their best under each limb, found by a few steps (`inverse.secants`): a full
descent leaves log densities 0.1 to 0.6 higher in the mean of one posterior's draws, at random. The marginal is that
times their room (`inverse.room`), which is learnt from draws of the posterior. To first order about the optimum alone
neither would do: tone curve, colour matrix and exposure bend together, and an interval three times too narrow was seen.
A sampler then sees only the atmosphere. Which points of the Moon a photograph shows, half of the work, is followed to
first order: that changed the log densities of one posterior's draws by 0.02 to 0.5 (rms of nine drawn photographs).
"""

from collections.abc import Callable, Iterator
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
from inverse.observed import Observed
from inverse.photo_model import of_the_view, seen_and_slopes
from inverse.room import Room, log_volume
from inverse.secants import Secants
from inverse.threads import side_by_side

BATCH = 4  # points worked out at once: one compiled shape serves any number of them, of which few are left over
SHADOWS = 8  # tables of the shadow worked out side by side: more needs memory and is no faster on a few cores
AT_ONCE = 128  # whose misfits are whitened together: a matrix product for 16 takes three times as long for each
NEARER = (0.5, 0.0)  # shares of the linear guess tried where it is hopeless
STEPS = 8  # of the nuisances after that, at most
SETTLED = 0.2  # fall of the squares that is not worth another step
TRIED, HOPELESS = 2, 50.0  # steps after which a limb is left that promises squares this far above the optimum's
SHORTER = 0.3  # a step that made things worse, when it is tried again
LEARNT = 96  # draws that the nuisances' room is learnt from


class LimbPosterior:
    """Log posterior of the limb up to a constant, the nuisances integrated out, the errors' size not quite known.

    Nuisances are sought from those at the nearest of the optimum, its rivals and the points of its `ridge`. As long as
    their room was not learnt, it is taken to be the same everywhere.

    - `evaluated`, `not_finite`: at how many points it was asked for, and at how many it was not a finite number.
    """

    def __init__(self, likelihood: Likelihood, optimum: Optimum):
        self.likelihood, self.sizes, self.room = likelihood, ErrorSize(optimum), Room.everywhere_alike()
        self.ends = [Surroundings(likelihood, end) for end in (optimum, *optimum.rivals, *optimum.ridge)]
        self.evaluated = self.not_finite = 0
        self.counting = Lock()

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Log densities (draw,) of points (draw, parameter); -inf where not finite."""
        value = self.sizes.log_density(z, self.squares(z))
        value = np.where(np.isfinite(value), value + self.room(z), -np.inf)
        with self.counting:
            self.evaluated += value.size
            self.not_finite += int(np.sum(~np.isfinite(value)))
        return value

    def squares(self, z: np.ndarray) -> np.ndarray:
        """Sums of the squared whitened misfits and nuisances, which are at their best (draw,)."""
        squares = np.empty(len(z))
        for which, found in self._parts(z, Surroundings.squares):
            squares[which] = found
        return squares

    def learn(self, z: np.ndarray) -> Room:
        """What log densities have more from now on: the nuisances' room, learnt once from draws (draw, parameter)."""
        places, nuisances = zip(*self._parts(z[:LEARNT], Surroundings.nuisances), strict=True)
        whole = np.column_stack([z[np.concatenate(places)], np.concatenate(nuisances)])
        volumes = list(side_by_side(partial(log_volume, self.likelihood), list(whole)))
        self.room = Room.through(whole[:, :LIMB], np.array(volumes))
        return self.room

    def _parts(self, z: np.ndarray, of: Callable) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Which points, `AT_ONCE` at most, and what `of` finds of them in the `Surroundings` that they are in."""
        nearest = np.argmax([end.limb.log_density(z) for end in self.ends], axis=0)
        groups = [np.flatnonzero(nearest == number) for number in range(len(self.ends))]
        parts = [
            (end, own[begin : begin + AT_ONCE])
            for end, own in zip(self.ends, groups, strict=True)
            for begin in range(0, own.size, AT_ONCE)
        ]
        return side_by_side(lambda part: (part[1], of(part[0], z[part[1]])), parts, compiled=self.evaluated > 0)


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

    def squares(self, limbs: np.ndarray) -> np.ndarray:
        """Of whitened misfits and nuisances, which are at their best under limbs (draw, parameter): summed (draw,)."""
        return self.best(limbs) ** 2 @ self.signs

    def nuisances(self, limbs: np.ndarray) -> np.ndarray:
        """The best ones (draw, nuisance) under limbs (draw, parameter)."""
        return self.best(limbs)[:, -self.slopes.shape[1] :]

    def best(self, limbs: np.ndarray) -> np.ndarray:
        """`JointWhitener.coordinates` of the misfits, and nuisances at their best, under limbs (draw, parameter).

        Where the nuisances of the linear guess are far too bad, those between it and the optimum's are tried. Steps are
        taken from the best so far, shorter after a bad one, with slopes that learn from all of them (`Secants`).
        """
        entries = batched(partial(_entries, self.likelihood.shadow), limbs)
        count, here = self.slopes.shape[1], self.optimum.z[LIMB:]
        hopeless = self.optimum.cost + HOPELESS - np.sum(limbs**2, axis=1)
        guess = self.optimum.nuisances(limbs)
        best = self._rows(entries, guess)
        least = self._finite_squares(best)

        def keep(which, rows):
            """Rows of the draws `which`, where they are better; and whether they are."""
            squares = self._finite_squares(rows)
            better = squares < least[which]
            best[which[better]], least[which[better]] = rows[better], squares[better]
            return better

        for part in NEARER:
            bad = np.flatnonzero(least > hopeless)
            if bad.size:
                keep(bad, self._rows(entries[bad], here + part * (guess[bad] - here)))
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
    return jax.lax.map(lambda z: shadow(z).log_light, limb, batch_size=SHADOWS)
