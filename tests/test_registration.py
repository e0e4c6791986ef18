"""The disc of the Moon: true to a fraction of a pixel in every phase, or refused with a reason."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from eclipsejax.errors import InputError
from inverse.photo import read_photo
from inverse.registration import register
from tests.moon_picture import CENTRE, RADIUS, encoded, photo_of, picture

PHASES = {
    "full": dict(axis=(0.0, 9.0), gain=0.8),
    "penumbral": dict(axis=(1.0, 3.6), gain=0.8),
    "partial": dict(axis=(0.5, 2.2), gain=3.0),
    "crescent": dict(axis=(0.3, 1.9), gain=10.0),
    "total, beside the axis": dict(axis=(0.6, 0.9), gain=1200.0, noise=0.006, sky=0.002),
    "total, near its end": dict(axis=(0.3, 1.5), gain=300.0, noise=0.005, sky=0.001),
    "total, on the axis": dict(axis=(0.2, 0.3), gain=4000.0, noise=0.01, sky=0.003),
}
HARD = {
    "total, noisy": dict(axis=(0.3, 1.2), gain=1000.0, noise=0.014, sky=0.002),
    "partial, underexposed": dict(axis=(0.5, 2.0), gain=0.8),
    "partial, overexposed 30 times": dict(axis=(0.5, 2.0), gain=30.0),
    "partial, overexposed 300 times": dict(axis=(0.5, 2.0), gain=300.0),
    "blurred": dict(axis=(0.6, 0.9), gain=1200.0, noise=0.006, blur=4.0),
}


def errors(photo, centre=CENTRE, radius=RADIUS, **options):
    found = register(photo, **options)
    return np.array([found.row - centre[0], found.column - centre[1], found.radius - radius]), found


def refusal(photo, **options):
    """The sentence with which a picture is refused."""
    with pytest.raises(InputError) as caught:
        register(photo, **options)
    sentence = str(caught.value)
    assert sentence.endswith(".") and "\n" not in sentence
    return sentence


@pytest.mark.parametrize("phase", PHASES)
def test_centre_and_radius_are_right_to_a_fraction_of_a_pixel_in_every_phase(phase):
    off, found = errors(picture(**PHASES[phase]))
    assert np.abs(off).max() < 0.3
    assert np.abs(off[:2]).max() < 4 * found.centre_error and abs(off[2]) < 4 * found.radius_error
    assert found.roll_from == "assumed north up"


@pytest.mark.parametrize("case", HARD)
def test_bad_exposures_are_right_to_a_pixel(case):
    off, _ = errors(picture(**HARD[case]))
    assert np.abs(off).max() < 1.0


def test_the_limb_is_measured_as_wide_as_it_is():
    for blur in (1.5, 3.0):
        _, found = errors(picture(axis=(0.0, 9.0), gain=0.8, blur=blur))
        assert found.blur == pytest.approx(2.355 * blur, rel=0.15)


def test_less_limb_is_less_certain():
    found = [errors(picture(**PHASES[phase]))[1] for phase in ("full", "partial", "crescent")]
    assert found[0].limb_fraction > 0.9 > found[1].limb_fraction
    assert found[0].centre_error < found[1].centre_error
    assert found[0].quality > found[1].quality > 0


def test_turning_the_picture_turns_the_disc():
    photo = picture(**PHASES["partial"])
    one = register(photo)
    turned = photo_of(np.rot90(photo.pixels))
    other = register(turned)
    assert other.row == pytest.approx(photo.pixels.shape[1] - 1 - one.column, abs=0.1)
    assert other.column == pytest.approx(one.row, abs=0.1)
    assert other.radius == pytest.approx(one.radius, abs=0.1)


def test_the_same_picture_gives_the_same_answer():
    photo = picture(**PHASES["crescent"])
    assert register(photo) == register(photo)


def test_a_small_moon_in_a_large_picture_is_found():
    photo = picture(shape=(1000, 1500), centre=(300.4, 1120.7), radius=24.3, axis=(0.0, 9.0), gain=0.8)
    off, _ = errors(photo, (300.4, 1120.7), 24.3)
    assert np.abs(off).max() < 0.2


def test_a_moon_cut_by_the_frame_is_used_if_enough_is_left():
    off, found = errors(picture(centre=(150.3, -30.2), axis=(0.0, 9.0), gain=0.8), (150.3, -30.2))
    assert np.abs(off).max() < 0.3 and found.limb_fraction < 0.45
    little = picture(shape=(360, 300), centre=(180.3, -150.0), radius=180.0, axis=(0.0, 9.0), gain=0.8)
    assert "too little of the Moon's limb" in refusal(little)


def test_a_radius_known_beforehand_helps_a_short_limb():
    photo = picture(axis=(0.4, 1.9), gain=1.0, noise=0.006)
    without, with_hint = (abs(errors(photo, **hint)[0][2]) for hint in ({}, {"radius_hint": RADIUS}))
    assert with_hint < max(without, 0.3)
    assert "no disc" in refusal(picture(**PHASES["full"]), radius_hint=2 * RADIUS)


def landscape():
    """A bright sky above dark, rough ground with round trees."""
    random = np.random.default_rng(4)
    y, x = np.mgrid[:300, :400] / 300
    ridge = 0.55 + 0.1 * np.cumsum(random.standard_normal(400)) / 20
    rough = ndimage.gaussian_filter(random.standard_normal(y.shape), 2) * 3
    image = np.where((y > ridge)[..., None], np.stack([0.12 + 0.06 * rough, 0.2 + 0.07 * rough, 0.06 + 0 * y], -1), 0.5)
    for _ in range(20):
        row, column, radius = random.uniform((0.5, 0, 0.02), (1, 1.3, 0.08))
        image[np.hypot(y - row, x - column) < radius] = random.uniform(0.02, 0.3)
    return np.clip(image + 0.01 * random.standard_normal(image.shape), 0, 1)


def empty(kind):
    random, shape = np.random.default_rng(0), (300, 400, 3)
    return {
        "black": np.zeros(shape),
        "noise": np.clip(0.02 * random.standard_normal(shape), 0, 1),
        "even": np.full(shape, 0.3),
        "ramp": np.broadcast_to(np.linspace(0, 1, 400)[None, :, None], shape),
        "one pixel": np.ones((1, 1, 3)),
        "stars": ndimage.gaussian_filter((random.random(shape[:2]) > 0.999) * 50.0, 1.5)[..., None] * np.ones(3),
        "landscape by day": landscape(),
    }[kind]


@pytest.mark.parametrize("kind", ["black", "noise", "even", "ramp", "one pixel", "stars", "landscape by day"])
def test_a_picture_without_a_moon_is_refused(kind):
    assert "no disc that could be the Moon" in refusal(encoded(np.clip(empty(kind), 0, 1)))


def composite():
    """Four phases of one Moon, in two lines that are not quite level."""
    tiles = [
        picture(shape=(240, 260), centre=(120.0 + 4 * k, 130.0 - 5 * k), radius=80.0, seed=k, **PHASES[phase])
        for k, phase in enumerate(["full", "partial", "crescent", "total, beside the axis"])
    ]
    lines = [np.concatenate([tile.pixels for tile in pair], 1) for pair in (tiles[:2], tiles[2:])]
    return photo_of(np.concatenate(lines))


def test_several_discs_are_counted_and_one_can_be_chosen_in_reading_order():
    photo = composite()
    assert "4 discs" in refusal(photo) and "--disc" in refusal(photo)
    assert "no disc 5" in refusal(photo, disc=5) and "no disc 0" in refusal(photo, disc=0)
    places = [(120, 130), (124, 125 + 260), (128 + 240, 120), (132 + 240, 115 + 260)]
    for number, place in enumerate(places, 1):
        off, _ = errors(photo, place, 80.0, disc=number)
        assert np.abs(off).max() < 0.5


def test_hopeless_blur_and_tiny_discs_are_refused_with_their_numbers():
    assert "too blurred" in refusal(picture(axis=(0.0, 9.0), gain=0.8, blur=13.0))
    assert "radius of 14 pixels" in refusal(picture(axis=(0.0, 9.0), gain=0.8, radius=14.0))


def test_pictures_whose_white_is_not_full_scale_are_recognised_as_overexposed():
    photo = picture(axis=(0.5, 2.0), gain=300.0)
    dimmed = replace(photo, pixels=0.8 * photo.pixels, saturated=np.zeros_like(photo.saturated))
    off, _ = errors(dimmed)
    assert np.abs(off).max() < 1.0


def test_real_discs_through_one_telescope_are_equally_large(shared):
    night = shared / "photos" / "2015-09-28-canon-t2i"
    found = [register(read_photo(night / f"IMG_{number}.jpg")) for number in (8672, 8742, 8757)]
    assert np.ptp([disc.radius for disc in found]) < 1.2  # of 770: the Moon sank and receded, by 0.6 in that time
    thin = register(read_photo(night / "IMG_8599.jpg"))
    assert abs(thin.radius - found[0].radius) < 3 * thin.radius_error


def test_real_composite_has_four_equal_discs(shared):
    photo = read_photo(shared / "photos" / "2022-05-16-newtonian" / "final.png")
    assert "4 discs" in refusal(photo)
    radii = [register(photo, disc=number).radius for number in (1, 2, 3, 4)]
    assert np.ptp(radii) < 0.5


def test_real_city_by_night_is_refused(shared):
    assert "no disc" in refusal(read_photo(shared / "photos" / "2025-09-07-phone" / "IMG20250907231612.jpg"))
