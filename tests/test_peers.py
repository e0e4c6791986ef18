"""Rays, optical depths and the shadow against other people's programs and against media with closed forms."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.limb import bending_angle, impact_parameter, optical_depth
from eclipsejax.march import march_ray
from eclipsejax.shadow import shadow_irradiance
from eclipsejax.spectra import ciddor_refractivity

ARCMIN = np.pi / 180 / 60


def rich() -> Atmosphere:
    """An atmosphere with something of everything."""
    return Atmosphere(
        air=Air(surface_temperature=293.0, surface_pressure=99e3),
        dust=Dust(extinction=3e-6, base=14e3, top=23e3),
        haze=Haze(optical_depth=0.2, scale_height=1.8e3),
        clouds=Clouds(top=6e3, cover=0.8, width=2e3),
    )


# Media in which rays have closed forms


class Curved(eqx.Module):
    """A ball of strongly refracting matter, transparent or as grey as its `grey`, with vacuum around it."""

    grey: jax.Array = eqx.field(default_factory=lambda: jnp.asarray(1e-7))

    @property
    def breaks(self):
        return jnp.asarray([0.0, 100e3, 300e3])

    def index(self, radius):
        raise NotImplementedError

    def refractivity(self, altitude, wavelength):
        return self.index((EARTH_RADIUS + altitude) / EARTH_RADIUS) - 1.0

    def extinction(self, altitude, wavelength):
        return self.grey + 0.0 * altitude

    def limb_transmission(self, tangent_height):
        return jnp.ones_like(tangent_height)


class FishEye(Curved):
    """Maxwell's: n = 2 / (1 + (r/a)^2) with a twice the Earth's radius. Every ray is a circle, with r_t a^2/r_t ends.

    Born & Wolf, *Principles of Optics*, section 4.2.2.
    """

    def index(self, radius):
        return 2.0 / (1.0 + (radius / 2.0) ** 2)

    def rays(self, tangent):
        """Bending angle [rad] and length [m]."""
        near, far = EARTH_RADIUS + tangent, (2.0 * EARTH_RADIUS) ** 2 / (EARTH_RADIUS + tangent)
        circle, off_centre = 0.5 * (far + near), 0.5 * (far - near)
        rise = (300e3 - tangent) * (EARTH_RADIUS + 300e3 + near)  # r^2 - r_t^2 where the ray leaves
        half = 2.0 * np.arcsin(np.sqrt(rise / (4.0 * circle * off_centre)))  # of the arc, at the circle's centre
        return 2.0 * half, 2.0 * circle * half


class FallingSquare(Curved):
    """n^2 = R/r, which falls linearly with height near the ground: there the tank of sugar water, whose rays are
    parabolas; and so they are throughout, with their focus at the centre (Kepler's orbits of no energy)."""

    def index(self, radius):
        return radius**-0.5

    def rays(self, tangent):
        """Bending angle [rad] and length [m]."""
        near = EARTH_RADIUS + tangent
        steep = np.sqrt((300e3 - tangent) / near)  # tan(theta/2) where r = r_t / cos^2(theta/2) is the top
        return 2.0 * np.arctan(steep), 2.0 * near * (steep * np.sqrt(1.0 + steep**2) + np.arcsinh(steep))


CLOSED_TANGENTS = np.array([0.0, 1.0, 20e3, 99.9e3, 100e3, 180e3, 290e3])


@pytest.mark.parametrize("medium", [FishEye(), FallingSquare()], ids=["circles", "parabolas"])
def test_rays_in_strong_media_are_circles_and_parabolas(medium):
    bending, length = medium.rays(CLOSED_TANGENTS)
    np.testing.assert_allclose(bending_angle(medium, CLOSED_TANGENTS, 550.0), bending, rtol=1e-9)
    np.testing.assert_allclose(optical_depth(medium, CLOSED_TANGENTS, 550.0), 1e-7 * length, rtol=1e-9)


@pytest.mark.parametrize("medium", [FishEye(), FallingSquare()], ids=["circles", "parabolas"])
def test_marched_rays_tend_to_circles_and_parabolas(medium):
    # First order, and up to a whole step too far into a medium that goes on at the top.
    tangent = np.array([0.0, 20e3, 180e3])
    bending, length = medium.rays(tangent)
    for step in (4000.0, 500.0, 125.0):
        marched, absorbed = march_ray(medium, tangent, 550.0, step)
        assert np.all(np.abs(marched / bending - 1.0) < 1.5 * step / (0.5 * length))
        assert np.all(np.abs(absorbed / (1e-7 * length) - 1.0) < 1.5 * step / (0.5 * length))


def test_marched_rays_in_the_fish_eye_curve_all_alike():
    # Turn by length, where the end of the ray does not matter: the radius of the circle.
    bending, length = FishEye().rays(CLOSED_TANGENTS)
    marched, absorbed = march_ray(FishEye(), CLOSED_TANGENTS, 550.0, 500.0)
    np.testing.assert_allclose(marched / (absorbed / 1e-7), bending / length, rtol=1e-6)


# The ray equation by an adaptive solver, in Cartesian coordinates


def test_rays_solve_the_equation_of_rays():
    # Nothing is known to the solver of Bouguer's invariant, nor of the breaks of the profile.
    pytest.importorskip("diffrax")
    from benchmarks.solved_ray import solved_ray

    tangent = np.array([0.0, 3e3, 9e3, 13e3, 17e3, 22e3, 30e3, 45e3, 60e3, 80e3])[:, None]
    wavelength = np.array([400.0, 700.0])
    bending, depth, impact = solved_ray(rich(), tangent, wavelength)
    np.testing.assert_allclose(bending_angle(rich(), tangent, wavelength), bending, rtol=1e-8)
    np.testing.assert_allclose(optical_depth(rich(), tangent, wavelength), depth, rtol=1e-8)
    np.testing.assert_allclose(impact_parameter(rich(), tangent, wavelength), impact, rtol=1e-13)


# A radiative transfer code


LIMB = np.array([0.5e3, 2e3, 5e3, 9e3, 15e3, 20e3, 30e3, 40e3, 55e3])


def test_optical_depth_is_that_of_sasktran2():
    pytest.importorskip("sasktran2")
    from benchmarks.occultation import occultation

    atmosphere, wavelength = Atmosphere(air=Air(293.0, 99e3)), np.array([400.0, 550.0, 700.0])
    theirs = occultation(atmosphere, LIMB, wavelength, 250.0)
    np.testing.assert_allclose(optical_depth(atmosphere, LIMB[:, None], wavelength), theirs, rtol=5e-4)
    # Straight lines between levels make haze with a scale height of 1.8 km too thick: 2.4e-3 at 250 m, 2.5e-4 at
    # 62.5 m. (No dust: its edges would become ramps between levels.)
    hazy = Atmosphere(air=Air(293.0, 99e3), haze=Haze(optical_depth=0.2, scale_height=1.8e3))
    theirs = occultation(hazy, LIMB, 550.0, 62.5)
    np.testing.assert_allclose(optical_depth(hazy, LIMB[:, None], [550.0]), theirs, rtol=5e-4)


# The eclipse shadow of CosmoScout VR


class CosmoScoutAir(eqx.Module):
    """The Earth of CosmoScout VR 1.10: isothermal air of one refractivity, haze, and ozone in a tent, to 80 km.

    Coefficients at 15 wavelengths from its tables (`scattering-table-generator`, output earth_cosmoscout_*), between
    which it interpolates linearly; the molecules' by its formula, with Ciddor's refractivity for Penndorf's (3e-5).
    """

    @property
    def breaks(self):
        return jnp.asarray([0.0, 1.5e3, 3e3, 6e3, 10e3, 17e3, 25e3, 32e3, 40e3, 60e3, 80e3])

    def refractivity(self, altitude, wavelength):
        return 2.77e-4 * jnp.exp(-altitude / 8e3)

    def extinction(self, altitude, wavelength):
        nodes = np.linspace(360.0, 830.0, 15)
        square = (2.0 * ciddor_refractivity(nodes)) ** 2
        king = (6.0 + 3.0 * 0.0279) / (6.0 - 7.0 * 0.0279)
        molecules = 8.0 / 3.0 * np.pi**3 * square * king / (2.68731e25 * (1e-9 * nodes) ** 4)
        haze = np.array([41.872, 41.126, 37.422, 35.956, 29.908, 29.162, 26.296, 25.420, 22.723, 22.538, 21.330])
        haze = np.append(haze, [19.269, 17.260, 16.655, 14.469]) * 1e-6
        sooty = np.array([4.8924, 4.5446, 4.4090, 3.9542, 3.5585, 3.4721, 3.0640, 3.0061, 2.9933, 2.5333, 2.6199])
        haze += np.append(sooty, [2.3921, 2.2024, 2.2076, 2.0463]) * 1e-6
        ozone = np.array([0.0047, 0.0039, 0.0305, 0.1502, 0.4607, 1.0517, 1.7341, 1.9493, 1.3194, 0.7100, 0.3324])
        ozone = np.append(ozone, [0.1687, 0.1018, 0.0605, 0.0279]) * 1e-6
        tent = jnp.maximum(1.0 - jnp.abs(altitude - 25e3) / 15e3, 0.0)
        return (
            jnp.interp(wavelength, nodes, molecules) * jnp.exp(-altitude / 8e3)
            + jnp.interp(wavelength, nodes, haze) * jnp.exp(-altitude / 1.2e3)
            + jnp.interp(wavelength, nodes, ozone) * tent
        )

    def limb_transmission(self, tangent_height):
        return jnp.ones_like(tangent_height)


class CosmoScoutSun(eqx.Module):
    """Infinitely far, as wide as from the Moon; I = 1 - 0.6 (1 - mu)."""

    radius: jax.Array = eqx.field(default_factory=lambda: jnp.asarray(6.9634e8 / (1.496e11 + 3.844e8) * 1e15))

    def limb_darkening_coefficients(self, wavelength):
        return jnp.asarray([0.4, 0.6, 0.0, 0.0, 0.0, 0.0])


def test_shadow_is_that_of_cosmoscout(shared):
    # From 1' to 40', in red and green: the largest difference is 1 %, at 2'. Its light is direct and scattered, ours
    # direct; in its third channel, at 440 nm, scattered light is most of what reaches the axis.
    table = np.loadtxt(shared / "reference" / "cosmoscout" / "earthShadow_384400km.csv", delimiter=",")
    arcmin, theirs = table[:, 0], table[:, 1:3]
    inside = (arcmin > 1.0) & (arcmin < 40.0)
    ours = shadow_irradiance(
        CosmoScoutAir(), arcmin[inside] * ARCMIN, [680.0, 550.0], sun=CosmoScoutSun(), sun_distance=1e15
    )
    np.testing.assert_allclose(ours, theirs[inside], rtol=0.015)
