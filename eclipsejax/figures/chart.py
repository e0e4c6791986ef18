"""The course of an eclipse: the Moon on its way through the shadow, and how its disc stands in the sky."""

import jax.numpy as jnp
import numpy as np

from eclipsejax.almanac import Eclipse, in_order, shadow_circles
from eclipsejax.aspect import Aspect, aspect
from eclipsejax.camera import Camera, sky_plane
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import Geometry, geometry
from eclipsejax.figures.page import BLUE, FAINT, GOLD, INK, Plate, photograph, styled
from eclipsejax.moon import Moon
from eclipsejax.response import encode_srgb
from eclipsejax.scene import disc_points, sky_axes

ARCMIN = np.degrees(1.0) * 60.0
FIELD = 2.3  # radii of the Moon that the picture of the disc is wide
TALL = 0.84  # height of the chart over its width
FINER = 2  # pixels computed along the side of one shown


def on_sky(where: Geometry) -> np.ndarray:
    """East and north of the Moon's centre from the shadow's axis, seen from the Earth's centre [arcmin]."""
    axis = -where.sun / jnp.linalg.norm(where.sun)
    across = jnp.stack(sky_axes(where, axis)) @ where.moon
    return ARCMIN * np.asarray(across / (where.moon @ axis))


@styled
def chart_plate(eclipse: Eclipse, site=(), size: int = 320) -> Plate:
    """The Moon at each contact in umbra and penumbra, and its disc at greatest eclipse with its coordinates.

    - `site`: latitude, longitude [degrees] and perhaps height [m]; () for the Earth's centre.
    - `size`: pixels along a side of the disc.
    """
    plate = Plate(f"{eclipse.greatest[:-10]}: the course of the eclipse", 11.0, 6.4)
    greatest = geometry(eclipse.greatest, *site)
    circles = shadow_circles(np.asarray(greatest.moon), np.asarray(greatest.sun))
    _, umbra, penumbra, moon = (float(x) * ARCMIN for x in circles)
    sky = plate.add_axes((0.06, 0.09, 0.58, 0.84))
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    for radius, face, name in ((penumbra, "#1d2733", "penumbra"), (umbra, "#3a1712", "umbra")):
        sky.fill(radius * np.cos(turn), radius * np.sin(turn), color=face, zorder=1)
        sky.text(0.0, radius - 4.5, name, color=FAINT, ha="center", fontsize=8.5, zorder=2)
    names = in_order(eclipse)
    centres = {name: on_sky(geometry(utc)) for name, utc in names.items()}
    first, last = centres["P1"], centres["P4"]
    sky.plot(*zip(first, last, strict=True), color=FAINT, linewidth=0.8, zorder=4)
    _moons(sky, eclipse, names, centres, moon, site)
    wide, high = (max(penumbra, abs(a), abs(b)) + 1.7 * moon for a, b in zip(first, last, strict=True))
    reach = max(wide, high / TALL)
    sky.set(xlim=(reach, -reach), ylim=(-TALL * reach, TALL * reach), aspect="equal")
    sky.set(xlabel="east of the shadow's axis  [arcmin]", ylabel="north of it  [arcmin]")
    sky.set_title("from the Earth's centre; the Moon moves to the east, leftwards")

    seen = aspect(greatest)
    panel = plate.add_axes((0.68, 0.24, 0.3, 0.3 * 11.0 / 6.4))
    up = "zenith up" if site else "celestial north up"
    photograph(panel, disc(greatest, size), f"greatest eclipse, {up}")
    plate.text(0.83, 0.04, told(seen), color=INK, fontsize=9, ha="center", linespacing=1.5)
    where = f"as seen from {site[0]:g}, {site[1]:g} (altitudes without refraction)" if site else ""
    plate.caption = (
        f"A {eclipse.kind} eclipse of umbral magnitude {eclipse.umbral_magnitude:.3f}, greatest at "
        f"{eclipse.greatest.replace('T', ' ').rstrip('Z')} UTC. Left, the Moon at the contacts with penumbra and "
        "umbra, which are those of the almanac (Danjon's enlarged shadow)"
        + (", dotted where it is below the horizon of the site" if site else "")
        + f". Right, the face of the Moon {where or 'as seen from the centre of the Earth'}: meridians and parallels "
        "every 30 degrees, gold for 0. What libration turns towards us is where they are off the middle."
    )
    return plate


def _moons(panel, eclipse: Eclipse, names, centres, radius: float, site) -> None:
    """Discs at the contacts, with their times in turn above and below the path."""
    turn = np.linspace(0.0, 2.0 * np.pi, 121)
    along = centres["P4"] - centres["P1"]
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    across = across * np.sign(across[1])
    middle = centres["greatest"]
    for name, utc in names.items():
        centre = centres[name]
        up = not site or float(aspect(geometry(utc, *site)).altitude) > 0.0
        style = "-" if up else ":"
        panel.plot(centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn), style, color=INK,
                   linewidth=1.2 if name == "greatest" else 0.9, zorder=5)  # fmt: skip
        side = 1.0 if name in ("P1", "U2", "U3", "P4") else -1.0
        clear = 1.35 if name == "greatest" else 1.12  # of the circles beside it
        x, y = centre + side * clear * radius * across
        ha = "center" if name not in ("U2", "U3") else ("left" if centre[0] < middle[0] else "right")
        panel.text(x, y, f"{name}\n{utc[-9:-1]}", color=GOLD if name == "greatest" else BLUE, fontsize=8.5, ha=ha,
                   va="bottom" if side > 0 else "top", zorder=6)  # fmt: skip


def disc(where: Geometry, size: int) -> np.ndarray:
    """The face of the Moon with its coordinates, as a picture (size, size, 3), the zenith or celestial north up."""
    seen = aspect(where)
    up = 0.0 if np.isnan(seen.tilt) else float(seen.axis - seen.tilt)
    fine = FINER * size
    radius = MOON_RADIUS / float(jnp.linalg.norm(where.moon - where.observer))
    scale = FIELD * radius / fine
    camera = Camera(shape=(fine, fine), scale=scale, roll=up)
    row, column = np.mgrid[:fine, :fine].astype(float)
    points = disc_points(where, *sky_plane(camera, jnp.asarray(row), jnp.asarray(column)))
    albedo = np.asarray(Moon().albedo(points.longitude, points.latitude))
    picture = np.repeat(np.where(points.on_disc, albedo, 0.0)[..., None] / 2.4, 3, axis=-1)
    longitude, latitude = np.degrees(points.longitude), np.degrees(points.latitude)
    towards = np.asarray(points.emission_cosine)
    for angle, shrink in ((longitude, np.cos(np.radians(latitude))), (latitude, 1.0)):
        off = angle - 30.0 * np.round(angle / 30.0)
        pixels = np.radians(np.abs(off)) * shrink * radius / scale * np.maximum(towards, 0.05)
        line = points.on_disc & (pixels < 1.0)
        picture[line] = 0.7 * picture[line] + 0.3 * np.array([0.35, 0.5, 0.8])
        picture[line & (np.abs(angle) < 15.0)] = (0.85, 0.6, 0.2)
    shown = picture.reshape(size, FINER, size, FINER, 3).mean(axis=(1, 3))
    return np.asarray(encode_srgb(np.clip(shown, 0.0, 1.0)))


def told(seen: Aspect) -> str:
    """Libration and orientation, in words."""

    def side(angle, positive, negative):
        degrees = float(np.degrees(angle))
        return f"{abs(degrees):.1f}° {positive if degrees > 0 else negative}"

    lines = [f"libration {side(seen.longitude, 'east', 'west')}, {side(seen.latitude, 'north', 'south')}",
             f"lunar north {side(seen.axis, 'east', 'west')} of celestial north"]  # fmt: skip
    if not np.isnan(seen.tilt):
        lines.append(f"and {side(seen.tilt, 'left', 'right')} of the zenith")
        lines.append(f"altitude {np.degrees(seen.altitude):.1f}°, azimuth {np.degrees(seen.azimuth):.1f}°")
    return "\n".join(lines)
