"""How well a fit knows the size of its errors: how far its estimates stray under the true ones, by what it says.

    python -m benchmarks.error_sizes --count 96

A fit counts with errors as large as the camera of its optimum makes those of the light, of amplitudes that it fits; in
drawn photographs both are known. What a drawn error does to the limb is followed to first order about the optimum.
`inverse.error_size` stands for what is found. Prints the mean and the spread of the log ratios, and keeps them.
"""

import argparse
import json
import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from benchmarks.calibration import QUANTITIES, SEED
from benchmarks.measure import RESULTS
from eclipsejax import session

Row = TypeVar("Row")
ERRORS = 1000  # drawn for each photograph: standard deviations to 2 %


def log_ratios(number: int, folder: Path) -> list[float]:
    """Of the standard deviations of the `QUANTITIES` under the true errors by those under the fit's."""
    session.start()
    from benchmarks.drawn_photograph import draw
    from inverse.evidence import gather, prepare
    from inverse.optimum import best

    drawn = draw(folder / f"{os.getpid()}.jpg", SEED, number)
    evidence = gather([drawn.path], time=drawn.utc, site=drawn.site, disc=None, progress=lambda *_: None)
    before = prepare(evidence)
    optimum, likelihood = best(before, [evidence[0].neighbours()])
    true = true_errors(before, drawn, truth(before, drawn, evidence[0].registration))
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


def true_errors(likelihood, drawn, z: np.ndarray):
    """`Errors` of a drawn photograph, of their true sizes, as its camera at the truth z makes them of the light's."""
    sizes = dict(zip(("smooth", "chromatic", "uneven"), drawn.amplitudes, strict=True))
    return replace(likelihood.carried(z, np.array([drawn.amplitudes])).errors[0], independent=1.0, **sizes)


def truth(likelihood, drawn, registration) -> np.ndarray:
    """The truth about a drawn photograph, put where its registration has it, as a vector z (parameter,)."""
    seen = {
        "gain": np.log(drawn.sensitivity) - float(likelihood.models[0].gain),
        "exposure": 0.0,
        "pointing.up": (registration.row - drawn.row) / registration.radius,
        "pointing.right": (drawn.column - registration.column) / registration.radius,
        "pointing.radius": drawn.radius / registration.radius - 1.0,
        "pointing.roll": -drawn.turned(registration),
    }
    known = drawn.limb | drawn.nuisance | seen
    return np.array([z_of(parameter, known[parameter.name]) for parameter in likelihood.parameters])


def z_of(parameter, value: float) -> float:
    """Where a parameter has a value."""
    scale = {"normal": lambda x: x, "lognormal": np.log, "logitnormal": lambda x: np.log(x / (1.0 - x))}
    to = scale[parameter.shape]
    return float((to(value) - to(parameter.centre)) / parameter.width)


def of_each(function: Callable[[int, Path], Row], count: int, workers: int) -> Iterator[Row]:
    """What a function makes of each of the first so many photographs, in processes; it is given a folder to draw in."""
    session.one_blas_thread()  # of the processes: they load NumPy before anything of ours
    with (
        TemporaryDirectory() as folder,
        ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool,
    ):
        yield from pool.map(function, range(count), repeat(Path(folder)))


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
