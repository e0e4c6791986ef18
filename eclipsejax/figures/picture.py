"""Pictures of the Moon for the figures: scenes prepared once, any number of atmospheres and exposures."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.camera import Camera, Exposure, expose
from eclipsejax.ephemeris import geometry
from eclipsejax.render import Renderer, renderer
from eclipsejax.response import LUMINANCE, display, into_gamut
from eclipsejax.scene import Scene, sky_axes
from eclipsejax.sky import Sky

FIELD = 1.1e-2  # rad, width of a picture: the Moon is 8.9e-3 to 9.9e-3 wide
SEEING = 2e-5  # rad (4 arcsec), full width at half maximum of the blur of the photographs
GLARE = 2e-3  # of the light, scattered in air and lens
GLARE_SCALE = 1e-3  # rad
TOLERANCE = 1e-3
FINER = 2  # pixels rendered along the side of one shown, so that the limb is no staircase
BLACK = 40.0  # mag, lost where no light arrives: the shadow's table ends at 1e-30

prepared = eqx.filter_jit(renderer)


@eqx.filter_jit
def _render(ready: Renderer, atmosphere):
    image = ready(atmosphere)
    rows, columns, channels = image.shape
    return image.reshape(rows // FINER, FINER, columns // FINER, FINER, channels).mean(axis=(1, 3))


def scene(utc: str, site=(), *, size: int, roll: float = 0.0, **parts) -> Scene:
    """The whole Moon at a time, from a site (latitude, longitude [degrees]) or from the Earth's centre.

    - `size`: rows and columns of its pictures, which are rendered `FINER` times finer. - `roll`: [rad].
    """
    fine = FINER * size
    return Scene.at(utc, *site, camera=Camera(shape=(fine, fine), scale=FIELD / fine, roll=roll), **parts)


def airless() -> Sky:
    """No air at the observer's; of the same structure as any sky, so that one compilation serves."""
    return Sky(pressure=0.0, aerosol_optical_depth=0.0, ozone_du=0.0)


def zenith_up(utc: str, site) -> float:
    """Roll of a picture in which the site's horizon is level [rad]."""
    where = geometry(utc, *site)
    east, north = sky_axes(where, where.moon - where.observer)
    return float(jnp.arctan2(where.zenith @ east, where.zenith @ north))


def pictures(scene: Scene, atmospheres) -> list[np.ndarray]:
    """Linear pictures of one scene, 1 = mean full Moon, one for each atmosphere."""
    ready = prepared(scene, tolerance=TOLERANCE)
    return [np.asarray(_render(ready, atmosphere)) for atmosphere in atmospheres]


def darkness(image: np.ndarray) -> str:
    """By how much the whole Moon is dimmed, in words."""
    lost = magnitudes_lost(image)
    return f"dimmed by {lost:.1f} mag" if lost < BLACK else "black"


def shown(image: np.ndarray, gain: float) -> np.ndarray:
    """A linear picture brightened, for the screen (uint8 sRGB)."""
    return display(image, gain)


def magnitudes_lost(image: np.ndarray) -> float:
    """By which the whole disc is fainter than the full Moon, in luminance.

    The mean of a picture's disc is 1 for the full Moon; the disc fills what `FIELD` leaves of the picture.
    """
    light = image @ np.asarray(LUMINANCE)
    disc = image.any(axis=-1)
    return float(-2.5 * np.log10(light[disc].mean()))


@eqx.filter_jit
def _expose(image, camera, key):
    # The umbra is redder than the sRGB primary: mixed with grey at its own luminance before the sensor clips.
    faint = 1e-9
    return expose(into_gamut(image * faint) / faint, camera, key)


def photographed(image: np.ndarray, exposure: Exposure, seed: int = 0) -> np.ndarray:
    """The photograph that a camera takes of a linear picture: blur, glare, noise, saturation (uint8 sRGB)."""
    size = image.shape[0]
    camera = Camera(
        shape=(size, size),
        scale=FIELD / size,
        psf_fwhm=SEEING * size / FIELD,
        glare=GLARE,
        glare_scale=GLARE_SCALE * size / FIELD,
        exposure=exposure,
        encoding="srgb",
    )
    return np.asarray(jnp.round(255.0 * _expose(jnp.asarray(image), camera, jax.random.key(seed)))).astype(np.uint8)


def shutter(seconds: float) -> str:
    """As photographers write it: 1/20 s, 1.5 s."""
    return f"1/{round(1 / seconds)} s" if seconds < 0.4 else f"{seconds:g} s"


def moment(utc: str) -> str:
    """A time, to read: 2008-02-21 03:26:00 UTC."""
    return utc.replace("T", " ").replace("Z", " UTC")
