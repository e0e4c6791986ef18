"""What an uneven limb does to the light of its shadow, as an even one's is computed.

Every sharp feature of the light against the offset from the axis comes from a bend of the temperature profile, the
tropopause above all: a step of 5 % where the Sun's edge touches the caustic of its rays, 0.8' farther out for every
kelvin that the limb is warmer. The Earth's limb is 50 K warmer and its tropopause 8 km higher in the tropics than at a
pole: 12 K of spread alone halve the step. A fit that believes in it finds the temperature of the limb to half a kelvin
in whatever noise looks like the step, or finds several temperatures.
"""

import numpy as np
from scipy.interpolate import BSpline

ARCMIN = np.radians(1.0 / 60.0)
WIDTH = 2.0 * ARCMIN  # features narrower than some six times this are washed out
KNOTS = 1.5 * ARCMIN
OUTER = np.array([30.0, 38.0]) * ARCMIN  # as far out as that: then the umbra has its edge


def washing(offset: np.ndarray) -> np.ndarray:
    """A matrix (entry, entry) that smooths log light over the entries of a table.

    Splines with a penalty on their third differences (Eilers & Marx 1996), so that parabolas pass unchanged; even about
    the axis, as the light is.

    - `offset`: of the entries from the axis [rad], ascending; negative beyond it.
    """
    weight = np.abs(np.gradient(offset))
    away = np.abs(offset)
    smooth = _smoothing(away, np.where(away < OUTER[1], weight, 0.0))
    share = np.interp(away, OUTER, [1.0, 0.0])[:, None]
    return share * smooth + (1.0 - share) * np.eye(len(offset))


def _smoothing(offset: np.ndarray, weight: np.ndarray) -> np.ndarray:
    near, far = offset[weight > 0].min(initial=OUTER[1]), offset.max()
    begin = -far if near < WIDTH else near  # beyond the axis everything comes once more
    count = int(np.ceil((far - begin) / KNOTS)) + 1
    knots = begin + KNOTS * np.arange(-3, count + 4)

    def basis(at):
        return BSpline.design_matrix(np.clip(at, begin, far), knots, 3).toarray()

    here = basis(offset)
    both = np.concatenate([here, basis(-offset)]) if begin < 0.0 else here
    right = both.T * np.resize(weight, len(both))
    fitted = right @ both
    rough = np.diff(np.eye(fitted.shape[0]), n=3, axis=0)
    penalty = KNOTS * (WIDTH / KNOTS) ** 6 * rough.T @ rough
    smooth = here @ np.linalg.solve(fitted + penalty, right)
    return smooth.reshape(len(offset), -1, len(offset)).sum(axis=1)  # either side of the axis knows the same entry
