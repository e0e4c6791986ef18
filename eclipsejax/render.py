"""The picture: light of the shadow on the Moon, through the observer's air, into a camera.

What no atmosphere changes (where the pixels look, the surface there, the Sun's half of the shadow) is worked out once,
in a `Renderer`; each atmosphere then costs the flux of its rays and a look into a table for every pixel.
"""

from functools import cache
from importlib.resources import files
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.camera import sky_plane
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import moon_altitude
from eclipsejax.moon import Moon
from eclipsejax.response import linear_from_xyz, responses
from eclipsejax.scene import Scene, axis_offset, disc_points
from eclipsejax.shadow_table import Places, Tabulator, tabulator
from eclipsejax.sun import Sun
from eclipsejax.tolerance import reached

# The uneclipsed Moon that is 1 in a picture stands at this phase angle, just outside the penumbra.
FULL_MOON_PHASE = np.radians(1.5)
FEW = 8  # fitted wavelengths, and their number


class Sampling(NamedTuple):
    """How finely a picture samples the shadow."""

    offsets: int
    wavelengths: int


SAMPLINGS = {1e-2: Sampling(40, FEW), 1e-3: Sampling(64, 40), 1e-4: Sampling(128, 80), 1e-5: Sampling(300, 200)}


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
        light = self.tabulator(atmosphere).at(self.places) * self.reflectance[..., None]
        return linear_from_xyz(light) if self.response == "srgb" else light


def render(scene: Scene, atmosphere, *, tolerance: float = 1e-3) -> Float[Array, "row column channel"]:
    """Linear picture of a lunar eclipse, before the camera's optics and exposure: see `camera.expose`.

    The unit is the mean of the uneclipsed disc (at the phase angle of 1.5 degrees) above the air, in luminance for
    the response "srgb" and in the green channel of a camera. "srgb" gives linear sRGB, which may be negative for
    colours outside its gamut.

    - `tolerance`: relative error wanted of the irradiance, at least 1e-5; see `SAMPLINGS`. Gradients err by more.
    """
    return renderer(scene, tolerance=tolerance)(atmosphere)


def renderer(scene: Scene, *, tolerance: float = 1e-3) -> Renderer:
    """Prepare a scene for many atmospheres; the arguments are those of `render`."""
    row, column = jnp.meshgrid(*(jnp.arange(n, dtype=float) for n in scene.camera.shape), indexing="ij")
    return renderer_at(scene, *sky_plane(scene.camera, row, column), tolerance=tolerance)


def renderer_at(scene: Scene, east, north, *, tolerance: float) -> Renderer:
    """As `renderer`, for directions instead of pixels.

    - `east`, `north`: angles from the disc's apparent centre, any shape [rad].
    """
    error = reached(SAMPLINGS, tolerance)
    sampling = SAMPLINGS[error]
    geometry = scene.geometry
    points = disc_points(geometry, *unflattened(scene, east, north))
    prepared = tabulator(
        scene.sun,
        jnp.linalg.norm(geometry.moon),
        jnp.linalg.norm(geometry.sun),
        disc_offsets(geometry),
        *channel_weights(scene, sampling.wavelengths),
        tolerance=error,
        count=sampling.offsets,
    )
    return Renderer(
        tabulator=prepared,
        places=prepared.grid.places(axis_offset(geometry, points.position), jnp.linalg.norm(points.position, axis=-1)),
        reflectance=surface_reflectance(scene.moon, points),
        response=scene.camera.response,
    )


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
    sight = geometry.moon - geometry.observer
    to_east = jnp.cross(geometry.pole, sight)
    to_north = jnp.cross(sight, to_east)
    up_east = geometry.zenith @ to_east / jnp.linalg.norm(to_east)
    up_north = geometry.zenith @ to_north / jnp.linalg.norm(to_north)
    length = jnp.sqrt(up_east**2 + up_north**2 + 1e-30)
    up_east, up_north = up_east / length, up_north / length
    lift = (up_east * east + up_north * north) * (1.0 / factor - 1.0)
    return east + lift * up_east, north + lift * up_north


def channel_weights(scene: Scene, count: int):
    """Wavelengths [nm] and weights (wavelength, channel) that turn irradiance into the camera's channels.

    XYZ for the response "srgb"; up to 8 wavelengths then are the fitted ones, if the Sun is the default.
    """
    camera = scene.camera
    if camera.response == "srgb":
        fitted = count <= FEW and scene.sun.spectrum == Sun().spectrum
        wavelength, weights = few_wavelengths() if fitted else binned_weights(scene.sun, scene.moon, "xyz", count)
    else:
        wavelength, weights = binned_weights(scene.sun, scene.moon, camera.response, count)
    if scene.sky is not None:
        weights = weights * scene.sky.transmission(wavelength, moon_altitude(scene.geometry))[:, None]
    return wavelength, weights


def binned_weights(sun: Sun, moon: Moon, response: str, count: int):
    """Wavelengths [nm] and weights (wavelength, channel), equally spaced from 380 to 780 nm.

    Each weight is the integral of Sun x Moon x response over a bin, on a 0.5 nm grid, so that Fraunhofer lines
    average out; the irradiance is taken at the bin's middle.
    """
    bins = np.linspace(380.0, 780.0, count + 1)
    fine = np.arange(380.25, 780.0, 0.5)
    light = sun.irradiance(jnp.asarray(fine)) * moon.spectrum(jnp.asarray(fine))
    member = np.clip(np.searchsorted(bins, fine) - 1, 0, count - 1)[None, :] == np.arange(count)[:, None]
    weights = jnp.asarray(member, dtype=float) @ (light[:, None] * responses(response, fine))
    return jnp.asarray(0.5 * (bins[1:] + bins[:-1])), weights / jnp.sum(weights[:, 1])


@cache
def few_wavelengths():
    """The fitted wavelengths [nm] and their weights (wavelength, 3) for XYZ: `tables/make_few_wavelengths.py`."""
    with files("eclipsejax").joinpath("tables/few_wavelengths.csv").open() as lines:
        table = np.loadtxt(lines, delimiter=",", skiprows=3)
    return table[:, 0], table[:, 1:]
