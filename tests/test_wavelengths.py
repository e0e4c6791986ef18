import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust
from eclipsejax.moon import Moon
from eclipsejax.render import channel_weights as seen_weights
from eclipsejax.response import linear_from_xyz
from eclipsejax.scene import Scene
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.sun import Sun
from eclipsejax.wavelengths import MANY, binned_weights, channel_weights

SUN, MOON = Sun(), Moon()
# Close together, so that the caustics' passage through the wavelengths is met.
OFFSETS = np.linspace(0.0, 0.0133, 150)
ATMOSPHERES = [
    Atmosphere.typical(),
    *(Atmosphere(dust=Dust(dust)) for dust in (0.0, 4.7e-6, 1e-5)),
    Atmosphere(air=Air(258.0, 98e3), clouds=Clouds(5e3, 0.9, 2e3)),
]


@pytest.fixture(scope="module")
def spectra():
    """Light of the shadow at the wavelengths of the reference, (atmosphere, offset, wavelength)."""
    wavelength = jnp.asarray(binned_weights(SUN, MOON, "xyz", MANY)[0])
    operator = eqx.filter_jit(shadow_operator)(
        SUN, jnp.asarray(OFFSETS)[None], jnp.asarray([3.8e8]), 1.5e11, wavelength
    )
    light = eqx.filter_jit(lambda operator, atmosphere: operator(atmosphere)[0])
    return np.stack([light(operator, atmosphere) for atmosphere in ATMOSPHERES])


def in_place(spectra, wavelength):
    """The light at some of the reference's wavelengths."""
    return spectra[..., np.searchsorted(np.asarray(binned_weights(SUN, MOON, "xyz", MANY)[0]), wavelength)]


@pytest.mark.parametrize(("count", "error"), [(16, 1e-2), (24, 1e-3), (48, 1e-4)])
@pytest.mark.parametrize("response", ["srgb", "nikon_5100"])
def test_a_few_wavelengths_make_the_channels_of_two_hundred(spectra, count, error, response):
    wavelength, weights = channel_weights(SUN, MOON, response, count)
    assert wavelength.shape == (count,)
    _, all_weights = binned_weights(SUN, MOON, "xyz" if response == "srgb" else response, MANY)
    np.testing.assert_allclose(in_place(spectra, wavelength) @ weights, spectra @ all_weights, rtol=error)


def test_the_middles_of_forty_bins_do_not(spectra):
    middles, weights = binned_weights(SUN, MOON, "xyz", 40)
    light = np.stack([np.interp(middles, np.linspace(381.0, 779.0, MANY), one) for one in spectra[0]])
    _, all_weights = binned_weights(SUN, MOON, "xyz", MANY)
    assert np.max(np.abs(light @ weights / (spectra[0] @ all_weights) - 1.0)) > 5e-3


def test_eight_fitted_wavelengths_make_the_colours_of_two_hundred(spectra):
    # To 1 % of the brightest channel, in the whole umbra; three wavelengths for R, G and B are wrong by half.
    wavelength, weights = channel_weights(SUN, MOON, "srgb", 8)
    assert wavelength.shape == (8,)
    _, all_weights = binned_weights(SUN, MOON, "xyz", MANY)
    many, few = (
        np.asarray(linear_from_xyz(jnp.asarray(light)))
        for light in (spectra @ all_weights, in_place(spectra, wavelength) @ weights)
    )
    assert np.max(np.abs(few - many).max(axis=-1) / many.max(axis=-1)) < 0.01


def test_seven_fitted_wavelengths_make_the_channels_of_a_camera(spectra):
    # Each channel to 1 % of itself: an inference compares their logarithms.
    wavelength, weights = channel_weights(SUN, MOON, "nikon_5100", 8)
    assert wavelength.shape == (7,)
    _, all_weights = binned_weights(SUN, MOON, "nikon_5100", MANY)
    np.testing.assert_allclose(in_place(spectra, wavelength) @ weights, spectra @ all_weights, rtol=1e-2)


def test_another_sun_takes_the_mixtures_instead_of_the_fitted_few():
    assert channel_weights(Sun(spectrum="blackbody"), MOON, "srgb", 8)[0].shape == (16,)
    assert channel_weights(Sun(spectrum="blackbody"), MOON, "nikon_5100", 8)[0].shape == (16,)


def test_weights_make_white_of_full_light():
    # The channels' unit is the luminance of the full Moon, whatever the wavelengths; under the observer's air too.
    for scene in (
        Scene.at("2008-02-21T03:26:00Z"),
        Scene.at("2008-02-21T03:26:00Z", 42.73, -73.68),
    ):
        fine, all_weights = binned_weights(SUN, MOON, "xyz", MANY)
        full = np.asarray(all_weights)
        if scene.sky is not None:
            _, thinned = seen_weights(scene, 48)
            full = np.asarray(thinned)
        for count in (8, 24):
            _, weights = seen_weights(scene, count)
            np.testing.assert_allclose(np.asarray(weights).sum(axis=0), full.sum(axis=0), rtol=0.01)
