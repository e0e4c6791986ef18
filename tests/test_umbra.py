"""The size and the colour of the edge of the umbra."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.moon import Moon
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.sun import Sun
from eclipsejax.sunlight import umbra_edge
from eclipsejax.umbra import umbra_enlargement, umbra_radius
from eclipsejax.wavelengths import binned_weights

DISTANCES = {"moon_distance": 3.825e8, "sun_distance": 1.479e11}  # 2008-02-21, surface of the Moon


def limb(ozone=300.0, dust=0.0, refraction=1.0):
    return Atmosphere(Air(refraction=refraction), Ozone(ozone), Dust(dust), Haze(), Clouds())


def test_umbra_is_about_as_large_as_crater_timings_have_it():
    # 87 +- 3 km on 2008-02-21; clear air gives 80, the typical limb 75.
    assert 1e-3 * umbra_enlargement(limb(), **DISTANCES) == pytest.approx(87.0, abs=10.0)
    assert 1e-3 * umbra_enlargement(Atmosphere.typical(), **DISTANCES) == pytest.approx(87.0, abs=15.0)


def test_edge_is_where_another_integral_is_steepest():
    radius = float(umbra_radius(limb(), **DISTANCES))
    wavelength, weights = binned_weights(Sun(), Moon(), "xyz", 20)
    step = 1e3 / 3.825e8  # 1 km on the Moon
    offset = radius + step * np.array([-12.0, -8.0, -2.0, 2.0, 8.0, 12.0])
    luminance = np.asarray(shadow_irradiance(limb(), offset, wavelength, tolerance=1e-4, **DISTANCES) @ weights[:, 1])
    inner, middle, outer = np.diff(np.log(luminance))[[0, 2, 4]]
    assert middle > inner and middle > outer


def test_larger_earth_of_the_enlargement_casts_that_umbra():
    enlargement, radius = umbra_enlargement(limb(), **DISTANCES), umbra_radius(limb(), **DISTANCES)
    moon, sun = DISTANCES.values()
    larger = EARTH_RADIUS + enlargement
    edge = jnp.arcsin(larger / moon) + jnp.arcsin(larger / sun) - jnp.arcsin(Sun().radius / sun)
    assert float(edge) == pytest.approx(float(radius), abs=1e-9)
    assert float(umbra_edge(moon, sun, Sun().radius)) < float(radius)


def test_without_air_or_under_thick_dust_there_is_no_such_edge():
    airless = Atmosphere(Air(refraction=0.0, scattering=0.0), Ozone(0.0), Dust(0.0), Haze(), Clouds())
    assert np.isnan(umbra_radius(airless, **DISTANCES))


def test_absorbing_air_moves_the_edge_smoothly():
    slope = jax.grad(lambda column: umbra_enlargement(limb(column), **DISTANCES))(300.0)
    difference = (umbra_enlargement(limb(310.0), **DISTANCES) - umbra_enlargement(limb(290.0), **DISTANCES)) / 20.0
    assert float(slope) == pytest.approx(float(difference), rel=0.2)


def test_ozone_paints_the_rim_of_the_umbra_blue():
    # Vollmer & Gedzelman 2008: without ozone no part of the shadow is bluer than sunlight.
    offset = np.linspace(10e-3, 14e-3, 81)
    with_ozone, without = (
        np.divide(*np.asarray(shadow_irradiance(limb(column), offset, [450.0, 620.0], **DISTANCES)).T)
        for column in (300.0, 0.0)
    )
    edge = float(umbra_edge(DISTANCES["moon_distance"], DISTANCES["sun_distance"], Sun().radius))
    assert with_ozone.max() > 1.05 and abs(offset[np.argmax(with_ozone)] - edge) < 1.5e-4
    assert without.max() < 1.0
