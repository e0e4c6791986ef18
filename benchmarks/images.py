"""A picture of a partial eclipse, 1,000 x 1,000: time against error, in either precision, with optics and derivatives.

    python -m benchmarks.images      # four minutes; prints a table and writes benchmarks/results/images.json

One atmosphere on a prepared scene. Errors are the largest on the disc, relative to a pixel's brightest channel, against
a picture that is finer than `render` offers; that in turn is compared, at some pixels, with `shadow_irradiance`, which
tabulates nothing. The outermost pixels are told apart: there the surface falls away from the line of sight, and what
float32 leaves of the direction decides whether it is lit.
"""

import json
import subprocess
import sys
import tempfile
from dataclasses import asdict
from functools import partial
from pathlib import Path
from unittest import mock

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.ndimage import binary_erosion

from benchmarks.measure import Measurement, report, timed
from benchmarks.scenes import FIELD, draw, prepare
from benchmarks.shadow_speed import PHASES, SITE, VALUES, typical_with
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.camera import Camera, signal
from eclipsejax.render import SAMPLINGS, Sampling, channel_weights, pixels, sampled, unflattened
from eclipsejax.response import linear_from_xyz
from eclipsejax.scene import Scene, disc_points
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.traced import slopes

SIZE = 1000
FINEST, FINE = 1e-4, Sampling(1280, 48)  # not offered: see `render.SAMPLINGS` for what does not get better with it
SOME = 100  # pixels

expose = eqx.filter_jit(lambda picture, limb, camera: signal(picture(limb), camera))
derive = eqx.filter_jit(lambda picture, values: slopes(lambda numbers: picture(typical_with(numbers)), list(values)))


def partial_eclipse() -> Scene:
    """The scene, through optics of two pixels."""
    camera = Camera(shape=(SIZE, SIZE), scale=FIELD / SIZE, psf_fwhm=2.0)
    return Scene.at(PHASES["partial"], *SITE, camera=camera)


def worst(found, expected, disc) -> float:
    """Largest difference on the disc, relative to the brightest channel of each pixel."""
    found, expected = (np.asarray(image, dtype=float)[disc] for image in (found, expected))
    return float(np.max(np.abs(found - expected).max(axis=-1) / expected.max(axis=-1)))


def measured(precision: str, sharp, blurred, disc) -> list[Measurement]:
    """Pictures without and with the camera's optics, in the present precision, against those given."""
    found, limb, scene = [], Atmosphere.typical(), partial_eclipse()
    inside = binary_erosion(disc)
    kind = "" if precision == "float64" else f", {precision}"
    for tolerance in SAMPLINGS:
        picture, cold, preparation = timed(partial(prepare, scene, tolerance=tolerance), 1)
        note = f"prepared once in {1e3 * preparation:.0f} ms, the first time {cold:.1f} s"
        setting = f"{tolerance:.0e}"
        image, cold, alone = timed(partial(draw, picture, limb), 10)
        note = f"{worst(image, sharp, np.logical_xor(disc, inside)):.1e} at the limb; {note}"
        found.append(Measurement(f"picture{kind}", setting, cold, alone, worst(image, sharp, inside), note))
        image, cold, warm = timed(partial(expose, picture, limb, scene.camera), 10)
        found.append(Measurement(f"picture with optics{kind}", setting, cold, warm, worst(image, blurred, inside)))
        _, cold, warm = timed(partial(derive, picture, jnp.asarray(VALUES)), 3)
        note = f"{warm / alone:.1f} times the picture alone"
        found.append(Measurement(f"picture, 6 derivatives{kind}", setting, cold, warm, None, note))
    return found


def in_single_precision(sharp, blurred, disc) -> list[Measurement]:
    """`measured` in float32, by a process of its own: tables once read in float64 stay so."""
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder, "expected.npz"), sharp=sharp, blurred=blurred, disc=disc)
        run = [sys.executable, "-m", "benchmarks.images", folder]
        lines = subprocess.run(run, check=True, capture_output=True, text=True).stdout.splitlines()
    return [Measurement(**measurement) for measurement in json.loads(lines[-1])]


def error_of(image, scene: Scene, grid, disc) -> float:
    """Largest error of a picture at some pixels, against the integral at each of them by itself."""
    east, north = (np.asarray(angle)[disc] for angle in pixels(scene.camera))
    chosen = np.random.default_rng(1).choice(east.size, SOME, replace=False)
    east, north = jnp.asarray(east[chosen]), jnp.asarray(north[chosen])
    position = disc_points(scene.geometry, *unflattened(scene, east, north)).position
    wavelength, weights = channel_weights(scene, FINE.wavelengths)
    light = shadow_irradiance(
        Atmosphere.typical(), scene.offset(position), wavelength,
        sun=scene.sun,
        moon_distance=jnp.linalg.norm(position, axis=-1),
        sun_distance=jnp.linalg.norm(scene.geometry.sun),
        tolerance=1e-4,
    )  # fmt: skip
    reflectance = sampled(scene, grid, east, north)[1]
    expected = linear_from_xyz(light @ weights * reflectance[:, None])
    return worst(np.asarray(image)[disc][chosen], expected, slice(None))


def main():
    if len(sys.argv) == 2:
        expected = np.load(Path(sys.argv[1], "expected.npz"))
        print(json.dumps([asdict(one) for one in measured("float32", **expected)]))
        return
    jax.config.update("jax_enable_x64", True)
    scene, limb = partial_eclipse(), Atmosphere.typical()
    with mock.patch.dict(SAMPLINGS, {FINEST: FINE}):
        finest = prepare(scene, tolerance=FINEST)
    sharp, blurred = (np.asarray(image) for image in (draw(finest, limb), expose(finest, limb, scene.camera)))
    disc = np.asarray(finest.reflectance) > 0.0
    found = measured("float64", sharp, blurred, disc) + in_single_precision(sharp, blurred, disc)
    facts = {"largest error of the finest picture at some pixels": error_of(sharp, scene, finest.tabulator.grid, disc)}
    report("images", f"A partial eclipse, {SIZE} x {SIZE} pixels, one atmosphere", found, facts)


if __name__ == "__main__":
    main()
