"""The camera: where its pixels look, how it blurs, exposes, saturates, adds noise and encodes."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float, PRNGKeyArray

from eclipsejax.errors import InputError
from eclipsejax.response import encode_srgb
from eclipsejax.traced import real, safe_sqrt

# The full Moon (1 in a relative image) at f/11 and 1/ISO s, the photographers' "looney 11", as a share of
# full scale. 5000 cd/m^2 (1.6 degrees of phase) and saturation at 78 lx s / ISO (ISO 12232) give 0.34 above
# the atmosphere; air, lens and the reserve that makers keep leave about half. Good to a factor of 2, which
# `Exposure.gain` takes up.
LOONEY_11 = 0.18

ENCODINGS = ("linear", "srgb")


def optional_real(x) -> Array | None:
    """`real`, but None stays None: absent, so that nothing of it is computed."""
    return None if x is None else real(x)


class ToneCurve(eqx.Module):
    """Picture style: black point, then exponent, toe and shoulder, on linear light with full scale 1.

    With x = (light - black) / (1 - black):  x^exponent -> x (1 + toe) x / (x + toe) -> x (1 + s) / (1 + s x).
    Each step is monotone, keeps 0 and 1, and is the identity at the default.
    """

    black: Float[Array, ""] = eqx.field(default=0.0, converter=real)
    """Light that is still black [full scale]; in [0, 1)."""
    exponent: Float[Array, ""] = eqx.field(default=1.0, converter=real)
    """Contrast [-]; above 0."""
    toe: Float[Array, ""] = eqx.field(default=0.0, converter=real)
    """Light below which the response turns quadratic [full scale]; 0 or more."""
    shoulder: Float[Array, ""] = eqx.field(default=0.0, converter=real)
    """Compression s of the highlights: shadows are lifted by 1 + s relative to them [-]; above -1."""


class Exposure(eqx.Module):
    """How much light makes full scale, and how noisy it is."""

    shutter_s: Float[Array, ""] | None = eqx.field(default=None, converter=optional_real)
    """Exposure time [s]; None for all of `shutter_s`, `f_number` and `iso`: `gain` alone."""
    f_number: Float[Array, ""] | None = eqx.field(default=None, converter=optional_real)
    """Focal ratio [-]."""
    iso: Float[Array, ""] | None = eqx.field(default=None, converter=optional_real)
    """ISO speed [-]."""
    gain: Float[Array, "3"] = eqx.field(default=(1.0, 1.0, 1.0), converter=real)
    """Per channel [-]: white balance, transmission, error of the calibration. Without shutter, f-number and
    ISO: the signal of the full Moon [full scale]."""
    full_well: Float[Array, ""] = eqx.field(default=50e3, converter=real)
    """Electrons at full scale at `base_iso`; fewer in proportion at a higher ISO [electron]."""
    base_iso: Float[Array, ""] = eqx.field(default=100.0, converter=real)
    """ISO speed at which the well is filled [-]."""
    read_noise: Float[Array, ""] = eqx.field(default=3.0, converter=real)
    """Standard deviation of reading a pixel [electron]."""

    def __check_init__(self):
        given = [x is not None for x in (self.shutter_s, self.f_number, self.iso)]
        if any(given) and not all(given):
            raise InputError("An exposure needs all of shutter_s, f_number and iso, or none of them.")

    def scale(self) -> Float[Array, "3"]:
        """Signal made by the full Moon [full scale]."""
        if self.shutter_s is None or self.f_number is None or self.iso is None:
            return self.gain
        return LOONEY_11 * self.shutter_s * self.iso * (11.0 / self.f_number) ** 2 * self.gain

    def capacity(self) -> Float[Array, ""]:
        """Electrons at full scale [electron]."""
        return self.full_well if self.iso is None else self.full_well * self.base_iso / self.iso


class Camera(eqx.Module):
    """Pointing, optics and response of a camera; by default the Moon in the frame and north up."""

    shape: tuple[int, int] = eqx.field(default=(256, 256), static=True)
    """Rows and columns."""
    scale: Float[Array, ""] = eqx.field(default=4e-5, converter=real)
    """Angle between neighbouring pixels at the centre [rad]."""
    roll: Float[Array, ""] = eqx.field(default=0.0, converter=real)
    """Position angle, from north through east, of the image's up direction [rad]."""
    mirror: bool = eqx.field(default=False, static=True)
    """True for an image mirrored left to right (a telescope with an odd number of mirrors)."""
    centre: Float[Array, "2"] | None = eqx.field(default=None, converter=optional_real)
    """Row and column of the disc's centre, pixel centres at integers [pixel]; None for the image's middle."""
    psf_fwhm: Float[Array, ""] | None = eqx.field(default=None, converter=optional_real)
    """Full width at half maximum of the Gaussian blur (seeing, focus, tracking) [pixel]; None for none."""
    glare: Float[Array, ""] | None = eqx.field(default=None, converter=optional_real)
    """Fraction of the light in the wings (scatter in air, lens and sensor); None for none [-]."""
    glare_scale: Float[Array, ""] = eqx.field(default=30.0, converter=real)
    """Core radius of the wings [pixel], a Moffat function that ends as the cube of the inverse distance."""
    exposure: Exposure | None = None
    """None for a relative image: optics only, no noise, no limits."""
    tone: ToneCurve | None = None
    """None for a linear camera."""
    encoding: str = eqx.field(default="linear", static=True)
    """Of the pixel values: "linear" or "srgb"."""
    response: str = eqx.field(default="srgb", static=True)
    """Spectral responses, a name that `response.responses` knows."""

    def __check_init__(self):
        if len(self.shape) != 2 or min(self.shape) < 1:
            raise InputError(f"A camera cannot have the shape {self.shape}: give rows and columns, at least 1.")
        if self.encoding not in ENCODINGS:
            raise InputError(f"A camera has no encoding {self.encoding!r}: take {' or '.join(ENCODINGS)}.")
        if self.exposure is None and (self.tone is not None or self.encoding != "linear"):
            raise InputError("A tone curve or an encoding needs a full scale: give the camera an exposure.")

    def disc_centre(self) -> Float[Array, "2"]:
        """Row and column of the centre of the Moon's disc [pixel]."""
        if self.centre is None:
            return real([(self.shape[0] - 1) / 2, (self.shape[1] - 1) / 2])
        return self.centre


def sky_plane(
    camera: Camera, row: Float[ArrayLike, "..."], column: Float[ArrayLike, "..."]
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Angles of pixels from the disc's centre, towards east and north in the tangent plane [rad]."""
    row_0, column_0 = camera.disc_centre()
    right = (jnp.asarray(column) - column_0) * camera.scale
    up = (row_0 - jnp.asarray(row)) * camera.scale
    # Seen from inside the celestial sphere with north up, east is on the left.
    left = right if camera.mirror else -right
    sine, cosine = jnp.sin(camera.roll), jnp.cos(camera.roll)
    return up * sine + left * cosine, up * cosine - left * sine


def pixel_at(
    camera: Camera, east: Float[ArrayLike, "..."], north: Float[ArrayLike, "..."]
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Row and column [pixel] of a direction in the tangent plane [rad]: the inverse of `sky_plane`."""
    row_0, column_0 = camera.disc_centre()
    east, north = jnp.asarray(east), jnp.asarray(north)
    sine, cosine = jnp.sin(camera.roll), jnp.cos(camera.roll)
    up, left = east * sine + north * cosine, east * cosine - north * sine
    right = left if camera.mirror else -left
    return row_0 - up / camera.scale, column_0 + right / camera.scale


def point_spread(camera: Camera) -> Float[Array, "row column"]:
    """Share of a point's light in each pixel around it, sum 1; shape (2 rows - 1, 2 columns - 1)."""
    rows, columns = camera.shape
    row, column = jnp.arange(1.0 - rows, rows), jnp.arange(1.0 - columns, columns)
    if camera.psf_fwhm is None:
        core = (row == 0.0)[:, None] * (column == 0.0)[None, :] * jnp.ones(())
    else:
        core = _gaussian(row, camera.psf_fwhm)[:, None] * _gaussian(column, camera.psf_fwhm)[None, :]
        core = core / core.sum()
    if camera.glare is None:
        return core
    # Twice the frame holds all wings that can matter; normalised there, no light is lost.
    wings = (1.0 + (row[:, None] ** 2 + column[None, :] ** 2) / camera.glare_scale**2) ** -1.5
    return (1.0 - camera.glare) * core + camera.glare * wings / wings.sum()


def _gaussian(distance: Float[Array, " pixel"], fwhm: Float[Array, ""]) -> Float[Array, " pixel"]:
    """Gaussian integrated over pixels, exact for any width down to none (2.3548 = FWHM / sigma)."""
    sigma = jnp.maximum(fwhm, 1e-3) / 2.354820045030949
    edge = (jnp.append(distance - 0.5, distance[-1] + 0.5)) / (sigma * jnp.sqrt(2.0))
    return 0.5 * jnp.diff(jax.scipy.special.erf(edge))


def blur(image: Float[ArrayLike, "row column 3"], camera: Camera) -> Float[Array, "row column 3"]:
    """The image through the optics: convolved with `point_spread`, the sky outside the frame black.

    What leaves the frame is lost, the rest of the light is kept. By FFT: errors are 1e-16 (float32: 1e-7) of
    the brightest pixel, so a bright crescent beside an umbra wants float64.
    """
    image = jnp.asarray(image)
    if camera.psf_fwhm is None and camera.glare is None:
        return image
    if camera.glare is None and camera.psf_fwhm is not None:
        for axis, count in enumerate(camera.shape):  # a Gaussian is separable: half the work
            core = _gaussian(jnp.arange(1.0 - count, count), camera.psf_fwhm)
            image = _convolved(image, core / core.sum(), (axis,))
        return image
    return _convolved(image, point_spread(camera), (0, 1))


def _convolved(image, kernel, axes: tuple[int, ...]):
    """Convolution along some of the first two axes with a kernel of 2 n - 1 elements along each."""
    # The full convolution is 3 n - 2 long; at a period of 2 n - 1 only what is cut away below overlaps.
    import scipy.fft  # takes a fifth of a second to load, and a picture without blur does not need it

    counts = [image.shape[axis] for axis in axes]
    padded = [scipy.fft.next_fast_len(2 * n - 1) or 2 * n - 1 for n in counts]
    spectrum = jnp.fft.rfftn(kernel, s=padded)
    spectrum = jnp.expand_dims(spectrum, [axis for axis in range(3) if axis not in axes])
    image = jnp.fft.irfftn(jnp.fft.rfftn(image, s=padded, axes=axes) * spectrum, s=padded, axes=axes)
    for axis, n in zip(axes, counts, strict=True):
        image = jax.lax.slice_in_dim(image, n - 1, 2 * n - 1, axis=axis)
    return image


def tone_curve(linear: Float[ArrayLike, "..."], camera: Camera) -> Float[Array, "..."]:
    """Response of the camera's picture style to linear light, both with full scale 1; see `ToneCurve`.

    Black, with zero gradient, below the black point.
    """
    linear = jnp.asarray(linear)
    if camera.tone is None:
        return linear
    tone = camera.tone
    light = (linear - tone.black) / (1.0 - tone.black)
    dark = light <= 1e-6  # a power has no finite slope at zero; 16 bits end at 1.5e-5; NaN is not dark
    x = jnp.where(dark, 1.0, light) ** tone.exponent
    x = x * (1.0 + tone.toe) * x / jnp.maximum(x + tone.toe, 1e-30)
    x = x * (1.0 + tone.shoulder) / (1.0 + tone.shoulder * x)
    return jnp.where(dark, 0.0, x)


def signal(image: Float[ArrayLike, "row column 3"], camera: Camera) -> Float[Array, "row column 3"]:
    """Light behind the optics, before noise and limits [full scale; relative without an exposure]."""
    blurred = blur(image, camera)
    return blurred if camera.exposure is None else blurred * camera.exposure.scale()


def noise_variance(light: Float[ArrayLike, "..."], exposure: Exposure) -> Float[Array, "..."]:
    """Variance by photons and reading of a linear pixel that receives `light` [full scale, squared]."""
    capacity = exposure.capacity()
    return jnp.maximum(jnp.asarray(light), 0.0) / capacity + (exposure.read_noise / capacity) ** 2


def develop(light: Float[ArrayLike, "..."], camera: Camera) -> Float[Array, "..."]:
    """Pixel values in [0, 1] of linear light [full scale]: saturation, tone curve, encoding."""
    toned = tone_curve(jnp.clip(jnp.asarray(light), 0.0, 1.0), camera)
    return encode_srgb(toned) if camera.encoding == "srgb" else toned


def expose(
    image: Float[ArrayLike, "row column 3"], camera: Camera, key: PRNGKeyArray | None = None
) -> Float[Array, "row column 3"]:
    """Photograph of a relative image (1 = mean full Moon): pixel values in [0, 1] of full scale, as encoded.

    Without an exposure the image stays relative and only the optics act. Photon noise is Gaussian with the
    variance of the Poisson law: so it has a gradient, and it is right above some 20 electrons.

    - `key`: a JAX random key; None for the photograph without noise.
    """
    light = signal(image, camera)
    if camera.exposure is None:
        return light
    if key is not None:
        noise = jax.random.normal(key, light.shape, light.dtype)
        light = light + safe_sqrt(noise_variance(light, camera.exposure)) * noise
    return develop(light, camera)
