"""Where the Moon is in a photograph, how large, and which way up.

`register` is the one thing to call: it searches the picture for discs (`disc_search`), fits the limb of one (`limb_fit`),
turns it (`orientation`), and refuses with one sentence what cannot be used.
"""

from dataclasses import dataclass, replace

import numpy as np

from eclipsejax.ephemeris import Geometry
from eclipsejax.errors import InputError
from eclipsejax.moon import Moon
from inverse.disc_search import Circle, search
from inverse.limb_fit import Limb, fit_limb
from inverse.orientation import orientation
from inverse.photo import Photo

SMALLEST = 20.0  # radius that can be used [pixel]
FAINTEST = 8.0  # radius below which a spot is not even called a disc: stars and lamps [pixel]
WIDEST_EDGE = 0.25  # full width at half maximum of the blur, of the radius
PATIENCE = 6  # circles looked at before a picture without a Moon is given up
LEAST_LIMB = 0.1  # of the circle
LARGEST_ERROR = 0.01  # of the centre and of the radius, of the radius


@dataclass(frozen=True)
class Registration:
    """The Moon's disc in a photograph.

    - `row`, `column`: centre of the disc, pixel centres at integers [pixel]; `radius` [pixel].
    - `roll`: position angle of the image's up direction, from north through east [rad]; `mirror`: mirrored left to right.
      As in `eclipsejax.Camera`.
    - `quality`: 1 where the limb fixes the disc perfectly, 0 where it is at the edge of being refused.
    - `limb_rms`: scatter of the limb about the circle [pixel]; `limb_fraction`: of the circle seen as limb.
    - `roll_from`: what fixed roll and mirror: "maria", "shadow", "maria and shadow", or "assumed north up" if nothing did.
    - `roll_quality`: by how much the best orientation beats the second best that is another one, 0 to 1 (see `orientation`).
    - `centre_error`, `radius_error`: standard errors, without what the tone curve does to the edge [pixel].
    - `blur`: full width at half maximum of the limb's edge [pixel].
    """

    row: float
    column: float
    radius: float
    roll: float
    mirror: bool
    quality: float
    limb_rms: float
    limb_fraction: float
    roll_from: str
    roll_quality: float
    centre_error: float = 0.0
    radius_error: float = 0.0
    blur: float = 0.0


def register(
    photo: Photo,
    geometry: Geometry | None = None,
    *,
    disc: int | None = None,
    moon: Moon | None = None,
    radius_hint: float | None = None,
) -> Registration:
    """Finds the disc of the Moon and, given the geometry of the instant, its roll and mirror state.

    The disc is the circle through the limb only, to 0.3 pixel where a third of the limb is seen above the noise; a crescent
    that is overexposed or lost in noise is worse, and says so in `centre_error`. The time behind the geometry may be wrong by
    minutes. `InputError` says why a picture cannot be used.

    - `disc`: which of several discs, counted from 1 in reading order.
    - `moon`: its albedo map is matched; None for the default.
    - `radius_hint`: the radius, if known to 5 % from focal length and pixel size [pixel].
    """
    name = photo.path
    luminance = photo.pixels.mean(-1, dtype=np.float32)
    circles = [circle for circle in search(luminance) if circle.radius > FAINTEST and on_sky(luminance, circle)]
    if radius_hint is not None:
        circles = [circle for circle in circles if abs(circle.radius / radius_hint - 1) < 0.25]
    discs = moons(photo, circles, radius_hint)
    if not discs:
        if circles and circles[0].coverage > 0.5:
            check_limb(name, limb_of(photo, circles[0], radius_hint))
        raise InputError(f"{name} shows no disc that could be the Moon: give a picture with its limb against a dark sky.")
    if len(discs) > 1 and disc is None:
        raise InputError(
            f"{name} shows {len(discs)} discs: say which is meant with disc=1 to {len(discs)} (--disc N), "
            "counted in reading order."
        )
    if disc is not None and not 1 <= disc <= len(discs):
        raise InputError(f"{name} has no disc {disc}: it shows {len(discs)}, counted from 1 in reading order.")
    circle, limb = discs[0 if disc is None else disc - 1]
    limb = limb_of(photo, circle, radius_hint) if limb is None else limb
    check_limb(name, limb)
    found = limb.circle
    error = max(limb.centre_error, limb.radius_error) / found.radius
    edge = 2.355 * limb.blur / found.radius
    registration = Registration(
        row=found.row,
        column=found.column,
        radius=found.radius,
        roll=0.0,
        mirror=False,
        quality=float((1 - edge / WIDEST_EDGE) * (1 - error / LARGEST_ERROR) * min(1.0, limb.fraction / 0.3)),
        limb_rms=limb.rms,
        limb_fraction=limb.fraction,
        roll_from="assumed north up",
        roll_quality=0.0,
        centre_error=limb.centre_error,
        radius_error=limb.radius_error,
        blur=2.355 * limb.blur,
    )
    if geometry is None:
        return registration
    turned = orientation(photo, found, geometry, Moon() if moon is None else moon)
    return replace(registration, roll=turned.roll, mirror=turned.mirror, roll_from=turned.source, roll_quality=turned.quality)


def moons(photo: Photo, circles: list[Circle], radius_hint: float | None) -> list[tuple[Circle, Limb | None]]:
    """Those of the circles, best first, that are Moons, in reading order, with their limbs if they had to be looked at."""
    found: list[tuple[Circle, Limb | None]] = []
    for number, circle in enumerate(circles):
        if not found and number == PATIENCE:
            break
        alike = not found or (0.5 < circle.radius / found[0][0].radius < 2 and circle.coverage > 0.15)
        apart = all(circle.distance(other) > max(circle.radius, other.radius) for other, _ in found)
        if not (alike and apart):
            continue
        # Half a circle of edges on a dark sky is no accident; less may be, in a landscape.
        limb = limb_of(photo, circle, radius_hint) if not found or circle.coverage < 0.5 else None
        if limb is None or is_limb(limb, circle):
            found.append((circle if limb is None else replace(circle, radius=limb.circle.radius), limb))
    # In a composite all Moons are as large; a round cloud or a ghost in the lens is not, unless it is as clear a disc.
    return reading_order(
        [
            (circle, limb)
            for circle, limb in found
            if abs(circle.radius / found[0][0].radius - 1) < 0.1 or circle.coverage > 0.6 * found[0][0].coverage
        ]
    )


def reading_order(discs: list[tuple[Circle, Limb | None]]) -> list[tuple[Circle, Limb | None]]:
    """Lines from top to bottom, each from left to right; a line is what overlaps in height by half a disc."""
    lines: list[list[tuple[Circle, Limb | None]]] = []
    for disc in sorted(discs, key=lambda disc: disc[0].row):
        if lines and disc[0].row - lines[-1][0][0].row < disc[0].radius:
            lines[-1].append(disc)
        else:
            lines.append([disc])
    return [disc for line in lines for disc in sorted(line, key=lambda disc: disc[0].column)]


def limb_of(photo: Photo, circle: Circle, radius_hint: float | None) -> Limb:
    """The limb near a circle, fitted in as much of the picture as it needs."""
    rows, columns = around(circle, photo.pixels.shape)
    local = replace(circle, row=circle.row - rows.start, column=circle.column - columns.start)
    light, saturated = limb_light(photo.pixels[rows, columns], photo.saturated[rows, columns], local)
    limb = fit_limb(light, saturated, local, radius_hint)
    there = replace(limb.circle, row=limb.circle.row + rows.start, column=limb.circle.column + columns.start)
    return replace(limb, circle=there)


def is_limb(limb: Limb, circle: Circle) -> bool:
    """Whether what was found near a circle is the edge of a disc, and not a chance of many edges."""
    radius = limb.circle.radius
    scattered = limb.rms > 0.015 * radius and limb.rms > limb.blur
    elsewhere = abs(radius / circle.radius - 1) > 0.2 or limb.circle.distance(circle) > 0.2 * circle.radius
    sure = max(limb.centre_error, limb.radius_error) < LARGEST_ERROR * radius
    return bool(limb.fraction > LEAST_LIMB and sure and not scattered and not elsewhere)


def ring(luminance: np.ndarray, circle: Circle, inner: float, outer: float) -> np.ndarray:
    """Samples of the picture between two multiples of the radius, as far as they are in the frame."""
    angle = np.linspace(0, 2 * np.pi, 180, endpoint=False)[:, None]
    radius = circle.radius * np.linspace(inner, outer, 24)
    row = np.round(circle.row + radius * np.sin(angle)).astype(int)
    column = np.round(circle.column + radius * np.cos(angle)).astype(int)
    inside = (row >= 0) & (row < luminance.shape[0]) & (column >= 0) & (column < luminance.shape[1])
    return luminance[row[inside], column[inside]]


def on_sky(luminance: np.ndarray, circle: Circle) -> bool:
    """Whether what surrounds the circle is darker and smoother than what is in it."""
    outside, inside = ring(luminance, circle, 1.08, 1.3), ring(luminance, circle, 0.0, 0.97)
    if outside.size < 200 or inside.size < 200:
        return False
    sky, moon = np.median(outside), np.percentile(inside, 95)
    # By day most of the picture outshines any round thing in it.
    elsewhere = np.mean(luminance[::7, ::7] > (sky + moon) / 2)
    smooth = np.percentile(outside, 90) - sky < 0.3 * (moon - sky)
    return bool(smooth and sky < 0.7 * moon and elsewhere < 0.4)


def around(circle: Circle, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """The part of the picture that the fit of the limb may look at."""
    reach = 1.25 * circle.radius + 40
    return tuple(slice(max(0, int(c - reach)), min(n, int(c + reach) + 2)) for c, n in zip(
        (circle.row, circle.column), shape[:2], strict=True))  # type: ignore[return-value]


def limb_light(pixels: np.ndarray, saturated: np.ndarray, circle: Circle) -> tuple[np.ndarray, np.ndarray]:
    """One image from three channels, by signal over noise, and 1 where it is a lower bound.

    Channels that are overexposed where others are not count little. In a picture whose whites were pulled down from full scale
    (tone mapping), what piles up at the top of the disc's histogram counts as saturated too.
    """
    weights, white = [], []
    for channel in range(pixels.shape[-1]):
        plane = pixels[..., channel]
        inside, outside = ring(plane, circle, 0.0, 0.97), ring(plane, circle, 1.08, 1.3)
        step = np.diff(plane[:: max(1, plane.shape[0] // 400)], axis=1)
        noise = 1.4826 * np.median(np.abs(step[step != 0])) if (step != 0).any() else 0.0
        contrast = max(float(np.mean(inside) - np.median(outside)), 0.0)
        top = np.percentile(inside, 99.5)
        pile = np.mean(inside > 0.96 * top) > 4 * np.mean((inside > 0.89 * top) & (inside <= 0.96 * top)) + 0.02
        over = saturated[..., channel] | ((plane > 0.96 * top) if pile and top > 0.3 else False)
        lost = ring(over.astype(np.float32), circle, 0.0, 0.97).mean()
        weights.append(contrast / max(noise, 0.003 * contrast, 1e-9) ** 2 * np.exp(-20 * lost))
        white.append(over)
    weight = np.array(weights) / max(sum(weights), 1e-30)
    if not weight.any():
        weight = np.full(len(weights), 1 / len(weights))
    mask = np.any([w for w, share in zip(white, weight, strict=True) if share > 0.1], axis=0)
    return (pixels @ weight.astype(np.float32)), mask.astype(np.float32)


def too_small(name: str, radius: float) -> str:
    return f"The Moon in {name} has a radius of {radius:.0f} pixels: {SMALLEST:.0f} are needed, take a longer lens or no shrunken copy."


def check_limb(name: str, limb: Limb) -> None:
    """Raises `InputError` where a limb cannot be relied on."""
    radius = limb.circle.radius
    edge = 2.355 * limb.blur / radius
    if edge > WIDEST_EDGE:
        raise InputError(f"{name} is too blurred: the limb is {100 * edge:.0f} % of the Moon's radius wide, where "
                         f"{100 * WIDEST_EDGE:.0f} % can be used; take a sharper picture.")
    if radius < SMALLEST:
        raise InputError(too_small(name, radius))
    error = max(limb.centre_error, limb.radius_error)
    if limb.fraction < LEAST_LIMB or error > LARGEST_ERROR * radius:
        raise InputError(f"{name} shows too little of the Moon's limb, {100 * limb.fraction:.0f} % of the circle (centre and "
                         f"radius to {error:.1f} pixels): take a picture with more of it in the frame and above the noise.")
