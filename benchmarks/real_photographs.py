"""What real photographs say of the dust: each one of `data/photographs.csv` that can be had, and each eclipse.

    python -m benchmarks.real_photographs --draws 0     # Laplace's approximation alone: a quarter of an hour
    python -m benchmarks.real_photographs               # what the posterior needs: more than an hour

An archive in out/real_photographs, of which the same command does what is left; prints a table and writes
benchmarks/results/real_photographs.json, which `notebooks/real_photographs.ipynb` reads. Photographs are copied there
from $ECLIPSEJAX_PHOTOS, or fetched where their licence allows it; what cannot be had or fitted is told with its reason.
"""

import argparse
import csv
import json
import shutil
from pathlib import Path
from typing import Any

from benchmarks.measure import RESULTS
from eclipsejax import session
from eclipsejax.errors import InputError
from inverse.archive.maker import make_archive
from inverse.catalogue import catalogue, photograph

OUT = Path("out/real_photographs")
KEPT = (
    "kind", "status", "error", "eclipse", "utc", "source", "disc", "photographs", "informed", "residual_rms",
    "smooth_error", "method", "seconds", "version", "licence", "credit",
)  # fmt: skip
DEPTH = "stratospheric_optical_depth"


def gathered(folder: Path) -> tuple[Path, dict[str, str]]:
    """A catalogue of the photographs that can be had, which are copied beside it, and why the others cannot."""
    rows, missing = [], {}
    for entry in catalogue():
        copy = folder / entry.file
        try:
            if not copy.is_file():
                found = photograph(entry.file)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(found, copy)
        except InputError as error:
            missing[entry.file] = str(error)
            continue
        site = "" if entry.site is None else ",".join(map(str, entry.site))
        rows.append([entry.file, entry.utc, site, entry.disc, entry.sha256, entry.licence, entry.credit])
    path = folder / "catalogue.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([["file", "utc", "site", "disc", "sha256", "licence", "credit"], *rows])
    return path, missing


def kept(row: dict[str, Any]) -> dict[str, Any]:
    """What of a row is worth keeping, and whether the model explains all that was fitted."""
    explained = "cannot explain" not in (row.get("warnings_text") or "")
    return {name: value for name, value in row.items() if name in KEPT or name.startswith(DEPTH)} | {
        "explained": explained
    }


def line(row: dict[str, Any]) -> str:
    """A row to read."""
    name = f"{row['eclipse']} {Path(row.get('source') or '').name or 'all together'} {row.get('disc') or ''}"
    if row["status"] == "failed":
        return f"{name:<44}{row['error']}"
    depth = [row[f"{DEPTH}_{end}"] for end in ("median", "ci95_low", "ci95_high")]
    return (
        f"{name:<44}{depth[0]:.4f} ({depth[1]:.4f}-{depth[2]:.4f}), residual {row['residual_rms']:.0%}, "
        f"{row['seconds']:.0f} s{'' if row['status'] == 'ok' else ', ' + row['status']}"
        f"{'' if row['explained'] else ', not explained'}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--draws", type=int, metavar="N", help="as of fit_atmosphere; default: what the posterior needs"
    )
    parser.add_argument("--workers", type=int, metavar="N", help="as of fit_atmosphere")
    options = parser.parse_args()
    session.one_blas_thread()  # of the workers
    (OUT / "pictures").mkdir(parents=True, exist_ok=True)
    path, missing = gathered(OUT / "pictures")
    archive = make_archive(path, OUT, draws=options.draws, workers=options.workers)
    rows = [kept(dict(row)) for row in archive]
    found = {"draws": options.draws, "missing": missing, "rows": rows}
    (RESULTS / "real_photographs.json").write_text(json.dumps(found, indent=1) + "\n")
    print("Vertical optical depth of the stratosphere's dust (95 %), misfit, time of the fit")
    for row in rows:
        print(line(row))
    for name, why in missing.items():
        print(f"{name:<44}{why}")


if __name__ == "__main__":
    main()
