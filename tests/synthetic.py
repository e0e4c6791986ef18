"""Photographs of eclipses that never were: rendered with the full model, exposed with noise, rolled, compressed."""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from PIL import Image

from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze
from eclipsejax.camera import Camera, Exposure, ToneCurve, expose
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import geometry
from eclipsejax.render import channel_weights, render
from eclipsejax.scatterers import Scatterers
from eclipsejax.scene import Scene

UTC, SITE = "2022-05-16T03:45:00Z", (-10.944, -37.056)
SHAPE, RADIUS, CENTRE, ROLL = (420, 480), 150.0, (190.0, 262.0), 137.0
ALPHA = 4.7e-6
STYLE = ToneCurve(exponent=1.05, toe=0.01, shoulder=0.3)  # as cameras have one


def limb(alpha: float = ALPHA) -> Atmosphere:
    """Standard surface temperature and pressure, dust of Yapo & Cutler's (2009) picture, usual clouds and haze."""
    return Atmosphere(dust=Dust(alpha), haze=Haze(0.1), clouds=Clouds(top=7e3, cover=0.95, width=4e3))


def photograph(
    path: Path, atmosphere: Atmosphere, *, utc: str = UTC, clock: str | None = None, tone: ToneCurve | None = STYLE,
    quality: int = 92, seed: int = 1,
):  # fmt: skip
    """Write a JPEG of the eclipse whose brightest parts reach 80 % of full scale.

    - `clock`: what the camera thinks that the time is, `2022:05:16 03:45:00`; with it the file states an exposure.
    """
    where = geometry(utc, *SITE)
    scale = MOON_RADIUS / float(np.linalg.norm(where.moon - where.observer)) / RADIUS
    frame = {"shape": SHAPE, "scale": scale, "roll": np.radians(ROLL), "centre": CENTRE, "response": "nikon_5100"}
    scene = Scene.at(utc, *SITE, camera=Camera(**frame), scatterers=Scatterers())
    light = np.asarray(eqx.filter_jit(render)(scene, atmosphere, tolerance=1e-2))
    light = light / np.asarray(channel_weights(scene, 24)[1].sum(axis=0))  # white balance on the uneclipsed Moon
    gain = 0.8 / np.percentile(light[..., 0][light[..., 0] > 0], 99.5)
    exposure = Exposure(gain=(gain, gain, gain), full_well=20e3, read_noise=5.0)
    optics = {"psf_fwhm": 2.0, "glare": 0.01, "glare_scale": 25.0}
    camera = Camera(**frame, **optics, exposure=exposure, tone=tone, encoding="srgb")
    encoded = np.asarray(expose(jnp.asarray(light), camera, jax.random.key(seed)))
    exif = Image.Exif()
    if clock is not None:
        exif[272] = "Synthetic"  # Model; then ExposureTime, DateTimeOriginal and ISOSpeedRatings
        exif.get_ifd(0x8769).update({33434: 1e-3 * float(gain), 36867: clock, 34855: 400})
    Image.fromarray(np.round(255 * np.clip(encoded, 0, 1)).astype(np.uint8)).save(path, quality=quality, exif=exif)
    return path
