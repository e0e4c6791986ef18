"""How well a fit knows the size of its errors: how far its estimates stray under the true ones, by what it says.

    python -m benchmarks.error_sizes --count 96

A fit counts with errors as large as the camera of its optimum makes those of the light, of amplitudes that it fits; in
drawn photographs both are known. What a drawn error does to the limb is followed to first order about the optimum.
`inverse.error_size` stands for what is found. Prints the mean and the spread of the log ratios, and keeps them.
"""

import argparse
import json
import os
from pathlib import Path

import numpy as np

from benchmarks.calibration import QUANTITIES, SEED
from benchmarks.drawn_evidence import evidence_of, of_each, true_errors, truth
from benchmarks.measure import RESULTS
from eclipsejax import session

ERRORS = 1000  # drawn for each photograph: standard deviations to 2 %


def log_ratios(number: int, folder: Path) -> list[float]:
    """Of the standard deviations of the `QUANTITIES` under the true errors by those under the fit's."""
    session.start()
    from inverse.optimum import best

    drawn, photo, before = evidence_of(number, folder)
    optimum, likelihood = best(before, [photo.neighbours()])
    true = true_errors(before, drawn, truth(before, drawn, photo.registration))
    measured = np.asarray(likelihood.observed[0].measured)[:, None]
    ((_, slopes),) = likelihood.misfits_and_slopes(optimum.z)
    (slopes,) = likelihood.whitener([slopes * measured])
    spreads = []
    for errors in (true, likelihood.errors[0]):
        (white,) = likelihood.whitener([drawn_errors(errors, np.random.default_rng(number), ERRORS) * measured])
        spreads.append((optimum.covariance @ (slopes.T @ white)).std(axis=1))
    names = [parameter.name for parameter in likelihood.parameters]
    return np.log(spreads[0] / spreads[1])[[names.index(name) for name in QUANTITIES]].tolist()


def drawn_errors(errors, random: np.random.Generator, count: int) -> np.ndarray:
    """Draws of the log values' errors (datum, draw)."""
    roots = errors.independent * np.linalg.cholesky(errors.cells)
    alone = roots @ random.standard_normal((*roots.shape[:2], count))
    modes = (errors.modes * errors.amplitudes) @ random.standard_normal((errors.modes.shape[1], count))
    return alone.reshape(modes.shape) + modes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=96)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    ratios = []
    for number, row in enumerate(of_each(log_ratios, options.count, options.workers)):
        ratios.append(row)
        print(f"photograph {number}: " + " ".join(f"{value:+.2f}" for value in row), flush=True)
    of_all = np.array(ratios)
    found = {
        "photographs": options.count, "seed": SEED, "mean": float(of_all.mean()), "spread": float(of_all.std()),
        "quantities": {
            name: {"mean": float(each.mean()), "spread": float(each.std())}
            for name, each in zip(QUANTITIES, of_all.T, strict=True)
        },
    }  # fmt: skip
    print(f"log ratio of standard deviations, true by claimed: {found['mean']:+.2f} +- {found['spread']:.2f}")
    (RESULTS / "error_sizes.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
