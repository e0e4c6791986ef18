"""The shadow's table, pictures and the command: time against error, and how time grows.

    python -m benchmarks.shadow_speed      # two minutes; prints a table and writes benchmarks/results/shadow_speed.json

The table is that of 64 offsets in totality at 24 wavelengths, clear air with the usual clouds, haze and dust; its error
is the largest relative one in all light above 1e-12 of the Sun's, against `shadow_irradiance` at 1e-6, which brute
force confirms to 6e-7 (tests/test_shadow.py). What an operator needs but once a scene is "prepared".
"""

import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import cold_start
from benchmarks.measure import Measurement, report, timed
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.camera import Camera, signal
from eclipsejax.constants import ASTRONOMICAL_UNIT, MOON_MEAN_DISTANCE
from eclipsejax.render import renderer
from eclipsejax.scene import Scene
from eclipsejax.shadow import QUADRATURES, shadow_irradiance
from eclipsejax.shadow_operator import COUNTS, shadow_operator
from eclipsejax.sun import Sun
from eclipsejax.traced import slopes

OFFSETS, WAVELENGTHS = np.linspace(0.0, 9.3e-3, 64), np.linspace(390.0, 770.0, 24)
FAINTEST = 1e-12
PHASES = {"penumbral": "2008-02-21T01:10:00Z", "partial": "2008-02-21T02:20:00Z", "total": "2008-02-21T03:26:00Z"}
SITE = (42.73, -73.68)

integral = eqx.filter_jit(partial(shadow_irradiance, sun=None))
applied = eqx.filter_jit(lambda operator, atmosphere: operator(atmosphere)[0])


@eqx.filter_jit
def prepared(offset, wavelength, tolerance):
    distance = jnp.asarray([MOON_MEAN_DISTANCE])
    return shadow_operator(Sun(), offset[None], distance, ASTRONOMICAL_UNIT, wavelength, tolerance=tolerance)


def typical_with(values) -> Atmosphere:
    """The typical limb with six numbers of one's own, of which the first two bend rays."""
    fields = lambda a: (a.air.surface_temperature, a.air.surface_pressure, a.ozone.column_du, a.dust.extinction,
                        a.haze.optical_depth, a.clouds.top)  # fmt: skip
    return eqx.tree_at(fields, Atmosphere.typical(), tuple(values))


@eqx.filter_jit
def jacobian(operator, values):
    """Derivatives by six numbers of the atmosphere, each by itself."""
    return slopes(lambda numbers: operator(typical_with(numbers))[0], list(values))


VALUES = np.array([288.15, 101325.0, 300.0, 5e-7, 0.1, 8e3])


def worst(found, expected) -> float:
    counted = expected > FAINTEST
    return float(np.max(np.abs(np.asarray(found)[counted] / expected[counted] - 1.0)))


def tables() -> list[Measurement]:
    """Ours, by integral and by operator."""
    limb, offset, wavelength = Atmosphere.typical(), jnp.asarray(OFFSETS), jnp.asarray(WAVELENGTHS)
    expected = np.asarray(integral(limb, offset, wavelength, tolerance=1e-6))
    found = []
    for tolerance in QUADRATURES:
        run = partial(integral, limb, offset, wavelength, tolerance=tolerance)
        light, cold, warm = timed(run, 2)
        found.append(Measurement("shadow_irradiance", f"{tolerance:.0e}", cold, warm, worst(light, expected)))
    for tolerance in COUNTS:
        operator, cold_preparation, preparation = timed(partial(prepared, offset, wavelength, tolerance))
        light, cold, warm = timed(partial(applied, operator, limb), 30)
        note = f"prepared once in {1e3 * preparation:.0f} ms, the first time {cold_preparation:.1f} s"
        found.append(Measurement("operator", f"{tolerance:.0e}", cold, warm, worst(light, expected), note))
        _, cold, slow = timed(partial(jacobian, operator, jnp.asarray(VALUES)), 30)
        note = f"{slow / warm:.1f} times the value alone"
        found.append(Measurement("operator, 6 derivatives", f"{tolerance:.0e}", cold, slow, None, note))
    return [*found, *single_precision(expected)]


def single_precision(expected) -> list[Measurement]:
    """The operator in float32."""
    found = []
    with jax.enable_x64(False):
        limb, offset, wavelength = Atmosphere.typical(), jnp.asarray(OFFSETS), jnp.asarray(WAVELENGTHS)
        for tolerance in COUNTS:
            operator = prepared(offset, wavelength, tolerance)
            light, cold, warm = timed(partial(applied, operator, limb), 30)
            assert light.dtype == jnp.float32
            found.append(Measurement("operator, float32", f"{tolerance:.0e}", cold, warm, worst(light, expected)))
    return found


def growth() -> list[Measurement]:
    """How the operator's time grows with offsets and wavelengths."""
    limb, found = Atmosphere.typical(), []
    sizes = [(16, 24), (64, 24), (256, 24), (64, 6), (64, 96)]
    for offsets, wavelengths in sizes:
        offset, wavelength = jnp.linspace(0.0, 9.3e-3, offsets), jnp.linspace(390.0, 770.0, wavelengths)
        operator = prepared(offset, wavelength, 1e-3)
        _, cold, warm = timed(partial(applied, operator, limb), 10)
        found.append(Measurement("operator, growth", f"{offsets} offsets, {wavelengths} wavelengths", cold, warm, None))
    return found


def pictures() -> list[Measurement]:
    """Of phases and sizes; one atmosphere on a prepared scene, without and with the camera's optics."""
    limb, found = Atmosphere.typical(), []
    prepare = eqx.filter_jit(renderer)
    draw = eqx.filter_jit(lambda picture, atmosphere: picture(atmosphere))
    blurred = eqx.filter_jit(lambda picture, atmosphere, camera: signal(picture(atmosphere), camera))
    for phase, size in [("penumbral", 500), ("total", 500), ("partial", 250), ("partial", 500), ("partial", 1000)]:
        camera = Camera(shape=(size, size), scale=0.0125 / size, psf_fwhm=2.0)
        picture, cold, preparation = timed(partial(prepare, Scene.at(PHASES[phase], *SITE, camera=camera)), 1)
        note = f"prepared once in {1e3 * preparation:.0f} ms, the first time {cold:.1f} s"
        _, cold, warm = timed(partial(draw, picture, limb), 5)
        found.append(Measurement(f"picture, {phase}", f"{size} x {size}", cold, warm, None, note))
        if size == 1000:
            _, cold, warm = timed(partial(blurred, picture, limb, camera), 5)
            found.append(Measurement(f"picture, {phase}, optics", f"{size} x {size}", cold, warm, None))
    return found


def commands() -> list[Measurement]:
    """`eclipsejax render` from shell to file: with an empty compilation cache, and again."""
    with tempfile.TemporaryDirectory() as folder:
        run = [Path(sys.executable).parent / "eclipsejax", *cold_start.command(folder)]

        def once():
            start = time.perf_counter()
            subprocess.run(run, check=True, capture_output=True, env=os.environ | {"XDG_CACHE_HOME": folder})
            return time.perf_counter() - start

        first = once()
        again = min(once() for _ in range(3))
    with tempfile.TemporaryDirectory() as folder:
        note = f"parts, two compiled at a time: {cold_start.told(cold_start.parts(folder))}"
        note += f"; again: {cold_start.told(cold_start.parts(folder))}"

    return [Measurement("eclipsejax render, shell to PNG", "first, then cached", first, again, None, note)]


def main():
    jax.config.update("jax_enable_x64", True)
    report(
        "shadow_speed",
        "The shadow over 64 offsets and 24 wavelengths, pictures, and the command",
        [*tables(), *growth(), *pictures(), *commands()],
    )


if __name__ == "__main__":
    main()
