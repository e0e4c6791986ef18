import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.errors import InputError
from eclipsejax.response import (
    LUMINANCE,
    SRGB_FROM_XYZ,
    decode_srgb,
    display,
    encode_srgb,
    gauss_wavelengths,
    into_gamut,
    linear_from_xyz,
    responses,
    trapezoid_weights,
    wavelengths,
)


@pytest.fixture(scope="module")
def colour():
    return pytest.importorskip("colour")


def test_observer_is_the_cie_s(colour):
    # colour-science has the same observer at every nanometre; ours is interpolated between every fifth.
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    grid = np.arange(380.0, 781.0)
    expected = cmfs.values[np.isin(cmfs.wavelengths, grid)]
    np.testing.assert_allclose(responses("xyz", grid), expected, atol=2e-3)
    np.testing.assert_allclose(responses("xyz", grid[::5]), expected[::5], atol=1e-6)


@pytest.mark.parametrize(
    "name, full_name", [("nikon_5100", "Nikon 5100 (NPL)"), ("sigma_sdmerill", "Sigma SDMerill (NPL)")]
)
def test_cameras_are_those_of_the_national_physical_laboratory(colour, name, full_name):
    sensitivity = colour.MSDS_CAMERA_SENSITIVITIES[full_name]
    np.testing.assert_allclose(responses(name, sensitivity.wavelengths), np.maximum(sensitivity.values, 0.0), atol=1e-6)


def test_other_responses_come_from_colour_science(colour):
    grid = np.array([450.0, 550.0])
    expected = colour.MSDS_CMFS["CIE 1964 10 Degree Standard Observer"][grid]
    np.testing.assert_allclose(responses("CIE 1964 10 Degree Standard Observer", grid), expected, atol=1e-9)


def test_srgb_matrix_and_encoding_are_those_of_colour_science(colour):
    np.testing.assert_array_equal(SRGB_FROM_XYZ, colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB)
    linear = np.linspace(0.0, 1.0, 301)
    np.testing.assert_allclose(encode_srgb(linear), colour.cctf_encoding(linear, "sRGB"), atol=1e-12)
    np.testing.assert_allclose(decode_srgb(linear), colour.cctf_decoding(linear, "sRGB"), atol=1e-12)


def test_daylight_is_white():
    # D65 has the chromaticity (0.3127, 0.3290).
    white = np.array([0.3127, 1 - 0.3127 - 0.3290]) / 0.3290
    np.testing.assert_allclose(linear_from_xyz(np.array([white[0], 1.0, white[1]])), 1.0, atol=3e-4)
    np.testing.assert_allclose(np.linalg.inv(SRGB_FROM_XYZ)[1], LUMINANCE, atol=1e-4)


def test_luminous_efficiency_integrates_to_its_known_area():
    # int y-bar d lambda = 106.86 nm: CIE 15. Both quadratures and any spacing must find it.
    grid = wavelengths()
    assert grid.shape == (200,) and grid[0] == 380.0 and grid[-1] == 780.0
    uneven = 380.0 + 400.0 * np.linspace(0, 1, 301) ** 1.5
    gauss, gauss_weights = gauss_wavelengths(80)
    for nodes, weights in (
        (grid, trapezoid_weights(grid)),
        (uneven, trapezoid_weights(uneven)),
        (gauss, gauss_weights),
    ):
        assert weights @ responses("xyz", nodes)[:, 1] == pytest.approx(106.86, abs=0.02)
        assert weights.sum() == pytest.approx(400.0)


def test_srgb_response_of_equal_energy_is_the_matrix_times_its_xyz():
    grid = wavelengths()
    weights = trapezoid_weights(grid)
    rgb, xyz = weights @ responses("srgb", grid), weights @ responses("xyz", grid)
    np.testing.assert_allclose(rgb, linear_from_xyz(xyz), rtol=1e-9)


def test_nothing_is_seen_outside_the_table():
    assert not responses("xyz", np.array([300.0, 379.9, 780.1, 1000.0])).any()


def test_a_table_of_the_user_s_own(tmp_path):
    table = tmp_path / "sensor.csv"
    table.write_text("# nm,R,G,B\n400,0,0,1\n500,0,1,0\n600,1,0,0\n700,0,0,0\n")
    np.testing.assert_allclose(responses(table, np.array([500.0, 600.0])), [[0, 1, 0], [1, 0, 0]], atol=1e-12)
    table.write_text("nonsense")
    with pytest.raises(InputError, match="cannot be read"):
        responses(tmp_path / "missing.csv", np.array([500.0]))


def test_unknown_response_is_refused_in_one_sentence(colour):
    with pytest.raises(InputError, match="no spectral response 'polaroid'"):
        responses("polaroid", np.array([500.0]))


def test_encoding_and_decoding_are_inverse_and_differentiable_everywhere():
    linear = jnp.array([-0.1, 0.0, 1e-9, 0.0031308, 0.0031309, 0.2, 1.0, 2.0])
    np.testing.assert_allclose(decode_srgb(encode_srgb(linear)), linear, atol=1e-7)
    for function in (encode_srgb, decode_srgb):
        slope = jax.jit(jax.vmap(jax.grad(function)))(linear)
        function = jax.jit(function)
        numeric = (function(linear + 1e-7) - function(linear - 1e-7)) / 2e-7
        away = np.array([0, 1, 5, 6, 7])  # the standard's two branches meet with a kink of 1e-3
        np.testing.assert_allclose(slope[away], numeric[away], rtol=1e-6)
        assert jnp.isfinite(slope).all()


def test_deep_red_is_desaturated_at_constant_luminance():
    # The linear sRGB of a 640 nm light, of a red umbra, and of an overexposed red: each outside the gamut.
    spectral = responses("srgb", np.array([640.0]))[0]
    colours = np.stack([spectral, np.array([0.9, 0.02, -0.05]), np.array([1.6, 0.3, 0.1])])
    shown = np.asarray(jax.jit(into_gamut)(colours))
    assert (shown >= 0).all() and (shown <= 1).all()
    np.testing.assert_allclose(shown @ LUMINANCE, colours @ LUMINANCE, rtol=1e-9)
    # Hue kept: the differences from grey stay in proportion.
    for before, after in zip(colours, shown, strict=True):
        grey = before @ LUMINANCE
        np.testing.assert_allclose(np.cross(before - grey, after - grey), 0.0, atol=1e-12)


def test_colours_inside_the_gamut_are_left_alone():
    colours = np.random.default_rng(1).uniform(size=(50, 3))
    np.testing.assert_allclose(jax.jit(into_gamut)(colours), colours, rtol=1e-12)


def test_gamut_mapping_has_finite_gradients():
    edge = [-0.1, 0.0, 0.5, 1.0, 1.5]
    colours = np.stack(np.meshgrid(edge, edge, edge), -1).reshape(-1, 3)
    assert jnp.isfinite(jax.jit(jax.vmap(jax.jacrev(into_gamut)))(colours)).all()


def test_display_is_eight_bit_srgb():
    image = jnp.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.5, 0.5, 0.5], [jnp.nan, 0.0, 0.0]]])
    shown = display(image)
    assert shown.dtype == np.uint8 and shown.shape == (1, 4, 3)
    np.testing.assert_array_equal(shown[0, :, 0], [0, 255, 188, 0])
    np.testing.assert_array_equal(display(image, gain=0.5)[0, 1], 188)
    np.testing.assert_array_equal(display(image, gain=1e9)[0, 1], 255)
