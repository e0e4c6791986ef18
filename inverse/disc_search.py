"""Where discs may be in a picture, to about a pixel of a reduced copy of it.

A bright disc on a dark sky has an edge whose gradient points to one centre. So does the edge of the Earth's shadow on the
Moon, but there the dark side is the inside: the sign of the gradient tells the two apart, and no circle through the
terminator survives the search. What is left is decided by how much of the circle is edge.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from skimage import feature, measure

LONG_SIDE = 640  # of the reduced copy [pixel]
SMALL = 30.0  # radius in the reduced copy below which a disc is looked at again in a close-up [pixel]
CLOSE_UPS = 6  # bright spots looked at again
ANGLE_BINS = 72  # in which the limb is looked for: 5 degrees each
TRIPLES = 40000  # random triples of edge points: a limb that makes up 10 % of all edges is hit 40 times
SCORED = 300  # of the triples that pass the test of their normals


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


def reduced(image: np.ndarray, factor: int) -> np.ndarray:
    """Mean over squares of `factor` pixels; rows and columns that do not fill a square are dropped."""
    rows, columns = (n // factor for n in image.shape)
    return image[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor).mean((1, 3))


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


def through(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre (circle, 2) and radius (circle,) of the circles through triples of points (circle, 3, 2); NaN if collinear."""
    first = points[:, 0]
    u, v = points[:, 1] - first, points[:, 2] - first
    cross = 2 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    cross = np.where(np.abs(cross) < 1e-9, np.nan, cross)
    uu, vv = (u**2).sum(-1), (v**2).sum(-1)
    offset = np.stack([v[:, 1] * uu - u[:, 1] * vv, u[:, 0] * vv - v[:, 0] * uu], -1) / cross[:, None]
    return first + offset, np.hypot(offset[:, 0], offset[:, 1])


def support(points, normals, strengths, centre, radius, tolerance=0.012) -> tuple[np.ndarray, float, np.ndarray]:
    """Edge points on a circle with the bright side inside: their mask, the fraction of bins of angle, weight of each bin."""
    towards = centre - points
    distance = np.hypot(towards[:, 0], towards[:, 1])
    cosine = (towards * normals).sum(-1) / np.maximum(distance, 1e-9)
    on = (np.abs(distance - radius) < max(1.2, tolerance * radius)) & (cosine > 0.88)
    angle = np.arctan2(towards[on, 0], towards[on, 1])
    bins = ((angle / (2 * np.pi) + 0.5) * ANGLE_BINS).astype(int) % ANGLE_BINS
    weight = np.zeros(ANGLE_BINS)
    np.maximum.at(weight, bins, strengths[on])
    return on, float((weight > 0).mean()), weight


def best_circle(points, normals, strengths, shape, random) -> tuple[np.ndarray, float, float] | None:
    """The circle with the most edge on it, bright side inside: centre (2,), radius, coverage. RANSAC on triples of edges."""
    if len(points) < 8:
        return None
    chosen = random.choice(len(points), (TRIPLES, 3), p=strengths / strengths.sum())
    centre, radius = through(points[chosen])
    with np.errstate(invalid="ignore"):
        towards = centre[:, None] - points[chosen]
        cosine = (towards * normals[chosen]).sum(-1) / radius[:, None]
        plausible = (cosine > 0.9).all(1) & (radius > 4) & (radius < max(shape))
    good = np.flatnonzero(plausible)
    if not good.size:
        return None
    good = good[np.argsort(-cosine[good].min(1))][:: max(1, good.size // SCORED)]
    typical = np.percentile(strengths, 75)

    def score(circle):
        weight = support(points, normals, strengths, *circle)[2]
        return np.minimum(weight / typical, 1.5).sum()

    circle = max(((centre[i], float(radius[i])) for i in good), key=score)
    for tolerance in (0.02, 0.012, 0.012):
        on = support(points, normals, strengths, *circle, tolerance)[0]
        if on.sum() < 6:
            return None
        model = measure.CircleModel.from_estimate(points[on])
        if not model or not np.isfinite(model.radius):
            break
        if score((np.array(model.center), float(model.radius))) >= 0.95 * score(circle):
            circle = np.array(model.center), float(model.radius)
    return *circle, support(points, normals, strengths, *circle)[1]


def discs_in(image: np.ndarray, random, most: int = 40) -> list[Circle]:
    """Discs in one image, the best first, none overlapping a better one."""
    points, normals, strengths = edge_points(stretched(image))
    found = []
    while len(found) < most:
        circle = best_circle(points, normals, strengths, image.shape, random)
        if circle is None or circle[2] < 0.1:
            break
        centre, radius, coverage = circle
        found.append(Circle(float(centre[0]), float(centre[1]), radius, coverage))
        far = np.hypot(*(points - centre).T) > 1.1 * radius
        points, normals, strengths = points[far], normals[far], strengths[far]
        if coverage < 0.5 * found[0].coverage:
            break
    return found


def search(luminance: np.ndarray) -> list[Circle]:
    """All discs that a picture of linear luminance (row, column) may hold, the best first.

    The whole picture is searched in a copy of about 640 pixels, small bright spots in close-ups, so the time hardly grows
    with the number of pixels. The random draws have a fixed seed: the same picture gives the same answer.
    """
    random = np.random.default_rng(20220516)
    factor = max(1, round(max(luminance.shape) / LONG_SIDE))
    copy = reduced(luminance, factor)
    found = [enlarged(circle, factor) for circle in discs_in(copy, random)]
    if factor > 1 and (not found or found[0].coverage < 0.3 or found[0].radius < SMALL * factor):
        for rows, columns in bright_spots(copy, factor, luminance.shape):
            part = luminance[rows, columns]
            again = max(1, round(max(part.shape) / LONG_SIDE))
            for circle in discs_in(reduced(part, again), random, most=1):
                circle = enlarged(circle, again)
                circle = Circle(circle.row + rows.start, circle.column + columns.start, circle.radius, circle.coverage)
                found = [c for c in found if c.distance(circle) > 0.5 * max(c.radius, circle.radius)] + [circle]
    return sorted(found, key=lambda circle: -circle.coverage)


def enlarged(circle: Circle, factor: int) -> Circle:
    """The circle of a reduced image in pixels of the image it was made from (pixel centres at integers)."""
    shift = (factor - 1) / 2
    return Circle(circle.row * factor + shift, circle.column * factor + shift, circle.radius * factor, circle.coverage)


def bright_spots(copy: np.ndarray, factor: int, shape: tuple[int, ...]) -> list[tuple[slice, slice]]:
    """Squares of the full picture around the brightest compact spots of its reduced copy."""
    image = ndimage.gaussian_filter(copy, 0.7)
    sky = np.median(image)
    spots = []
    for fraction in (0.6, 0.3, 0.1):
        regions = measure.regionprops(measure.label(image > sky + fraction * (image.max() - sky)), image)
        regions = [r for r in regions if r.area >= 3 and max(r.bbox[2] - r.bbox[0], r.bbox[3] - r.bbox[1]) < 4 * SMALL]
        for region in sorted(regions, key=lambda r: -r.area * r.intensity_mean)[:CLOSE_UPS]:
            row, column = ((np.add(region.bbox[:2], region.bbox[2:]) - 1) / 2 + 0.5) * factor
            half = 1.5 * max(region.bbox[2] - region.bbox[0], region.bbox[3] - region.bbox[1], 4) * factor
            spots.append(tuple(slice(max(0, int(c - half)), min(n, int(c + half))) for c, n in zip((row, column), shape, strict=True)))
    return list(dict.fromkeys((s[0].start, s[0].stop, s[1].start, s[1].stop) for s in spots)) and spots[:CLOSE_UPS]
