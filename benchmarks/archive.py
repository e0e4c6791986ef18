"""What a photograph of an archive costs, by number of photographs and of workers; and what ten thousand would.

    python -m benchmarks.archive                    # 8 and 16 photographs on 1 and 2 workers: an hour on two cores
    python -m benchmarks.archive --photographs 2 --draws 0    # Laplace's approximation alone: minutes

Photographs are rendered with noise of their own, compressed as JPEG and fitted for real, each by itself; compiled code
is on disk from a first run, whose time is the cold one. Strong scaling: the same photographs on more workers. Weak
scaling: so many more photographs on more workers.
"""

import argparse
import os
import shutil
import tempfile
import time
from pathlib import Path

from benchmarks.measure import Measurement, report
from eclipsejax import session
from inverse.archive.maker import make_archive
from tests import synthetic

WORKERS = (1, 2)
MANY = 10_000


def photographs(folder: Path, count: int) -> list[Path]:
    """So many photographs of one eclipse, with other noise and other dust."""
    folder.mkdir(parents=True)
    return [
        synthetic.photograph(folder / f"{n:04d}.jpg", synthetic.limb(1e-6 + 4e-6 * (n % 7) / 6), seed=n)
        for n in range(count)
    ]


def catalogue(folder: Path, paths: list[Path]) -> Path:
    """A catalogue of some of the photographs."""
    path = folder / f"catalogue-{len(paths)}.csv"
    site = ",".join(f"{x:g}" for x in synthetic.SITE)
    rows = [f'{each.name},{synthetic.UTC},"{site}"\n' for each in paths]
    path.write_text("file,utc,site\n" + "".join(rows))
    return path


def seconds(paths: list[Path], folder: Path, workers: int, draws: int | None) -> tuple[float, float, str]:
    """Time of an archive from nothing [s], mean time of its fits [s], and how many converged."""
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    start = time.perf_counter()
    rows = make_archive(catalogue(paths[0].parent, paths), out, workers=workers, draws=draws, most=1)
    whole = time.perf_counter() - start
    fits = [row for row in rows if row["kind"] == "photograph"]
    good = sum(row["status"] == "ok" for row in fits)
    return whole, sum(row["seconds"] for row in fits) / len(fits), f"{good} of {len(fits)} ok"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photographs", type=int, default=8, metavar="N", help="N and twice as many; default 8")
    parser.add_argument(
        "--draws", type=int, metavar="N", help="as of fit_atmosphere; default: what the posterior needs"
    )
    options = parser.parse_args()
    count = options.photographs
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        session.start()
        paths = photographs(folder / "photographs", 2 * count)
        cold, first, _ = seconds(paths[:1], folder, 1, options.draws)
        print(f"One photograph with nothing compiled: {cold:.0f} s, {first:.0f} s of it the fit.", flush=True)
        found, measured = {}, []
        for workers in WORKERS:
            for number in (count, 2 * count):
                whole, fit, good = seconds(paths[:number], folder, workers, options.draws)
                found[workers, number] = whole
                note = f"{whole / number:.1f} s a photograph, {fit:.1f} s a fit; {good}"
                measured.append(Measurement(f"{workers} workers", f"{number} photographs", cold, whole, None, note))
                print(f"{workers} workers, {number} photographs: {whole:.0f} s, {note}", flush=True)
    # What begins and ends an archive is paid once: the slope between the two numbers is what a photograph costs.
    slope = {workers: (found[workers, 2 * count] - found[workers, count]) / count for workers in WORKERS}
    most = WORKERS[-1]
    facts = {
        "seconds_per_photograph": slope,
        "strong_scaling": found[1, 2 * count] / found[most, 2 * count] / most,
        "weak_scaling": found[1, count] / found[most, most * count],
        f"hours_of_{MANY}": {workers: MANY * each / 3600.0 for workers, each in slope.items()},
    }
    report("archive", "An archive of photographs of 420 x 480 pixels.", measured, facts)
    print(f"\nStrong scaling {facts['strong_scaling']:.2f}, weak scaling {facts['weak_scaling']:.2f} (1: perfect).")
    for workers, each in slope.items():
        hours = MANY * each / 3600.0
        print(f"{MANY} photographs on {workers} workers: {hours:.1f} hours; on 64 of them {hours * workers / 64:.2f}.")


if __name__ == "__main__":
    main()
