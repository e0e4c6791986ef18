"""Photographs of eclipses that never were, everything about them drawn from the prior of a fit.

They are made by other means than the fit's own: rendered at full tolerance for every pixel, with the light that the
limb scatters worked out anew; errors of surface and limb laid over it; a camera that is written down a second time;
photon noise, and JPEG. A fit is told the time and the place, and must find out where the disc lies.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from PIL import Image
from scipy.signal import fftconvolve

from benchmarks.drawn_errors import DrawnErrors, Located
from eclipsejax.almanac import Eclipse, eclipses
from eclipsejax.atmosphere import Atmosphere, Clouds
from eclipsejax.camera import Camera, sky_plane
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import Geometry, geometry, moon_altitude
from eclipsejax.limb_sectors import along_limb
from eclipsejax.moon import Moon
from eclipsejax.render import channel_weights, render
from eclipsejax.response import encode_srgb
from eclipsejax.scatterers import Scatterers
from eclipsejax.scene import Scene, axis_offset, axis_position_angle, disc_points
from eclipsejax.sounding import Sounding
from inverse import prior
from inverse.camera_colours import ASSUMED_MATRIX
from inverse.photo_model import GLARE_SCALE, TINT

SHAPE = (440, 480)
RADIUS = (135.0, 155.0)  # pixel
FIRST, LAST = "1990-01-01", "2026-01-01"
LOWEST = np.radians(25.0)  # of the Moon
FULL, EARLY = "full", np.timedelta64(10, "m")  # a phase: so long after the eclipse's begin, the Moon as bright as full
BRIGHTEST = (0.45, 0.9)  # of full scale: what the exposure brings 99.5 % of the disc below
QUALITY = (85, 97)
FULL_WELL, READ_NOISE = 20e3, 5.0  # electrons
BLUR = 2.0  # pixel, full width at half maximum
COLOURS = ("red", "green", "blue")
CLOUDS_WIDTH = 4e3  # m: of those that are `Wrong`


@dataclass(frozen=True)
class Wrong:
    """What is wrong with a photograph that no fit knows of; by default nothing.

    - `vignetting`: by how much light is lost one radius of the disc from the picture's middle, as its square.
    - `glow`: over the middle, of the disc's mean, from nothing on the left to twice as much on the right.
    - `tone`: swing of the tone curve, once up and down in a decade of light.
    - `clock`: error of its clock [s], instead of one from the prior.
    - `air`: name of an AFGL atmosphere, instead of the U.S. standard one.
    - `clouds`: top of clouds without gaps on a fifth of the limb [m].
    """

    vignetting: float = 0.0
    glow: float = 0.0
    tone: float = 0.0
    clock: float | None = None
    air: str | None = None
    clouds: float | None = None

    def limb(self, atmosphere: Atmosphere) -> Atmosphere:
        """What the limb is, instead of the one drawn."""
        if self.air is not None:
            atmosphere = replace(atmosphere, air=Sounding.afgl(self.air))
        if self.clouds is None:
            return atmosphere
        cloudy = replace(atmosphere, clouds=Clouds(self.clouds, 1.0, CLOUDS_WIDTH))
        return along_limb([cloudy, *[atmosphere] * 4])

    def light(self, light: np.ndarray, radius: float) -> np.ndarray:
        """What falls on the sensor (row, column, 3); `radius`: of the disc [pixel]."""
        row, column = (axis - side / 2 for axis, side in zip(np.indices(SHAPE), SHAPE, strict=True))
        lost = self.vignetting * (row**2 + column**2) / radius**2
        glow = self.glow * light.mean() * np.prod(SHAPE) / (np.pi * radius**2) * (1.0 + 2.0 * column / SHAPE[1])
        return light * (1.0 - lost)[..., None] + glow[..., None]

    def curve(self, value: np.ndarray) -> np.ndarray:
        """Linear values in [0, 1] after the tone curve, with its swing."""
        return value * (1.0 + self.tone * np.sin(2.0 * np.pi * np.log10(np.maximum(value, 1e-6))))


@dataclass(frozen=True)
class Drawn:
    """A photograph and the truth about it.

    - `utc`, `site`: what its photographer says; the clock is wrong by the nuisance `clock`.
    - `limb`: by name, the quantities of `prior.ATMOSPHERE`; `nuisance`: those of `prior.PHOTOGRAPH` and `prior.TONE`.
    - `roll`, `row`, `column`, `radius`: of the disc in the picture [rad, pixel].
    - `sensitivity`: what the sensor recorded, 1 where it is full, by the light of the full Moon's disc.
    - `amplitudes`: of its errors, smooth common and chromatic ones, and those of an uneven limb.
    """

    path: Path
    utc: str
    site: tuple[float, float]
    limb: dict[str, float]
    nuisance: dict[str, float]
    roll: float
    row: float
    column: float
    radius: float
    sensitivity: float
    amplitudes: tuple[float, float, float]

    def turned(self, registration) -> float:
        """By how much the roll of a `Registration` is off [rad], between minus and plus half a turn."""
        return (registration.roll - self.roll + np.pi) % (2.0 * np.pi) - np.pi


def draw(path: Path, seed: int, number: int, wrong: Wrong = Wrong(), share: float = 1.0) -> Drawn:
    """Draw photograph `number` of a seed and write it, a JPEG; `share` as of `DrawnErrors`."""
    random = np.random.default_rng([seed, number])
    z = random.standard_normal(len(prior.ATMOSPHERE))
    nuisance = drawn_nuisance(random)
    if wrong.clock is not None:
        nuisance["clock"] = wrong.clock
    [stated], site = instants(random, lambda: [random.uniform()])
    light, truth = recorded(random, path, stated, site, z, nuisance, wrong, share=share)
    encoded = _encoded(light, nuisance, wrong)
    Image.fromarray(np.round(255 * encoded).astype(np.uint8)).save(path, quality=int(random.integers(*QUALITY)))
    return truth


def drawn_nuisance(random) -> dict[str, float]:
    """Of one photograph, by name."""
    return {p.name: float(p.value(random.standard_normal())) for p in prior.PHOTOGRAPH + prior.TONE}


def recorded(
    random,
    path: Path,
    stated: Geometry,
    site,
    z: np.ndarray,
    nuisance: dict[str, float],
    wrong: Wrong = Wrong(),
    errors: DrawnErrors | None = None,
    share: float = 1.0,
) -> tuple[np.ndarray, Drawn]:
    """What a sensor records (row, column, 3), 1 where it is full, and the truth about it.

    - `stated`: the scene at the time that the photographer says; `z`: of the limb (parameter,).
    - `errors`: of surface and limb, which a series shares; by default drawn, and this `share` of them given.
    """
    limb = {p.name: float(p.value(value)) for p, value in zip(prior.ATMOSPHERE, z, strict=True)}
    where = stated.after(nuisance["clock"])
    roll, radius = random.uniform(0.0, 2.0 * np.pi), random.uniform(*RADIUS)
    row, column = (side / 2 + random.uniform(-30, 30) for side in SHAPE)
    scale = MOON_RADIUS / float(np.linalg.norm(where.moon - where.observer)) / radius
    camera = Camera(shape=SHAPE, scale=scale, roll=roll, centre=(row, column), response="nikon_5100")
    scene = Scene(where, camera, moon=Moon(contrast=nuisance["albedo.contrast"]))
    light = _light(scene, wrong.limb(prior.atmosphere(jnp.asarray(z))), limb["scattered.amplitude"])
    right, up = _positions(row, column, radius)
    east, north = up * np.sin(roll) - right * np.cos(roll), up * np.cos(roll) + right * np.sin(roll)
    east_of_axis, north_of_axis = (np.asarray(axis) for axis in _shadow(scene))
    located = Located(right, up, east, north, (east_of_axis, north_of_axis))
    errors = errors or DrawnErrors(random, share)
    light = light * np.exp(errors.of(random, located))
    on_disc = np.hypot(right, up) < 0.95
    light = _exposed(wrong.light(light, radius), nuisance, on_disc, radius)
    sensitivity = random.uniform(*BRIGHTEST) / np.percentile(light[on_disc].max(axis=-1), 99.5)
    electrons = FULL_WELL * np.maximum(light * sensitivity, 0.0)
    light = (random.poisson(electrons) + READ_NOISE * random.standard_normal(light.shape)) / FULL_WELL
    amplitudes = errors.common, errors.chromatic, errors.uneven
    return light, Drawn(path, stated.utc, site, limb, nuisance, roll, row, column, radius, sensitivity, amplitudes)


@cache
def _total_eclipses() -> tuple[Eclipse, ...]:
    return tuple(one for one in eclipses(FIRST, LAST) if one.kind == "total")


def instants(random, phases: Callable[[], Sequence[float | str]]) -> tuple[list[Geometry], tuple[float, float]]:
    """Times of a total eclipse, and a site with the Moon well above its horizon at all of them.

    - `phases`: asked once for each eclipse that is tried: shares of the time of totality, or `FULL`.
    """
    known = _total_eclipses()
    while True:
        contacts = known[random.integers(len(known))].contacts
        first, begin, end = (np.datetime64(contacts[name].rstrip("Z"), "s") for name in ("P1", "U2", "U3"))
        times = [first + EARLY if phase == FULL else begin + (end - begin) * float(phase) for phase in phases()]
        site = (float(np.degrees(np.arcsin(random.uniform(-0.8, 0.8)))), random.uniform(-180.0, 180.0))
        wheres = [geometry(f"{time}Z", *site) for time in times]
        if all(float(moon_altitude(where)) > LOWEST for where in wheres):
            return wheres, site


def _light(scene: Scene, atmosphere: Atmosphere, amplitude: float) -> np.ndarray:
    """Light in the camera's channels (row, column, 3), white on the uneclipsed Moon."""
    direct, whole = (np.asarray(_rendered(replace(scene, scatterers=s), atmosphere)) for s in (None, Scatterers()))
    light = direct + amplitude * (whole - direct)
    return light / np.asarray(channel_weights(scene, 24)[1].sum(axis=0))


@eqx.filter_jit
def _rendered(scene, atmosphere):
    return render(scene, atmosphere, tolerance=1e-3)


@eqx.filter_jit
def _shadow(scene):
    """Place of the pixels in the shadow, east and north of its axis [rad] (row, column) each."""
    points = disc_points(scene.geometry, *sky_plane(scene.camera, *jnp.indices(SHAPE).astype(float)))
    angle, offset = axis_position_angle(scene.geometry, points.position), axis_offset(scene.geometry, points.position)
    return offset * jnp.sin(angle), offset * jnp.cos(angle)


def _positions(row: float, column: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Of the pixels, from the disc's centre [its radii]."""
    rows, columns = np.indices(SHAPE)
    return (columns - column) / radius, (row - rows) / radius


def _exposed(light, nuisance, on_disc, radius: float) -> np.ndarray:
    """Light (row, column, 3) after optics, sky and white balance."""
    veil = nuisance["camera.veil"] * np.exp(np.mean(np.log(light.mean(axis=-1)[on_disc])))
    apart = np.square(np.indices((2 * SHAPE[0] - 1, 2 * SHAPE[1] - 1)) - np.array(SHAPE)[:, None, None] + 1).sum(axis=0)
    width, core = GLARE_SCALE * radius, BLUR / 2.355
    wings = (1.0 + apart / width**2) ** -1.5 / (2.0 * np.pi * width**2)
    sharp = np.exp(-0.5 * apart / core**2) / (2.0 * np.pi * core**2)
    spread = (1.0 - nuisance["camera.glare"]) * sharp + nuisance["camera.glare"] * wings
    light = np.stack([fftconvolve(light[..., channel], spread, mode="same") for channel in range(3)], axis=-1) + veil
    balance = [nuisance[f"white_balance.{name}"] + TINT * nuisance[f"tint.{name}"] for name in ("red", "blue")]
    return light * np.exp([balance[0], 0.0, balance[1]])


def _encoded(light, nuisance, wrong: Wrong) -> np.ndarray:
    """What a camera makes of what its sensor recorded (row, column, 3): pixel values in [0, 1]."""
    own = np.zeros((3, 3))
    for row, to in enumerate(COLOURS):
        for column, source in enumerate(COLOURS):
            if to != source:
                own[row, column] = nuisance[f"matrix.{to}_{source}"]
    own -= np.diag(own.sum(axis=1))
    matrix = np.eye(3) + nuisance["tone.saturation"] * (ASSUMED_MATRIX - np.eye(3)) + own
    x = np.clip(light @ matrix.T - nuisance["tone.black"], 0.0, 1.0) ** nuisance["tone.exponent"]
    x = x * (1.0 + nuisance["tone.toe"]) * x / (x + nuisance["tone.toe"])
    x = x * (1.0 + nuisance["tone.shoulder"]) / (1.0 + nuisance["tone.shoulder"] * x)
    return np.clip(np.asarray(encode_srgb(jnp.asarray(wrong.curve(x)))), 0.0, 1.0)
