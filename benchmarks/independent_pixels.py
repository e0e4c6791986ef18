"""The negative control: what intervals hold where errors are taken to be independent from cell to cell, as is usual.

    python -m benchmarks.independent_pixels --count 60

The photographs are those of `benchmarks.calibration`. Their errors are noise and those of each cell by itself, as large
as makes the mean square of the misfits 1. Descents begin at the true limb and camera: it is not the search that fails.
Prints and keeps how often Laplace's intervals hold the truth.
"""

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import norm

from benchmarks.calibration import QUANTITIES, SEED
from benchmarks.coverage import LEVELS
from benchmarks.drawn_evidence import evidence_of, of_each, truth
from benchmarks.measure import RESULTS
from eclipsejax import session

ROUNDS = 2  # of sizes of errors, and descents with them


def ranks(number: int, folder: Path) -> dict[str, float] | None:
    """Shares of Laplace's Gaussian below the true quantities, by name; None for a photograph that cannot be fitted."""
    session.start()
    from eclipsejax.errors import InputError
    from inverse.map_estimate import descend

    try:
        drawn, photo, before = evidence_of(number, folder)
    except InputError:
        return None
    true = truth(before, drawn, photo.registration)
    (errors,), measured = before.errors, np.asarray(before.observed[0].measured) > 0
    none = np.zeros((measured.size, 1))
    likelihood = before.with_errors([replace(errors, modes=none, common=1, broad=0, black=0, excess=0.0)])
    optimum = descend(likelihood, true)
    for _ in range(ROUNDS):
        (errors,), (misfit,) = likelihood.errors, likelihood.misfits(optimum.z)
        (white,) = likelihood.whitener([misfit[:, None]])
        size = float(np.sqrt(np.mean(white[measured] ** 2)))
        likelihood = likelihood.with_errors([replace(errors, independent=errors.independent * size)])
        optimum = descend(likelihood, optimum.z)
    sd = np.sqrt(np.diag(optimum.covariance))
    found = norm.cdf((true - optimum.z) / sd)
    return {name: float(found[likelihood.labels.index(name)]) for name in QUANTITIES}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    rows = [row for row in of_each(ranks, options.count, options.workers) if row is not None]
    found = {}
    for name in QUANTITIES:
        away = np.abs(np.array([row[name] for row in rows]) - 0.5)
        found[name] = {f"{100 * level:.0f}": float(np.mean(away <= 0.5 * level)) for level in LEVELS}
        shares = ", ".join(f"{level} % intervals hold the truth in {share:.0%}" for level, share in found[name].items())
        print(f"{name:<26}{shares}")
    kept = {"seed": SEED, "photographs": len(rows), "quantities": found}
    (RESULTS / "independent_pixels.json").write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main()
