"""What the cells of a photograph should hold, and how badly they miss it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.camera import Camera, Exposure, ToneCurve, tone_curve
from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import Geometry
from eclipsejax.moon import Moon, lunar_map
from eclipsejax.render import disc_offsets, surface_reflectance
from eclipsejax.response import responses
from eclipsejax.scene import axis_offset, disc_points
from eclipsejax.shadow_table import ShadowTable, Tabulator, tabulator
from eclipsejax.sun import Sun
from eclipsejax.sunlight import umbra_edge
from inverse import prior
from inverse.cells import Cells
from inverse.noise import Whitener

OFFSETS, EDGE_OFFSETS = 28, 72  # in the table of the shadow: in totality, and where the umbra's edge is on the Moon
TOLERANCE = 1e-2  # of the shadow's light
BINS = np.array([380.0, 440.0, 480.0, 520.0, 560.0, 600.0, 640.0, 680.0, 780.0])  # nm
# Nikon D5100 (NPL) to linear sRGB, rows sum to 1: least squares over the ISO 17321-1 chart in daylight, rms 0.010.
# A stand-in for the matrix of whatever camera it was; `tone.saturation` says how much of it was applied.
COLOUR_MATRIX = np.array([[1.7398, -0.6525, -0.0873], [-0.1553, 1.6422, -0.4869], [0.0592, -0.5461, 1.4870]])
GLARE_SCALE = 0.15  # of the disc's radius: core of the wings (1 + r^2/a^2)^-1.5
GLARE_POINTS_PER_RADIUS = 8


class Disc(eqx.Module):
    """Points of a photograph that look at the Moon, in radii from the registered centre, before any correction."""

    right: Float[Array, " point"]
    up: Float[Array, " point"]

    def points(self, geometry: Geometry, roll, mirror: bool, nuisance):
        """The lunar surface behind them, with the corrections of `nuisance` to pointing and clock."""
        later = geometry.after(nuisance["clock"])
        scale = MOON_RADIUS / jnp.linalg.norm(later.moon - later.observer)  # tangent of the radius to 1e-5
        roll = roll + nuisance["pointing.roll"]
        right, up = self.right - nuisance["pointing.right"], self.up - nuisance["pointing.up"]
        left = right if mirror else -right
        sine, cosine = jnp.sin(roll), jnp.cos(roll)
        east, north = scale * (up * sine + left * cosine), scale * (up * cosine - left * sine)
        return later, disc_points(later, east, north)


class PhotoModel(eqx.Module):
    """Everything that turns the table of the shadow and the nuisances into the cells of one photograph."""

    geometry: Geometry
    roll: Float[Array, ""]
    moon: Moon
    cells: Disc
    glare_points: Disc
    wings: Float[Array, "cell point"]
    on_disc: Float[Array, " cell"]
    primaries: Float[Array, "3 3"]
    gain: Float[Array, ""]
    floor: Float[Array, ""]
    mirror: bool = eqx.field(static=True)
    tone_curve: str = eqx.field(static=True)

    @property
    def parameters(self) -> tuple[prior.Parameter, ...]:
        """The nuisances of this photograph."""
        return prior.photograph_parameters(self.tone_curve)

    def surface_light(self, table: ShadowTable, disc: Disc, nuisance) -> Float[Array, "point 3"]:
        """Light of the surface in the camera's channels, the uneclipsed disc 1."""
        geometry, points = disc.points(self.geometry, self.roll, self.mirror, nuisance)
        distance = jnp.linalg.norm(points.position, axis=-1)
        light = table(axis_offset(geometry, points.position), distance)
        return light * self.surface(points, nuisance)[:, None]

    def surface(self, points, nuisance) -> Float[Array, " point"]:
        """Brightness of the surface in full sunlight, mean of the disc 1."""
        moon = eqx.tree_at(lambda moon: moon.contrast, self.moon, nuisance["albedo.contrast"])
        return surface_reflectance(moon, points)

    def signal(self, table: ShadowTable, z: Float[Array, " parameter"]) -> Float[Array, "cell 3"]:
        """Decoded pixel values of the cells [full scale]."""
        nuisance = prior.values(self.parameters, z)
        light = self.surface_light(table, self.cells, nuisance) * self.on_disc[:, None]
        around = self.surface_light(table, self.glare_points, nuisance)
        light = (1.0 - nuisance["camera.glare"]) * light + nuisance["camera.glare"] * (self.wings @ around)
        typical = jnp.exp(jnp.mean(jnp.log(jnp.mean(around, axis=1) + 1e-12)))
        light = light + nuisance["camera.veil"] * typical
        return developed(light, nuisance, self.gain, self.primaries, self.tone_curve)

    def __call__(self, table: ShadowTable, z: Float[Array, " parameter"]) -> Float[Array, "cell 3"]:
        """Log of the cells' values above the floor: what the likelihood compares."""
        return jnp.log(self.signal(table, z) + self.floor)


def developed(light, nuisance, gain, primaries, encoding: str):
    """Light in the camera's channels after exposure, white balance, colour matrix and picture style."""
    balance = jnp.stack(
        [nuisance["white_balance.red"], jnp.zeros_like(nuisance["gain"]), nuisance["white_balance.blue"]]
    )
    exposed = light * jnp.exp(gain + nuisance["gain"] + balance)
    if encoding == "linear":
        return exposed
    identity = jnp.eye(3)
    matrix = identity + nuisance["tone.saturation"] * (jnp.asarray(COLOUR_MATRIX) - identity)
    mixed = exposed @ (primaries @ matrix).T
    # Deep red turns green and blue negative; cameras clip there, we round the corner a little above zero.
    corner = 0.02 * jnp.mean(exposed, axis=-1, keepdims=True)
    positive = 0.5 * (mixed + jnp.sqrt(mixed**2 + corner**2))
    style = ToneCurve(exponent=nuisance["tone.exponent"], toe=nuisance["tone.toe"], shoulder=nuisance["tone.shoulder"])
    return tone_curve(positive, Camera(exposure=Exposure(), tone=style))


class Shadow(eqx.Module):
    """The table of the shadow as a function of the parameters z of the limb."""

    tabulator: Tabulator

    def __call__(self, limb: Float[Array, " parameter"]) -> ShadowTable:
        return ShadowTable(self.tabulator.grid, log_light(limb, self.tabulator))


@eqx.filter_custom_jvp
def log_light(limb, tabulator: Tabulator) -> Float[Array, "offset 2 channel"]:
    """Log of the light in the camera's channels at the table's entries, for parameters z of the limb."""
    return tabulator(prior.atmosphere(limb)).log_light


@log_light.def_jvp
def _log_light_jvp(primals, tangents):
    """All derivatives by the few parameters of the limb at once, so that the Jacobian by many nuisances, whose
    tangents are zero here, costs no more; and one after the other: side by side they leave the processor's cache."""
    (limb, tabulator), (limb_dot, _) = primals, tangents
    light, along = jax.linearize(lambda limb: tabulator(prior.atmosphere(limb)).log_light, limb)
    slopes = jax.lax.map(along, jnp.eye(limb.size))
    return light, jnp.tensordot(limb_dot, slopes, axes=1)


def camera_weights(sun: Sun, moon: Moon):
    """Wavelengths [nm] and weights (wavelength, 3) of the camera's channels, balanced to the uneclipsed Moon."""
    fine = np.arange(380.5, 780.0)
    light = np.asarray(sun.irradiance(jnp.asarray(fine)) * moon.spectrum(jnp.asarray(fine)))
    spectral = light[:, None] * responses("nikon_5100", fine)
    member = (np.digitize(fine, BINS) - 1)[None, :] == np.arange(BINS.size - 1)[:, None]
    weights = member @ spectral
    wavelength = (member @ (spectral.sum(axis=1) * fine)) / weights.sum(axis=1)
    return jnp.asarray(wavelength), jnp.asarray(weights / weights.sum(axis=0))


def shadow_of(geometries: list[Geometry], clock_reach: float = 400.0) -> Shadow:
    """The shadow over the discs of all photographs of one eclipse.

    - `clock_reach`: the discs are followed this long before and after their times [s].
    """
    sun, moon = Sun(), Moon()
    wavelength, weights = camera_weights(sun, moon)
    ends_at = eqx.filter_jit(lambda where, dt: disc_offsets(where.after(dt)))
    ends = np.array(
        [ends_at(where, jnp.asarray(dt)) for where in geometries for dt in (-clock_reach, 0.0, clock_reach)]
    )
    moon_distance = jnp.mean(jnp.stack([jnp.linalg.norm(where.moon) for where in geometries]))
    sun_distance = jnp.linalg.norm(geometries[0].sun)
    edge = float(umbra_edge(moon_distance, sun_distance, sun.radius))
    count = OFFSETS if ends.max() < edge else EDGE_OFFSETS
    prepared = eqx.filter_jit(tabulator)(
        sun, moon_distance, sun_distance, jnp.asarray([ends.min(), ends.max()]), wavelength, weights,
        tolerance=TOLERANCE, count=count, deep=False,
    )  # fmt: skip
    return Shadow(prepared)


def photo_model(photo, registration, where: Geometry, cells: Cells, floor: float) -> PhotoModel:
    """Put a registered photograph's model together."""
    spacing = 1.0 / GLARE_POINTS_PER_RADIUS
    line = np.arange(-GLARE_POINTS_PER_RADIUS, GLARE_POINTS_PER_RADIUS) * spacing + 0.5 * spacing
    right, up = (axis.ravel() for axis in np.meshgrid(line, line))
    inside = np.hypot(right, up) < 0.97
    right, up = right[inside], up[inside]
    return PhotoModel(
        geometry=where,
        roll=jnp.asarray(registration.roll),
        moon=Moon(albedo_map=lunar_map(256)),
        cells=Disc(jnp.asarray(cells.right), jnp.asarray(cells.up)),
        glare_points=Disc(jnp.asarray(right), jnp.asarray(up)),
        wings=jnp.asarray(wings_at(cells.right, cells.up, right, up)),
        on_disc=jnp.asarray(cells.on_disc, dtype=float),
        primaries=jnp.asarray(getattr(photo, "primaries", np.eye(3))),
        gain=jnp.asarray(0.0),
        floor=jnp.asarray(floor),
        mirror=registration.mirror,
        tone_curve=photo.tone_curve,
    )


def wings_at(right, up, point_right, point_up) -> np.ndarray:
    """Share of the light of each glare point that falls on each cell (cell, point), positions in radii."""
    apart = (right[:, None] - point_right) ** 2 + (up[:, None] - point_up) ** 2
    density = (1.0 + apart / GLARE_SCALE**2) ** -1.5 / (2 * np.pi * GLARE_SCALE**2)
    return density / GLARE_POINTS_PER_RADIUS**2


class Likelihood(eqx.Module):
    """Cells of one or more photographs of one eclipse, under one limb."""

    shadow: Shadow
    models: tuple
    data: tuple
    """Log values above the floor (cell x 3,)."""
    usable: tuple
    """1 where they count, 0 where not (cell x 3,)."""
    whiteners: tuple[Whitener, ...]

    def split(self, z):
        """Parameters of the atmosphere and of each photograph."""
        sizes = np.cumsum([len(prior.ATMOSPHERE)] + [len(model.parameters) for model in self.models])
        return jnp.split(z, sizes[:-1])

    @property
    def parameters(self) -> tuple[prior.Parameter, ...]:
        """All free quantities, in the order of the vector z."""
        return prior.ATMOSPHERE + tuple(p for model in self.models for p in model.parameters)

    def misfits(self, z: Float[Array, " parameter"]) -> list[Float[Array, " datum"]]:
        """Data minus model of each photograph, in log value."""
        limb, *nuisances = self.split(z)
        table = self.shadow(limb)
        return [
            usable * (data - model(table, nuisance).ravel())
            for model, nuisance, data, usable in zip(self.models, nuisances, self.data, self.usable, strict=True)
        ]

    def residuals(self, z: Float[Array, " parameter"]) -> Float[Array, " residual"]:
        """Whitened misfits, then z itself, the prior: half their sum of squares is minus the log posterior."""
        return jnp.concatenate([*(w(r) for w, r in zip(self.whiteners, self.misfits(z), strict=True)), z])

    def with_gains(self) -> "Likelihood":
        """The same with each photograph's gain centred: medians of model and data agree at the prior's centre."""
        table = shadow_light(self.shadow, jnp.zeros(len(prior.ATMOSPHERE)))
        models = []
        for model, data, usable in zip(self.models, self.data, self.usable, strict=True):
            for _ in range(6):  # the tone curve makes it a little more than one step
                misfit = data - jnp.log(signal(model, table, jnp.zeros(len(model.parameters))) + model.floor).ravel()
                gain = model.gain + np.median(np.asarray(misfit)[np.asarray(usable) > 0])
                model = eqx.tree_at(lambda model: model.gain, model, gain)
            models.append(model)
        return eqx.tree_at(lambda self: self.models, self, tuple(models))

    def inflated(self, factor: float) -> "Likelihood":
        """The same with all errors larger by a factor."""
        sigma = lambda self: [whitener.sigma for whitener in self.whiteners]
        return eqx.tree_at(sigma, self, [factor * old for old in sigma(self)])


class ProfileModel(eqx.Module):
    """As `PhotoModel`, for a profile of brightness against offset: no pointing, no pixels."""

    offset: Float[Array, " bin"]
    distance: Float[Array, ""]
    albedo: Float[Array, " bin"]
    gain: Float[Array, ""]
    floor: Float[Array, ""]
    tone_curve: str = eqx.field(static=True)

    @property
    def parameters(self) -> tuple[prior.Parameter, ...]:
        """The nuisances of this profile."""
        return prior.profile_parameters(self.tone_curve)

    def signal(self, table: ShadowTable, z: Float[Array, " parameter"]) -> Float[Array, "bin 3"]:
        """Decoded pixel values [full scale]."""
        nuisance = prior.values(self.parameters, z)
        offset = jnp.abs(self.offset + nuisance["pointing.offset"])
        light = table(offset, jnp.full(offset.shape, self.distance)) * self.albedo[:, None]
        typical = jnp.exp(jnp.mean(jnp.log(jnp.mean(light, axis=1) + 1e-12)))
        light = light + nuisance["camera.veil"] * typical
        return developed(light, nuisance, self.gain, jnp.eye(3), self.tone_curve)

    def __call__(self, table: ShadowTable, z: Float[Array, " parameter"]) -> Float[Array, "bin 3"]:
        """Log of the values above the floor."""
        return jnp.log(self.signal(table, z) + self.floor)


def profile_model(profile, where: Geometry, floor: float) -> ProfileModel:
    """The model of a measured profile."""
    return ProfileModel(
        offset=jnp.asarray(profile.offset),
        distance=jnp.linalg.norm(where.moon) - 0.6 * MOON_RADIUS,
        albedo=jnp.asarray(profile.surface),
        gain=jnp.asarray(0.0),
        floor=jnp.asarray(floor),
        tone_curve=profile.tone_curve,
    )


@eqx.filter_jit
def shadow_light(shadow: Shadow, limb: Float[Array, " parameter"]) -> ShadowTable:
    """The table of the shadow, compiled by itself."""
    return shadow(limb)


@eqx.filter_jit
def signal(model, table: ShadowTable, z: Float[Array, " parameter"]) -> Float[Array, "cell 3"]:
    """Decoded pixel values of one photograph's cells [full scale], compiled by itself."""
    return model.signal(table, z)
