"""How large the errors of a photograph are, by its own evidence; and which of its cells belong to no model.

The amplitudes of independent and of smooth errors are those at which the photograph is most probable once its model
has been fitted: the evidence counts the fitted quantities too, so that a flexible model does not pass for a good one.
Cells that differ from their neighbours by more than three errors (stars, hot pixels) count as three (Huber 1964).
Student's distribution was tried: where the errors are Gaussian after all, it takes them for an eighth smaller.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from inverse.noise import CHROMATIC, COMMON, UNEVEN, Errors

# Lognormal priors of s, a, c, u: a discrepancy that is free to be anything eats the physics (Brynjarsdottir & O'Hagan
# 2014). An error of 25 % is two widths away.
CENTRES = np.log([1.0, COMMON, CHROMATIC, UNEVEN])
WIDTHS = np.array([0.7, 0.3, 0.3, 0.8])
# Nor are the first three ever smaller than was thought beforehand (`inverse.noise`): that one photograph fits better
# may be luck, and the model itself (its table, nuisances taken for straight) is no better than some per cent.
LEAST = np.append(CENTRES[:3], np.log(0.1 * UNEVEN))
MOST = np.log([100.0, 2.0, 2.0, 2.0])  # farther out a search for the minimum is lost, and so are the digits
FARTHEST = 3.0  # errors
ROUNDS = 3  # between amplitudes and weights


def fitted_errors(
    errors: Errors, misfit: np.ndarray, slopes: np.ndarray, usable: np.ndarray, neighbours: np.ndarray
) -> Errors:
    """The same errors with the most probable amplitudes and weights.

    - `misfit`: at the optimum (datum,); `slopes`: its derivatives by the parameters (datum, parameter); `usable`:
      1 where a datum counts (datum,).
    - `neighbours`: numbers of the cells around each cell, itself among them (cell, neighbour).
    """
    used = usable > 0
    local = local_misfit(misfit, used, neighbours)
    for _ in range(ROUNDS):
        errors = _amplitudes(errors, misfit, slopes, used)
        excess = local / (errors.independent * errors.sigma)
        errors = replace(errors, outlying=np.maximum(1.0, (excess / FARTHEST) ** 2))
    return errors


def _amplitudes(errors: Errors, misfit, slopes, used) -> Errors:
    """The most probable s, a, c and u with the weights as they are."""
    rank = errors.modes.shape[1]
    columns = np.concatenate([errors.modes, slopes, misfit[:, None]], axis=1) * used[:, None]
    columns = replace(errors, independent=1.0).alone(columns)
    gram = columns.T @ columns
    modes, rest = slice(0, rank), slice(rank, None)
    group = errors.kinds
    count = int(used.sum())

    def cost(log_amplitude):
        independent, *smooth = np.exp(log_amplitude)
        ratio = np.asarray([1.0, *smooth])[group] / independent
        # Woodbury: (1 + L L')^-1 = 1 - L (1 + L'L)^-1 L'.
        inner = np.eye(rank) + ratio[:, None] * gram[modes, modes] * ratio
        factor = np.linalg.cholesky(inner)
        half = np.linalg.solve(factor, ratio[:, None] * gram[modes, rest])
        whole = (gram[rest, rest] - half.T @ half) / independent**2
        fitted = np.linalg.slogdet(np.eye(len(whole) - 1) + whole[:-1, :-1])[1]
        logarithms = 2.0 * count * np.log(independent) + 2.0 * np.log(np.diag(factor)).sum() + fitted
        return 0.5 * (whole[-1, -1] + logarithms + np.sum(((log_amplitude - CENTRES) / WIDTHS) ** 2))

    now = [errors.independent, errors.smooth, errors.chromatic, errors.uneven]
    start = np.clip(np.log(now), LEAST + 0.05, MOST)
    found = minimize(
        cost, start, method="L-BFGS-B", bounds=list(zip(LEAST, MOST, strict=True)),
        options={"eps": 1e-4, "ftol": 1e-6},
    )  # fmt: skip
    independent, smooth, chromatic, uneven = (float(value) for value in np.exp(found.x))
    return replace(errors, independent=independent, smooth=smooth, chromatic=chromatic, uneven=uneven)


def local_misfit(misfit, used, neighbours) -> np.ndarray:
    """Misfits against the median of their neighbours' (datum,): no failure of the model as a whole is in them."""
    cells = np.where(used, misfit, np.nan).reshape(len(neighbours), -1)
    around = cells[neighbours]  # (cell, neighbour, channel)
    known = np.isfinite(around).sum(axis=1) > neighbours.shape[1] // 2
    middle = np.nanmedian(np.where(known[:, None], around, 0.0), axis=1)
    return np.where(known & np.isfinite(cells), cells - middle, 0.0).ravel()
