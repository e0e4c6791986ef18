"""The table of a flattened Earth's shadow: that of a round Earth, and how the light swings about it with the angle.

To first order in the flattening, 1/298, the light changes with the angle about the axis as the cosine of twice that
angle does, and its mean is that of a round Earth (`LimbShape.rounded`): to 4e-4 (tests/test_flattened_table.py). Most
of the swing is the outline's own, by which offsets are scaled before they are looked up (`scene.rounded_offset`). What
is left, up to 1.4 % in the blue within 20' of the axis, where rays from all around the limb cross and the point to
which a round Earth's would converge is drawn out into an astroid, is worked out from sectors at few offsets. That
leaves 1e-3 of the light, and 3e-3 within 0.2' of the ring, as far from the axis as the Sun is wide, where the Sun's
edge stands at that point.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.limb_sectors import irradiance_by_sectors
from eclipsejax.shadow import quadrature_for
from eclipsejax.shadow_table import Places, ShadowTable, Tabulator

_KNOTS = 32  # offsets at which the swing is worked out
_LARGEST = 0.5  # of a swing: keeps the logs of opaque air finite


def flattened_table(tabulator: Tabulator, atmosphere) -> "FlattenedTable":
    """The table of a scene with a flattening, for an atmosphere that is the same all around."""
    assert tabulator.flattening is not None
    shape, sun, wavelength, weights = tabulator.flattening
    mean, grid = tabulator(atmosphere), tabulator.grid
    distance = jnp.mean(grid.distances)
    knot = jnp.asarray(np.linspace(1.0, grid.count - 2.0, _KNOTS))
    angle = jnp.asarray([0.0, 0.5 * jnp.pi])
    stretch = shape.umbra_stretch(angle, distance, grid.sun_distance)
    light = irradiance_by_sectors(
        atmosphere,
        shape,
        sun,
        (stretch[:, None] * grid.offsets_at(distance, knot)).reshape(-1),
        jnp.repeat(angle, _KNOTS),
        wavelength,
        jnp.full(2 * _KNOTS, distance),
        grid.sun_distance,
        quadrature_for(1e-2),  # its error is nearly the same at either angle
    )
    north, east = (light @ weights).reshape(2, _KNOTS, -1)
    # Light that the limb scatters is in the mean, and does not swing.
    whole = mean.at(Places(knot, jnp.full(_KNOTS, 0.5)))
    return FlattenedTable(mean, jnp.arctanh(jnp.clip(0.5 * (north - east) / whole, -_LARGEST, _LARGEST)))


class FlattenedTable(eqx.Module):
    """Light in a flattened Earth's shadow in some channels."""

    mean: ShadowTable
    swing: Float[Array, "knot channel"]
    """Log of the light northwards over the mean."""

    def at(self, places: Places) -> Float[Array, "... channel"]:
        """Channel values at places that are known, with their position angle."""
        assert places.angle is not None
        fine = jnp.clip((places.position - 1.0) / (self.mean.grid.count - 3.0), 0.0, 1.0) * (_KNOTS - 1)
        left = jnp.minimum(jnp.floor(fine).astype(int), _KNOTS - 2)
        part = (fine - left)[..., None]
        swing = self.swing[left] * (1.0 - part) + self.swing[left + 1] * part
        return jnp.exp(self.mean.log_at(places) + jnp.cos(2.0 * places.angle)[..., None] * swing)
