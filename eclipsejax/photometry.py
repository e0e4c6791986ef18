"""How bright an eclipsed Moon is: magnitude, Danjon's number, and the dimming of the disc or of fields on it.

The disc is sampled evenly and its light compared with that of the uneclipsed Moon (1 in a picture), so the albedo of
the Moon matters only to the zero point, `FULL_MOON`. All of it is above the observer's air: one vertical air mass at
sea level takes some 0.2 mag more.
"""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.camera import Camera
from eclipsejax.constants import ASTRONOMICAL_UNIT, MOON_MEAN_DISTANCE, MOON_RADIUS
from eclipsejax.lopsided_table import scene_table
from eclipsejax.render import FULL_MOON_PHASE, Renderer, renderer_at
from eclipsejax.response import LUMINANCE, linear_from_xyz
from eclipsejax.scene import Scene, disc_points

SUN_MAGNITUDE = -26.76  # visual, from M_V = 4.81: Willmer 2018, ApJS 236, 47
# Of the disc at 549 nm and 1.5 degrees of phase: ROLO, Kieffer & Stone 2005, AJ 129, 2887.
FULL_MOON_REFLECTANCE = 0.1375

# Visual magnitude of the full Moon at 1.5 degrees of phase, 384,400 km from the observer and 1 au from the Sun: -12.88.
# Good to 0.2 mag. The 13.5 % albedo of Hernitschek et al. (2008) gives -12.86, but Velikodsky et al. (2011) found the
# Moon 15 % brighter than ROLO, and E. Schmidt's photometer showed -13.09 before the eclipse of 2022-11-08.
FULL_MOON = SUN_MAGNITUDE - 2.5 * float(np.log10(FULL_MOON_REFLECTANCE * (MOON_RADIUS / MOON_MEAN_DISTANCE) ** 2))

# Where H. Vital's relation is used: L = 4 and L = 0.
BRIGHTEST, FAINTEST = -3.8, 4.2

RINGS, SPOKES = 24, 64


class Brightness(eqx.Module):
    """How bright the whole disc is, above the observer's air."""

    magnitude: Float[Array, ""]
    """Visual magnitude, at the distances of the scene; the zero point is good to 0.2."""
    dimming: Float[Array, ""]
    """By how many visual magnitudes the disc is fainter than the full Moon (1.5 degrees of phase) at the same place."""
    danjon: Float[Array, ""]
    """Danjon's L, from the magnitude: `danjon_number`."""


class Photometer(eqx.Module):
    """A scene whose disc is measured in the light of any atmosphere's shadow."""

    renderer: Renderer
    weights: Float[Array, "..."]
    """Share of each sample in the light of the disc; their sum is 1."""
    full: Float[Array, "channel"]
    """Of the full Moon: mean of the disc in each channel."""
    zero: Float[Array, ""]
    """Magnitude of the full Moon at the distances of the scene."""

    def __call__(self, atmosphere) -> Brightness:
        """Brightness of the disc; the photometer's channels must be XYZ, as `photometer` makes them."""
        dimming = -2.5 * jnp.log10(self.light(atmosphere)[1] / self.full[1])
        magnitude = self.zero + dimming
        return Brightness(magnitude=magnitude, dimming=dimming, danjon=danjon_number(magnitude))

    def light(self, atmosphere) -> Float[Array, " channel"]:
        """Mean of the disc in each channel; the full Moon's luminance is 1."""
        return jnp.tensordot(self.weights, self.renderer(atmosphere), axes=self.weights.ndim)


@eqx.filter_jit
def danjon(scene: Scene, atmosphere, *, tolerance: float = 1e-3) -> Brightness:
    """Predicted magnitude and Danjon number of the Moon in a scene, above the observer's air.

    Under `Atmosphere.typical()` five eclipses of 1990-2022 come out to 0.6 mag (`notebooks/brightness_of_eclipses`):
    real limbs differ by that much. Direct light only, which matters little to luminance. Differentiable by the
    atmosphere. For many atmospheres prepare the scene once: `photometer(scene)(atmosphere)`.

    - `tolerance`: of the irradiance, as in `render`.
    """
    return photometer(scene, tolerance=tolerance)(atmosphere)


@eqx.filter_jit
def photometer(scene: Scene, *, response: str = "xyz", tolerance: float = 1e-3) -> Photometer:
    """Prepare a scene for the measurement of its disc under many atmospheres.

    - `response`: of the channels, a name that `response.responses` knows; only with "xyz" is there a magnitude.
    """
    # Even in area: Gauss-Legendre in the square of the radius, equal steps around.
    node, weight = np.polynomial.legendre.leggauss(RINGS)
    radius = np.sqrt(0.5 * (node + 1.0))[:, None]
    angle = 2 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    prepared = renderer_at(*_at(scene, response, radius * np.sin(angle), radius * np.cos(angle)), tolerance=tolerance)
    return Photometer(
        renderer=prepared,
        weights=jnp.asarray(0.5 * weight[:, None] * np.ones(SPOKES) / SPOKES),
        full=_full_sunlight(prepared),
        zero=full_moon_magnitude(scene),
    )


def full_moon_magnitude(scene: Scene) -> Float[Array, ""]:
    """Visual magnitude that the full Moon would have at the distances of a scene."""
    geometry = scene.geometry
    distance = jnp.linalg.norm(geometry.moon - geometry.observer)
    away = jnp.linalg.norm(geometry.sun - geometry.moon) / ASTRONOMICAL_UNIT
    return FULL_MOON + 5.0 * jnp.log10(distance / MOON_MEAN_DISTANCE * away)


def pictured_brightness(scene: Scene, picture: Float[Array, "row column 3"]) -> Brightness:
    """Brightness of the disc in a linear sRGB picture of a scene (`render`) that holds all of it.

    As seen: through the observer's air, if the scene has any. Pixels cut by the limb leave 0.01 mag of doubt.
    """
    geometry, camera = scene.geometry, scene.camera
    radius = jnp.arcsin(MOON_RADIUS / jnp.linalg.norm(geometry.moon - geometry.observer))
    light = jnp.sum(picture @ jnp.asarray(LUMINANCE)) * camera.scale**2 / (jnp.pi * radius**2)
    dimming = -2.5 * jnp.log10(light)
    magnitude = full_moon_magnitude(scene) + dimming
    return Brightness(magnitude=magnitude, dimming=dimming, danjon=danjon_number(magnitude))


@eqx.filter_jit
def field_stops(
    scene: Scene, atmosphere, east, north, *, response: str = "srgb", tolerance: float = 1e-3
) -> Float[Array, "... channel"]:
    """By how many stops fields on the Moon are darker than in the full Moon (then negative), in a camera's channels.

    NaN beside the disc, and in "srgb" where a colour is outside its gamut.

    - `east`, `north`: of the fields, from the disc's centre, any shape [radii of the disc].
    - `response`: as in `photometer`.
    """
    bare, east, north = _at(scene, response, jnp.asarray(east), jnp.asarray(north))
    prepared = renderer_at(bare, east, north, tolerance=tolerance)
    points = disc_points(scene.geometry, east, north)
    # The albedo cancels, but the phase of the refracted light is smaller than the full Moon's.
    cosines = points.incidence_cosine, points.emission_cosine
    surge = scene.moon.reflectance(*cosines, points.phase_angle) / scene.moon.reflectance(*cosines, FULL_MOON_PHASE)
    surge = jnp.where(points.on_disc, surge, jnp.nan)
    light = scene_table(prepared.tabulator, atmosphere).at(prepared.places)
    light = linear_from_xyz(light) if response == "srgb" else light
    return jnp.log2(light / _full_sunlight(prepared) * surge[..., None])


def _at(scene: Scene, response: str, east, north):
    """The scene above the observer's air in other channels, and directions [rad] for radii of the disc."""
    radius = jnp.tan(jnp.arcsin(MOON_RADIUS / jnp.linalg.norm(scene.geometry.moon - scene.geometry.observer)))
    return replace(scene, camera=Camera(response=response), sky=None), radius * east, radius * north


def _full_sunlight(renderer: Renderer) -> Float[Array, " channel"]:
    """The channels of a white disc of mean albedo in full sunlight."""
    full = jnp.sum(renderer.tabulator.weights, axis=0)
    return linear_from_xyz(full) if renderer.response == "srgb" else full


def danjon_number(magnitude: Float[Array, "..."]) -> Float[Array, "..."]:
    """Danjon's L of an eclipse whose Moon has a visual magnitude at mid-totality; clipped to 0 ... 4.

    From H. Vital's m = 4.2 - 3 L + (L / 2)^2. A fit to visual estimates, which scatter by 0.3 in L and 0.4 mag; it
    knows neither colour nor where in the umbra the Moon stands, which Danjon's scale judges too: worth half a unit.
    """
    within = jnp.clip(jnp.asarray(magnitude, dtype=float), BRIGHTEST, FAINTEST)
    return 6.0 - 2.0 * jnp.sqrt(9.0 - (4.2 - within))
