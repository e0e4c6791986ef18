"""From the light of the shadow to the numbers of a photograph: surface, optics, colours, tone."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.camera import Camera, Exposure, ToneCurve, tone_curve
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import Geometry
from eclipsejax.moon import Moon, lunar_map
from eclipsejax.render import surface_reflectance
from eclipsejax.scene import axis_offset, disc_points
from eclipsejax.shadow_table import ShadowTable
from eclipsejax.traced import real
from inverse import prior
from inverse.camera_colours import ASSUMED_MATRIX
from inverse.cells import CELLS_PER_RADIUS, Cells

GLARE_SCALE = 0.15  # of the disc's radius: core of the wings (1 + r^2/a^2)^-1.5
GLARE_POINTS_PER_RADIUS = 8
WITHIN = 0.25 * np.array([[-1.0, 1.0, -1.0, 1.0], [-1.0, -1.0, 1.0, 1.0]])  # right and up, in sizes of a cell
CORNER = 0.004  # of the mean of all channels: wider, and blue that a camera cut off would pass for light
BLACK_CORNER = 2e-4  # full scale: less than one code of 8 bits
FREE_EXPOSURE = 3.0  # ln: width of the prior of an exposure of which nothing is known
TINT = 0.03  # ln: between photographs of one camera whose white balance stands still


class Surface(eqx.Module):
    """Points of the Moon that a photograph shows."""

    offset: Float[Array, " point"]
    """From the shadow's axis [rad]."""
    distance: Float[Array, " point"]
    """From the Earth's centre [m]."""
    brightness: Float[Array, " point"]
    """In full sunlight, mean of the disc 1."""

    def light(self, table: ShadowTable) -> Float[Array, "point 3"]:
        """Light in the camera's channels, the uneclipsed disc 1."""
        return table(self.offset, self.distance) * self.brightness[:, None]


class Disc(eqx.Module):
    """Points of a photograph that look at the Moon, in radii from the registered centre, before any correction.

    Around each point are `WITHIN` places whose mean is taken: one place in the middle of a cell knows its albedo to
    4.5 % only, and a map that errs passes for one of less contrast; four of them know it to 1.4 %.
    """

    right: Float[Array, " point"]
    up: Float[Array, " point"]
    size: float = eqx.field(static=True)
    """Of the cells, in radii."""

    def surface(self, later: Geometry, roll, mirror: bool, moon: Moon, nuisance) -> Surface:
        """What lies behind them, with the corrections of `nuisance` to the pointing."""
        scale = MOON_RADIUS / jnp.linalg.norm(later.moon - later.observer)  # tangent of the radius to 1e-5
        roll = roll + nuisance["pointing.roll"]
        larger = 1.0 + nuisance["pointing.radius"]
        right, up = (
            ((middle - nuisance[f"pointing.{name}"])[:, None] + self.size * WITHIN[axis]) / larger
            for axis, (name, middle) in enumerate((("right", self.right), ("up", self.up)))
        )
        left = right if mirror else -right
        sine, cosine = jnp.sin(roll), jnp.cos(roll)
        east, north = scale * (up * sine + left * cosine), scale * (up * cosine - left * sine)
        points = disc_points(later, east, north)
        moon = eqx.tree_at(lambda moon: moon.contrast, moon, nuisance["albedo.contrast"])
        distance = jnp.linalg.norm(points.position, axis=-1)
        each = axis_offset(later, points.position), distance, surface_reflectance(moon, points)
        return Surface(*(jnp.mean(values, axis=1) for values in each))


class PhotoModel(eqx.Module):
    """Everything that turns the table of the shadow and the nuisances into the cells of one photograph.

    In stages, so that the first is left out where geometry stands still: `seen`, the points of the Moon; `light`, what
    falls on the sensor; `signal`.
    """

    geometry: Geometry
    roll: Float[Array, ""]
    moon: Moon
    cells: Disc
    glare_points: Disc
    wings: Float[Array, "cell point"]
    on_disc: Float[Array, " cell"]
    primaries: Float[Array, "3 3"]
    gain: Float[Array, ""]
    """Centre of the prior of the log exposure."""
    exposure_width: Float[Array, ""]
    """Width of the prior of this photograph's own log exposure."""
    balance: Float[Array, "2"]
    """Centre of the prior of the log gains of red and blue, against others of its camera."""
    tint_width: Float[Array, ""]
    """Width of that prior."""
    floor: Float[Array, ""]
    colours: Float[Array, "3 3"]
    """From the camera's channels to linear sRGB; `tone.saturation` says how much of it was applied."""
    mirror: bool = eqx.field(static=True)
    tone_curve: str = eqx.field(static=True)
    clock_width: float = eqx.field(static=True)
    """Width of the prior of the clock's error [s]."""
    gain_width: float = eqx.field(static=True, default=prior.GAIN)
    """Width of the prior of the camera's sensitivity [ln]."""

    @property
    def parameters(self) -> tuple[prior.Parameter, ...]:
        """The nuisances of this photograph."""
        return prior.photograph_parameters(self.tone_curve, self.clock_width, self.gain_width)

    def seen(self, z: Float[Array, " parameter"]) -> tuple[Surface, Surface]:
        """The Moon behind the cells, and around them for the glare."""
        nuisance = prior.values(self.parameters, z)
        later = self.geometry.after(nuisance["clock"])
        cells, around = (
            disc.surface(later, self.roll, self.mirror, self.moon, nuisance) for disc in (self.cells, self.glare_points)
        )
        return cells, around

    def light(self, table: ShadowTable, seen, nuisance) -> Float[Array, "cell 3"]:
        """Light of the cells in the camera's channels, with glare and glow; `nuisance`: values by name."""
        cells, around = seen
        light, around = cells.light(table) * self.on_disc[:, None], around.light(table)
        light = (1.0 - nuisance["camera.glare"]) * light + nuisance["camera.glare"] * (self.wings @ around)
        return with_veil(light, around, nuisance)

    def signal(self, table: ShadowTable, seen, z: Float[Array, " parameter"]) -> Float[Array, "cell 3"]:
        """Decoded pixel values of the cells [full scale]."""
        nuisance = prior.values(self.parameters, z)
        return developed(self, self.light(table, seen, nuisance), nuisance)


class ProfileModel(eqx.Module):
    """As `PhotoModel`, for a profile of brightness against offset: no pointing, no pixels."""

    offset: Float[Array, " bin"]
    distance: Float[Array, ""]
    albedo: Float[Array, " bin"]
    primaries: Float[Array, "3 3"]
    gain: Float[Array, ""]
    exposure_width: Float[Array, ""]
    balance: Float[Array, "2"]
    tint_width: Float[Array, ""]
    floor: Float[Array, ""]
    colours: Float[Array, "3 3"]
    tone_curve: str = eqx.field(static=True)

    @property
    def parameters(self) -> tuple[prior.Parameter, ...]:
        """The nuisances of this profile."""
        return prior.profile_parameters(self.tone_curve)

    def seen(self, z: Float[Array, " parameter"]) -> Surface:
        """The Moon in the bins."""
        offset = jnp.abs(self.offset + prior.values(self.parameters, z)["pointing.offset"])
        return Surface(offset, jnp.full(offset.shape, self.distance), self.albedo)

    def light(self, table: ShadowTable, seen: Surface, nuisance) -> Float[Array, "bin 3"]:
        """Light of the bins in the camera's channels, with the glow; `nuisance`: values by name."""
        light = seen.light(table)
        return with_veil(light, light, nuisance)

    def signal(self, table: ShadowTable, seen: Surface, z: Float[Array, " parameter"]) -> Float[Array, "bin 3"]:
        """Decoded pixel values [full scale]."""
        nuisance = prior.values(self.parameters, z)
        return developed(self, self.light(table, seen, nuisance), nuisance)


def log_value(model, signal: Float[Array, "point 3"]) -> Float[Array, "point 3"]:
    """Log of pixel values [full scale] above the model's floor: what the likelihood compares."""
    return jnp.log(signal + model.floor)


def slopes_by_light(model, light, nuisance) -> Float[Array, "point 3 3"]:
    """Change of the log values by the log light of each channel (point, value, light), under light (point, 3)."""
    return jax.jacfwd(lambda by: log_value(model, developed(model, light * jnp.exp(by), nuisance)))(jnp.zeros(3))


def with_veil(light, around, nuisance):
    """Light (point, 3) with the glow of the sky, in units of the geometric mean over the disc."""
    return light + nuisance["camera.veil"] * jnp.exp(jnp.mean(jnp.log(jnp.mean(around, axis=1) + 1e-12)))


def developed(model, light, nuisance):
    """Light (point, 3) in the camera's channels after exposure, white balance, colour matrix and picture style.

    - `model`: its gain and balance with their widths, primaries, colours and kind of tone curve.
    """
    red, blue = (
        nuisance[f"white_balance.{name}"] + centre + model.tint_width * nuisance[f"tint.{name}"]
        for name, centre in zip(("red", "blue"), model.balance, strict=True)
    )
    balance = jnp.stack([red, jnp.zeros_like(red), blue])
    exposure = model.gain + nuisance["gain"] + model.exposure_width * nuisance["exposure"]
    exposed = light * jnp.exp(exposure + balance)
    if model.tone_curve == "linear":
        return exposed
    lit = exposed @ (model.primaries @ colour_matrix(model.colours, nuisance)).T - nuisance["tone.black"]
    # Deep red turns green and blue negative; cameras clip there, and we round the corner: below one the light would
    # have no slope.
    corner = jnp.hypot(CORNER * jnp.mean(exposed, axis=-1, keepdims=True), BLACK_CORNER)
    positive = 0.5 * (lit + jnp.hypot(lit, corner))
    style = ToneCurve(**{name: nuisance[f"tone.{name}"] for name in ("exponent", "toe", "shoulder")})
    return tone_curve(positive, Camera(exposure=Exposure(), tone=style))


def colour_matrix(colours, nuisance) -> Float[Array, "3 3"]:
    """From the camera's channels to linear sRGB; rows sum to 1, so that white stays white.

    - `colours`: that of its sensitivities.
    """
    identity, zero = jnp.eye(3), jnp.zeros(())
    red_green, red_blue, green_red, green_blue, blue_red, blue_green = (
        nuisance[f"matrix.{name}"]
        for name in ("red_green", "red_blue", "green_red", "green_blue", "blue_red", "blue_green")
    )
    own = jnp.array([[zero, red_green, red_blue], [green_red, zero, green_blue], [blue_red, blue_green, zero]])
    own = own - jnp.diag(own.sum(axis=1))
    return identity + nuisance["tone.saturation"] * (colours - identity) + own


def photo_model(
    photo, registration, where: Geometry, cells: Cells, floor: float,
    clock_width: float = prior.CLOCK, gain_width: float = prior.GAIN,
) -> PhotoModel:  # fmt: skip
    """Put a registered photograph's model together."""
    spacing = 1.0 / GLARE_POINTS_PER_RADIUS
    line = np.arange(-GLARE_POINTS_PER_RADIUS, GLARE_POINTS_PER_RADIUS) * spacing + 0.5 * spacing
    right, up = (axis.ravel() for axis in np.meshgrid(line, line))
    inside = np.hypot(right, up) < 1.0  # what of them lies beside the disc is dark: the limb is nearest to the sky
    right, up = right[inside], up[inside]
    return PhotoModel(
        geometry=where,
        roll=real(registration.roll),
        moon=Moon(albedo_map=lunar_map(256)),
        cells=Disc(jnp.asarray(cells.right), jnp.asarray(cells.up), 1.0 / CELLS_PER_RADIUS),
        glare_points=Disc(jnp.asarray(right), jnp.asarray(up), spacing),
        wings=jnp.asarray(wings_at(cells.right, cells.up, right, up)),
        on_disc=jnp.asarray(cells.on_disc, dtype=float),
        primaries=jnp.asarray(photo.primaries),
        gain=real(0.0),
        exposure_width=real(FREE_EXPOSURE),
        balance=jnp.zeros(2),
        tint_width=real(TINT),
        floor=real(floor),
        colours=jnp.asarray(ASSUMED_MATRIX),
        mirror=registration.mirror,
        tone_curve=photo.tone_curve,
        clock_width=clock_width,
        gain_width=gain_width,
    )


def profile_model(profile, where: Geometry, floor: float) -> ProfileModel:
    """The model of a measured profile."""
    return ProfileModel(
        offset=jnp.asarray(profile.offset),
        distance=jnp.linalg.norm(where.moon) - 0.6 * MOON_RADIUS,
        albedo=jnp.asarray(profile.surface),
        primaries=jnp.eye(3),
        gain=real(0.0),
        exposure_width=real(FREE_EXPOSURE),
        balance=jnp.zeros(2),
        tint_width=real(TINT),
        floor=real(floor),
        colours=jnp.asarray(ASSUMED_MATRIX),
        tone_curve=profile.tone_curve,
    )


def wings_at(right, up, point_right, point_up) -> np.ndarray:
    """Share of the light of each glare point that falls on each cell (cell, point), positions in radii."""
    apart = (right[:, None] - point_right) ** 2 + (up[:, None] - point_up) ** 2
    density = (1.0 + apart / GLARE_SCALE**2) ** -1.5 / (2 * np.pi * GLARE_SCALE**2)
    return density / GLARE_POINTS_PER_RADIUS**2


@eqx.filter_jit
def seen(model, z: Float[Array, " parameter"]):
    """What of the Moon one photograph or profile shows, compiled by itself."""
    return model.seen(z)


@eqx.filter_jit
def seen_and_slopes(model, z: Float[Array, " parameter"]):
    """The same, and its derivatives by the nuisances that change it (`of_the_view`), along a first axis."""
    shown, along = jax.linearize(model.seen, z)
    return shown, jax.vmap(along)(jnp.eye(z.size)[of_the_view(model)])


def of_the_view(model) -> np.ndarray:
    """Which of a model's nuisances are in `prior.OF_THE_VIEW`."""
    return np.flatnonzero([parameter.name in prior.OF_THE_VIEW for parameter in model.parameters])


@eqx.filter_jit
def signal(model, table: ShadowTable, z: Float[Array, " parameter"]) -> Float[Array, "cell 3"]:
    """Decoded pixel values of one photograph's cells [full scale], compiled by itself."""
    return model.signal(table, model.seen(z), z)
