"""Where the posterior goes far from an optimum: the best limbs and cameras under cloud tops lower and higher.

Low clouds take light that would be faint anyway, high ones most of what there is, and the camera makes up for it: the
posterior bends along their top, with exposure, black and tone curve. From the optimum alone the steps of
`inverse.posterior` did not find these there. Of seven drawn photographs that ruled out the true, low clouds, four were
left with squares of 2 to 2600 too many at the true limb, where a full descent gives 10 to 21 more than the optimum's.
"""

import numpy as np

from inverse.likelihood import Likelihood
from inverse.map_estimate import Optimum, descend
from inverse.threads import side_by_side

ALONG = "clouds.top"
TOPS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # z of the tops
APART = 0.4  # z of the top between two points at least
LIKELY = 30.0  # above the optimum's cost, at most
ROUGH = 1e-3  # relative change of the cost at which these descents end


def ridge(likelihood: Likelihood, optimum: Optimum) -> list[Optimum]:
    """The best points with each of the tops, from the optimum on to either side, as far as they are likely."""
    place = [parameter.name for parameter in likelihood.parameters].index(ALONG)
    free = np.delete(np.arange(optimum.z.size), place)

    def along(tops):
        found, last = [], optimum
        for top in tops:
            start = last.z.copy()
            start[place] = top
            last = descend(likelihood, start, ROUGH, free)
            if last.cost > optimum.cost + LIKELY:
                break
            found.append(last)
        return found

    higher, lower = TOPS[TOPS > optimum.z[place] + APART], TOPS[TOPS < optimum.z[place] - APART][::-1]
    return [point for side in side_by_side(along, [higher, lower]) for point in side]
