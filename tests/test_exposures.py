"""What files say of exposures: relative within a camera, unknown between cameras."""

from types import SimpleNamespace

import numpy as np
import pytest

from inverse.exposures import FREE_TINT, OTHER_ISO, STATED, WRITTEN_TINT, log_exposures
from inverse.photo_model import FREE_EXPOSURE, TINT


def photo(**given):
    return SimpleNamespace(
        **{"camera": "T2i", "focal_length_mm": None, "tone_curve": "srgb", "exposure_s": 0.5, "iso": 400.0,
           "f_number": None, "balanced_once": None, "balance": None, **given}
    )  # fmt: skip


def test_shutter_and_iso_order_the_photographs_of_a_camera():
    one, two, three = log_exposures([photo(), photo(exposure_s=1.0), photo(exposure_s=1.0, iso=800.0)])
    assert two.relative - one.relative == pytest.approx(np.log(2.0))
    assert three.relative - one.relative == pytest.approx(np.log(4.0))
    assert one.camera == two.camera == three.camera is not None
    assert (one.width, two.width, three.width) == (STATED, STATED, OTHER_ISO)


def test_a_wider_stop_is_more_light():
    one, two = log_exposures([photo(f_number=8.0), photo(f_number=4.0)])
    assert two.relative - one.relative == pytest.approx(np.log(4.0))


def test_other_cameras_styles_and_lenses_share_nothing():
    found = log_exposures([photo(), photo(camera="5D"), photo(focal_length_mm=400.0), photo(tone_curve="linear")])
    assert all(one.camera is None for one in found)


def test_what_is_not_stated_is_free():
    known, unknown = log_exposures([photo(), photo(exposure_s=None)])
    assert known.camera == unknown.camera
    assert (unknown.relative, unknown.width) == (0.0, FREE_EXPOSURE)
    assert log_exposures([photo(camera=None), photo(camera=None)])[0].camera is None


def test_a_balance_chosen_for_each_picture_ties_no_colours():
    """But where the camera wrote it down, or it was set by hand, or the file is the sensor's own."""
    for facts, width in (
        ({"balanced_once": True}, TINT), ({"balanced_once": False}, FREE_TINT), ({}, FREE_TINT),
        ({"balanced_once": False, "tone_curve": "linear"}, TINT),
    ):  # fmt: skip
        assert all(one.tint == width and one.balance == (0.0, 0.0) for one in log_exposures([photo(**facts)] * 2))
    white, grey, red, unknown = log_exposures(
        [photo(balance=(0.7, 0.5)), photo(balance=(0.7, 0.4)), photo(balance=(0.4, 0.8)), photo(balanced_once=False)]
    )
    assert white.balance == pytest.approx((0.0, 0.0)) and grey.balance == pytest.approx((0.0, -0.1))
    assert red.balance == pytest.approx((-0.3, 0.3)) and red.tint == WRITTEN_TINT
    assert unknown.balance == (0.0, 0.0) and unknown.tint == FREE_TINT
    assert log_exposures([photo(balanced_once=False)])[0].tint == TINT  # alone, its own balance is free
