"""What an uneven limb does to the light of its shadow, as an even one's is computed.

Every sharp feature of the light against the offset from the axis comes from a bend of the temperature profile, the
tropopause above all: a step of 5 % where the Sun's edge touches the caustic of its rays, 0.8' farther out for every
kelvin that the limb is warmer. The Earth's limb is 50 K warmer and its tropopause 8 km higher in the tropics than at a
pole: 12 K of spread alone halve the step. A fit that believes in it finds the temperature of the limb to half a kelvin
in whatever noise looks like the step, or finds several temperatures.
"""

import numpy as np

WIDTH = np.radians(3.0 / 60.0)  # features narrower than some six times this are washed out
# Beyond these offsets they are not: there the edge of the umbra is sharp, for any limb.
TAPER = np.radians(np.array([30.0, 38.0]) / 60.0)


def washing(offset: np.ndarray) -> np.ndarray:
    """A matrix (entry, entry) that smooths log light over the entries of a table.

    The smoothest curve near the entries, in its third derivative (Whittaker 1923): parabolas pass unchanged.

    - `offset`: of the entries from the axis [rad], ascending; negative beyond it.
    """
    count = len(offset)
    spacing = np.gradient(offset)
    third = np.eye(count)
    place = offset
    for order in range(1, 4):
        third = np.diff(third, axis=0) / (place[order:] - place[:-order])[:, None] * order
    middle = np.convolve(offset, np.full(4, 0.25), mode="valid")
    taper = np.clip((TAPER[1] - middle) / (TAPER[1] - TAPER[0]), 0.0, 1.0)
    cost = (WIDTH * taper) ** 6 * np.convolve(spacing, np.full(4, 0.25), mode="valid")
    weights = np.diag(spacing)
    return np.linalg.solve(weights + third.T @ (cost[:, None] * third), weights)
