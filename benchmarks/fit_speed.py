"""What a fit of one photograph costs: in a new process with nothing compiled, in another, and once more in that.

    python -m benchmarks.fit_speed                # three minutes
    python -m benchmarks.fit_speed --ensembles    # and ensembles on the posterior itself, until they have converged

The photograph is the first of `benchmarks.calibration`, of some 400 x 500 pixels. "optimum" is from the call of
`fit_atmosphere` to the best limb and camera, "posterior" from there to the draws, "report" what is left. Log posteriors
are timed once it is known, as where a sampler asks for them, which nuisances go with which limb.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.calibration import SEED
from benchmarks.drawn_photograph import draw
from benchmarks.measure import RESULTS, machine
from eclipsejax import session
from inverse.answer import MOST_DRAWS
from inverse.evidence import gather, prepare
from inverse.fit import fit_atmosphere
from inverse.nuisance_guess import MOST
from inverse.optimum import best
from inverse.posterior import LimbPosterior

BATCH, REPEATS = 64, 5  # log posteriors at once, and how often
ENDS = {"fitting": "optimum", "weighing": "posterior", "sampling": "posterior"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ensembles", action="store_true", help="sample the posterior itself, too")
    parser.add_argument("--measure", help=argparse.SUPPRESS)  # what the processes do that this one begins
    options = parser.parse_args()
    session.start()
    if options.measure:
        print(json.dumps(measured(**json.loads(options.measure))))
        return
    with tempfile.TemporaryDirectory() as folder:
        drawn = draw(Path(folder) / "moon.jpg", SEED, 0)
        photograph = {"path": str(drawn.path), "utc": drawn.utc, "site": drawn.site}
        first = _in_a_process(folder, photograph | {"more": False, "ensembles": False})
        again = _in_a_process(folder, photograph | {"more": True, "ensembles": options.ensembles})
    found = {"nothing compiled": first["first"], "another process": again["first"], "once more": again["second"]}
    for name, spent in found.items():
        print(f"{name}: {', '.join(f'{part} {seconds:.1f} s' for part, seconds in spent.items())}")
    print(f"{BATCH} log posteriors at once: {1e3 * again['batch']:.0f} ms")
    found |= {name: again[name] for name in ("batch", "ensembles") if name in again}
    if options.ensembles:
        print(f"ensembles: {again['ensembles']}")
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "fit_speed.json").write_text(json.dumps({"machine": machine(), "seconds": found}, indent=1) + "\n")


def _in_a_process(folder: str, given: dict) -> dict:
    """What `measured` finds, as given, in a new process that keeps compiled programs in a folder."""
    command = [sys.executable, "-m", "benchmarks.fit_speed", "--measure", json.dumps(given)]
    here = {name: value for name, value in os.environ.items() if name != "JAX_COMPILATION_CACHE_DIR"}
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=here | {"XDG_CACHE_HOME": folder})
    return json.loads(done.stdout.splitlines()[-1])


def measured(path: str, utc: str, site: list[float], more: bool, ensembles: bool) -> dict:
    """Seconds of the parts of a fit in this process; and, for `more`, of a second and of a batch of log posteriors."""

    def fit(draws=None):
        ends, start = {}, time.perf_counter()
        found = fit_atmosphere(
            path, time=utc, site=tuple(site), draws=draws,
            progress=lambda step: ends.update({ENDS.get(step.stage, "read"): time.perf_counter()}),
        )  # fmt: skip
        times = [start, ends["optimum"], ends["posterior"], time.perf_counter()]
        return found, dict(zip(("optimum", "posterior", "report"), map(float, np.diff(times)), strict=True))

    result: dict = {"first": fit()[1]}
    if not more:
        return result
    result["second"] = fit()[1]
    evidence = gather([path], time=utc, site=tuple(site), disc=None, progress=lambda *_: None)
    optimum, likelihood = best(prepare(evidence), [item.neighbours() for item in evidence])
    density, random = LimbPosterior(likelihood, optimum), np.random.default_rng(0)
    points = lambda count: optimum.limb.at(random.standard_normal((count, len(optimum.limb.centre))))
    density.explore(points(MOST))
    times = []
    for _ in range(REPEATS):
        z = points(BATCH)
        start = time.perf_counter()
        density(z)
        times.append(time.perf_counter() - start)
    result["batch"] = float(np.median(times))
    if ensembles:
        found, spent = fit(MOST_DRAWS)
        result["ensembles"] = spent | {"converged": found.diagnostics["converged"], **found.diagnostics["sampler"]}
    return result


if __name__ == "__main__":
    main()
