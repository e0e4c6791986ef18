import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.camera import (
    Camera,
    Exposure,
    ToneCurve,
    blur,
    expose,
    noise_variance,
    pixel_at,
    point_spread,
    signal,
    sky_plane,
    tone_curve,
)
from eclipsejax.errors import InputError
from eclipsejax.response import encode_srgb

RAMP = jnp.linspace(0.0, 1.0, 101)


blurred = eqx.filter_jit(blur)
spread = eqx.filter_jit(point_spread)
photograph = eqx.filter_jit(expose)
toned = eqx.filter_jit(tone_curve)


def spot(shape, row, column, light: float | np.ndarray = 1.0):
    image = np.zeros((*shape, 3))
    image[row, column] = light
    return image


def test_the_sky_is_seen_from_inside():
    camera = Camera(shape=(11, 21), scale=1e-4)
    east, north = sky_plane(camera, np.array([5.0, 0.0, 5.0]), np.array([10.0, 10.0, 20.0]))
    np.testing.assert_allclose(east, [0.0, 0.0, -1e-3], atol=1e-18)  # right is west
    np.testing.assert_allclose(north, [0.0, 5e-4, 0.0], atol=1e-18)  # up is north
    east, _ = sky_plane(Camera(shape=(11, 21), scale=1e-4, mirror=True), 5.0, 20.0)
    assert east == pytest.approx(1e-3)


@pytest.mark.parametrize("mirror", [False, True])
def test_up_has_the_position_angle_of_the_roll(mirror):
    east, north = sky_plane(Camera(shape=(9, 9), roll=0.7, mirror=mirror), 0.0, 4.0)
    assert np.arctan2(east, north) == pytest.approx(0.7)


@pytest.mark.parametrize("mirror", [False, True])
def test_pixels_and_directions_are_inverse(mirror):
    camera = Camera(shape=(9, 13), scale=3e-5, roll=2.1, mirror=mirror, centre=(-3.5, 20.25))
    row, column = jnp.meshgrid(jnp.arange(9.0), jnp.arange(13.0), indexing="ij")
    back = pixel_at(camera, *sky_plane(camera, row, column))
    np.testing.assert_allclose(back, (row, column), atol=1e-10)


def test_no_optics_means_the_same_array():
    image = jnp.asarray(spot((4, 5), 1, 2))
    assert blur(image, Camera(shape=(4, 5))) is image
    assert expose(image, Camera(shape=(4, 5))) is image


@pytest.mark.parametrize(
    "optics", [{"psf_fwhm": 2.5}, {"glare": 0.3, "glare_scale": 2.0}, {"psf_fwhm": 1.5, "glare": 0.1}]
)
def test_light_is_conserved(optics):
    camera = Camera(shape=(41, 61), **optics)
    assert spread(camera).sum() == pytest.approx(1.0, abs=1e-12)
    shown = blurred(spot((41, 61), 20, 30, np.array([1.0, 2.0, 3.0])), camera)
    np.testing.assert_allclose(shown[..., 1], 2 * shown[..., 0], atol=1e-14)
    # What the frame does not hold is in the wings: all of the core is there.
    lost = 1.0 - shown[..., 0].sum()
    assert -1e-12 < lost < 0.7 * optics.get("glare", 0.0) + 1e-9


def test_the_psf_has_its_width_and_its_wings():
    # At half the FWHM from the centre the core has half its height.
    core = spread(Camera(shape=(31, 31), psf_fwhm=10.0))
    assert core[30, 35] / core[30, 30] == pytest.approx(0.5, rel=5e-3)
    variance = (core.sum(0) * np.arange(-30, 31) ** 2).sum()
    assert variance == pytest.approx((10 / 2.3548) ** 2 + 1 / 12, rel=1e-4)  # 1/12: the pixel itself
    wings = spread(Camera(shape=(201, 201), glare=0.2, glare_scale=5.0))
    assert wings[200, 200] > 0.8
    assert wings[200, 380] / wings[200, 290] == pytest.approx((90 / 180) ** 3, rel=0.01)


def test_blur_is_a_convolution_without_wrapping_round():
    camera = Camera(shape=(8, 10), psf_fwhm=2.0, glare=0.2, glare_scale=3.0)
    kernel = np.asarray(spread(camera))
    image = np.random.default_rng(2).uniform(size=(8, 10, 3))
    expected = np.zeros((8, 10, 3))
    for row in range(8):
        for column in range(10):
            window = kernel[7 - row : 15 - row, 9 - column : 19 - column]
            expected += window[..., None] * image[row, column]
    np.testing.assert_allclose(blurred(image, camera), expected, atol=1e-14)


def test_a_vanishing_psf_does_nothing():
    image = np.random.default_rng(3).uniform(size=(8, 10, 3))
    np.testing.assert_allclose(
        blurred(image, Camera(shape=(8, 10), psf_fwhm=0.0, glare=0.0, glare_scale=3.0)), image, atol=1e-14
    )


def test_looney_eleven_and_reciprocity():
    def full_moon(**exposure):
        return Exposure(**exposure).scale()

    np.testing.assert_allclose(full_moon(shutter_s=1 / 200, f_number=11, iso=200), 0.18)
    # Twice the time, or the ISO, or an aperture wider by a stop: twice the signal.
    np.testing.assert_allclose(full_moon(shutter_s=1 / 100, f_number=11, iso=200), 0.36)
    np.testing.assert_allclose(full_moon(shutter_s=1 / 200, f_number=11, iso=400), 0.36)
    np.testing.assert_allclose(full_moon(shutter_s=1 / 200, f_number=11 / 2**0.5, iso=200), 0.36)
    np.testing.assert_allclose(full_moon(gain=(0.5, 1.0, 2.0)), [0.5, 1.0, 2.0])


def test_noise_has_the_mean_and_variance_of_electrons():
    exposure = Exposure(shutter_s=1.0, f_number=11.0, iso=1600.0, full_well=40e3, read_noise=4.0)
    camera = Camera(shape=(200, 200), exposure=exposure)
    image = np.full((200, 200, 3), 0.3 / (0.18 * 1600))
    electrons = np.asarray(photograph(image, camera, jax.random.key(4))) * 2500.0
    assert exposure.capacity() == pytest.approx(2500.0)
    expected = 0.3 * 2500 + 4.0**2
    assert electrons.mean() == pytest.approx(750.0, abs=5 * (expected / 120e3) ** 0.5)
    assert electrons.var() == pytest.approx(expected, rel=5 * (2 / 120e3) ** 0.5)
    assert noise_variance(0.3, exposure) * 2500**2 == pytest.approx(expected)


def test_saturation_and_limits():
    camera = Camera(shape=(1, 2), exposure=Exposure(gain=(2.0, 2.0, 2.0)), encoding="srgb")
    image = np.array([[[0.1, 0.4, 0.7], [-1.0, 0.0, 1e9]]])
    np.testing.assert_allclose(photograph(image, camera)[0, 0], encode_srgb(np.array([0.2, 0.8, 1.0])))
    np.testing.assert_allclose(photograph(image, camera)[0, 1], [0.0, 0.0, 1.0], atol=1e-15)
    noisy = photograph(image, camera, jax.random.key(0))
    assert (noisy >= 0).all() and (noisy <= 1).all()


def test_default_tone_curve_is_the_identity():
    np.testing.assert_array_equal(tone_curve(RAMP, Camera()), RAMP)
    neutral = toned(RAMP, Camera(exposure=Exposure(), tone=ToneCurve()))
    np.testing.assert_allclose(neutral, RAMP, atol=1e-15)


@pytest.mark.parametrize(
    "tone",
    [
        {"black": 0.05},
        {"exponent": 0.6},
        {"exponent": 1.8},
        {"toe": 0.2},
        {"shoulder": 3.0},
        {"black": 0.02, "exponent": 1.2, "toe": 0.1, "shoulder": 2.0},
    ],
)
def test_tone_curves_rise_from_black_to_white(tone):
    curve = toned(RAMP, Camera(exposure=Exposure(), tone=ToneCurve(**tone)))
    assert curve[0] == 0.0 and curve[-1] == pytest.approx(1.0)
    above_black = np.asarray(RAMP)[:-1] >= tone.get("black", 0.0)
    assert (np.diff(curve)[above_black] > 0).all()


def test_toe_doubles_the_contrast_of_the_shadows_and_leaves_the_highlights():
    camera = Camera(exposure=Exposure(), tone=ToneCurve(toe=0.01))
    log_slope = jax.jit(jax.vmap(jax.grad(lambda t: jnp.log(tone_curve(jnp.exp(t), camera)))))
    np.testing.assert_allclose(log_slope(np.log([1e-5, 0.9])), [2.0, 1.0], atol=0.02)


def test_every_gradient_of_a_photograph_agrees_with_central_differences():
    names = ("psf_fwhm", "glare", "gain", "shutter_s", "black", "exponent", "toe", "shoulder")
    values = np.array([1.7, 0.1, 0.9, 0.004, 0.01, 1.1, 0.05, 0.8])
    image = np.random.default_rng(5).uniform(0.5, 1.0, size=(7, 8, 3))

    @jax.jit
    @jax.value_and_grad
    def brightness(values):
        v = dict(zip(names, values, strict=True))
        camera = Camera(
            shape=(7, 8),
            psf_fwhm=v["psf_fwhm"],
            glare=v["glare"],
            glare_scale=3.0,
            exposure=Exposure(v["shutter_s"], 8.0, 200.0, gain=v["gain"] * jnp.ones(3)),
            tone=ToneCurve(v["black"], v["exponent"], v["toe"], v["shoulder"]),
            encoding="srgb",
        )
        return (expose(image, camera) * image**2).sum()

    slopes = brightness(values)[1]
    for i, value in enumerate(values):
        step = np.eye(len(values))[i] * 1e-6 * value
        numeric = float(brightness(values + step)[0] - brightness(values - step)[0]) / (2e-6 * value)
        assert float(slopes[i]) == pytest.approx(numeric, rel=1e-5), names[i]


def test_gradients_are_finite_in_the_dark_and_in_saturation():
    camera = Camera(
        shape=(3, 3),
        psf_fwhm=0.0,
        glare=0.0,
        exposure=Exposure(read_noise=0.0),
        tone=ToneCurve(exponent=0.5),
        encoding="srgb",
    )
    image = np.array([-1.0, 0.0, 1e-300, 1e-12, 1e-6, 0.5, 1.0, 2.0, 1e6]).reshape(3, 3, 1).repeat(3, 2)
    slopes = eqx.filter_jit(eqx.filter_grad(lambda both: expose(both[0], both[1], jax.random.key(7)).sum()))
    for leaf in jax.tree.leaves(slopes((image, camera))):
        assert jnp.isfinite(leaf).all()


def test_one_trace_serves_all_values():
    traces = []

    @eqx.filter_jit
    def light(image, camera):
        traces.append(None)
        return signal(image, camera)

    for width in (1.0, 2.0, 3.0):
        light(spot((5, 5), 2, 2), Camera(shape=(5, 5), psf_fwhm=width, exposure=Exposure(0.1, 8, 100)))
    assert len(traces) == 1


@pytest.mark.parametrize(
    "build, sentence",
    [
        (lambda: Camera(shape=(0, 5)), "cannot have the shape"),
        (lambda: Camera(encoding="gamma", exposure=Exposure()), "no encoding 'gamma'"),
        (lambda: Camera(encoding="srgb"), "needs a full scale"),
        (lambda: Exposure(shutter_s=0.1), "all of shutter_s, f_number and iso"),
    ],
)
def test_unusable_cameras_are_refused_in_one_sentence(build, sentence):
    with pytest.raises(InputError, match=sentence):
        build()
