"""A limb whose air or shape changes along it, as overlapping sectors, each of a sphere of its own with its own air.

N places are equally spaced along the limb; half-way between two of them the light is half that of either's air, and
so on in proportion. Each sector then is the symmetric integral of `shadow` with arcs that are weighted by azimuth
(`arc.sector_moments`), and the weights add up to 1 everywhere: with the same air all around the symmetric shadow is
met to the accuracy of the arcs. A flattened Earth gives each sector its circle of curvature (`limb_shape`).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.arc import sector_moments
from eclipsejax.atmosphere import Atmosphere, varying
from eclipsejax.constants import ATMOSPHERE_TOP, EARTH_RADIUS
from eclipsejax.errors import InputError
from eclipsejax.limb_shape import Ground, LimbShape
from eclipsejax.limb_table import limb_table
from eclipsejax.ring import AXIS, LimbRays, Sky, ring_light
from eclipsejax.sunlight import sky_angle, whole_sun

FEWEST = 4  # sectors: a sector reaches a quarter of the way around at most
SHAPE_SECTORS = 16  # of a flattened Earth with the same air all around


def along_limb(atmospheres) -> Atmosphere:
    """One atmosphere with a leading limb axis, from atmospheres with the same parts.

    `render`, `danjon`, `photometer`, `shadow_irradiance` and `scattered_irradiance` take it; what describes a single
    ray, such as `bending_angle`, takes one of its atmospheres. Textures, films and the umbra's radius are of shadows
    that are the same all around.

    - `atmospheres`: at equally spaced angles along the limb, from north through east (see `LimbShape`); 4 or more.
    """
    atmospheres = list(atmospheres)
    structures = {jax.tree.structure(one) for one in atmospheres}
    if len(structures) > 1 or len({tuple(jnp.shape(x) for x in jax.tree.leaves(one)) for one in atmospheres}) > 1:
        raise InputError("All atmospheres along a limb must have the same parts, and soundings as many levels.")
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *atmospheres)
    limb_axes(stacked)
    return stacked


def limb_angles(count: int) -> np.ndarray:
    """Angles along the limb of `count` places [rad]."""
    return 2.0 * np.pi * np.arange(count) / count


def limb_axes(atmosphere):
    """(number of places along the limb, tree of 0 for leaves with a limb axis and None for others); (0, None) if the
    atmosphere is the same all around."""
    if not isinstance(atmosphere, Atmosphere):
        return 0, None
    varies = varying(atmosphere)
    pairs = zip(jax.tree.leaves(atmosphere), jax.tree.leaves(varies), strict=True)
    counts = {jnp.shape(leaf)[0] for leaf, own in pairs if own}
    if not counts:
        return 0, None
    if len(counts) > 1 or min(counts) < FEWEST:
        raise InputError(
            f"An atmosphere along the limb needs the same number of places, {FEWEST} or more, in all its parts, "
            f"not {sorted(counts)}."
        )
    return counts.pop(), jax.tree.map(lambda own: 0 if own else None, varies)


def is_lopsided(atmosphere, shape: LimbShape | None = None) -> bool:
    """Whether the light depends on the position angle."""
    return shape is not None or limb_axes(atmosphere)[0] > 0


class Sector(eqx.Module):
    """Where the limb of each sector is; leading axis sector."""

    angle: Float[Array, "..."]
    """Of its middle, from north through east [rad]."""
    centre: Float[Array, "... 2"]
    """Of its circle, north and east of the shadow's axis [m]."""
    ground: Ground
    """With the radius of its circle."""

    @classmethod
    def around(cls, shape: LimbShape | None, count: int) -> "Sector":
        """Equally spaced sectors of a limb; a sphere if it has no shape."""
        angle = jnp.asarray(limb_angles(count))
        if shape is None:
            same = jnp.full(count, EARTH_RADIUS)
            return cls(angle, jnp.zeros((count, 2)), Ground(same, same))
        return cls(angle, shape.centre(angle), Ground(shape.curvature_radius(angle), shape.ray_radius(angle)))

    def seen(self, offset, position_angle, distance, sun_distance):
        """(offset, position angle) of a point from the axis through this circle's centre [rad]."""
        reach = 1.0 / distance + 1.0 / sun_distance
        north = offset * jnp.cos(position_angle) - self.centre[0] * reach
        east = offset * jnp.sin(position_angle) - self.centre[1] * reach
        square = north**2 + east**2
        return jnp.sqrt(square + AXIS**2), jnp.arctan2(east, jnp.where(square > 0.0, north, 1.0))


@eqx.filter_jit
def irradiance_by_sectors(
    atmosphere, shape, sun, offset, position_angle, wavelength, distance, sun_distance, counts
) -> Float[Array, "offset wavelength"]:
    """`shadow_irradiance` of a limb that is not the same all around; the arguments are its own, of shape (offset,)."""
    places, axes = limb_axes(atmosphere)
    sectors = Sector.around(shape, places or SHAPE_SECTORS)
    darkening = jax.vmap(sun.limb_darkening_coefficients)(wavelength)
    radius = jnp.arcsin(sun.radius / sun_distance)
    trace = lambda one: limb_table(one, wavelength, counts)
    if places:
        trace = jax.vmap(trace, in_axes=(axes,))
    tables = trace(atmosphere)
    outermost = EARTH_RADIUS + ATMOSPHERE_TOP if shape is None else shape.equatorial_radius + ATMOSPHERE_TOP

    def of_sector(sector, air, table, coefficients, darkening, point):
        """Light of one sector at one wavelength."""
        offset, position_angle, distance = point
        offset, position_angle = sector.seen(offset, position_angle, distance, sun_distance)

        def arcs(psi):
            apart = sector.angle - position_angle + jnp.where(psi < 0.0, jnp.pi, 0.0)
            half_width = 2.0 * np.pi / (places or SHAPE_SECTORS)
            return sector_moments(offset, jnp.abs(psi), radius, counts.sector, apart=apart, half_width=half_width)

        rays = LimbRays(sector.ground.fitted(table), coefficients, air.limb_transmission)
        sky = Sky(offset, distance, sun_distance, radius)
        return ring_light(rays, sky, darkening, arcs, sector.ground.radius + ATMOSPHERE_TOP, counts.shadow)

    several = 0 if places else None
    by_wavelength = jax.vmap(of_sector, in_axes=(None, None, 0, 0, 0, None))
    by_sector = jax.vmap(by_wavelength, in_axes=(0, axes, several, several, None, None))

    def one(point):
        offset, position_angle, distance = point
        outside = offset - radius >= sky_angle(outermost, distance, sun_distance)
        # Far outside, integrals that do not count would have gradients that are not finite.
        offset = jnp.where(outside, 0.0, offset)
        light = jnp.sum(by_sector(sectors, atmosphere, *tables, darkening, (offset, position_angle, distance)), axis=0)
        whole = jax.vmap(lambda a: whole_sun(distance, sun_distance, radius, a, counts.shadow, offset))(darkening)
        return jnp.where(outside, 1.0, light / whole)

    return jax.lax.map(one, (offset, position_angle, distance))  # each point needs much room on the way
