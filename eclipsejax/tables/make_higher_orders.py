"""Prints the numbers of `scatterers.higher_orders`: `python -m eclipsejax.tables.make_higher_orders`, two minutes.

The limb's light on the axis, scattered once and any number of times, by sasktran2: a clear limb (standard air, ozone of
300 DU) above a ground of albedo 0.3, the Sun 57' below its horizontal, straight rays. Its spherical successive orders
are taken, with sources at five angles of the Sun. Beside them its discrete ordinates at fifteen angles, lower by up to
0.03: over a black ground, one of albedo 0.3, a white one, and with dust of an extinction of 5e-6 /m.
"""

import jax
import jax.numpy as jnp
import numpy as np
import sasktran2 as sk

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Dust, extinction
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.scatterers import rayleigh_forward
from eclipsejax.spectra import rayleigh_cross_section

DEPRESSION = np.radians(57.0 / 60.0)
WAVELENGTHS = (400.0, 440.0, 500.0, 550.0, 600.0, 700.0)
ASYMMETRY = 0.7
MOMENTS = 16
TANGENTS = np.concatenate([np.arange(0.5, 36.0, 1.5), np.arange(36.5, 70.0, 3.0)]) * 1e3  # m


def limb_light(atmosphere, wavelength, depression, *, orders=None, albedo=0.3, spacing=1e3, tangents=TANGENTS) -> float:
    """Radiance of the limb, with the irradiance of sunlight as unit, summed as G of `twilight` is [m^2/sr].

    - `orders`: None for light scattered once, else the name of a source of multiple scattering of sasktran2.
    """
    level = np.arange(0.0, 80e3 + 1.0, spacing)
    total = np.asarray(extinction(atmosphere, level[:, None], [wavelength]))
    air = float(rayleigh_cross_section(jnp.asarray(wavelength))) * jax.vmap(atmosphere.air.profile)(level)[:, None]
    dust = 0.0 * air if atmosphere.dust is None else jax.vmap(atmosphere.dust.profile)(level)[:, None]
    air, dust = np.asarray(air), np.asarray(dust)
    moments = ASYMMETRY ** np.arange(MOMENTS) * (2.0 * np.arange(MOMENTS) + 1.0)
    legendre = moments[:, None, None] * dust / (air + dust)
    legendre[0] = 1.0
    legendre[2] += (4.0 * np.pi * float(rayleigh_forward(jnp.asarray(wavelength))) - 1.0) * air / (air + dust)

    config = sk.Config()
    config.num_streams = MOMENTS
    config.num_singlescatter_moments = MOMENTS
    config.single_scatter_source = sk.SingleScatterSource.Exact
    if orders is not None:
        config.multiple_scatter_source = getattr(sk.MultipleScatterSource, orders)
        config.num_sza = 5 if orders == "SuccessiveOrders" else 15
        config.num_successive_order_points = 20
        config.num_successive_orders_incoming = config.num_successive_orders_outgoing = 38
    cosine = float(np.cos(0.5 * np.pi + depression))
    geometry = sk.Geometry1D(cosine, 0.0, EARTH_RADIUS, level)
    view = sk.ViewingGeometry()
    for tangent in tangents:
        view.add_ray(sk.TangentAltitudeSolar(float(tangent), 0.0, 3.78e8, cosine))
    medium = sk.Atmosphere(geometry, config, wavelengths_nm=np.array([wavelength]), calculate_derivatives=False)
    medium["all"] = sk.constituent.Manual(total, (air + dust) / total, legendre)
    medium["ground"] = sk.constituent.LambertianSurface(albedo)
    radiance = np.asarray(sk.Engine(config, geometry, view).calculate_radiance(medium)["radiance"]).reshape(-1)
    return float(np.trapezoid(radiance * (EARTH_RADIUS + tangents), tangents))


def main():
    jax.config.update("jax_enable_x64", True)
    straight = Air(refraction=0.0)
    clear = Atmosphere(air=straight, dust=None, haze=None, clouds=None)
    dusty = Atmosphere(air=straight, dust=Dust(extinction=5e-6), haze=None, clouds=None)
    for wavelength in WAVELENGTHS:
        once = limb_light(clear, wavelength, DEPRESSION)
        more = [limb_light(clear, wavelength, DEPRESSION, orders="SuccessiveOrders") / once - 1.0]
        for albedo in (0.0, 0.3, 1.0):
            more.append(
                limb_light(clear, wavelength, DEPRESSION, orders="DiscreteOrdinates", albedo=albedo) / once - 1.0
            )
        dust = limb_light(dusty, wavelength, DEPRESSION, orders="DiscreteOrdinates")
        more.append(dust / limb_light(dusty, wavelength, DEPRESSION) - 1.0)
        print(f"{wavelength:.0f} nm: {more[0]:.3f}; ordinates, ground black, 0.3, white, dust:", np.round(more[1:], 3))


if __name__ == "__main__":
    main()
