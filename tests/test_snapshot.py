"""The picture of the command is that of the library, whether its programs are compiled or taken from the disk."""

import subprocess
import sys

import equinox as eqx
import numpy as np
import pytest

from eclipsejax.atmosphere import Atmosphere
from eclipsejax.camera import Camera
from eclipsejax.photometry import pictured_brightness
from eclipsejax.render import render
from eclipsejax.response import display
from eclipsejax.scene import Scene

SIZE = 40
SITE = 42.73, -73.68
PHASES = {"total": ("2008-02-21T03:26:00Z", True), "partial": ("2008-02-21T02:20:00Z", False)}

# In a process of its own, set up as that of the command.
PROGRAM = f"""
import sys
from pathlib import Path
from eclipsejax import session
session.start(keep_compiled=False)
import jax.numpy as jnp, numpy as np
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.camera import Camera
from eclipsejax.scene import Scene
from eclipsejax.snapshot import snapshot
_, utc, folder, out = sys.argv
scene = Scene.at(utc, *{SITE}, camera=Camera(shape=({SIZE}, {SIZE}), scale=1.1e-2 / {SIZE}))
taken = snapshot(scene, Atmosphere.typical(), 1e-2, Path(folder))
developed = taken.developed(taken.image, jnp.asarray(2.0 / taken.image.max()))
np.savez(out, taken.image, developed, taken.brightness.magnitude, taken.within_umbra)
"""


@pytest.mark.parametrize("phase", PHASES)
def test_a_snapshot_is_the_picture_of_the_library(tmp_path, monkeypatch, phase):
    utc, inside = PHASES[phase]
    scene = Scene.at(utc, *SITE, camera=Camera(shape=(SIZE, SIZE), scale=1.1e-2 / SIZE))
    expected = np.asarray(eqx.filter_jit(render)(scene, Atmosphere.typical(), tolerance=1e-2))
    faintness = float(pictured_brightness(scene, expected).magnitude)
    programs = tmp_path / "programs"
    programs.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for _ in range(2):
        run = [sys.executable, "-c", PROGRAM, utc, str(programs), str(tmp_path / "taken.npz")]
        subprocess.run(run, check=True)
        image, developed, magnitude, within_umbra = np.load(tmp_path / "taken.npz").values()
        np.testing.assert_allclose(image, expected, rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(developed, display(expected, 2.0 / expected.max()))
        assert float(magnitude) == pytest.approx(faintness, abs=1e-9) and bool(within_umbra) == inside
        assert len(list(programs.iterdir())) == 5  # the second time they are taken from here
