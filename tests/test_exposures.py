"""What files say of exposures: relative within a camera, unknown between cameras."""

from types import SimpleNamespace

import numpy as np
import pytest

from eclipsejax.errors import InputError
from inverse import cli
from inverse.exposures import (
    ERRORS,
    FREE_TINT,
    OTHER_ISO,
    STATED,
    WRITTEN_TINT,
    believed,
    check_exposure,
    log_exposures,
)  # fmt: skip
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


def test_what_is_believed_of_exposures_is_a_choice():
    photos = [photo(f_number=8.0), photo(f_number=8.0, exposure_s=1.0, iso=100.0), photo(camera="5D", f_number=11.0)]
    stated = log_exposures(photos)
    assert believed(photos, stated, "relative") == stated
    free = believed(photos, stated, "free")
    assert [(one.relative, one.width) for one in free[:2]] == [(0.0, FREE_EXPOSURE)] * 2
    assert free[2] == stated[2]  # its camera's sensitivity is free as it is
    known = believed(photos, stated, 0.25)
    assert [one.error for one in known] == [0.25] * 3 and [one.width for one in known] == [one.width for one in stated]
    assert known[1].relative - known[0].relative == pytest.approx(stated[1].relative - stated[0].relative)
    # Sunny 16, for the Moon: 1/ISO s at f/11 has it at 0.18 of full scale.
    moon = [photo(camera="5D", f_number=11.0, exposure_s=1.0 / 400.0)]
    assert np.exp(believed(moon, log_exposures(moon), 0.25)[0].relative) == pytest.approx(0.18)


def test_an_exposure_that_is_not_stated_cannot_be_known():
    dark = [photo(path="moon.jpg", iso=None)]
    with pytest.raises(InputError, match=r"moon.jpg does not state its focal ratio nor its ISO, .* leave out --exp"):
        believed(dark, log_exposures(dark), 0.5)


@pytest.mark.parametrize("exposure", ["known", 0.0, 10.0, True, None, float("nan")])
def test_what_is_no_exposure_is_refused(exposure):
    with pytest.raises(InputError, match="is neither relative nor free"):
        check_exposure(exposure)


def test_the_command_knows_the_words(capsys):
    assert (cli.RELATIVE, cli.FREE, cli.ERRORS) == ("relative", "free", ERRORS)
    assert cli.main(["moon.jpg", "--exposure", "known"]) == 2
    assert "--exposure" in capsys.readouterr().err
    assert cli.main(["catalogue.csv", "--archive", "out", "--exposure", "free"]) == 2
    assert "not --exposure" in capsys.readouterr().err
