"""Which way up a photograph of the Moon is, from the maria and from the direction of the Earth's shadow.

The brightness of the disc, in a thousand cells and as a logarithm, is a smooth function of the distance from
the shadow's axis plus the logarithm of the albedo map. Both turn with the camera, so every roll and both mirror
states are tried:

- the maria by the correlation of map and photograph after both are freed from whatever is smooth over the disc
  (shadow, haze, vignetting) and from any function of the distance from the axis;
- the shadow by the part of the brightness that a function of the distance from the axis explains. It cannot tell a
  mirrored picture from one that is not, and near the middle of totality, or in the penumbra alone, it has no
  direction.
"""

from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy import ndimage

from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import Geometry
from eclipsejax.moon import Moon
from eclipsejax.scene import axis_offset, disc_points
from inverse.disc_search import Circle, reduced
from inverse.photo import Photo

CELLS = (36, 64)  # across the disc; the larger number where little of it can be used
MAP = 192  # samples of the map across the disc
EDGE = 0.93  # of the radius: nearer the limb, blur and slope of the ground spoil a cell
STEP = np.radians(4.0)  # of the roll in the search
MIRRORED = 0.1  # share of mirrored photographs, before looking
LEAST_CELLS = 60  # of a channel that can be used
SHADOW_ELEMENTS = 10  # independent parts of the disc that tell the shadow's direction: it is not quite round


@dataclass(frozen=True)
class Orientation:
    """Roll [rad] and mirror state of the camera.

    - `source`: what they rest on: "maria", "shadow", "maria and shadow", or "assumed north up" for want of both. A
      mirrored picture is recognised by the maria alone.
    - `quality`: gain over the best other orientation, one that is mirrored or more than 20 degrees away: in the
      correlation with the maria, or where only the shadow is seen in the share of the brightness that it explains.
    - `error`: standard error of the roll [rad]; pi if it is assumed.
    """

    roll: float
    mirror: bool
    source: str
    quality: float
    error: float


@dataclass(frozen=True)
class Face:
    """The Moon as seen, north up and east left to right: log albedo and distance from the shadow's axis [Moon
    radii], both (north, east) on a grid over the square around the disc."""

    log_albedo: np.ndarray
    offset: np.ndarray


@eqx.filter_jit
def _surface(geometry: Geometry, moon: Moon, grid):
    """Albedo and angle from the shadow's axis [rad] on a square grid of the sky; compiled whole, not step by step."""
    points = disc_points(geometry, grid[None, :], grid[:, None])
    return moon.albedo(points.longitude, points.latitude), axis_offset(geometry, points.position)


def face(geometry: Geometry, moon: Moon, across: int = CELLS[0]) -> Face:
    """Albedo and shadow on the apparent disc; the map is smoothed to the size of a cell."""
    distance = float(jnp.linalg.norm(geometry.moon - geometry.observer))
    radius = np.tan(np.arcsin(MOON_RADIUS / distance))
    grid = radius * np.linspace(-1, 1, MAP)
    albedo, offset = (np.asarray(field) for field in _surface(geometry, moon, jnp.asarray(grid)))
    smooth = ndimage.gaussian_filter(albedo, 0.4 * MAP / across)
    unit = MOON_RADIUS / float(jnp.linalg.norm(geometry.moon))
    return Face(np.log(smooth), offset / unit)


@dataclass(frozen=True)
class Cells:
    """Cells of the disc: right of and above its centre [radii], log brightness (cell, channel), which are usable."""

    right: np.ndarray
    up: np.ndarray
    log_light: np.ndarray
    good: np.ndarray


def cells(photo: Photo, circle: Circle, across: int = CELLS[0]) -> Cells:
    """Means of the usable pixels; a cell is good where four fifths of its pixels are."""
    reach = circle.radius + 2
    top, left = (max(0, int(x - reach)) for x in (circle.row, circle.column))
    part = (slice(top, int(circle.row + reach) + 1), slice(left, int(circle.column + reach) + 1))
    factor = max(1, int(circle.radius / (2 * across)))
    usable = photo.usable[part].astype(np.float32)
    light = photo.pixels[part] * usable
    light, usable = (np.stack([reduced(x[..., i], factor) for i in range(x.shape[-1])], -1) for x in (light, usable))
    row, column = np.indices(light.shape[:2])
    shift = (factor - 1) / 2
    up = (circle.row - top - shift - row * factor) / circle.radius
    right = (column * factor + shift + left - circle.column) / circle.radius
    inside = np.hypot(up, right) < EDGE
    number = (np.floor((up + 1) / 2 * across) * across + np.floor((right + 1) / 2 * across))[inside].astype(int)

    def sums(values):
        """Of each cell, for each layer of values (row, column, layer)."""
        layers = (layer[inside] for layer in np.moveaxis(values, -1, 0))
        return np.stack([np.bincount(number, layer, minlength=across**2) for layer in layers], -1)

    count = np.bincount(number, minlength=across**2)
    full = count > 0.5 * np.median(count[count > 0])
    count = count[full, None]
    total, share = sums(light)[full], sums(usable)[full]
    place = sums(np.stack([right, up], -1))[full] / count
    good = (share > 0.8 * count) & (total > 0)
    log_light = np.log(np.where(good, total / np.maximum(share, 1e-9), 1.0))
    return Cells(place[:, 0], place[:, 1], log_light, good)


def disc_cells(photo: Photo, circle: Circle) -> tuple[Cells, int]:
    """The cells, finer where little of the disc can be used, and how many there are across it."""
    across = CELLS[0]
    here = cells(photo, circle, across)
    if here.good.sum(0).max() < 0.2 * across**2:
        across = CELLS[1]
        here = cells(photo, circle, across)
    return here, across


def turned(face_image: np.ndarray, here: Cells, roll: float, mirror: bool) -> np.ndarray:
    """An image of the face at the cells of a camera with this roll: as in `eclipsejax.camera.sky_plane`."""
    left = here.right if mirror else -here.right
    east = here.up * np.sin(roll) + left * np.cos(roll)
    north = here.up * np.cos(roll) - left * np.sin(roll)
    at = [(x + 1) / 2 * (MAP - 1) for x in (north, east)]
    return ndimage.map_coordinates(face_image, at, order=1, mode="nearest")


def functions_of(offset: np.ndarray) -> np.ndarray:
    """Functions (cell, 7) that span the smooth functions of the offset: a cubic spline with three inner knots."""
    x = (offset - offset.min()) / max(float(np.ptp(offset)), 1e-9)
    return np.stack([x**k for k in range(4)] + [np.maximum(x - k, 0) ** 3 for k in (0.25, 0.5, 0.75)], -1)


def freed(values: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """What a linear combination of the basis (cell, function) leaves of values (cell, ...)."""
    q, _ = np.linalg.qr(basis)
    return values - q @ (q.T @ values)


@dataclass(frozen=True)
class Colour:
    """One channel: places of its good cells, their log brightness, a basis of the smooth fields over them, and what
    they leave of the brightness."""

    places: Cells
    light: np.ndarray
    haze: np.ndarray
    rough: np.ndarray

    @classmethod
    def of(cls, here: Cells, channel: int) -> "Colour":
        good = here.good[:, channel]
        right, up, light = here.right[good], here.up[good], here.log_light[good, channel]
        haze, _ = np.linalg.qr(np.stack([right**i * up**j for i in range(4) for j in range(4 - i)], -1))
        return cls(Cells(right, up, light[:, None], good[good, None]), light, haze, light - haze @ (haze.T @ light))


def match(colours: list[Colour], there: Face, roll: float, mirror: bool) -> tuple[float, float]:
    """Correlation of maria and photograph, share of the brightness that shadow and maria explain: means of channels."""
    maria, shadow = [], []
    for colour in colours:
        albedo, offset = (turned(image, colour.places, roll, mirror) for image in (there.log_albedo, there.offset))
        shades = functions_of(offset)
        rough = np.column_stack([albedo, shades[:, 1:]])
        rough = rough - colour.haze @ (colour.haze.T @ rough)
        light, ground = freed(np.stack([colour.rough, rough[:, 0]], -1), rough[:, 1:]).T
        maria.append(light @ ground / np.sqrt(max((light @ light) * (ground @ ground), 1e-24)))
        light, ground = freed(np.stack([colour.light, albedo], -1), shades).T
        left = light - max(light @ ground / max(ground @ ground, 1e-12), 0.0) * ground
        shadow.append(left @ left / max(len(left) * colour.light.var(), 1e-12))
    weights = [len(colour.light) for colour in colours]
    unexplained = np.log(1 - np.clip(maria, 0.0, 0.999) ** 2), np.log(np.clip(shadow, 1e-3, 1.0))
    maria, shadow = (1 - np.exp(np.average(logarithm, weights=weights)) for logarithm in unexplained)
    return float(np.sqrt(maria)), float(shadow)


def evidence(pairs: np.ndarray, elements: float) -> np.ndarray:
    """Log-likelihood of orientations from their (..., [maria, shadow]); `elements` independent features are in view."""
    return -0.5 * elements * np.log1p(-(pairs[..., 0] ** 2)) - 0.5 * SHADOW_ELEMENTS * np.log1p(-pairs[..., 1])


def orientation(photo: Photo, circle: Circle, geometry: Geometry, moon: Moon) -> Orientation:
    """Roll and mirror state of a photograph whose disc is known, at an instant that is known to some minutes."""
    here, across = disc_cells(photo, circle)
    there = face(geometry, moon, across)
    colours = [Colour.of(here, i) for i, good in enumerate(here.good.T) if good.sum() >= LEAST_CELLS]
    if not colours:
        return Orientation(0.0, False, "assumed north up", 0.0, np.pi)

    rolls = STEP * np.arange(round(2 * np.pi / STEP))
    tried = np.array([[match(colours, there, roll, mirror) for roll in rolls] for mirror in (False, True)])
    maria, shadow = tried[..., 0], tried[..., 1]  # (mirror, roll)
    # Wrong orientations show how large a correlation chance gives with this much of the disc in view.
    elements = 1 / max(float(np.mean(np.sort(maria, axis=None)[: int(0.9 * maria.size)] ** 2)), 1e-3)
    likely = evidence(tried, elements) + np.log([[1 - MIRRORED], [MIRRORED]])
    flipped, best = np.unravel_index(int(np.argmax(likely)), maria.shape)
    far = apart(rolls, rolls[best])
    other = np.stack([far | (flipped == 1), far | (flipped == 0)])
    here_best, other_best = np.arctanh(maria[~other].max()), np.arctanh(maria[other].max())
    seen = here_best * np.sqrt(elements) > 3 and (here_best - other_best) * np.sqrt(elements) > 1
    directed = 1 - shadow[flipped].min() > 2 * (1 - shadow[flipped].max())
    if not seen:
        flipped, best = 0, int(shadow[0].argmax())
    if not (seen or directed):
        return Orientation(0.0, False, "assumed north up", 0.0, np.pi)

    # A parabola through the top of the evidence, and its width.
    weight = elements if seen else 0.0
    roll, mirror = rolls[best], bool(flipped)
    for step in STEP * np.array([0.5, 0.25]):
        trials = roll + step * np.arange(-2, 3)
        found = np.array([match(colours, there, trial, mirror) for trial in trials])
        roll = trials[int(np.argmax(evidence(found, weight)))]
    turn = np.radians(np.linspace(-1.5, 1.5, 7))
    found = np.array([match(colours, there, roll + x, mirror) for x in turn])
    bend, slope, _ = np.polyfit(turn, evidence(found, weight), 2)
    error = np.sqrt(-0.5 / bend) if bend < 0 else np.pi
    roll += float(np.clip(-0.5 * slope / bend, turn[0], turn[-1])) if bend < 0 else 0.0
    pair = found.max(0)
    quality = pair[0] - maria[other].max() if seen else pair[1] - shadow[0][apart(rolls, roll)].max()
    source = "shadow" if not seen else "maria and shadow" if directed else "maria"
    return Orientation(
        float(roll % (2 * np.pi)), mirror, source, float(np.clip(quality, 0, 1)), float(min(error, np.pi))
    )


def apart(rolls: np.ndarray, roll: float) -> np.ndarray:
    """Whether rolls are another orientation, not a near one: more than 20 degrees away."""
    return np.abs((rolls - roll + np.pi) % (2 * np.pi) - np.pi) > np.radians(20)
