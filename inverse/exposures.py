"""What the files say of the exposures and white balances of a camera's photographs, relative to each other."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inverse.photo_model import FREE_EXPOSURE, TINT

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
    - `balance`: log gains of red and blue against others of that camera; 0 where nothing is known.
    - `tint`: standard deviation of either.
    """

    camera: object
    relative: float
    width: float
    balance: tuple[float, float] = (0.0, 0.0)
    tint: float = TINT


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
