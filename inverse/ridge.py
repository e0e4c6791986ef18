"""Where the posterior goes far from an optimum: the best limbs and cameras with more and less of dust and clouds.

Low clouds take light that would be faint anyway, high ones most of what there is, and so does dust; the camera makes up
for it, and the posterior bends along them, with exposure, black and tone curve. From the optimum alone the steps of
`inverse.posterior` did not find these there. Of seven drawn photographs that ruled out the true, low clouds, four were
left with squares of 2 to 2600 too many at the true limb, where a full descent gives 10 to 21 more than the optimum's.
Proposals that know the ridge as well (`inverse.answer`) agree on its ends: of one photograph, drawn from by three
seeds, clouds below 3.5 km had chances of 0.012 to 0.034 without and of 0.039 to 0.042 with it.
"""

import numpy as np

from inverse.likelihood import Likelihood
from inverse.map_estimate import CLOSE, Optimum, descend
from inverse.threads import side_by_side

ALONG = ("clouds.top", "dust.extinction", "clouds.cover")
PLACES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # z of these
APART = 0.4  # between two points, at least
LIKELY = 30.0  # above the optimum's cost, at most
BESIDE = 12.0  # the same, of points whose surroundings are looked at
STEEP = 10.0  # rise from one point to the next above which another descent is tried, with all else left where it was


def ridge(likelihood: Likelihood, optimum: Optimum) -> list[Optimum]:
    """The best points with each of these values of one quantity, from the optimum on as far as they are likely."""
    names = [parameter.name for parameter in likelihood.parameters]
    numbers = [names.index(name) for name in ALONG]
    higher = [(number, PLACES[PLACES > optimum.z[number] + APART]) for number in numbers]
    lower = [(number, PLACES[PLACES < optimum.z[number] - APART][::-1]) for number in numbers]

    def along(way):
        number, places = way
        free = np.delete(np.arange(optimum.z.size), number)
        found, last = [], optimum

        def there(place, direction):
            start = last.z + (place - last.z[number]) * direction
            start[number] = place
            return descend(likelihood, start, CLOSE, free)

        for place in places:
            end = there(place, last.covariance[:, number] / last.covariance[number, number])
            if end.cost > last.cost + STEEP:
                end = min(end, there(place, 0.0), key=lambda end: end.cost)
            if end.cost > optimum.cost + LIKELY:
                break
            found.append(end)
            last = end
        return found

    return [point for points in side_by_side(along, higher + lower) for point in points]
