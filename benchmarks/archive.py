"""What a photograph of an archive costs, by number of photographs and of workers; and what ten thousand would.

    python -m benchmarks.archive                    # 8 and 16 photographs on 1 and 2 workers: hours on two cores
    python -m benchmarks.archive --photographs 2 --draws 0    # Laplace's approximation alone: half an hour

Photographs are rendered with noise of their own, compressed as JPEG and fitted for real, each by itself; compiled code
is on disk from a first run, whose time is the cold one. Strong scaling: the same photographs on more workers. Weak
scaling: so many more photographs on more workers. Both by the clock, which counts whatever else the machine does, and
by the processors' time that all processes took together.

Last, whether a step of a descent is cheaper for photographs side by side (`vmap`) than one after the other: it is not
(`step_side_by_side` in results/archive.json), which is why `inverse.archive` fits them one by one.
"""

import argparse
import os
import resource
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.measure import Measurement, report
from eclipsejax import session
from inverse.archive.maker import make_archive
from tests import synthetic

WORKERS = (1, 2)
MANY = 10_000
SIDE_BY_SIDE = (1, 2, 4, 8)
REPEATS = 5


@dataclass(frozen=True)
class Cost:
    """Of an archive: time by the clock, of the processors, and mean time of a fit by the clock [s]; what came of it."""

    clock: float
    processors: float
    fit: float
    outcome: str


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


def cost(paths: list[Path], folder: Path, workers: int, draws: int | None) -> Cost:
    """What an archive costs from nothing."""
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    start, before = time.perf_counter(), processor_time()
    rows = make_archive(catalogue(paths[0].parent, paths), out, workers=workers, draws=draws, most=1)
    whole, used = time.perf_counter() - start, processor_time() - before
    fits = [row for row in rows if row["kind"] == "photograph"]
    good = sum(row["status"] == "ok" for row in fits)
    return Cost(whole, used, sum(row["seconds"] for row in fits) / len(fits), f"{good} of {len(fits)} ok")


def processor_time() -> float:
    """Of this process and those that it has begun and that have ended [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def side_by_side(path: Path) -> dict[str, float]:
    """Processors' time of one step of a descent for each photograph [s], by how many are worked out at once."""
    from inverse.evidence import gather, prepare
    from inverse.likelihood import LIMB, misfit_and_slopes
    from inverse.limb_light import shadow_slopes

    likelihood = prepare(
        gather([path], time=synthetic.UTC, site=synthetic.SITE, disc=None, progress=lambda *_: None)
    )  # fmt: skip
    shadow, (model,), (observed,) = likelihood.shadow, likelihood.models, likelihood.observed

    @eqx.filter_jit
    def together(photographs, z):
        limbs: Any = eqx.filter_vmap(shadow_slopes, in_axes=(None, 0))
        light, slopes = limbs(shadow, z[:, :LIMB])
        each: Any = eqx.filter_vmap(misfit_and_slopes, in_axes=(0, 0, None, 0, 0, 0))
        return each(*photographs, shadow, light, slopes, z[:, LIMB:])

    def one(z):
        light, slopes = shadow_slopes(shadow, z[:LIMB])
        return misfit_and_slopes(model, observed, shadow, light, slopes, z[LIMB:])

    found = {}
    for count in SIDE_BY_SIDE:
        z = jnp.asarray(0.1 * np.random.default_rng(count).standard_normal((count, len(likelihood.parameters))))
        if count == 1:
            found["1"] = least(lambda z=z: one(z[0]))
            continue
        many = jax.tree.map(lambda leaf, count=count: jnp.stack([leaf] * count), (model, observed))
        found[str(count)] = least(lambda z=z, many=many: together(many, z)) / count
    return found


def least(step: Callable[[], Any]) -> float:
    """Processors' time of a call whose program is compiled [s]: the least of several."""
    jax.block_until_ready(step())
    times = []
    for _ in range(REPEATS):
        start = time.process_time()
        jax.block_until_ready(step())
        times.append(time.process_time() - start)
    return min(times)


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
        os.environ.pop("JAX_COMPILATION_CACHE_DIR", None)
        session.start()
        paths = photographs(folder / "photographs", 2 * count)
        first = cost(paths[:1], folder, 1, options.draws)
        print(f"One photograph with nothing compiled: {first.clock:.0f} s, {first.processors:.0f} s of processors'.")
        found, measured = {}, []
        for workers in WORKERS:
            for number in (count, 2 * count):
                spent = found[workers, number] = cost(paths[:number], folder, workers, options.draws)
                note = (
                    f"{spent.processors / number:.1f} s of processors' a photograph, {spent.fit:.1f} s a fit; "
                    f"{spent.outcome}"
                )
                setting = f"{number} photographs"
                measured.append(Measurement(f"{workers} workers", setting, first.clock, spent.clock, None, note))
                print(f"{workers} workers, {number} photographs: {spent.clock:.0f} s, {note}", flush=True)
        steps = side_by_side(paths[0])
    most = WORKERS[-1]
    facts: dict[str, Any] = {"command": f"--photographs {count} --draws {options.draws}", "step_side_by_side": steps}
    for name in ("clock", "processors"):
        spent = {key: getattr(one, name) for key, one in found.items()}
        # What begins and ends an archive is paid once: the slope between the two numbers is what a photograph costs.
        slope = {workers: (spent[workers, 2 * count] - spent[workers, count]) / count for workers in WORKERS}
        shared = most if name == "clock" else 1  # the processors' time is that of all workers together
        facts[name] = {
            "seconds_per_photograph": slope,
            "strong_scaling": spent[1, 2 * count] / spent[most, 2 * count] / shared,
            "weak_scaling": most / shared * spent[1, count] / spent[most, most * count],
            f"hours_of_{MANY}": {workers: MANY * each / 3600.0 for workers, each in slope.items()},
        }
    report("archive", "An archive of photographs of 420 x 480 pixels.", measured, facts)
    for name, told in (("clock", "by the clock"), ("processors", "by the processors' time")):
        now = facts[name]
        print(f"\n{told}: strong scaling {now['strong_scaling']:.2f}, weak {now['weak_scaling']:.2f} (1: perfect).")
    hours = MANY * facts["processors"]["seconds_per_photograph"][most] / 3600.0
    print(f"{MANY} photographs: {hours:.0f} hours of a processor, {hours / 64:.1f} on 64.")


if __name__ == "__main__":
    main()
