"""One picture of one atmosphere, for a command that has just been started.

The same as `render.render`, in parts that are compiled side by side: while the compiler is at one, the next is traced.
"""

from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from eclipsejax.lopsided_table import scene_table
from eclipsejax.photometry import Brightness, pictured_brightness
from eclipsejax.programs import Program, program
from eclipsejax.render import disc_offsets, painted, scene_tabulator
from eclipsejax.response import displayed
from eclipsejax.scene import Scene
from eclipsejax.shadow_table import Tabulator


class Snapshot(NamedTuple):
    """A picture and what is to be said of it."""

    image: Float[Array, "row column channel"]
    """As by `render.render`."""
    brightness: Brightness
    within_umbra: Bool[Array, ""]
    """Whether all of the Moon is."""
    developed: Program
    """`response.displayed`, for this picture and a gain."""


def snapshot(scene: Scene, atmosphere, tolerance: float, folder: Path | None) -> Snapshot:
    """Take it; the camera's response must be "srgb", and all of the Moon in the picture.

    - `tolerance`: as in `render.render`.
    - `folder`: where programs are kept from one run to the next; None keeps none.
    """
    prepare = program(scene_tabulator, scene, tolerance, folder=folder)
    trace = program(_rays, prepare.shape, atmosphere, folder=folder)
    tabulate = program(_table, prepare.shape, atmosphere, trace.shape, folder=folder)
    see = program(_seen, scene, prepare.shape.grid, tabulate.shape, folder=folder)
    gain = jax.ShapeDtypeStruct((), jnp.result_type(float))
    develop = program(displayed, see.shape[0], gain, folder=folder)

    prepared = prepare(scene, tolerance)
    shadow = tabulate(prepared, atmosphere, trace(prepared, atmosphere))
    image, brightness, within_umbra = see(scene, prepared.grid, shadow)
    return Snapshot(image, brightness, within_umbra, develop)


def _rays(prepared: Tabulator, atmosphere):
    return prepared.operator.rays(atmosphere)


def _table(prepared: Tabulator, atmosphere, rays):
    # A flattened Earth's table is made in one, and traces the rays of several limbs.
    return prepared(atmosphere, rays) if prepared.flattening is None else scene_table(prepared, atmosphere)


def _seen(scene: Scene, grid, shadow):
    image = painted(scene, grid, shadow)
    within_umbra = disc_offsets(scene.geometry)[1] < scene.umbra()
    return image, pictured_brightness(scene, image), within_umbra
