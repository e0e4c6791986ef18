"""Whether the intervals of a fit can be believed: photographs drawn from its prior, fitted as users do.

    python -m benchmarks.calibration                  # 500 photographs, as the user gets them fitted
    python -m benchmarks.calibration --count 60 --draws 0     # Laplace's Gaussian alone
    python -m benchmarks.calibration --count 100 --draws 256000    # the ensembles on every one of them
    python -m benchmarks.calibration --first 100 --count 60 --minutes 30    # some of them, if there is time
    python -m benchmarks.calibration --rows rows.jsonl --minutes 120    # goes on with what another machine has done

The row of each photograph is kept in a file, as those of archives are, and the same command does what is left, so that
it may be stopped at any moment; rows of another version of the program, or of what draws the photographs, do not count.
Prints and keeps coverage and ranks, and fails (status 1) where they leave the bands of a right posterior.
"""

import argparse
import json
import math
import multiprocessing
import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage import LEVELS, coverage, least_tail, smallest_tail
from benchmarks.measure import RESULTS
from eclipsejax import session
from eclipsejax.atmosphere import Dust

SEED = 20221108
QUANTITIES = (
    "dust.extinction", "air.surface_temperature", "clouds.top", "clouds.cover", "ozone.column_du",
)  # fmt: skip
DEPTHS = {"0.01": (0.005, 0.02), "0.1": (0.05, 0.2)}  # optical depths whose errors are told
OUT = Path("out/calibration")
NOTHING: Mapping[str, Any] = {}


def fitted(number: int, draws: int | None, folder: Path, wrong: Mapping[str, Any]) -> dict:
    """The row of a photograph: ranks of the truth, medians, and how it was fitted."""
    session.start()
    from benchmarks.drawn_photograph import Wrong, draw
    from inverse.fit import fit_atmosphere

    drawn = draw(folder / f"{os.getpid()}.jpg", SEED, number, Wrong(**wrong))
    fit = fit_atmosphere(drawn.path, time=drawn.utc, site=drawn.site, draws=draws, seed=number, further=False)
    registration = fit.photos[0].registration
    assert registration is not None
    right, up, larger, roll = (fit.estimates[f"1.pointing.{name}"].map for name in ("right", "up", "radius", "roll"))
    row, column, radius = registration.row, registration.column, registration.radius
    turn = drawn.turned(registration)
    return row_of(number, fit, drawn.limb) | {
        "centre_error_px": float(np.hypot(row - drawn.row, column - drawn.column)),
        "fitted_centre_error_px": float(
            np.hypot(row - radius * up - drawn.row, column + radius * right - drawn.column)
        ),
        "radius_error": radius / drawn.radius - 1.0,
        "fitted_radius_error": radius * (1.0 + larger) / drawn.radius - 1.0,
        "roll_error_deg": float(np.degrees(turn)),
        "fitted_roll_error_deg": float(np.degrees(turn + roll)),
        "clock_error_s": fit.estimates["1.clock"].map - drawn.nuisance["clock"],
    }


def row_of(number: int, fit, truth: Mapping[str, float]) -> dict:
    """What is kept of any fit of a limb that is known."""
    told = fit.diagnostics
    return {
        "number": number,
        "truth": dict(truth),
        "rank": {name: float(np.mean(fit.draws[name] < value)) for name, value in truth.items()},
        "median": {name: fit.estimates[name].median for name in truth},
        "sd": {name: float(np.std(fit.draws[name])) for name in truth},
        "method": told["method"],
        "converged": told["converged"],
        "k_hat": (told["psis"] or {}).get("k_hat"),
        "p": told["misfit_checks"][0]["p"],
        "errors": told["errors"],
        "seconds": told["seconds"],
    }


def run(
    numbers: Sequence[int],
    draws: int | None,
    workers: int,
    folder: Path,
    how: Mapping[str, Any] = NOTHING,
    fitted=fitted,
    minutes: float = math.inf,
) -> list[dict]:
    """Rows of photographs of these numbers, kept ones and new.

    - `how`: they are drawn; of `fitted`, what is wrong with them, as `drawn_photograph.Wrong` takes it.
    - `fitted`: makes a row of (number, `draws`, `folder`, `how`) in a process of its own.
    - `minutes`: after which no photograph is begun any more; there are fewer rows then.
    """
    session.one_blas_thread()  # of the processes: they load NumPy before anything of ours
    from inverse.archive.rows import program, read_row, write_row
    from inverse.chain import digest

    (folder / "rows").mkdir(parents=True, exist_ok=True)
    keys = {number: digest([program(), _drawing(), SEED, draws, number, *how.items()]) for number in numbers}
    rows = {number: row for number, key in keys.items() if (row := read_row(folder, key)) is not None}
    left = [number for number in numbers if number not in rows]
    until = time.time() + 60.0 * minutes
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        tasks = {pool.submit(_in_time, until, fitted, number, draws, folder, how): number for number in left}
        for task in as_completed(tasks):
            number = tasks[task]
            try:
                row = task.result()
            except Exception as error:  # a photograph that cannot be fitted is a result, too
                row = {"number": number, "error": f"{type(error).__name__}: {error}"[:300]}
            if row is None:
                continue
            rows[number] = {**row, "key": keys[number]}
            write_row(folder, rows[number])
            print(f"{len(rows)} of {len(keys)}: photograph {number} {_short(row)}", flush=True)
    return [rows[number] for number in sorted(rows)]


def _drawing() -> list[str]:
    """The code that photographs are drawn with."""
    return [path.read_text() for path in sorted(Path(__file__).parent.glob("drawn_*.py"))]


def unpack(packed: Path, folder: Path) -> None:
    """Put the rows of one file, if there is such a file, among those that are kept in a folder."""
    from inverse.archive.rows import read_row, write_row

    (folder / "rows").mkdir(parents=True, exist_ok=True)
    for line in packed.read_text().splitlines() if packed.exists() else ():
        row = json.loads(line)
        if read_row(folder, row["key"]) is None:
            write_row(folder, row)


def pack(rows: list[dict], packed: Path) -> None:
    """Put rows into one file, a line each and six digits of every number: it can be carried to another machine."""
    from inverse.archive.rows import write_whole

    short = json.loads(json.dumps(rows), parse_float=lambda digits: float(f"{float(digits):.6g}"))
    write_whole(packed, "".join(json.dumps(row) + "\n" for row in short).encode())


def _in_time(until: float, fitted, *of_what) -> dict | None:
    """The row; None where it is too late to begin."""
    return fitted(*of_what) if time.time() < until else None


def _short(row: dict) -> str:
    if "error" in row:
        return row["error"]
    ranks = " ".join(f"{row['rank'][name]:.3f}" for name in QUANTITIES)
    return f"{row['method']} in {row['seconds']:.0f} s, ranks {ranks}"


def summary(rows: list[dict]) -> dict:
    """Coverage and ranks of the quantities tested, and the rest of what is known."""
    fits = [row for row in rows if "error" not in row]
    found = {"photographs": len(rows), "not fitted": len(rows) - len(fits), "seed": SEED, "quantities": {}}
    for name in QUANTITIES:
        ranks = np.array([row["rank"][name] for row in fits])
        parts = [coverage(ranks, level, len(LEVELS) * len(QUANTITIES)) for level in LEVELS]
        tail, least = float(smallest_tail(ranks[None])[0]), least_tail(len(ranks), len(QUANTITIES))
        found["quantities"][name] = {
            **{f"{100 * part.level:.0f}": {"share": part.share, "band": [part.low, part.high], "inside": part.inside}
               for part in parts},
            "ranks": {"tail": tail, "least": least, "inside": tail >= least},
        }  # fmt: skip
    found["optical depth"] = {about: accuracy(fits, *ends) for about, ends in DEPTHS.items()}
    found["methods"] = {}
    for method in sorted({row["method"] for row in fits}):
        seconds = [row["seconds"] for row in fits if row["method"] == method]
        found["methods"][method] = {
            "photographs": len(seconds), "median seconds": float(np.median(seconds)), "most seconds": max(seconds),
        }  # fmt: skip
    for name in ("centre_error_px", "fitted_centre_error_px", "radius_error", "fitted_radius_error",
                 "roll_error_deg", "fitted_roll_error_deg", "clock_error_s"):  # fmt: skip
        values = np.abs([row[name] for row in fits])
        found[name] = {"median": float(np.median(values)), "95 %": float(np.quantile(values, 0.95))}
    return found


def accuracy(fits: list[dict], least: float, most: float) -> dict[str, float | int]:
    """How far the medians of photographs with optical depths in a range are off, and what their fits say of that."""
    truth = optical_depths(fits, "truth")
    chosen = list(compress(fits, (truth > least) & (truth < most)))
    return {"photographs": len(chosen), **(errors_of(chosen) if chosen else {})}


def errors_of(fits: list[dict]) -> dict[str, float]:
    """Rms error of the optical depths, and the mean of what fits say of it."""
    off = optical_depths(fits, "median") - optical_depths(fits, "truth")
    return {"rms error": float(np.sqrt(np.mean(off**2))), "mean sd": float(optical_depths(fits, "sd").mean())}


def optical_depths(fits: list[dict], what: str) -> np.ndarray:
    """Vertical ones of the stratosphere's dust (photograph,); `what`: "truth", "median" or "sd" of them."""
    return np.asarray(Dust(np.array([row[what]["dust.extinction"] for row in fits])).optical_depth)


def passed(found: dict) -> bool:
    """Whether everything is within its band."""
    return all(part["inside"] for one in found["quantities"].values() for part in one.values())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=500, metavar="N", help="photographs; default 500")
    parser.add_argument("--first", type=int, default=0, metavar="N", help="number of the first; default 0")
    parser.add_argument("--draws", type=int, metavar="N", help="as of fit_atmosphere")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("--minutes", type=float, default=math.inf, metavar="M", help="after which none is begun")
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"of the rows; default {OUT}")
    parser.add_argument("--rows", type=Path, metavar="FILE", help="of rows done before, written anew at the end")
    options = parser.parse_args()
    numbers = range(options.first, options.first + options.count)
    if options.rows:
        unpack(options.rows, options.out)
    rows = run(numbers, options.draws, options.workers, options.out, minutes=options.minutes)
    if options.rows:
        pack(rows, options.rows)
    if all("error" in row for row in rows):
        print(f"Of {options.count} photographs {len(rows)} were begun in time, and none could be fitted.")
        return 1
    found = summary(rows)
    whole = not options.first and found["photographs"] == options.count  # others are no result to keep
    draws = "" if options.draws is None else f"-{options.draws}"
    folder = RESULTS if whole else options.out
    (folder / f"calibration-{found['photographs']}{draws}.json").write_text(json.dumps(found, indent=1) + "\n")
    print(f"{found['photographs']} photographs, {found['not fitted']} of them not fitted")
    for row in rows:
        if "error" in row:
            print(f"{row['number']}: {row['error']}")
    for quantity, one in found["quantities"].items():
        shares = ", ".join(
            f"{level} %: {one[level]['share']:.1%} ({one[level]['band'][0]:.1%}-{one[level]['band'][1]:.1%})"
            for level in ("68", "95")
        )
        print(f"{quantity:<26}{shares}, ranks {'inside' if one['ranks']['inside'] else 'outside'}")
    for method, one in found["methods"].items():
        print(
            f"{method:<26}{one['photographs']} photographs, {one['median seconds']:.0f} s in the median, "
            f"{one['most seconds']:.0f} s at most"
        )
    for about, one in found["optical depth"].items():
        if one["photographs"]:
            print(
                f"optical depth about {about:<6}{one['photographs']} photographs, rms error {one['rms error']:.4f}, "
                f"mean standard deviation {one['mean sd']:.4f}"
            )
    return 0 if passed(found) else 1


if __name__ == "__main__":
    raise SystemExit(main())
