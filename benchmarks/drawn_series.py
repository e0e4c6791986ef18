"""RAW photographs of one eclipse by one camera, all drawn from the prior of a fit, as `drawn_photograph` draws one."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.drawn_errors import DrawnErrors
from benchmarks.drawn_photograph import Drawn, drawn_nuisance, instants, recorded
from inverse import prior
from tests.dng import write_dng

WHITE = 16383  # of the sensor, 14 bits
SHUTTER = 0.01  # s, for a sensitivity of 1
SHARED = prior.OF_CAMERA | {"clock"}
CAMERA = {0x8827: (800, 1), 0x829D: (8, 1)}  # Exif: ISO and focal ratio


def draw_series(folder: Path, seed: int, number: int, phases: Sequence[float | str], dust: float) -> list[Drawn]:
    """Draw series `number` of a seed and write it, a DNG for each phase, which states its exposure.

    - `phases`: as `instants` takes them.
    - `dust`: extinction of the stratosphere's [1/m], instead of one drawn.
    """
    random = np.random.default_rng([seed, number])
    z, camera = random.standard_normal(len(prior.ATMOSPHERE)), drawn_nuisance(random)
    index, extinction = next((i, p) for i, p in enumerate(prior.ATMOSPHERE) if p.name == "dust.extinction")
    z[index] = np.log(dust / extinction.centre) / extinction.width
    wheres, site = instants(random, lambda: phases)
    errors = DrawnErrors(random)
    drawn = []
    for place, where in enumerate(wheres):
        nuisance = drawn_nuisance(random) | {name: camera[name] for name in SHARED}
        light, truth = recorded(random, folder / f"{number}-{place}.dng", where, site, z, nuisance, errors=errors)
        # The sensor's counts, of a black level of 0: nothing is lost below it.
        counts = np.clip(np.round(light * WHITE), 0, WHITE).astype(np.uint16)
        shutter = SHUTTER * truth.sensitivity
        exif = {0x829A: (round(1e6 * shutter), 1_000_000), **CAMERA}
        write_dng(truth.path, counts, white=WHITE, exif=exif)
        drawn.append(truth)
    return drawn
