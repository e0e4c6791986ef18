"""How badly photographs fit the Earth's shadow at instants that are only supposed, without fitting the air.

The log light of each cell is that of the usual shadow at its distance from the axis, plus the log of the albedo, plus
what may differ: the shadow (a free, smooth function of the distance that all photographs share: wide in the umbra,
which air and clouds colour, narrow in the penumbra, which is the Sun's geometry), the contrast of the maria and the
tone curve, shared too, and for each photograph its exposure (known or not), a haze, the glare and a small turn. All of
it is linear with Gaussian priors, so that the least misfit is one small system of equations for each channel.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from eclipsejax.almanac import Eclipse
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import Geometry, geometry
from eclipsejax.moon import Moon
from inverse.likelihood import LIMB
from inverse.limb_light import shadow_of
from inverse.orientation import MAP, Cells, Face, face, turned

CELL = 0.1  # ln: what blur, map and sharp edges leave in a cell
BLACK = 6e-4  # full scale: two codes of 8 bits
CONTRAST, CONTRAST_WIDTH = 0.7, 0.14  # of the albedo map near opposition, as in `prior`
TONE = 0.15  # exponent of the tone curve
SHOULDER = 0.3  # ln, at full scale: its compression of highlights
GLARE = 0.01  # share of the light; its log is free by 1
HAZE = (0.1, 0.1, 0.05, 0.05, 0.05)  # ln at the limb: right, up, and their squares and product
TURN = 0.01  # rad
LEAST_CELLS = 20  # of a channel
# From the axis [arc minutes], and how far the log of the shadow's light may differ there. At the umbra's edge, some
# 45', 0.3 moves it by a third of an arc minute: as much as the air does.
KNOTS = np.array([0.0, 8.0, 16.0, 24.0, 30.0, 35.0, 39.0, 42.0, 44.0, 46.0, 49.0, 53.0, 60.0, 70.0])
FREE = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.7, 0.7, 0.3, 0.3, 0.1, 0.1, 0.05, 0.05])


class Profile(NamedTuple):
    """Log light of the usual shadow (distance, 3), the uneclipsed Moon 0, at distances from the axis [Moon radii].

    - `arc_minutes`: that a Moon's radius is.
    """

    offset: np.ndarray
    log_light: np.ndarray
    arc_minutes: float


@dataclass(frozen=True)
class View:
    """One photograph, the right way up.

    - `cells`: as `orientation.cells` gives them, `across` the disc; `roll` [rad], `mirror`: as in `Orientation`.
    - `exposure`: log exposure against the others; `width`: its standard deviation.
    - `site`: as for `geometry`.
    """

    cells: Cells
    across: int
    roll: float
    mirror: bool
    exposure: float
    width: float
    site: tuple


def shadow_profile(eclipse: Eclipse) -> Profile:
    """The shadow of one eclipse, under the limb that the prior thinks most likely."""
    wheres = [geometry(utc) for utc in (*eclipse.contacts.values(), eclipse.greatest)]
    table = eqx.filter_jit(shadow_of(wheres, clock_reach=60.0))(jnp.zeros(LIMB))
    moon = float(jnp.linalg.norm(wheres[-1].moon))
    radius = MOON_RADIUS / moon
    offset = np.linspace(0.0, np.radians(1.3) / radius, 400)
    light = table(jnp.asarray(radius * offset), jnp.full(offset.shape, moon - 0.6 * MOON_RADIUS))
    return Profile(offset, np.log(np.asarray(light)), 60.0 * np.degrees(radius))


def misfit(views: Sequence[View], wheres: Sequence[Geometry], shadow: Profile, moon: Moon) -> float:
    """The least sum of squares of photographs taken at these instants: in units of the errors, with the priors'."""
    faces = [face(where, moon, view.across) for view, where in zip(views, wheres, strict=True)]
    total = 0.0
    for channel in range(3):
        count = KNOTS.size + 4
        normal = np.diag([1.0] * (count - 1) + [1e-6, 0.0])  # the exposure that all share is free
        for view, there in zip(views, faces, strict=True):
            if view.cells.good[:, channel].sum() >= LEAST_CELLS:
                normal += _reduced(view, there, shadow, channel)
        total += normal[-1, -1] - normal[-1, :-1] @ np.linalg.solve(normal[:-1, :-1], normal[:-1, -1])
    return float(total)


def _reduced(view: View, there: Face, shadow: Profile, channel: int) -> np.ndarray:
    """Normal equations of what photographs share, the data last, once this photograph's own unknowns are solved for."""
    good = view.cells.good[:, channel]
    here = Cells(*(values[good] for values in (view.cells.right, view.cells.up, view.cells.log_light, view.cells.good)))

    def light(albedo, offset):
        return np.exp(np.interp(offset, shadow.offset, shadow.log_light[:, channel]) + CONTRAST * albedo)

    line = np.linspace(-1.0, 1.0, MAP)[::6]
    on_disc = np.hypot(line[:, None], line) < 0.97
    glare = GLARE * light(there.log_albedo[::6, ::6], there.offset[::6, ::6])[on_disc].mean()
    (albedo, offset), turned_by = (
        [turned(image, here, view.roll + turn, view.mirror) for image in (there.log_albedo, there.offset)]
        for turn in (0.0, TURN)
    )
    direct, log_light = light(albedo, offset), here.log_light[:, channel]
    expected = np.log(direct + glare)
    own_share = direct / (direct + glare)
    knots = np.stack([np.interp(shadow.arc_minutes * offset, KNOTS, one) for one in np.diag(FREE)], -1)
    shared = np.column_stack(
        [
            own_share[:, None] * knots,
            TONE * expected,
            SHOULDER * np.exp(log_light),
            CONTRAST_WIDTH * albedo * own_share,
            np.ones_like(albedo),
        ]
    )
    right, up = here.right, here.up
    own = np.column_stack([
        *(width * shape for width, shape in zip(HAZE, (right, up, right * up, right**2, up**2), strict=True)),
        1.0 - own_share, np.log(light(*turned_by) + glare) - expected, np.full(albedo.shape, view.width),
    ])  # fmt: skip
    data = log_light - expected - view.exposure
    weight = 1.0 / np.hypot(CELL, BLACK * np.exp(-log_light))[:, None]
    own, rest = weight * own, weight * np.column_stack([shared, data])
    cross = own.T @ rest
    return rest.T @ rest - cross.T @ np.linalg.solve(np.eye(own.shape[1]) + own.T @ own, cross)
