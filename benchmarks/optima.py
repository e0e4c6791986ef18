"""Whether descents find the best optimum, and whether the posterior knows the truth for possible.

    python -m benchmarks.optima --count 60      # eleven minutes on two cores

Photographs are drawn from the prior; with the errors that the fit of one has found, a descent from the true limb and
camera may find a better end than the fit's several starts did. And the posterior of the true limb, by the nuisances
that its own search finds there, should not be far below that of the optimum: half of chi-squared of as many degrees of
freedom as the limb has parameters, were it a Gaussian. Prints both for each photograph, and keeps them.
"""

import argparse
import json
import os
from pathlib import Path

import numpy as np

from benchmarks.calibration import SEED
from benchmarks.drawn_evidence import evidence_of, of_each, truth
from benchmarks.measure import RESULTS
from eclipsejax import session

BETTER = 1.0  # in cost
FAR = 13.0  # below the optimum in log density: one in 500 truths, of a Gaussian of nine parameters


def descended(number: int, folder: Path) -> dict[str, float] | None:
    """Costs of the fit's optimum and of the end of a descent from the truth, the truth's log density by the optimum's.

    None for a photograph that cannot be fitted.
    """
    session.start()
    from eclipsejax.errors import InputError
    from inverse.likelihood import LIMB
    from inverse.map_estimate import descend
    from inverse.optimum import best
    from inverse.posterior import LimbPosterior

    try:
        drawn, photo, before = evidence_of(number, folder)
    except InputError:
        return None
    optimum, likelihood = best(before, [photo.neighbours()])
    true = truth(before, drawn, photo.registration)
    here, there = LimbPosterior(likelihood, optimum)(np.array([optimum.z[:LIMB], true[:LIMB]]))
    return {
        "cost": optimum.cost,
        "from_truth": descend(likelihood, true).cost,
        "steps": optimum.steps,
        "rivals": len(optimum.rivals),
        "truth": float(there - here),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    rows = {}
    for number, row in enumerate(of_each(descended, options.count, options.workers)):
        if row is None:
            print(f"photograph {number}: not fitted", flush=True)
            continue
        rows[number] = row
        print(
            f"photograph {number}: cost {row['cost']:.2f} after {row['steps']} steps, {row['rivals']} rivals; from the "
            f"truth {row['from_truth'] - row['cost']:+.2f}; log density of the truth {row['truth']:+.1f}",
            flush=True,
        )
    missed = [number for number, row in rows.items() if row["from_truth"] < row["cost"] - BETTER]
    far = [number for number, row in rows.items() if row["truth"] < -FAR]
    median = float(np.median([row["truth"] for row in rows.values()]))
    print(
        f"of {len(rows)}: better optima from the truth for {missed or 'none'}; truths more than {FAR:g} below for "
        f"{far or 'none'}; median {median:+.1f}"
    )
    kept = {"seed": SEED, "better from the truth": missed, "truth far below": far, "median": median, "rows": rows}
    (RESULTS / "optima.json").write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main()
