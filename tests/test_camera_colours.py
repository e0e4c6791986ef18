"""A camera whose sensitivities are known: its matrix, its channels of the shadow, and what is refused."""

from importlib.resources import files

import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.errors import InputError
from eclipsejax.moon import Moon
from eclipsejax.sun import Sun
from inverse import cli
from inverse.camera_colours import ASSUMED_MATRIX, checked_response, colour_matrix_of
from inverse.catalogue import data_file
from inverse.evidence import gather, prepare
from inverse.likelihood import LIMB
from inverse.limb_light import camera_weights, shadow_slopes

NIKON = str(files("eclipsejax") / "tables" / "camera_sensitivity_nikon_5100_npl.csv")


def test_the_matrix_assumed_is_that_of_its_sensitivities():
    np.testing.assert_allclose(colour_matrix_of(NIKON), ASSUMED_MATRIX, atol=3e-4)


def test_a_matrix_leaves_white_white():
    for name in (NIKON, "sigma_sdmerill"):
        np.testing.assert_allclose(colour_matrix_of(name).sum(axis=1), 1.0, atol=1e-12)
    # Three layers of silicon hardly tell colours apart: its matrix has to.
    assert np.linalg.norm(colour_matrix_of("sigma_sdmerill")) > 1.5 * np.linalg.norm(ASSUMED_MATRIX)


def test_a_fit_is_of_the_channels_of_its_camera(likelihood):
    """Of a table of the assumed camera as of its name, to what 16 wavelengths differ from its 7."""
    evidence = gather([data_file(cli.DEMO_PROFILE)], time=None, site=None, disc=None, progress=lambda *_: None)
    same = prepare(evidence, response=NIKON)
    light, assumed = (np.asarray(shadow_slopes(one.shadow, jnp.zeros(LIMB))[0]) for one in (same, likelihood))
    np.testing.assert_allclose(light, assumed, atol=0.01)
    np.testing.assert_array_equal(same.models[0].colours, colour_matrix_of(NIKON))
    sun, moon = Sun(), Moon()
    (_, nikon), (_, sigma) = (camera_weights(sun, moon, name) for name in (NIKON, "sigma_sdmerill"))
    assert np.abs(sigma[: len(nikon)] - nikon[: len(sigma)]).max() > 0.1  # which sees other colours


@pytest.mark.parametrize(
    ("name", "why"), [("srgb", "no camera"), ("nothing.csv", "cannot be read"), ("leica", "There is no spectral")]
)
def test_what_is_no_camera_is_refused(name, why, capsys):
    with pytest.raises(InputError, match=why):
        checked_response(name)
    assert cli.main(["moon.jpg", "--response", name]) == 2
    assert why in capsys.readouterr().err
