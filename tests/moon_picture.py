"""Pictures of an eclipsed Moon for the tests of the registration, made without any code of the package but `Photo`."""

import io

import numpy as np
from PIL import Image
from scipy import ndimage

from inverse.photo import Photo

UMBRA, PENUMBRA = 2.65, 4.65  # radii of the shadow at the Moon [Moon radii]
CENTRE, RADIUS = (150.37, 205.61), 90.2


def sunlight(offset):
    """Fraction of sunlight against the distance from the axis [Moon radii]: the shape of the real one, no more."""
    umbra = 10 ** (-4.5 + 2.2 * np.clip(offset / UMBRA, 0, 1) ** 2)
    rise = np.clip((offset - UMBRA) / (PENUMBRA - UMBRA), 0, 1) ** 1.5
    return np.where(offset < UMBRA, umbra, 10**-2.3 + (1 - 10**-2.3) * rise)


def patches(right, up):
    """An albedo with dark and bright patches."""
    return 1 + 0.25 * np.sin(5 * right + 1) * np.cos(4 * up)


def picture(
    shape=(300, 400),
    centre=CENTRE,
    radius=RADIUS,
    axis=(0.3, 2.0),
    gain=1.0,
    blur=1.2,
    noise=0.003,
    sky=0.0,
    jpeg=92,
    surface=patches,
    colour=(1.0, 0.8, 0.6),
    seed=0,
):
    """A photograph: three samples a pixel, Gaussian blur, noise that grows with the signal, clipping, sRGB, JPEG.

    - `axis`: of the shadow, right of and above the disc's centre [Moon radii]; `gain`: signal of the full Moon;
      `noise`: of a black pixel [both in full scales]; `jpeg`: quality, None for none.
    """
    over = 3
    row, column = ((np.arange(n * over) - (over - 1) / 2) / over for n in shape)
    right, up = (column - centre[1])[None, :] / radius, (centre[0] - row)[:, None] / radius
    light = sunlight(np.hypot(right - axis[0], up - axis[1])) * surface(right, up) * (np.hypot(right, up) < 1)
    light = ndimage.gaussian_filter(light, blur * over, truncate=5)
    light = light.reshape(shape[0], over, shape[1], over).mean((1, 3))
    image = gain * light[..., None] * np.array(colour) + sky
    random = np.random.default_rng(seed)
    image = image + noise * np.sqrt(1 + 20 * np.clip(image, 0, 1)) * random.standard_normal(image.shape)
    return encoded(np.clip(image, 0, 1), jpeg)


def encoded(image, jpeg=92):
    """Linear light (row, column, channel) as it comes back from a file."""
    code = np.where(image <= 0.0031308, 12.92 * image, 1.055 * np.maximum(image, 1e-9) ** (1 / 2.4) - 0.055)
    file = Image.fromarray(np.uint8(np.round(255 * code)))
    if jpeg:
        stored = io.BytesIO()
        file.save(stored, "JPEG", quality=jpeg)
        file = Image.open(stored)
    code = np.asarray(file, dtype=np.float32) / 255
    light = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)
    return photo_of(light)


def photo_of(light):
    """A `Photo` of linear light (row, column, 3) in full scales."""
    light = np.asarray(light, dtype=np.float32)
    return Photo(
        pixels=light,
        variance=np.full_like(light, 1e-6),
        usable=(light > 4e-4) & (light < 0.97),
        saturated=light >= 0.97,
        black=light <= 4e-4,
        tone_curve="srgb",
        time=None,
        local_time=None,
        exposure_s=None,
        iso=None,
        f_number=None,
        focal_length_mm=None,
        camera=None,
        site=None,
        balanced_once=None,
        balance=None,
        path="picture.jpg",
        sha256="",
        format="JPEG",
    )
