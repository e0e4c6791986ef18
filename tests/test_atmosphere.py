from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

import eclipsejax
from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone, extinction, refractivity
from eclipsejax.spectra import ozone_cross_section, rayleigh_cross_section
from tests.test_limb import rays

TABLES = Path(eclipsejax.__file__).parent / "tables"
DOBSON_UNIT = 2.6867e20  # m^-2


def only(**part) -> Atmosphere:
    """An atmosphere whose air bends but does not scatter, with amounts of nothing but the parts given."""
    parts = {"air": Air(scattering=0.0), "ozone": Ozone(column_du=0.0)}
    return Atmosphere(**(parts | part))


@pytest.mark.parametrize("column", [100.0, 345.75])
def test_ozone_column_is_the_one_asked_for(column):
    altitude = np.linspace(0.0, 120e3, 4001)
    profile = jax.vmap(Ozone(column_du=column).profile)(altitude)
    assert np.trapezoid(profile, altitude) / DOBSON_UNIT == pytest.approx(column, rel=1e-6)


def test_ozone_has_the_profile_of_afgl():
    table = np.loadtxt(TABLES / "atmosphere_profiles_afgl1986.csv", delimiter=",")
    table = table[table[:, 0] <= 85]
    altitude, density = table[:, 0] * 1e3, table[:, 4]
    column = np.trapezoid(density, altitude) / DOBSON_UNIT
    assert column == pytest.approx(345.75, rel=2e-3)
    error = jax.vmap(Ozone(column_du=column).profile)(altitude) - density
    assert np.sqrt(np.mean(error**2)) < 0.008 * density.max()


# Slant columns of the reference along refracted rays of 550 nm: kilometres of air at 15 C and one atmosphere,
# Dobson units of ozone (345.75 vertically), kilometres between 15 and 25 km.
TANGENTS = np.array([0.0, 5e3, 10e3, 20e3, 25e3])
SLANT_AIR = [645.186, 354.824, 180.8, 36.96, 16.78]
SLANT_OZONE = [9936.0, 10479.0, 12366.0, 13521.0, 9205.0]
PATH_IN_LAYER = [266.07, 306.13, 380.0, 510.3, 0.0]


def test_grazing_rays_cross_the_air_of_the_reference():
    depth = rays(only(air=Air()), TANGENTS)[1]
    slant = depth / (rayleigh_cross_section(550.0) * 2.5469e25) / 1e3
    np.testing.assert_allclose(slant, SLANT_AIR, rtol=4e-4)


def test_grazing_rays_cross_the_ozone_of_the_reference():
    # There the AFGL levels are joined by straight lines; the smooth fit is within 1.5 % of that.
    slant = rays(only(ozone=Ozone(column_du=345.75)), TANGENTS)[1] / ozone_cross_section(550.0)
    np.testing.assert_allclose(slant / DOBSON_UNIT, SLANT_OZONE, rtol=0.015)


def test_grazing_rays_have_the_path_in_the_dust_of_the_reference():
    path = rays(only(dust=Dust(extinction=1e-3)), TANGENTS)[1]
    np.testing.assert_allclose(path, PATH_IN_LAYER, rtol=1.5e-3, atol=1e-9)  # the reference is that rough


def test_extinction_is_the_sum_of_the_parts():
    atmosphere = Atmosphere(dust=Dust(extinction=1e-6), haze=Haze(optical_depth=0.2))
    altitude = np.array([0.0, 1e3, 16e3, 24e3, 60e3])
    parts = [
        only(air=Air()),
        only(ozone=atmosphere.ozone),
        only(dust=atmosphere.dust),
        only(haze=atmosphere.haze),
    ]
    total = sum(extinction(part, altitude, 500.0) for part in parts)
    np.testing.assert_allclose(extinction(atmosphere, altitude, 500.0), total, rtol=1e-12)


def test_an_absent_part_is_a_part_of_nothing():
    bare = Atmosphere(ozone=None, dust=None, haze=None, clouds=None)
    empty = Atmosphere(ozone=Ozone(column_du=0.0))
    altitude = np.array([0.0, 5e3, 20e3])
    np.testing.assert_allclose(extinction(bare, altitude, 450.0), extinction(empty, altitude, 450.0), rtol=1e-14)
    np.testing.assert_allclose(bare.limb_transmission(altitude), empty.limb_transmission(altitude))


def test_refractivity_and_extinction_broadcast():
    altitude, wavelength = np.linspace(0.0, 50e3, 4)[:, None], np.array([400.0, 550.0, 700.0])
    for quantity in (refractivity, extinction):
        table = quantity(Atmosphere(), altitude, wavelength)
        assert table.shape == (4, 3)
        assert table[2, 1] == pytest.approx(float(quantity(Atmosphere(), altitude[2, 0], 550.0)), rel=1e-13)
        assert np.all(np.diff(table, axis=0) < 0)


def test_vertical_optical_depths_are_those_of_the_fields():
    haze = Haze(optical_depth=0.3, scale_height=2e3, angstrom=1.5)
    column = quad(lambda z: float(haze.profile(z)), 0.0, 60e3, points=[2e3, 8e3])[0]
    assert column == pytest.approx(0.3, rel=1e-8)
    assert haze.coefficient(jnp.asarray(1100.0)) == pytest.approx(2**-1.5)
    assert Dust(extinction=4.7e-6).optical_depth == pytest.approx(0.047)


def test_clouds_block_their_cover_below_and_nothing_aloft():
    clouds = Clouds(top=8e3, cover=0.9, width=2e3)
    clear = clouds.limb_transmission(np.array([-40e3, 7e3, 8e3, 9e3, 60e3]))
    np.testing.assert_allclose(clear, [0.1, 1 - 0.9 * 0.8808, 0.55, 1 - 0.9 * 0.1192, 1.0], atol=1e-4)


def test_breaks_rise_from_the_ground_to_the_top():
    atmosphere = Atmosphere(dust=Dust(base=14e3, top=90e3), clouds=Clouds(top=1e3, width=3e3))
    breaks = np.asarray(atmosphere.breaks)
    assert breaks[0] == 0.0 and breaks[-1] == 120e3
    assert np.all(np.diff(breaks) >= 0.0)
    for altitude in (14e3, 90e3, 1e3, 4e3, 20063.0):
        assert np.min(np.abs(breaks - altitude)) < 1.0


def test_one_trace_serves_all_values():
    traces = []

    @jax.jit
    def at_ten_kilometres(atmosphere):
        traces.append(1)
        return atmosphere.extinction(10e3, 550.0)

    values = [at_ten_kilometres(Atmosphere(air=Air(surface_temperature=t))) for t in (280, 288.15, 300.0)]
    assert len(traces) == 1 and len(set(map(float, values))) == 3
