"""What a scene needs: node counts and times by phase, response, region and air; growth with pixels and photographs.

    python -m benchmarks.scenes      # two minutes; prints a table and writes benchmarks/results/scenes.json

Times of a picture are of one atmosphere on a prepared scene, at tolerance 1e-3, after compilation.
"""

import resource
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import equinox as eqx
import jax
import numpy as np

from benchmarks.measure import Measurement, report, timed
from benchmarks.shadow_speed import PHASES, SITE
from eclipsejax.atmosphere import Atmosphere, Clouds
from eclipsejax.camera import Camera
from eclipsejax.limb_table import ray_breaks
from eclipsejax.render import render, renderer
from eclipsejax.scatterers import Scatterers
from eclipsejax.scene import Scene
from inverse.evidence import gather
from inverse.evidence import prepare as evidence_likelihood

PROFILE = Path(__file__).parents[1] / "data" / "2022-05-16-profile.csv"
SIZE = 500
FIELD = 0.0125  # rad
BARE = Atmosphere(ozone=None, dust=None, haze=None, clouds=Clouds(8e3, 0.97, 4e3))

prepare = eqx.filter_jit(renderer)
table = eqx.filter_jit(lambda picture, atmosphere: picture.tabulator(atmosphere).log_light)
draw = eqx.filter_jit(lambda picture, atmosphere: picture(atmosphere))


def scenes():
    """Name, scene and atmosphere of each case."""
    whole = Camera(shape=(SIZE, SIZE), scale=FIELD / SIZE)
    region = Camera(shape=(SIZE // 5, SIZE // 5), scale=FIELD / SIZE)
    for phase, utc in PHASES.items():
        yield phase, Scene.at(utc, *SITE, camera=whole), Atmosphere.typical()
    total = PHASES["total"]
    camera = replace(whole, response="nikon_5100")
    yield "total, a camera's channels", Scene.at(total, *SITE, camera=camera), Atmosphere.typical()
    yield "total, a fifth of the disc", Scene.at(total, *SITE, camera=region), Atmosphere.typical()
    yield "total, air and clouds alone", Scene.at(total, *SITE, camera=whole), BARE
    yield (
        "total, with scattered light",
        Scene.at(total, *SITE, camera=whole, scatterers=Scatterers()),
        Atmosphere.typical(),
    )


def measured(name, scene, atmosphere) -> Measurement:
    """Time of a picture and what it is made of."""
    picture, _, preparation = timed(partial(prepare, scene), 1)
    _, _, shadow = timed(partial(table, picture, atmosphere), 10)
    _, cold, warm = timed(partial(draw, picture, atmosphere), 10)
    operator = picture.tabulator.operator
    distances, offsets, wavelengths = operator.views.direct.shape
    panels = ray_breaks(atmosphere).size - 1
    counts = operator.counts
    note = (
        f"{offsets} offsets at {distances} distances, {wavelengths} wavelengths, "
        f"{operator.views.cells.edges.shape[1] - 1} cells, {panels * counts.table} tangent heights "
        f"x {counts.dispersion} refractivities, {picture.reflectance.size} pixels; table {1e3 * shadow:.0f} ms, "
        f"prepared in {1e3 * preparation:.0f} ms"
    )
    return Measurement(f"scene, {name}", "1e-03", cold, warm, None, note)


def photographs() -> list[Measurement]:
    """Misfits of a fit and all their derivatives, for 1, 2 and 4 profiles of one eclipse."""
    found = []
    for count in (1, 2, 4):
        evidence = gather([PROFILE] * count, time=None, site=None, disc=None, progress=lambda *_: None)
        likelihood = evidence_likelihood(evidence)
        free = len(likelihood.parameters)
        _, cold, warm = timed(partial(likelihood.misfits_and_slopes, np.zeros(free)), 5)
        found.append(Measurement("fit, derivatives", f"{count} profiles, {free} parameters", cold, warm, None))
    return found


def large_picture(rows: int, columns: int) -> Measurement:
    """Time and memory of a large picture, in a process of its own."""
    run = [sys.executable, "-m", "benchmarks.scenes", str(rows), str(columns)]
    seconds, gigabytes = subprocess.run(run, check=True, capture_output=True, text=True).stdout.split()
    note = f"at most {float(gigabytes):.2f} GB in memory, compilation included in both"
    return Measurement("picture, 24 megapixels", f"{rows} x {columns}", float(seconds), float(seconds), None, note)


def _large(rows, columns):
    camera = Camera(shape=(rows, columns), scale=FIELD / rows)
    scene = Scene.at(PHASES["partial"], *SITE, camera=camera)
    drawn = partial(eqx.filter_jit(partial(render, tolerance=1e-3)), scene, Atmosphere.typical())
    _, seconds, _ = timed(drawn, 0)
    print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)


def main():
    jax.config.update("jax_enable_x64", True)
    if len(sys.argv) == 3:
        _large(int(sys.argv[1]), int(sys.argv[2]))
        return
    found = [measured(*case) for case in scenes()]
    report("scenes", "What a scene needs", [*found, *photographs(), large_picture(4000, 6000)])


if __name__ == "__main__":
    main()
