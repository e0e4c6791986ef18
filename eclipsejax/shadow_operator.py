"""The shadow as a fixed operator: what depends on the Sun and the offsets alone is worked out once.

For points at one distance the irradiance is a product of two small matrices: flux of the grazing rays on cells of
sky angle (`sky_flux`), which changes with the air, and the Sun's arcs on them (`sky_cells`), which does not. It
serves where one scene is computed for many atmospheres, or one atmosphere for many points: pictures and fits.
`shadow.shadow_irradiance` is slower by a hundred, and serves everything else.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.arc import arc_moments
from eclipsejax.constants import ATMOSPHERE_TOP, EARTH_RADIUS
from eclipsejax.limb_shape import Ground
from eclipsejax.limb_table import LimbTable, limb_table, ray_breaks
from eclipsejax.sky_cells import SkyCells
from eclipsejax.sky_flux import branches, cell_flux
from eclipsejax.sun import Sun
from eclipsejax.sunlight import light_above, whole_sun
from eclipsejax.tolerance import reached
from eclipsejax.traced import real

_DIRECT_ORDER = 20
_ARC_ORDER = 8


class Counts(NamedTuple):
    """Node counts that together meet a tolerance."""

    ray: int  # Gauss-Legendre nodes a panel along a ray
    table: int  # Chebyshev nodes a panel of tangent heights
    dispersion: int  # refractivities at which rays are traced, for all wavelengths
    cells: int  # edges of cells of sky angle, besides those where the Sun is touched
    piece: int  # nodes on the rays of a cell
    arc: int  # nodes on an arc of the Sun
    fit: int  # angles of a cell at which arcs are fitted


# Measured against `shadow_irradiance` (tests/test_shadow_operator.py): offsets of totality and partiality, 390-770 nm,
# light down to 1e-12, 250-310 K, dust from none to an extinction of 3e-5 /m: largest errors 9e-3, 7e-4, 6e-5 and 2e-6.
COUNTS = {
    1e-2: Counts(ray=5, table=8, dispersion=2, cells=80, piece=3, arc=4, fit=7),
    1e-3: Counts(ray=6, table=10, dispersion=2, cells=96, piece=4, arc=4, fit=7),
    1e-4: Counts(ray=8, table=13, dispersion=3, cells=160, piece=5, arc=6, fit=8),
    1e-5: Counts(ray=12, table=18, dispersion=4, cells=512, piece=6, arc=8, fit=10),
}


class View(eqx.Module):
    """What the points at one distance see, but for the air."""

    distance: Float[Array, ""]
    """From the Earth's centre [m]."""
    cells: SkyCells
    arcs: Float[Array, "cell function power offset"]
    direct: Float[Array, "offset wavelength"]
    """Light that passes above the air [-]."""
    whole: Float[Array, "offset wavelength"]
    """Light of the whole Sun [sr]."""


class ShadowOperator(eqx.Module):
    """Maps an atmosphere to irradiance at fixed distances, offsets and wavelengths."""

    wavelength: Float[Array, " wavelength"]
    """[nm]"""
    darkening: Float[Array, "wavelength power"]
    """A_k of the Sun's I(mu)/I(1) = sum A_k mu^k."""
    sun_distance: Float[Array, ""]
    """[m]"""
    views: View
    """One for each distance (leading axis)."""
    counts: Counts = eqx.field(static=True)
    ground: Ground | None = None
    """What the rays graze; None is the sphere of `EARTH_RADIUS`."""

    def __call__(self, atmosphere) -> Float[Array, "distance offset wavelength"]:
        """Fraction of unobstructed sunlight, as by `shadow.shadow_irradiance`."""
        return self.light(atmosphere, self.rays(atmosphere))

    def rays(self, atmosphere) -> tuple[LimbTable, Float[Array, "wavelength constituent"]]:
        """The grazing rays of an atmosphere, as by `limb_table`: the first half of the work."""
        table, coefficients = limb_table(atmosphere, self.wavelength, self.counts, breaks=ray_breaks(atmosphere))
        return (table if self.ground is None else self.ground.fitted(table)), coefficients

    def light(self, atmosphere, rays) -> Float[Array, "distance offset wavelength"]:
        """What its rays bring: the second half."""
        table, coefficients = rays

        def seen(view: View):
            seen_rays = branches(table, coefficients, view.distance, self.sun_distance)
            of_one = lambda one: jnp.sum(cell_flux(one, atmosphere.limb_transmission, view.cells, self.counts.piece), 0)
            flux = jax.vmap(of_one)(seen_rays)
            wavelengths, *rows = flux.shape
            light = flux.reshape(wavelengths, -1) @ view.arcs.reshape(rows[0] * rows[1], -1)
            light = light.reshape(wavelengths, *view.arcs.shape[2:])
            return jnp.einsum("wmo,wm->ow", light, self.darkening) / view.whole + view.direct

        return jax.vmap(seen)(self.views)


def shadow_operator(
    sun: Sun, offset, distance, sun_distance, wavelength, *, tolerance: float = 1e-3, ground: Ground | None = None
) -> ShadowOperator:
    """Work out the operator; no atmosphere is needed.

    - `distance`: of the points from the Earth's centre, shape (distance,) [m].
    - `offset`: their angles from the axis of the shadow, shape (distance, offset) [rad].
    - `sun_distance`: of the Sun from the Earth's centre [m].
    - `wavelength`: (wavelength,) [nm].
    - `tolerance`: largest relative error wanted, in light down to 1e-12; a setting of `COUNTS` that meets it is taken.
    - `ground`: what the rays graze; None is the sphere of `EARTH_RADIUS`.
    """
    counts = counts_for(tolerance)
    radius = jnp.arcsin(sun.radius / sun_distance)
    darkening = jax.vmap(sun.limb_darkening_coefficients)(wavelength)  # (wavelength, 6)
    top = jnp.asarray((EARTH_RADIUS if ground is None else ground.radius) + ATMOSPHERE_TOP)

    def view(offset, distance):
        cells = SkyCells.around(offset, radius, counts.cells)
        # One after the other: each needs much room on the way.
        arcs = jax.lax.map(lambda one: cells.arcs(one, radius, counts.arc, counts.fit), offset)

        def direct_and_whole(offset, darkening):
            arcs = lambda circle: arc_moments(offset, circle, radius, _ARC_ORDER)
            direct = light_above(top, offset, distance, sun_distance, radius, darkening, order=_DIRECT_ORDER, arcs=arcs)
            return direct, whole_sun(distance, sun_distance, radius, darkening, _DIRECT_ORDER, offset)

        each = jax.vmap(jax.vmap(direct_and_whole, in_axes=(None, 0)), in_axes=(0, None))
        direct, whole = each(offset, darkening)
        return View(distance, cells, jnp.moveaxis(arcs, 0, -1), direct / whole, whole)

    views = jax.vmap(view)(real(offset), real(distance))
    return ShadowOperator(wavelength, darkening, real(sun_distance), views, counts, ground)


def counts_for(tolerance: float) -> Counts:
    """The cheapest node counts that meet a relative tolerance."""
    return COUNTS[reached(COUNTS, tolerance)]
