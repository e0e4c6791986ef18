"""How large the errors of a photograph are, by its own evidence; and which of its cells belong to no model.

The amplitudes of independent and of smooth errors are those at which the photograph is most probable once its model
has been fitted: the evidence counts the fitted quantities too, so that a flexible model does not pass for a good one.
Cells that differ from their neighbours by more than three errors (stars, hot pixels) count as three (Huber 1964).
Student's distribution was tried: where the errors are Gaussian after all, it takes them for an eighth smaller.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.linalg.lapack import dtrtri  # pyright: ignore[reportAttributeAccessIssue]
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
ROUNDS = 2  # between amplitudes and weights: a third changed those of one drawn photograph by 4e-4 of themselves


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
    columns = np.concatenate([errors.modes, slopes, misfit[:, None]], axis=1) * used[:, None]
    columns = replace(errors, independent=1.0).alone(columns)
    gram = columns.T @ columns
    start = np.clip(np.log(errors.sizes), LEAST + 0.05, MOST)
    found = minimize(
        improbability, start, (gram, errors.kinds, int(used.sum())), jac=True, method="L-BFGS-B",
        bounds=list(zip(LEAST, MOST, strict=True)), options={"ftol": 1e-6},
    )  # fmt: skip
    independent, smooth, chromatic, uneven = (float(value) for value in np.exp(found.x))
    return replace(errors, independent=independent, smooth=smooth, chromatic=chromatic, uneven=uneven)


def improbability(log_amplitude: np.ndarray, gram: np.ndarray, kinds: np.ndarray, count: int):
    """Minus the log of the evidence, up to a constant, and its derivatives by log s, a, c and u.

    - `gram`: products of modes, slopes and misfit with each other, divided by the errors of cells with s of 1.
    - `kinds`: as of `Errors`; `count`: of data.
    """
    independent, *smooth = np.exp(log_amplitude)
    ratio = np.asarray([1.0, *smooth])[kinds] / independent
    modes, rest = slice(0, kinds.size), slice(kinds.size, None)
    # Woodbury: (1 + L L')^-1 = 1 - L (1 + L'L)^-1 L'.
    factor = np.linalg.cholesky(np.eye(kinds.size) + ratio[:, None] * gram[modes, modes] * ratio)
    root, _ = dtrtri(factor, lower=1)
    half = root @ (ratio[:, None] * gram[modes, rest])
    whole = (gram[rest, rest] - half.T @ half) / independent**2
    known = np.eye(len(whole) - 1) + whole[:-1, :-1]
    logarithms = 2.0 * count * np.log(independent) + 2.0 * np.log(np.diag(factor)).sum() + np.linalg.slogdet(known)[1]
    apart = (log_amplitude - CENTRES) / WIDTHS
    by_whole = block_diag(np.linalg.inv(known), 1.0)
    pull = root.T @ half / independent
    by_ratio = 1.0 - np.sum(root**2, axis=0) - np.sum((pull @ by_whole) * pull, axis=1)  # of each mode
    slope = np.bincount(kinds, by_ratio, minlength=len(CENTRES))
    slope[0] = count - np.sum(whole * by_whole) - np.sum(by_ratio)  # they all are by s
    return 0.5 * (whole[-1, -1] + logarithms + np.sum(apart**2)), slope + apart / WIDTHS


def local_misfit(misfit, used, neighbours) -> np.ndarray:
    """Misfits against the median of their neighbours' (datum,): no failure of the model as a whole is in them."""
    cells = np.where(used, misfit, np.nan).reshape(len(neighbours), -1)
    around = cells[neighbours]  # (cell, neighbour, channel)
    known = np.isfinite(around).sum(axis=1) > neighbours.shape[1] // 2
    middle = np.nanmedian(np.where(known[:, None], around, 0.0), axis=1)
    return np.where(known & np.isfinite(cells), cells - middle, 0.0).ravel()
