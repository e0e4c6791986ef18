"""The limb as a circle, to a fraction of a pixel.

The circle is the maximum of the sum of the log-likelihoods that the rays across it (`limb_rays`) give to the places of
their edges: a ray without an edge (the limb in deep umbra, or beyond the frame) says nothing, a ray with the wrong one
is outvoted.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage, optimize

from inverse.disc_search import Circle
from inverse.limb_rays import SAMPLES, SIGNIFICANT, Rays, edge_gain, rays_across

PLACES = 81  # positions of the edge tried on each ray
STAGES = 8  # of ever shorter rays, at most
OUTLIERS = 0.1  # of the rays may show something else than the limb
# Mountains on the limb: rms of their height, of the radius, and how far along the limb they stand together. From 18
# frames of 2015 through one telescope, which show the same profile again and again, with a hollow of 0.3 %.
RELIEF = 1.1e-3
RANGE = np.radians(15.0)


@dataclass(frozen=True)
class Limb:
    """A fitted limb; lengths in pixels.

    - `blur`: standard deviation of the edge; `rms`: scatter of the edge about the circle.
    - `fraction`: of the circle, seen as limb.
    - `centre_error` (of the worse coordinate), `radius_error`: standard errors.
    """

    circle: Circle
    blur: float
    rms: float
    fraction: float
    centre_error: float
    radius_error: float


@dataclass(frozen=True)
class Look:
    """What one set of rays says: gain of an edge at each place (ray, place), and the circle's shift that follows."""

    rays: Rays
    places: np.ndarray
    gain: np.ndarray
    blur: float
    scatter: np.ndarray
    shift: np.ndarray
    covariance: np.ndarray


def fit_limb(
    light: np.ndarray,
    saturated: np.ndarray,
    circle: Circle,
    radius_hint: float | None = None,
    *,
    reach: float = 0.12,
) -> Limb:
    """Limb in linear light (row, column), starting from a circle good to a few per cent of its radius.

    The rays shorten until their samples are half a pixel apart or as short as the blur allows. The standard errors
    hold the noise and the mountains; a tone curve that crushes the dark side of the edge is not in them.

    - `saturated`: 1 where the light is a lower bound, else 0 (row, column).
    - `radius_hint`: a radius known beforehand to 5 % [pixel].
    - `reach`: half the length of the first rays, of the radius.
    """
    half = reach * circle.radius
    blurs = half * np.geomspace(0.03, 0.35, 7)
    stage = 0
    while True:
        prior = None if radius_hint is None else (radius_hint - circle.radius, 0.05 * radius_hint)
        rays = rays_across(light, saturated, circle, half)
        look = look_at(rays, circle.radius, 0.6 if stage < 2 else 0.4, blurs, prior)
        circle = replace(circle.moved(*look.shift[:2].tolist()), radius=circle.radius + float(look.shift[2]))
        shortest = max(16.0, 8 * look.blur)
        settled = half <= 1.5 * shortest and np.abs(look.shift).max() < 0.3 * max(rays.u[1] - rays.u[0], 0.5)
        lost = circle.radius < 4 or look.shift[2] > 0.5 * circle.radius  # judged, and refused, by what was seen last
        stage += 1
        if settled or lost or stage == STAGES:
            return summary(look, circle)
        half = max(half / 2.5, shortest)
        # What is shorter than the samples cannot be told, nor what is longer than the rays.
        trial = look.blur * (np.geomspace(0.35, 1.6, 7) if stage == 1 else np.array([0.6, 0.8, 1.0, 1.25]))
        blurs = np.clip(trial, max(0.4, 1.4 * half / (SAMPLES - 1)), 0.35 * half)


def look_at(rays: Rays, radius: float, reach: float, blurs: np.ndarray, prior: tuple[float, float] | None) -> Look:
    """Best shift of the circle by one set of rays, tried up to `reach` of their length.

    An overexposed limb stands too far out, by an unknown part of the blur; one near the noise too far in, because
    the sky was clipped to black (0.5 to 1.3 blur x noise / height in simulated frames). Both keep a say, with an
    error of that size.
    """
    places = reach * rays.u[-1] * np.linspace(-1, 1, PLACES)
    gain, blur, contrast = edge_gain(rays, places, blurs)
    faint = blur * np.minimum(contrast, 1)
    white = np.where(rays.overexposed, blur, 0.0)
    relief = max(0.7 * RELIEF * radius, 0.15, 0.5 * (rays.u[1] - rays.u[0]))
    scatter = np.sqrt(relief**2 + (1.2 * faint) ** 2 + white**2)
    outward = np.where(rays.overexposed, white, -0.8 * faint)
    shift, covariance = best_shift(gain, rays, places, scatter, outward, prior)
    return Look(rays, places, gain, blur, scatter, shift, covariance)


def summary(look: Look, circle: Circle) -> Limb:
    """The limb as fitted, from the last look at it."""
    design = look.rays.design()
    off = look.places[look.gain.argmax(1)] - design @ look.shift
    limb = (look.gain.max(1) > SIGNIFICANT) & (np.abs(off) < np.maximum(4 * look.scatter, look.blur))
    rms = float(np.sqrt((off[limb] ** 2).mean())) if limb.any() else float("inf")
    excess = max(1.0, rms / float(np.sqrt((look.scatter[limb] ** 2).mean()))) if limb.any() else 1.0
    # Noise averages out along the limb; mountains, which stand in groups, do so far less.
    together = RANGE / look.rays.angle[1]
    mountains = (RELIEF * circle.radius) ** 2 * together * np.linalg.pinv(design[limb].T @ design[limb])
    # Where the limb is overexposed, all of it may stand further out, or less, than allowed for.
    white = 0.3 * look.blur * float(look.rays.overexposed[limb].mean()) if limb.any() else 0.0
    errors = np.sqrt(np.diag(excess**2 * look.covariance + mountains) + white**2)
    return Limb(
        circle=circle,
        blur=look.blur,
        rms=rms,
        fraction=float(limb.mean()),
        centre_error=float(errors[:2].max()),
        radius_error=float(errors[2]),
    )


def best_shift(
    gain: np.ndarray,
    rays: Rays,
    places: np.ndarray,
    scatter: np.ndarray,
    outward: np.ndarray,
    prior: tuple[float, float] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Shift (row, column) and growth of the circle [pixel] that most rays agree on, and its covariance (3, 3).

    - `scatter`, `outward`: error of the edge's place on each ray beyond the noise, and its mean [pixel].
    - `prior`: growth and its error, or None.
    """
    spacing = places[1] - places[0]
    likelihood = np.exp((gain - gain.max(1, keepdims=True)) / 2)
    likelihood /= likelihood.sum(1, keepdims=True)
    # Half-octave steps of the scatter share one convolution.
    width = 2.0 ** (np.round(2 * np.log2(np.maximum(scatter, 0.7 * spacing))) / 2)
    moved = np.round(outward / spacing).astype(int)
    for pair in sorted(set(zip(width, moved, strict=True))):
        same = (width == pair[0]) & (moved == pair[1])
        shifted = ndimage.shift(likelihood[same], (0, -pair[1]), order=0, mode="nearest")
        likelihood[same] = ndimage.gaussian_filter1d(shifted, pair[0] / spacing, axis=1, mode="nearest")
    log = np.log((1 - OUTLIERS) * likelihood + OUTLIERS / len(places))
    design, every = rays.design(), np.arange(len(rays.angle))

    def cost(shift):
        # Catmull-Rom: with straight pieces every node would be a small trap, and at no shift all rays stand on one.
        at = np.clip((design @ shift - places[0]) / spacing, 1, len(places) - 2.001)
        low = at.astype(int)
        t = at - low
        p, q, r, s = (log[every, low + k] for k in (-1, 0, 1, 2))
        value = q + 0.5 * t * (r - p + t * (2 * p - 5 * q + 4 * r - s + t * (3 * (q - r) + s - p)))
        return -value.sum() + (0.0 if prior is None else 0.5 * ((shift[2] - prior[0]) / prior[1]) ** 2)

    # Far from the answer the rays all look like outliers and the cost is flat: least squares lead there.
    starts: list[np.ndarray] = [np.zeros(3)]
    limb = np.flatnonzero(gain.max(1) > SIGNIFICANT)
    if limb.size > 9:
        edge, weight, fitted = places[log.argmax(1)][limb], np.ones(limb.size), np.zeros(3)
        for _ in range(4):
            fitted = np.linalg.lstsq(design[limb] * weight[:, None], edge * weight, rcond=None)[0]
            weight = 1 / np.sqrt(1 + np.abs(edge - design[limb] @ fitted) / (scatter[limb] + spacing))
        starts.append(fitted)
    start = min(starts, key=cost)
    size = max(float(scatter.min()), spacing)
    simplex = start + 3 * size * np.vstack([np.zeros(3), np.eye(3)])
    options = {"initial_simplex": simplex, "xatol": 1e-3 * size, "fatol": 1e-3, "maxfev": 600}
    shift = optimize.minimize(cost, start, method="Nelder-Mead", options=options).x
    axes = size * np.eye(3)
    signs = [(i, j) for i in (1, -1) for j in (1, -1)]
    curvature = [[sum(i * j * cost(shift + i * a + j * b) for i, j in signs) for a in axes] for b in axes]
    values, vectors = np.linalg.eigh(np.array(curvature) / (4 * size**2))
    return shift, (vectors / np.maximum(values, 1e-6)) @ vectors.T
