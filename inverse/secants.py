"""Slopes that follow a search: those at its begin, corrected by what every step of it found.

Of many searches side by side, each near another point, where the slopes of all would cost ten times their steps. About
an optimum the slopes there will do. Far from it they mislead: where clouds are lower, cells that were black are lit,
and answer to exposure and tone curve as they did not.
"""

import numpy as np


class Secants:
    """Slopes (draw, datum, parameter) of misfits, and the normal equations of least squares with them.

    After Broyden (1965): the least change of the slopes that explains a step. A change is a product of two vectors, so
    that no slopes but the first are ever held whole.

    - `slopes`: at the begin of all searches (datum, parameter).
    - `information`: of the same, with what else makes the squares (parameter, parameter).
    - `draws`: number of searches.
    - `signs`: of the data's squares (datum,), where they are `JointWhitener.coordinates`.
    """

    def __init__(self, slopes: np.ndarray, information: np.ndarray, draws: int, signs: np.ndarray | float = 1.0):
        self.slopes, self.signs = slopes, signs
        self.information = np.repeat(information[None], draws, axis=0)
        self.changes: list[tuple[np.ndarray, np.ndarray]] = []  # of each step (draw, datum), (draw, parameter)

    def transposed(self, who: np.ndarray, misfits: np.ndarray) -> np.ndarray:
        """Slopes of the searches `who`, transposed, times misfits (draw, datum): (draw, parameter)."""
        misfits = self.signs * misfits
        found = misfits @ self.slopes
        for change, move in self.changes:
            found += np.sum(change[who] * misfits, axis=1)[:, None] * move[who]
        return found

    def times(self, who: np.ndarray, move: np.ndarray) -> np.ndarray:
        """Slopes of the searches `who` times moves (draw, parameter): (draw, datum)."""
        found = move @ self.slopes.T
        for change, before in self.changes:
            found += np.sum(before[who] * move, axis=1)[:, None] * change[who]
        return found

    def step(self, who: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """To where the squares would be least, from a half of their gradient (draw, parameter), downwards."""
        return np.linalg.solve(self.information[who], gradient[..., None])[..., 0]

    def learn(self, who: np.ndarray, move: np.ndarray, changed: np.ndarray) -> None:
        """Correct the slopes of the searches `who`, whose misfits a move (draw, parameter) changed (draw, datum)."""
        missed = (changed - self.times(who, move)) / np.sum(move**2, axis=1)[:, None]
        missed = np.where(np.isfinite(missed), missed, 0.0)
        cross = self.transposed(who, missed)[..., None] * move[:, None]
        both = np.sum(self.signs * missed**2, axis=1)[:, None, None] * move[..., None] * move[:, None]
        self.information[who] += cross + np.swapaxes(cross, 1, 2) + both
        every = len(self.information)
        change, before = np.zeros((every, missed.shape[1])), np.zeros((every, move.shape[1]))
        change[who], before[who] = missed, move
        self.changes.append((change, before))
