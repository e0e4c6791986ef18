"""Where the Moon is in a photograph, how large, and which way up.

`register` is the one thing to call: it searches the picture for discs (`disc_search`), fits the limb of one
(`limb_fit`), turns it (`orientation`), and refuses with one sentence what cannot be used.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from eclipsejax.ephemeris import Geometry
from eclipsejax.errors import InputError
from eclipsejax.moon import Moon
from inverse.disc_light import limb_light, on_sky
from inverse.disc_search import Circle, enlarged, reduced, search
from inverse.limb_fit import Limb, fit_limb
from inverse.orientation import orientation
from inverse.photo import Photo

SMALLEST = 20.0  # radius that can be used [pixel]
SPECK = 8.0  # radius below which a spot is not even called a disc: stars and lamps [pixel]
WIDEST_EDGE = 0.25  # full width at half maximum of the blur, of the radius
LEAST_LIMB = 0.1  # of the circle
LARGEST_ERROR = 0.01  # of the centre and of the radius, of the radius
PATIENCE = 6  # circles looked at before a picture is said to have no Moon

Disc = tuple[Circle, Limb | None]


@dataclass(frozen=True)
class Registration:
    """The Moon's disc in a photograph.

    - `row`, `column`: centre of the disc, pixel centres at integers [pixel]; `radius` [pixel].
    - `roll`: position angle of the image's up direction, from north through east [rad]; `mirror`: mirrored left to
      right. As in `eclipsejax.Camera`.
    - `quality`: 1 where the limb fixes the disc perfectly, 0 where it is at the edge of being refused.
    - `limb_rms`: scatter of the limb about the circle [pixel]; `limb_fraction`: of the circle seen as limb.
    - `roll_from`: what roll and mirror rest on: "maria", "shadow" (then `mirror` is assumed False), "maria and
      shadow", or "assumed north up".
    - `roll_quality`: gain over the best other orientation, 0 to 1, see `orientation.Orientation`.
    - `centre_error`, `radius_error`: standard errors, by noise and by the mountains of the limb [pixel].
    - `blur`: full width at half maximum of the limb's edge [pixel].
    - `roll_error`: standard error of the roll [rad]; pi if it is assumed.
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
    roll_error: float = np.pi

    @property
    def circle(self) -> Circle:
        """The disc alone."""
        return Circle(self.row, self.column, self.radius, self.limb_fraction)


def register(
    photo: Photo,
    geometry: Geometry | None = None,
    *,
    disc: int | None = None,
    moon: Moon | None = None,
    radius_hint: float | None = None,
) -> Registration:
    """Finds the disc of the Moon and, given the geometry of the instant, its roll and mirror state.

    On simulated frames whose limb is a circle, a third of it above the noise, centre and radius are right to 0.3
    pixel. The Moon's own limb is not a circle: see `centre_error`. A limb that is overexposed or lost in noise is
    worse by a part of its blur. The time behind the geometry may be wrong by minutes. `InputError` says why a picture
    cannot be used.

    - `disc`: which of several discs, counted from 1 in reading order.
    - `moon`: its albedo map is matched; None for the default.
    - `radius_hint`: the radius, if known to 5 % from focal length and pixel size [pixel].
    """
    found, limb = chosen_disc(photo, disc, radius_hint)
    error = max(limb.centre_error, limb.radius_error) / found.radius
    edge = 2.355 * limb.blur / found.radius
    quality = (1 - edge / WIDEST_EDGE) * (1 - error / LARGEST_ERROR) * min(1.0, limb.fraction / 0.3)
    registration = Registration(
        row=float(found.row),
        column=float(found.column),
        radius=float(found.radius),
        roll=0.0,
        mirror=False,
        quality=float(quality),
        limb_rms=limb.rms,
        limb_fraction=limb.fraction,
        roll_from="assumed north up",
        roll_quality=0.0,
        centre_error=limb.centre_error,
        radius_error=limb.radius_error,
        blur=2.355 * limb.blur,
    )
    return registration if geometry is None else oriented(registration, photo, geometry, moon)


def oriented(registration: Registration, photo: Photo, geometry: Geometry, moon: Moon | None = None) -> Registration:
    """A registration without the roll, with it; the arguments are those of `register`."""
    turned = orientation(photo, registration.circle, geometry, Moon() if moon is None else moon)
    return replace(
        registration,
        roll=turned.roll,
        mirror=turned.mirror,
        roll_from=turned.source,
        roll_quality=turned.quality,
        roll_error=turned.error,
    )


def chosen_disc(photo: Photo, disc: int | None, radius_hint: float | None) -> tuple[Circle, Limb]:
    """The one disc of a photograph, or the one asked for, with its limb; `InputError` if there is none."""
    name = photo.path
    luminance = photo.pixels.mean(-1, dtype=np.float32)
    circles = [circle for circle in search(luminance) if circle.radius > SPECK and on_sky(luminance, circle)]
    if radius_hint is not None:
        circles = [circle for circle in circles if abs(circle.radius / radius_hint - 1) < 0.25]
    discs, refused = moons(photo, circles, radius_hint)
    if not discs:
        for limb in spoilt_limbs(photo, luminance, refused):
            check_limb(name, limb)
        raise InputError(
            f"{name} shows no disc that could be the Moon: give a picture of it in focus, against a dark sky."
        )
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
    return limb.circle, limb


def moons(photo: Photo, circles: list[Circle], radius_hint: float | None) -> tuple[list[Disc], list[Disc]]:
    """Those of the circles (best first) that are Moons, in reading order, and those that on a closer look are none."""
    found: list[Disc] = []
    refused: list[Disc] = []
    for circle in circles:
        if not found and len(refused) == PATIENCE:
            break
        alike = not found or (0.5 < circle.radius / found[0][0].radius < 2 and circle.coverage > 0.15)
        apart = all(circle.distance(other) > max(circle.radius, other.radius) for other, _ in found)
        if not (alike and apart):
            continue
        # Half a circle of edges on a dark sky is no accident; less may be, in a landscape.
        limb = limb_of(photo, circle, radius_hint) if not found or circle.coverage < 0.5 else None
        if limb is None:
            found.append((circle, None))
        elif is_limb(limb, circle):
            found.append((replace(circle, radius=limb.circle.radius), limb))
        else:
            refused.append((circle, limb))
    # In a composite all Moons are as large; a round cloud or a ghost in the lens is not, unless it is as clear a disc.
    moons = [
        (circle, limb)
        for circle, limb in found
        if abs(circle.radius / found[0][0].radius - 1) < 0.1 or circle.coverage > 0.6 * found[0][0].coverage
    ]
    return reading_order(moons), refused


def spoilt_limbs(photo: Photo, luminance: np.ndarray, refused: list[Disc]) -> Iterator[Limb]:
    """Limbs in a picture without one that can be used: they are too short, or too blurred to be seen as edges."""
    for circle, limb in refused:
        if limb is not None and limb.rms < max(0.01 * circle.radius, limb.blur) and not elsewhere(limb, circle):
            yield limb
    factor = max(4, max(luminance.shape) // 100)  # in so small a copy any blur is sharp
    if min(luminance.shape) > 8 * factor:
        for circle in search(reduced(luminance, factor)):
            circle = enlarged(circle, factor)
            if circle.coverage > 0.5 and on_sky(luminance, circle):
                yield limb_of(photo, circle, None, reach=0.5)


def reading_order(discs: list[Disc]) -> list[Disc]:
    """Lines from top to bottom, each from left to right; a line is what overlaps in height by half a disc."""
    lines: list[list[Disc]] = []
    for disc in sorted(discs, key=lambda disc: disc[0].row):
        if lines and disc[0].row - lines[-1][0][0].row < disc[0].radius:
            lines[-1].append(disc)
        else:
            lines.append([disc])
    return [disc for line in lines for disc in sorted(line, key=lambda disc: disc[0].column)]


def limb_of(photo: Photo, circle: Circle, radius_hint: float | None, reach: float = 0.12) -> Limb:
    """The limb near a circle, fitted in as much of the picture as it needs; `reach` as in `fit_limb`."""
    half = (1.1 + reach) * circle.radius + 40
    rows, columns = (
        slice(max(0, int(place - half)), min(count, int(place + half) + 2))
        for place, count in zip((circle.row, circle.column), photo.pixels.shape[:2], strict=True)
    )
    local = circle.moved(-rows.start, -columns.start)
    light, saturated = limb_light(photo.pixels[rows, columns], photo.saturated[rows, columns], local)
    limb = fit_limb(light, saturated, local, radius_hint, reach=reach)
    return replace(limb, circle=limb.circle.moved(rows.start, columns.start))


def is_limb(limb: Limb, circle: Circle) -> bool:
    """Whether what was found near a circle is the edge of a disc, and not a chance of many edges."""
    radius = limb.circle.radius
    scattered = limb.rms > 0.015 * radius and limb.rms > limb.blur
    sure = max(limb.centre_error, limb.radius_error) < LARGEST_ERROR * radius
    # Lamps along a street give edges that look like a circle from afar, of which little is left close by.
    kept = limb.fraction > max(LEAST_LIMB, 0.5 * circle.coverage)
    return bool(kept and sure and not scattered and not elsewhere(limb, circle))


def elsewhere(limb: Limb, circle: Circle) -> bool:
    """Whether the fit left the circle that it began with."""
    grown = abs(limb.circle.radius / circle.radius - 1) > 0.2
    return grown or limb.circle.distance(circle) > 0.2 * circle.radius


def check_limb(name: str, limb: Limb) -> None:
    """Raises `InputError` where a limb cannot be relied on."""
    radius = limb.circle.radius
    edge = 2.355 * limb.blur / radius
    if edge > WIDEST_EDGE:
        raise InputError(
            f"{name} is too blurred: the limb is {100 * edge:.0f} % of the Moon's radius wide, more than "
            f"the {100 * WIDEST_EDGE:.0f} % that can be used; take a sharper picture."
        )
    if radius < SMALLEST:
        raise InputError(
            f"The Moon in {name} has a radius of {radius:.0f} pixels, where {SMALLEST:.0f} are needed: "
            "take a longer lens, or the original instead of a reduced copy."
        )
    error = max(limb.centre_error, limb.radius_error)
    if limb.fraction < LEAST_LIMB or error > LARGEST_ERROR * radius:
        raise InputError(
            f"{name} shows too little of the Moon's limb, {100 * limb.fraction:.0f} % of the circle (centre and radius "
            f"to {error:.1f} pixels): take a picture with more of it in the frame and above the noise."
        )
