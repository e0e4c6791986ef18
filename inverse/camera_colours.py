"""The spectral sensitivities of a camera, and the matrix from its channels to linear sRGB that follows from them."""

import numpy as np

from eclipsejax.errors import InputError
from eclipsejax.response import responses, srgb_from_camera

NO_CAMERAS = ("xyz", "srgb")
ASSUMED = "nikon_5100"  # of a camera of which nothing is known
ASSUMED_MATRIX = np.array([[1.7398, -0.6525, -0.0873], [-0.1553, 1.6422, -0.4869], [0.0592, -0.5461, 1.4870]])


def checked_response(response) -> str:
    """A camera's, by name or as the path of a table; `InputError` where there is none."""
    name = str(response)
    if name in NO_CAMERAS:
        raise InputError(f"{name} is no camera's response: give the path of a CSV table of its sensitivities.")
    responses(name, np.array([550.0]))
    return name


def colour_matrix_of(response: str) -> np.ndarray:
    """From a camera's channels to linear sRGB (3, 3), as `eclipsejax.response.srgb_from_camera` has it."""
    return ASSUMED_MATRIX if response == ASSUMED else srgb_from_camera(response)  # colour-science loads for a second
