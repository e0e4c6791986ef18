"""The outline of the flattened Earth that the Sun's rays graze.

Seen along the axis of the shadow the ellipsoid's outline is an ellipse, with the full equatorial radius across the
pole and less along it. At the place whose normal points at the angle nu from north it is followed to the third order
by a circle, its circle of curvature, about a centre up to 43 km off the Earth's (as evolutes go). The ray bends in
the plane of that normal, above ground that is curved along the ray, which is another radius: 6378 km at the equator,
6400 km at the poles, just where the Earth's own radius is least.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.constants import EARTH_EQUATORIAL_RADIUS, EARTH_POLAR_RADIUS, EARTH_RADIUS, SUN_RADIUS
from eclipsejax.limb_table import LimbTable
from eclipsejax.traced import real


class Ground(eqx.Module):
    """What a ray grazes: curved in one way along the ray, in another along the limb."""

    radius: Float[Array, "..."]
    """Of the limb's circle [m]."""
    ray_radius: Float[Array, "..."]
    """Of the ground along the ray [m]."""

    def fitted(self, table: LimbTable) -> LimbTable:
        """Rays traced over the sphere, over this ground: the bending and the columns of air that is thin against its
        radius grow with the square root of that, here to 1e-5 of either."""
        stretch = self.ray_radius / EARTH_RADIUS
        lift = (table.lift * stretch).at[..., 0].add(self.radius - EARTH_RADIUS)
        root = jnp.sqrt(stretch)
        return eqx.tree_at(lambda t: (t.lift, t.bending, t.columns), table,
                           (lift, table.bending * root, table.columns * root))  # fmt: skip


class LimbShape(eqx.Module):
    """An ellipsoid of revolution, grazed by the rays of a distant Sun.

    Angles along the limb are those of its normal, from the Earth's north pole through east, in the sense of
    position angles about the shadow's axis: the Sun rises along the east limb, 90 degrees, and sets along the west.

    - `declination`: of the Sun [rad].
    - `equatorial_radius`, `polar_radius`: [m]; WGS 84 by default.
    """

    declination: Float[Array, ""] = eqx.field(converter=real, default=0.0)
    equatorial_radius: Float[Array, ""] = eqx.field(converter=real, default=EARTH_EQUATORIAL_RADIUS)
    polar_radius: Float[Array, ""] = eqx.field(converter=real, default=EARTH_POLAR_RADIUS)

    @classmethod
    def facing(cls, sun: Float[Array, "3"], pole: Float[Array, "3"]) -> "LimbShape":
        """That of the Earth with the Sun and the pole in these directions."""
        return cls(jnp.arcsin(pole @ sun / (jnp.linalg.norm(sun) * jnp.linalg.norm(pole))))

    def latitude(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Geodetic latitude of the limb [rad]."""
        return jnp.arcsin(jnp.cos(angle) * jnp.cos(self.declination))

    def radius(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Distance of the limb's tangent from the shadow's axis [m]: that of a point of the limb to 1e-5."""
        return jnp.sqrt((self._minor * jnp.cos(angle)) ** 2 + (self.equatorial_radius * jnp.sin(angle)) ** 2)

    def centre(self, angle: Float[Array, "..."]) -> Float[Array, "... 2"]:
        """Centre of curvature of the outline, north and east of the shadow's axis [m]."""
        height, bend = self.radius(angle), self.curvature_radius(angle)
        north = (self._minor**2 / height - bend) * jnp.cos(angle)
        return jnp.stack([north, (self.equatorial_radius**2 / height - bend) * jnp.sin(angle)], axis=-1)

    def curvature_radius(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Radius of curvature of the outline [m]."""
        return (self._minor * self.equatorial_radius) ** 2 / self.radius(angle) ** 3

    def ray_radius(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Radius of curvature of the ground along the ray [m]: of the normal section of the ellipsoid."""
        cosine, sine = jnp.cos(self.declination), jnp.sin(self.declination)
        return 1.0 / (self.radius(angle) * ((cosine / self.equatorial_radius) ** 2 + (sine / self.polar_radius) ** 2))

    def rounded(self) -> Ground:
        """The ground of a round Earth whose shadow is this one's mean over the angles about the axis.

        What is left goes with the cosine of twice the angle: to first order in the flattening, the light too.
        """
        ends = jnp.asarray([0.0, 0.5 * jnp.pi])
        return Ground(jnp.mean(self.radius(ends)), jnp.mean(self.ray_radius(ends)))

    def umbra_stretch(self, angle: Float[Array, "..."], distance, sun_distance) -> Float[Array, "..."]:
        """Angle from the axis of the umbra's edge, by the angle about the axis, over its mean [-].

        - `distance`, `sun_distance`: of the point and of the Sun from the Earth's centre [m].
        """
        reach = 1.0 / distance + 1.0 / sun_distance
        return (self.radius(angle) * reach - SUN_RADIUS / sun_distance) / (
            self.rounded().radius * reach - SUN_RADIUS / sun_distance
        )

    @property
    def _minor(self):
        """Half of the outline along its axis [m]."""
        cosine, sine = jnp.cos(self.declination), jnp.sin(self.declination)
        return jnp.sqrt((self.polar_radius * cosine) ** 2 + (self.equatorial_radius * sine) ** 2)
