"""The picture: light of the shadow on the Moon, through the observer's air, into a camera.

What no atmosphere changes (where the pixels look, the surface there, the Sun's half of the shadow) is worked out once,
in a `Renderer`; each atmosphere then costs the flux of its rays and a look into a table for every pixel.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax import wavelengths
from eclipsejax.camera import Camera, sky_plane
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import moon_altitude
from eclipsejax.flattened_table import FlattenedTable
from eclipsejax.lopsided_table import LopsidedTable, scene_table
from eclipsejax.response import linear_from_xyz
from eclipsejax.scene import Scene, axis_offset, axis_position_angle, disc_points, limb_shape, sky_axes
from eclipsejax.shadow_table import Flattening, Places, ShadowTable, TableGrid, Tabulator, tabulator
from eclipsejax.tolerance import reached

# The uneclipsed Moon that is 1 in a picture stands at this phase angle, just outside the penumbra.
FULL_MOON_PHASE = np.radians(1.5)
_BAND = 2**18  # pixels that are worked out at once: 100 MB on the way


class Sampling(NamedTuple):
    """How finely a picture samples the shadow."""

    offsets: int
    wavelengths: int


# Errors of a pixel, relative to its brightest channel, over the discs of totality and partiality and all their depth
# (tests/test_shadow_table.py): 1e-2 and 1e-3, but 3e-3 at a caustic near the axis when the ground is at 255 K, and 15
# times the tolerance within 0.3' of where the Sun sets behind dust of 3e-5 /m. More entries do not make it better:
# what is left comes from going linearly from the nearest to the farthest distance.
SAMPLINGS = {1e-2: Sampling(128, 8), 1e-3: Sampling(320, 24)}
# Beyond 1' from the umbra's edge direct light hides most of what the air does.
PENUMBRAL_SAMPLINGS = {1e-2: Sampling(64, 8), 1e-3: Sampling(96, 24)}


class Renderer(eqx.Module):
    """A scene, ready for any atmosphere.

    - `places`: in the table of the shadow, of what each sample shows.
    - `reflectance`: its brightness in full sunlight, mean of the uneclipsed disc 1 [-]; 0 beside the disc.
    """

    tabulator: Tabulator
    places: Places
    reflectance: Float[Array, "..."]
    response: str = eqx.field(static=True)

    def __call__(self, atmosphere) -> Float[Array, "... channel"]:
        """The picture in this atmosphere's shadow, as by `render`."""
        return lit(scene_table(self.tabulator, atmosphere), self.places, self.reflectance, self.response)


def render(scene: Scene, atmosphere, *, tolerance: float = 1e-3) -> Float[Array, "row column channel"]:
    """Linear picture of a lunar eclipse, before the camera's optics and exposure: see `camera.expose`.

    The unit is the mean of the uneclipsed disc (at the phase angle of 1.5 degrees) above the air, in luminance for
    the response "srgb" and in the green channel of a camera. "srgb" gives linear sRGB, which may be negative for
    colours outside its gamut. Large pictures are made in bands of rows, so that little but the picture is in memory.

    - `tolerance`: relative error wanted of the light, at least 1e-3; see `SAMPLINGS`. Gradients err by more.
    """
    prepared = scene_tabulator(scene, tolerance)
    return painted(scene, prepared.grid, scene_table(prepared, atmosphere))


def painted(
    scene: Scene, grid: TableGrid, shadow: ShadowTable | FlattenedTable | LopsidedTable
) -> Float[Array, "row column channel"]:
    """The picture in the light of a shadow: the last step of `render`, in bands of rows."""
    rows, columns = scene.camera.shape
    band = min(rows, max(1, _BAND // columns))

    def seen(first, count):
        return lit(shadow, *sampled(scene, grid, *pixels(scene.camera, first, count)), scene.camera.response)

    if band == rows:
        return seen(0, rows)

    def add(i, picture):
        first = jnp.minimum(i * band, rows - band)  # the last band overlaps the one before
        return jax.lax.dynamic_update_slice(picture, seen(first, band), (first, 0, 0))

    return jax.lax.fori_loop(0, -(-rows // band), add, jnp.zeros((rows, columns, 3)))


def renderer(scene: Scene, *, tolerance: float = 1e-3) -> Renderer:
    """Prepare a scene for many atmospheres; the arguments are those of `render`."""
    return renderer_at(scene, *pixels(scene.camera), tolerance=tolerance)


def renderer_at(scene: Scene, east, north, *, tolerance: float) -> Renderer:
    """As `renderer`, for directions instead of pixels.

    - `east`, `north`: angles from the disc's apparent centre, any shape [rad].
    """
    prepared = scene_tabulator(scene, tolerance)
    return Renderer(prepared, *sampled(scene, prepared.grid, east, north), scene.camera.response)


def scene_tabulator(scene: Scene, tolerance: float) -> Tabulator:
    """What makes the table of a scene's shadow for any atmosphere, in the camera's channels."""
    samplings = SAMPLINGS if scene.umbral else PENUMBRAL_SAMPLINGS
    error = reached(samplings, tolerance)
    sampling = samplings[error]
    geometry = scene.geometry
    return tabulator(
        scene.sun,
        jnp.linalg.norm(geometry.moon),
        jnp.linalg.norm(geometry.sun),
        disc_offsets(geometry),
        *channel_weights(scene, sampling.wavelengths),
        tolerance=error,
        count=sampling.offsets,
        scatterers=scene.scatterers,
        flattening=_flattening(scene) if scene.flattened else None,
    )


def _flattening(scene: Scene) -> Flattening:
    coarse = min(sampling.wavelengths for sampling in SAMPLINGS.values())
    wavelength, weights = channel_weights(scene, coarse)
    return Flattening(limb_shape(scene.geometry), scene.sun, jnp.asarray(wavelength), jnp.asarray(weights))


def pixels(camera: Camera, first=0, count: int | None = None):
    """Angles of a camera's pixels from the disc's centre, towards east and north [rad].

    - `first`, `count`: of rows; all by default.
    """
    rows, columns = camera.shape
    row, column = jnp.meshgrid(first + jnp.arange(rows if count is None else count), jnp.arange(columns), indexing="ij")
    return sky_plane(camera, row.astype(float), column.astype(float))


def sampled(scene: Scene, grid: TableGrid, east, north) -> tuple[Places, Float[Array, "..."]]:
    """What directions [rad] show: places in a table of the shadow, and `surface_reflectance`."""
    points = disc_points(scene.geometry, *unflattened(scene, east, north))
    angle = axis_position_angle(scene.geometry, points.position)
    distance = jnp.linalg.norm(points.position, axis=-1)
    return grid.places(scene.offset(points.position), distance, angle), surface_reflectance(scene.moon, points)


def lit(
    shadow: ShadowTable | FlattenedTable | LopsidedTable, places: Places, reflectance, response: str
) -> Float[Array, "... channel"]:
    """The surface in the light of a shadow: the last step to a picture, in the channels of a camera's response."""
    light = shadow.at(places) * reflectance[..., None]
    return linear_from_xyz(light) if response == "srgb" else light


def surface_reflectance(moon, points):
    """Brightness of the surface in full sunlight, mean of the uneclipsed disc 1 [-]; 0 beside the disc."""
    shape = moon.reflectance(points.incidence_cosine, points.emission_cosine, points.phase_angle)
    full = moon.reflectance(1.0, 1.0, FULL_MOON_PHASE) / moon.reflectance(1.0, 1.0, 0.0)
    return jnp.where(points.on_disc, shape / full * moon.albedo(points.longitude, points.latitude), 0.0)


def disc_offsets(geometry):
    """Smallest and largest angle from the shadow's axis on the Moon [rad]."""
    distance = jnp.linalg.norm(geometry.moon)
    centre = axis_offset(geometry, geometry.moon)
    reach = jnp.arcsin(MOON_RADIUS / (distance - MOON_RADIUS))
    return jnp.stack([jnp.maximum(centre - reach, 0.0), centre + reach])


def unflattened(scene: Scene, east, north):
    """True angles from the disc's centre for those seen through the refracting air of the observer."""
    if scene.sky is None:
        return east, north
    geometry = scene.geometry
    factor = scene.sky.flattening(moon_altitude(geometry))
    up_east, up_north = (geometry.zenith @ axis for axis in sky_axes(geometry, geometry.moon - geometry.observer))
    length = jnp.sqrt(up_east**2 + up_north**2 + 1e-30)
    up_east, up_north = up_east / length, up_north / length
    lift = (up_east * east + up_north * north) * (1.0 / factor - 1.0)
    return east + lift * up_east, north + lift * up_north


def channel_weights(scene: Scene, count: int):
    """Wavelengths [nm] and weights (wavelength, channel) that turn irradiance into the camera's channels."""
    wavelength, weights = wavelengths.channel_weights(scene.sun, scene.moon, scene.camera.response, count)
    if scene.sky is not None:
        weights = weights * scene.sky.transmission(wavelength, moon_altitude(scene.geometry))[:, None]
    return wavelength, weights
