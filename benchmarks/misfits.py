"""What a fit makes of photographs that are wrong in ways it knows nothing of: does the dust hold?

    python -m benchmarks.misfits                # 10 photographs in each of seven ways: 45 minutes on two cores
    python -m benchmarks.misfits --draws 0      # by Laplace's approximation alone: half an hour

Photographs are those of `benchmarks.calibration`, spoilt. The bias is the mean change of the median optical depth by
what is wrong, of the same photographs; wanted is 0.003 or a tenth of their mean optical depth, and 95 % intervals that
hold the truth in nine of ten, of which the photographs before they are spoilt tell what chance does. Rows are kept as
there, and the same command does what is left.
"""

import argparse
import json
import os
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.calibration import OUT as CALIBRATION
from benchmarks.calibration import SEED, optical_depths, run
from benchmarks.coverage import coverage
from benchmarks.measure import RESULTS
from inverse.misfit_check import IMPROBABLE

WAYS: dict[str, dict[str, Any]] = {
    "vignetting of 10 %": {"vignetting": 0.1},
    "clouds to 13 km on a fifth of the limb": {"clouds": 13e3},
    "clock wrong by 2 minutes": {"clock": 120.0},
    "glow of 0.5 %, uneven": {"glow": 0.005},
    "tone curve wrong by 5 %": {"tone": 0.05},
    "tropical air": {"air": "tropical"},
    "subarctic winter's air": {"air": "subarctic_winter"},
}
OUT = Path("out/misfits")
LARGEST_BIAS, LARGEST_SHARE, LEAST_COVERAGE = 0.003, 0.1, 0.9


def judged(rows: list[dict], clean: list[dict]) -> dict[str, Any]:
    """Bias of the optical depth, and how often intervals held the truth."""
    both = ["error" not in row and "error" not in other for row, other in zip(rows, clean, strict=True)]
    fits, unspoilt = list(compress(rows, both)), list(compress(clean, both))
    change = optical_depths(fits, "median") - optical_depths(unspoilt, "median")
    bias, wanted = float(change.mean()), max(LARGEST_BIAS, LARGEST_SHARE * float(optical_depths(fits, "truth").mean()))
    held = coverage(np.array([row["rank"]["dust.extinction"] for row in fits]), 0.95, 1).share
    return {
        "photographs": len(rows), "not fitted": len(rows) - len(fits),
        "bias": bias, "wanted": wanted, "coverage of 95 %": held,
        "median of all changes": float(np.median(change)),
        "told that the model does not explain them": int(sum(row["p"] < IMPROBABLE for row in fits)),
        "inside": abs(bias) <= wanted and held >= LEAST_COVERAGE,
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10, metavar="N", help="photographs in each way; default 10")
    parser.add_argument("--draws", type=int, metavar="N", help="as of fit_atmosphere")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"of the rows; default {OUT}")
    parser.add_argument(
        "--clean",
        type=Path,
        default=CALIBRATION,
        metavar="DIR",
        help=f"of the rows of calibration; default {CALIBRATION}",
    )
    options = parser.parse_args()
    clean = run(range(options.count), options.draws, options.workers, options.clean)
    found = {"nothing wrong": judged(clean, clean)}
    for way, wrong in WAYS.items():
        print(f"{way}:", flush=True)
        found[way] = judged(run(range(options.count), options.draws, options.workers, options.out, wrong), clean)
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "misfits.json").write_text(
        json.dumps({"seed": SEED, "draws": options.draws, "ways": found}, indent=1) + "\n"
    )
    for way, one in found.items():
        print(
            f"{way:<40}bias {one['bias']:+.4f} (wanted {one['wanted']:.4f}), 95 % intervals hold "
            f"{one['coverage of 95 %']:.0%}{'' if one['inside'] else ', missed'}"
        )
    return 0 if all(one["inside"] for one in found.values()) else 1


if __name__ == "__main__":
    raise SystemExit(main())
