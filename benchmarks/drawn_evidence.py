"""The evidence of drawn photographs as their fits gather it, and the truth about them in the fits' own terms."""

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

from benchmarks.calibration import SEED
from eclipsejax import session

Row = TypeVar("Row")


def of_each(function: Callable[[int, Path], Row], count: int, workers: int) -> Iterator[Row]:
    """What a function makes of each of the first so many photographs, in processes; it is given a folder to draw in."""
    session.one_blas_thread()  # of the processes: they load NumPy before anything of ours
    with (
        TemporaryDirectory() as folder,
        ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool,
    ):
        yield from pool.map(function, range(count), repeat(Path(folder)))


def evidence_of(number: int, folder: Path, share: float = 1.0):
    """A drawn photograph, what a fit gathers of it, and the likelihood before errors are found.

    - `share`: of the errors of surface and limb.
    - Raises `InputError` if it cannot be fitted.
    """
    from benchmarks.drawn_photograph import draw
    from inverse.evidence import gather, prepare

    drawn = draw(folder / f"{os.getpid()}.jpg", SEED, number, share=share)
    evidence = gather([drawn.path], time=drawn.utc, site=drawn.site, disc=None, progress=lambda *_: None)
    return drawn, evidence[0], prepare(evidence)


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
