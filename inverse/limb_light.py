"""The shadow's light in the camera's channels, as a function of the limb."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.ephemeris import Geometry
from eclipsejax.moon import Moon
from eclipsejax.render import disc_offsets
from eclipsejax.shadow_table import ShadowTable, Tabulator, tabulator
from eclipsejax.sun import Sun
from eclipsejax.sunlight import umbra_edge
from eclipsejax.traced import slopes
from eclipsejax.wavelengths import channel_weights
from inverse import prior
from inverse.camera_colours import ASSUMED
from inverse.scattered_light import log_scattered
from inverse.uneven_limb import washing

OFFSETS, EDGE_OFFSETS = 28, 72  # in the table of the shadow: in totality, and where the umbra's edge is on the Moon
TOLERANCE = 1e-2  # of the shadow's light
WAVELENGTHS = 8
BENDING = ("air.surface_temperature", "air.surface_pressure")  # what bends rays; all else dims them


class Shadow(eqx.Module):
    """The table of the shadow as a function of the parameters z of the limb."""

    tabulator: Tabulator
    moon_distance: Float[Array, ""]
    """From the Earth's centre [m]."""
    washing: Float[Array, "offset offset"]
    """Smooths the log of the direct light over the table's entries, see `uneven_limb`."""
    response: str = eqx.field(static=True, default=ASSUMED)
    """Whose channels they are, as of `eclipsejax.response.responses`."""

    def __call__(self, limb: Float[Array, " parameter"]) -> ShadowTable:
        return self.table(log_light(limb, self))

    def table(self, log_light: Float[Array, "offset 1 channel"]) -> ShadowTable:
        """The table with these entries."""
        return ShadowTable(self.tabulator.grid, log_light)


def log_light(limb: Float[Array, " parameter"], shadow: Shadow) -> Float[Array, "offset 1 channel"]:
    """Log of the light in the camera's channels at the table's entries, for parameters z of the limb."""
    value = prior.values(prior.ATMOSPHERE, limb)
    scattered = log_scattered(value, shadow.moon_distance) + jnp.log(value["scattered.amplitude"])
    direct = jnp.tensordot(shadow.washing, shadow.tabulator(prior.atmosphere(limb)).log_light, axes=1)
    return jnp.logaddexp(direct, scattered)


def shadow_light(shadow: Shadow, limb: Float[Array, " parameter"]) -> ShadowTable:
    """The table of the shadow, by the program that gives the slopes too: one of its own takes longer to compile."""
    return shadow.table(shadow_slopes(shadow, limb)[0])


@eqx.filter_jit
def shadow_slopes(shadow: Shadow, limb: Float[Array, " parameter"]):
    """Entries of the table (offset, 1, channel) and their derivatives (parameter, offset, 1, channel)."""
    straight = [number for number, one in enumerate(prior.ATMOSPHERE) if one.name not in BENDING]
    return slopes(lambda limb: log_light(limb, shadow), list(limb), straight)


def camera_weights(sun: Sun, moon: Moon, response: str = ASSUMED):
    """Wavelengths [nm] and weights (wavelength, 3) of a camera's channels, balanced to the uneclipsed Moon."""
    wavelength, weights = channel_weights(sun, moon, response, WAVELENGTHS)
    return wavelength, weights / weights.sum(axis=0)


def shadow_of(geometries: list[Geometry], clock_reach: float = 400.0, response: str = ASSUMED) -> Shadow:
    """The shadow over the discs of all photographs of one eclipse.

    - `clock_reach`: the discs are followed this long before and after their times [s].
    - `response`: of the camera. The scattered light stays that of the Nikon D5100, which is that of other cameras with
      filters before one layer of pixels to 3 %, of one's red to 12 %; in three layers, 4 to 22 %.
    """
    sun, moon = Sun(), Moon()
    wavelength, weights = camera_weights(sun, moon, response)
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
    smooth = washing(np.asarray(prepared.grid.from_axis(moon_distance)))
    return Shadow(prepared, moon_distance, jnp.asarray(smooth), response)
