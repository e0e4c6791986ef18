"""How well RAW photographs tell the dust: one with the full Moon beside it, or three of totality.

    python -m benchmarks.accuracy                # 10 of each at two optical depths: an hour on two cores
    python -m benchmarks.accuracy --draws 0      # by Laplace's approximation alone

Photographs are drawn from the prior of a fit (`benchmarks.drawn_series`), but for their dust; what one JPEG tells is in
`benchmarks.calibration`. Rows are kept as there, and the same command does what is left. Prints and keeps errors and
standard deviations of the optical depth, beside what is wanted of them.
"""

import argparse
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.calibration import SEED, errors_of, optical_depths, row_of, run
from benchmarks.measure import RESULTS
from eclipsejax import session
from eclipsejax.atmosphere import Dust

WAYS = {"RAW and the full Moon": (0.4, "full"), "three RAW": (0.2, 0.5, 0.8)}  # phases of `draw_series`
WANTED = {
    "RAW and the full Moon": {0.01: 0.003, 0.1: 0.010},
    "three RAW": {0.01: 0.002, 0.1: 0.005},
}  # errors and standard deviations, by optical depth
OUT = Path("out/accuracy")


def fitted(number: int, draws: int | None, folder: Path, how: Mapping[str, Any]) -> dict:
    """The row of a series, of the dust alone."""
    session.start()
    from benchmarks.drawn_series import draw_series
    from inverse.fit import fit_atmosphere

    dust = how["depth"] / float(Dust(1.0).optical_depth)
    with tempfile.TemporaryDirectory() as pictures:
        drawn = draw_series(Path(pictures), SEED, number, WAYS[how["way"]], dust)
        fit = fit_atmosphere(
            [one.path for one in drawn], time=[one.utc for one in drawn], site=drawn[0].site, draws=draws, seed=number
        )  # fmt: skip
    return row_of(number, fit, drawn[0].limb)


def judged(rows: list[dict], wanted: float) -> dict[str, Any]:
    """Error and standard deviation of the optical depth."""
    fits = [row for row in rows if "error" not in row]
    off = optical_depths(fits, "median") - optical_depths(fits, "truth")
    errors = errors_of(fits)
    return {
        "series": len(rows), "not fitted": len(rows) - len(fits), **errors, "mean bias": float(off.mean()),
        "wanted": wanted, "inside": max(errors.values()) <= wanted,
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10, metavar="N", help="series of each kind; default 10")
    parser.add_argument("--draws", type=int, metavar="N", help="as of fit_atmosphere")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"of the rows; default {OUT}")
    options = parser.parse_args()
    found: dict[str, dict[str, Any]] = {}
    for way in WAYS:
        for depth, wanted in WANTED[way].items():
            print(f"{way}, optical depth {depth:g}:", flush=True)
            how = {"way": way, "depth": depth}
            rows = run(range(options.count), options.draws, options.workers, options.out, how, fitted)
            found.setdefault(way, {})[f"{depth:g}"] = judged(rows, wanted)
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "accuracy.json").write_text(
        json.dumps({"seed": SEED, "draws": options.draws, "ways": found}, indent=1) + "\n"
    )
    parts = [(way, depth, one) for way, of in found.items() for depth, one in of.items()]
    for way, depth, one in parts:
        print(
            f"{way:<24}optical depth {depth:<6}rms error {one['rms error']:.4f}, standard deviation "
            f"{one['mean sd']:.4f}, wanted {one['wanted']:.3f}{'' if one['inside'] else ', missed'}"
        )
    return 0 if all(one["inside"] for *_, one in parts) else 1


if __name__ == "__main__":
    raise SystemExit(main())
