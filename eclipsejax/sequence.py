"""Many instants of one eclipse, in one atmosphere: the shadow is worked out once, and each picture looks into it.

Over the six hours of an eclipse the shadow itself hardly changes. What does, and is followed, is where the Moon is in
it, how far away, and how high above the observer's horizon.
"""

from collections.abc import Sequence as Ordered
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, UInt8

from eclipsejax.camera import Camera
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import Geometry
from eclipsejax.render import SAMPLINGS, channel_weights, disc_offsets, lit, pixels, sampled
from eclipsejax.response import encode_srgb, into_gamut
from eclipsejax.scene import Scene, limb_shape
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.shadow_table import ShadowTable, Tabulator, table_grid
from eclipsejax.tolerance import reached

WIDER = 2  # times as many offsets as for one picture: the Moon crosses the whole shadow


class Sequence(eqx.Module):
    """Pictures of the instants for which it was prepared, each as by `render`, for any camera of the same response."""

    shadow: ShadowTable
    """Light in the Earth's shadow, a channel for each wavelength."""

    def __call__(self, scene: Scene) -> Float[Array, "row column channel"]:
        """The linear picture of a scene; one compilation serves all scenes with cameras of one shape.

        - `scene`: at one of the instants, with the sun of the scene given to `sequence`.
        """
        _, weights = channel_weights(scene, self.shadow.log_light.shape[-1])
        table = self.shadow.grid.filled(jnp.exp(self.shadow.log_light) @ weights)
        return lit(table, *sampled(scene, table.grid, *pixels(scene.camera)), scene.camera.response)


def sequence(scene: Scene, instants: Ordered[Geometry], atmosphere, *, tolerance: float = 1e-3) -> Sequence:
    """Work out the shadow of an eclipse for pictures at several instants.

    The Sun is kept at its mean distance: over an eclipse this moves the umbra's edge by 0.1 arcsec. At a tolerance of
    1e-3 totality is right to 1.4e-3 rms (`render`: 1.0e-3), and to 1e-2 in a thin ring, as far from the axis as the
    Sun is wide, where the light has a kink and the table few entries. Of a flattened Earth the swing that
    `flattened_table` adds is left out, 1.4 % at most.

    - `scene`: any of the pictures wanted, for its sun, moon, scatterers and camera response.
    - `instants`: the geometries of all of them, or of the first, the deepest and the last.
    - `atmosphere`: along the Earth's limb.
    - `tolerance`: relative error wanted of the irradiance, as in `render`.
    """
    # Only a few numbers go in: one compilation serves films of any length, size and site.
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *instants)
    moon, sun = (jnp.linalg.norm(place, axis=-1) for place in (stacked.moon, stacked.sun))
    offsets = jax.vmap(disc_offsets)(stacked)
    plain = replace(scene, geometry=instants[0], camera=Camera(response=scene.camera.response), sky=None)
    return _prepared(
        plain,
        jnp.stack([jnp.min(moon), jnp.max(moon)]),
        jnp.mean(sun),
        jnp.stack([jnp.min(offsets), jnp.max(offsets)]),
        atmosphere,
        reached(SAMPLINGS, tolerance),
    )


@eqx.filter_jit
def _prepared(scene, moon_distances, sun_distance, offsets, atmosphere, error):
    sampling = SAMPLINGS[error]
    grid = table_grid(scene.sun, jnp.mean(moon_distances), sun_distance, offsets, WIDER * sampling.offsets)
    distances = moon_distances - jnp.asarray([MOON_RADIUS, 0.0])
    grid = eqx.tree_at(lambda grid: grid.distances, grid, distances)
    wavelength, _ = channel_weights(scene, sampling.wavelengths)
    offset = jax.vmap(grid.offsets_at)(distances)
    ground = limb_shape(scene.geometry).rounded() if scene.flattened else None
    operator = shadow_operator(scene.sun, offset, distances, sun_distance, wavelength, tolerance=error, ground=ground)
    return Sequence(Tabulator(grid, operator, jnp.eye(wavelength.size), scene.scatterers)(atmosphere))


@eqx.filter_jit
def pictured(pictures: Sequence, scene: Scene) -> Float[Array, "row column channel"]:
    """`pictures(scene)`, compiled."""
    return pictures(scene)


@eqx.filter_jit
def developed(pictures: Sequence, scene: Scene, gain) -> UInt8[Array, "row column 3"]:
    """The same to look at: sRGB, as by `response.display`.

    - `gain`: signal of a full Moon [full scale].
    """
    # The barrier keeps the compiler from working the picture out once for each use of it: a fifth of the time.
    picture = jax.lax.optimization_barrier(pictures(scene))
    return jnp.round(255.0 * encode_srgb(into_gamut(gain * picture))).astype(jnp.uint8)
