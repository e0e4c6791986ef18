"""What the files say of the exposures of a camera's photographs, relative to each other."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inverse.photo_model import FREE_EXPOSURE

STATED = 0.03  # ln: shutters are as good
OTHER_ISO = 0.2  # ln: steps of ISO are not


@dataclass(frozen=True)
class Exposed:
    """The exposure of one photograph.

    - `camera`: what shares a sensitivity, a white balance and a tone curve with others; None for what is alone.
    - `relative`: log of the exposure against others of that camera; 0 where nothing is known.
    - `width`: standard deviation of `relative`.
    """

    camera: object
    relative: float
    width: float


def log_exposures(photos: Sequence) -> list[Exposed]:
    """Exposures of photographs, and of profiles, which are each alone."""
    cameras = [_camera(photo) for photo in photos]
    found = []
    for photo, camera in zip(photos, cameras, strict=True):
        alike = [other for other, its in zip(photos, cameras, strict=True) if its == camera]
        if camera is None or len(alike) == 1:
            found.append(Exposed(None, 0.0, STATED))
        elif photo.exposure_s is None or photo.iso is None:
            found.append(Exposed(camera, 0.0, FREE_EXPOSURE))
        else:
            usual = Counter(other.iso for other in alike).most_common(1)[0][0]
            # A telescope says nothing of its focal ratio, and keeps it.
            relative = np.log(photo.exposure_s * photo.iso / (photo.f_number or 1.0) ** 2)
            found.append(Exposed(camera, float(relative), STATED if photo.iso == usual else OTHER_ISO))
    return found


def _camera(photo) -> object:
    name = getattr(photo, "camera", None)
    return None if name is None else (name, photo.focal_length_mm, photo.tone_curve, photo.f_number is None)
