"""What the files say of the exposures and white balances of a camera's photographs, relative to each other.

And, where that is believed, of the light itself: what the full Moon would be by seconds, focal ratio and ISO.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eclipsejax.camera import LOONEY_11
from eclipsejax.errors import InputError
from inverse.photo_model import FREE_EXPOSURE, TINT

RELATIVE, FREE = "relative", "free"  # instead of the error of exposures
ERRORS = (0.05, 3.0)  # ln: from what no camera keeps to what is no knowledge
STATED = 0.03  # ln: shutters are as good
OTHER_ISO = 0.2  # ln: steps of ISO are not
WRITTEN_TINT = 0.06  # ln: of a balance that the camera wrote down; the matrix that went with it, it did not
FREE_TINT = 0.3  # ln: of a balance that the camera chose for each picture, and did not write down


@dataclass(frozen=True)
class Exposed:
    """The exposure and the white balance of one photograph.

    - `camera`: what shares a sensitivity, a white balance and a tone curve with others; None for what is alone.
    - `relative`: log of the exposure against others of that camera; 0 where nothing is known.
    - `width`: standard deviation of `relative`.
    - `error`: of the camera's sensitivity, where that is known: `relative` then is the log of what the full Moon would
      be [full scale].
    - `balance`: log gains of red and blue against others of that camera; 0 where nothing is known.
    - `tint`: standard deviation of either.
    """

    camera: object
    relative: float
    width: float
    balance: tuple[float, float] = (0.0, 0.0)
    tint: float = TINT
    error: float | None = None


def log_exposures(photos: Sequence) -> list[Exposed]:
    """Exposures of photographs, and of profiles, which are each alone."""
    cameras = [_camera(photo) for photo in photos]
    found = []
    for photo, camera in zip(photos, cameras, strict=True):
        alike = [other for other, its in zip(photos, cameras, strict=True) if its == camera]
        if camera is None or len(alike) == 1:
            found.append(Exposed(None, 0.0, STATED))
            continue
        colours = _balance(photo, alike)
        if photo.exposure_s is None or photo.iso is None:
            found.append(Exposed(camera, 0.0, FREE_EXPOSURE, *colours))
        else:
            usual = Counter(other.iso for other in alike).most_common(1)[0][0]
            # A telescope says nothing of its focal ratio, and keeps it.
            relative = np.log(photo.exposure_s * photo.iso / (photo.f_number or 1.0) ** 2)
            found.append(Exposed(camera, float(relative), STATED if photo.iso == usual else OTHER_ISO, *colours))
    return found


def believed(photos: Sequence, exposures: Sequence[Exposed], exposure: float | str) -> list[Exposed]:
    """Exposures as `exposure` of `fit_atmosphere` has them, from those of `log_exposures`."""
    if exposure == RELATIVE:
        return list(exposures)
    if exposure == FREE:
        return [one if one.camera is None else replace(one, relative=0.0, width=FREE_EXPOSURE) for one in exposures]
    pairs = zip(photos, exposures, strict=True)
    return [replace(one, relative=_of_full_moon(photo), error=float(exposure)) for photo, one in pairs]


def check_exposure(exposure: float | str) -> None:
    """`InputError` unless it is "relative", "free" or an error of exposures."""
    number = isinstance(exposure, int | float) and not isinstance(exposure, bool)
    if exposure not in (RELATIVE, FREE) and not (number and ERRORS[0] <= float(exposure) <= ERRORS[1]):
        raise InputError(
            f"The exposure {exposure!r} is neither {RELATIVE} nor {FREE}, nor an error from {ERRORS[0]:g} to "
            f"{ERRORS[1]:g}: give --exposure 0.25 if what shutter, focal ratio and ISO tell is known to 25 %."
        )


def _of_full_moon(photo) -> float:
    """Log of its value [full scale]."""
    facts = {"shutter": "exposure_s", "focal ratio": "f_number", "ISO": "iso"}
    missing = [name for name, field in facts.items() if getattr(photo, field, None) is None]
    if missing:
        raise InputError(
            f"{photo.path} does not state its {' nor its '.join(missing)}, and without them its exposure is not known: "
            "leave out --exposure, or give --exposure relative."
        )
    return float(np.log(LOONEY_11 * photo.exposure_s * photo.iso * (11.0 / photo.f_number) ** 2))


def _camera(photo) -> object:
    name = getattr(photo, "camera", None)
    return None if name is None else (name, photo.focal_length_mm, photo.tone_curve, photo.f_number is None)


def _balance(photo, alike: Sequence) -> tuple[tuple[float, float], float]:
    """`balance` and `tint` of a photograph among those of its camera."""
    if photo.tone_curve == "linear":  # sensors have none, and what is made of them by hand is made alike
        return (0.0, 0.0), TINT
    stated = [other.balance for other in alike if other.balance is not None]
    if photo.balance is not None:
        red, blue = np.subtract(photo.balance, np.median(stated, axis=0))
        return (float(red), float(blue)), WRITTEN_TINT
    return (0.0, 0.0), TINT if photo.balanced_once else FREE_TINT
