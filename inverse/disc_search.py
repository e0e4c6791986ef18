"""Where discs may be in a picture, to about a pixel of a reduced copy of it.

A bright disc on a dark sky has an edge whose gradient points to one centre. So does the edge of the Earth's
shadow on the Moon, but there the dark side is the inside: the sign of the gradient tells the two apart, and no
circle through the terminator survives the search. What is left is decided by how much of the circle is edge.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from skimage import feature, measure

LONG_SIDE = 640  # of the reduced copy [pixel]
SMALL = 30.0  # radius in the reduced copy below which a disc is looked at again in a close-up [pixel]
CLOSE_UPS = 6  # bright spots looked at again
ANGLE_BINS = 72  # in which the limb is looked for: 5 degrees each
TRIPLES = 40000  # random triples of edge points
DOUBTFUL = 12  # discs with less than half of their edge, after which the search ends
SCORED = 200  # of the triples that pass the test of their normals


@dataclass(frozen=True)
class Circle:
    """Circle in pixels of the full picture; `coverage` is the fraction of it that is the edge of something brighter."""

    row: float
    column: float
    radius: float
    coverage: float = 0.0

    def distance(self, other: "Circle") -> float:
        """Distance of the centres [pixel]."""
        return float(np.hypot(self.row - other.row, self.column - other.column))

    def moved(self, rows: float, columns: float) -> "Circle":
        """The same circle with its centre shifted [pixel]."""
        return replace(self, row=self.row + rows, column=self.column + columns)


def search(luminance: np.ndarray) -> list[Circle]:
    """All discs that a picture of linear luminance (row, column) may hold, those with most edge first.

    The whole picture is searched in a copy of about 640 pixels, small bright spots in close-ups, so the time hardly
    grows with the number of pixels. The random draws have a fixed seed: the same picture gives the same answer.
    """
    random = np.random.default_rng(20220516)
    factor = max(1, round(max(luminance.shape) / LONG_SIDE))
    if min(luminance.shape) < 4 * factor:
        return []
    copy = reduced(luminance, factor)
    found = [enlarged(circle, factor) for circle in discs_in(copy, random)]
    if factor > 1 and (not found or found[0].coverage < 0.3 or found[0].radius < SMALL * factor):
        for rows, columns in bright_spots(copy, factor, luminance.shape):
            part = luminance[rows, columns]
            again = max(1, round(max(part.shape) / LONG_SIDE))
            for circle in discs_in(reduced(part, again), random, most=1):
                circle = enlarged(circle, again).moved(rows.start, columns.start)
                same = [c for c in found if c.distance(circle) < 0.5 * max(c.radius, circle.radius)]
                if all(circle.coverage > 0.8 * c.coverage for c in same):
                    found = [c for c in found if c not in same] + [circle]
    return sorted(found, key=lambda circle: -circle.coverage)


def reduced(image: np.ndarray, factor: int) -> np.ndarray:
    """Mean over squares of `factor` pixels; rows and columns that do not fill a square are dropped."""
    rows, columns = (n // factor for n in image.shape)
    return image[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor).mean((1, 3))


def enlarged(circle: Circle, factor: int) -> Circle:
    """The circle of a reduced image in pixels of the image it was made from (pixel centres at integers)."""
    shift = (factor - 1) / 2
    row, column = circle.row * factor + shift, circle.column * factor + shift
    return Circle(row, column, circle.radius * factor, circle.coverage)


def stretched(image: np.ndarray) -> np.ndarray:
    """Brightness on a scale that is linear in the noise and logarithmic above it: umbra and crescent both show."""
    sky = np.percentile(image, 20)
    step = np.diff(image, axis=1)[image[:, 1:] <= np.percentile(image, 60)]
    noise = 1.4826 * np.median(np.abs(step)) / np.sqrt(2) if step.size else 0.0
    # The floor keeps the quantisation of a sky that was clipped to black from being taken for signal.
    unit = max(4 * noise, 5e-4 * (image.max() - sky), 1e-12)
    return np.arcsinh((image - sky) / unit)


def edge_points(image: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges of a stretched image: positions (edge, 2), unit vectors to the bright side (edge, 2), strengths (edge,)."""
    smooth = ndimage.gaussian_filter(image, 1.5)
    gradient = np.stack([ndimage.sobel(smooth, axis) / 8 for axis in (0, 1)], -1)
    strength = np.hypot(gradient[..., 0], gradient[..., 1])
    high = max(6 * np.median(strength), 0.12 * strength.max())
    # canny's own gradient is eight times ours.
    edges = feature.canny(image, sigma=1.5, low_threshold=3.2 * high, high_threshold=8 * high)
    strength = strength[edges]
    return np.argwhere(edges).astype(float), gradient[edges] / np.maximum(strength, 1e-12)[:, None], strength


def triples(points: np.ndarray, strengths: np.ndarray, random) -> np.ndarray:
    """Random triples of edge points (triple, 3), each within a square; strong edges and all sizes of square alike.

    Drawn from the whole picture, three points of a small disc among the edges of clouds would hardly ever meet.
    """
    drawn = []
    extent = float(np.ptp(points, axis=0).max()) + 1
    sizes = np.geomspace(16, max(extent, 17), 6)
    for size in sizes:
        cell = np.floor((points + size * random.random(2)) / size).astype(int)
        number = cell[:, 0] * (int(extent / size) + 3) + cell[:, 1]
        order = np.argsort(number, kind="stable")
        _, start, count = np.unique(number[order], return_index=True, return_counts=True)
        group = np.repeat(np.arange(len(count)), count)
        first = random.choice(len(points), TRIPLES // len(sizes), p=strengths[order] / strengths.sum())
        others = start[group[first], None] + (random.random((len(first), 2)) * count[group[first], None]).astype(int)
        drawn.append(order[np.column_stack([first, others])])
    return np.concatenate(drawn)


def through(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres (circle, 2) and radii (circle,) of circles through triples of points (circle, 3, 2); NaN on a line."""
    first = points[:, 0]
    u, v = points[:, 1] - first, points[:, 2] - first
    cross = 2 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    cross = np.where(np.abs(cross) < 1e-9, np.nan, cross)
    uu, vv = (u**2).sum(-1), (v**2).sum(-1)
    offset = np.stack([v[:, 1] * uu - u[:, 1] * vv, u[:, 0] * vv - v[:, 0] * uu], -1) / cross[:, None]
    return first + offset, np.hypot(offset[:, 0], offset[:, 1])


def support(points, normals, strengths, centre, radius, tolerance=0.012) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the edge points on a circle and bright inside, and the strongest of them in each bin of angle."""
    margin = max(1.2, tolerance * radius)
    reach = np.searchsorted(points[:, 0], [centre[0] - radius - margin, centre[0] + radius + margin])
    part = slice(*reach)  # points come row by row
    towards = centre - points[part]
    distance = np.hypot(towards[:, 0], towards[:, 1])
    cosine = (towards * normals[part]).sum(-1) / np.maximum(distance, 1e-9)
    on = np.flatnonzero((np.abs(distance - radius) < margin) & (cosine > 0.88))
    angle = np.arctan2(towards[on, 0], towards[on, 1])
    bins = ((angle / (2 * np.pi) + 0.5) * ANGLE_BINS).astype(int) % ANGLE_BINS
    on += reach[0]
    strongest = np.zeros(ANGLE_BINS)
    np.maximum.at(strongest, bins, strengths[on])
    return on, strongest


def best_circle(points, normals, strengths, shape, random) -> Circle | None:
    """The circle with the most edge on it, bright side inside: random triples of edges, then least squares."""
    if len(points) < 8:
        return None
    chosen = triples(points, strengths, random)
    centre, radius = through(points[chosen])
    with np.errstate(invalid="ignore"):
        towards = centre[:, None] - points[chosen]
        cosine = (towards * normals[chosen]).sum(-1) / radius[:, None]
        plausible = (cosine > 0.9).all(1) & (radius > 4) & (radius < max(shape))
    good = np.flatnonzero(plausible)
    if not good.size:
        return None
    # True circles are hit again and again: first those triples that many others agree with to a tenth of the radius.
    size = np.round(np.log(radius[good]) / 0.1)
    bins = np.column_stack([np.round(centre[good] / (0.1 * np.exp(0.1 * size))[:, None]), size])
    _, bin_of, count = np.unique(bins, axis=0, return_inverse=True, return_counts=True)
    good = good[np.argsort(-count[bin_of.ravel()], kind="stable")][:SCORED]
    typical = np.percentile(strengths, 75)

    def edge(centre, radius):
        return np.minimum(support(points, normals, strengths, centre, radius)[1] / typical, 1.5).sum()

    def score(centre, radius):
        # A circle in the texture of trees or clouds has as much edge just inside and outside of it.
        return edge(centre, radius) - 0.5 * (edge(centre, 0.8 * radius) + edge(centre, 1.25 * radius))

    best = good[int(np.argmax([score(centre[i], radius[i]) for i in good]))]
    middle, size = centre[best], float(radius[best])
    for tolerance in (0.02, 0.012, 0.012):
        on, _ = support(points, normals, strengths, middle, size, tolerance)
        if on.size < 6:
            return None
        model = measure.CircleModel.from_estimate(points[on])
        if not model or not np.isfinite(model.radius):
            break
        if score(np.asarray(model.center), float(model.radius)) >= 0.95 * score(middle, size):
            middle, size = np.asarray(model.center), float(model.radius)
    if score(middle, size) < 0.05 * ANGLE_BINS:
        return None
    coverage = float((support(points, normals, strengths, middle, size)[1] > 0).mean())
    return Circle(float(middle[0]), float(middle[1]), size, coverage)


def discs_in(image: np.ndarray, random, most: int = 40) -> list[Circle]:
    """Discs in one image, the best first; each is looked for in the edges that the ones before it left over."""
    points, normals, strengths = edge_points(stretched(image))
    found: list[Circle] = []
    while len(found) < most:
        circle = best_circle(points, normals, strengths, image.shape, random)
        if circle is None or circle.coverage < 0.1:
            break
        found.append(circle)
        if circle.coverage < 0.5 * found[0].coverage or (len(found) > DOUBTFUL and circle.coverage < 0.5):
            break
        far = np.hypot(*(points - (circle.row, circle.column)).T) > 1.1 * circle.radius
        points, normals, strengths = points[far], normals[far], strengths[far]
    return found


def bright_spots(copy: np.ndarray, factor: int, shape: tuple[int, ...]) -> list[tuple[slice, slice]]:
    """Squares of the full picture around the brightest compact spots of its reduced copy."""
    image = ndimage.gaussian_filter(copy, 0.7)
    sky = np.median(image)
    spots = []
    for fraction in (0.6, 0.3, 0.1):
        for region in measure.regionprops(measure.label(image > sky + fraction * (image.max() - sky)), image):
            side = max(region.bbox[2] - region.bbox[0], region.bbox[3] - region.bbox[1])
            if region.area < 3 or side > 4 * SMALL:
                continue
            middle = (np.add(region.bbox[:2], region.bbox[2:]) / 2 * factor).astype(int)
            half = int(1.5 * max(side, 4) * factor)
            rows, columns = (slice(max(0, c - half), min(n, c + half)) for c, n in zip(middle, shape, strict=True))
            spots.append((region.area * region.intensity_mean, rows, columns))
    spots.sort(key=lambda spot: -spot[0])
    return [(rows, columns) for _, rows, columns in spots[:CLOSE_UPS]]
