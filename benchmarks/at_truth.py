"""What photographs say about the model itself: how far a fit would move from the truth, in standard deviations.

    python -m benchmarks.at_truth --count 60

Photographs are drawn from the prior, and their likelihood is followed to first order about the truth, with errors of
the true sizes: one step, of no optimiser. Over many photographs the steps of a right model have mean 0 and variance 1.
The same photographs, drawn once more without errors of surface and limb, leave what two programs make differently of
one scene. Coverage says whether intervals are wrong; this says by what, in seconds a photograph. Prints and keeps both.
"""

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.calibration import SEED
from benchmarks.drawn_evidence import evidence_of, of_each, true_errors, truth
from benchmarks.measure import RESULTS
from eclipsejax import session


def steps(misfit: np.ndarray, slopes: np.ndarray, z: np.ndarray | float) -> np.ndarray:
    """From a point to the best one by straight lines, in standard deviations (parameter,).

    - `misfit`: whitened (datum,); `slopes`: its derivatives (datum, parameter); `z`: the point, of prior N(0, 1); 0 for
      what the data alone would move.
    """
    information = slopes.T @ slopes + np.eye(slopes.shape[1])
    move = -np.linalg.solve(information, slopes.T @ misfit + z)
    return move / np.sqrt(np.diag(np.linalg.inv(information)))


def moved(number: int, folder: Path) -> dict[str, list[float]] | None:
    """Steps of one photograph by parameter, with its errors and without; None if it cannot be fitted."""
    session.start()
    from eclipsejax.errors import InputError

    found: dict[str, list[float]] = {}
    for share in (1.0, 0.0):
        try:
            drawn, photo, before = evidence_of(number, folder, share)
        except InputError:
            return None
        z = truth(before, drawn, photo.registration)
        errors = true_errors(before, drawn, z)
        # The mean of what bends with errors is not there without them.
        likelihood = before.with_errors([errors if share else replace(errors, excess=0.0)])
        ((misfit, slopes),) = likelihood.misfits_and_slopes(z)
        measured = np.asarray(likelihood.observed[0].measured)
        columns = np.column_stack([misfit, slopes]) * measured[:, None]
        (white,) = likelihood.whitener([columns])
        for name, step in zip(likelihood.labels, steps(white[:, 0], white[:, 1:], z * share), strict=True):
            found.setdefault(name, []).append(float(step))
    return found


def summary(rows: list[dict[str, list[float]]]) -> dict[str, dict[str, float]]:
    """By parameter: mean and standard deviation of the steps, and the mean of those without errors, with its error."""
    found = {}
    for name in rows[0]:
        step, alone = np.array([row[name] for row in rows]).T
        found[name] = {
            "mean": float(step.mean()), "standard deviation": float(step.std()),
            "without errors": float(alone.mean()), "error of that": float(alone.std() / np.sqrt(len(rows))),
        }  # fmt: skip
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    rows = [row for row in of_each(moved, options.count, options.workers) if row is not None]
    found = summary(rows)
    for name, one in found.items():
        print(
            f"{name:<28}mean {one['mean']:+.2f}, standard deviation {one['standard deviation']:.2f}; "
            f"without errors {one['without errors']:+.2f} +- {one['error of that']:.2f}"
        )
    kept = {"photographs": len(rows), "not fitted": options.count - len(rows), "seed": SEED, "steps": found}
    (RESULTS / "at_truth.json").write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main()
