"""The limb as a circle, to a fraction of a pixel, from the light on both sides of it.

Along each ray from the disc's centre the light is a step blurred by the optics,

    f(u) = a + b u + (c + d (u - u0)) H(u0 - u) * Gauss(blur),        H the unit step, * the convolution,

with u the distance beyond the assumed circle: sky with a glare that falls outwards, Moon with a brightness that
varies inwards. For every u0 and blur of a grid the other four are a linear least-squares problem whose matrix all
rays share, so the likelihood of u0 on every ray costs one matrix product. The circle is the maximum of the sum of
the rays' log-likelihoods: a ray without an edge (the limb in deep umbra, or beyond the frame) says nothing, a ray
with the wrong one is outvoted.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage, optimize
from scipy.special import erfc

from inverse.disc_search import Circle, reduced

SAMPLES = 65  # along a ray
INWARD = 0.75  # of the outer half of a ray: the sky is smooth, the Moon is not
PLACES = 81  # positions of the edge tried on each ray
STAGES = 8  # of ever shorter rays, at most
MISFIT = 0.02  # error of the model of the step, of its height
SIGNIFICANT = 25.0  # chi-square that an edge must explain before its ray counts as limb
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
class Rays:
    """Light on rays across the limb.

    - `angle`: from the direction of growing columns towards growing rows (ray,) [rad].
    - `u`: beyond the circle (sample,) [pixel]; `light`: (ray, sample).
    - `whole`: the ray lies in the frame; `overexposed`: part of it is only a lower bound (ray,).
    """

    angle: np.ndarray
    u: np.ndarray
    light: np.ndarray
    whole: np.ndarray
    overexposed: np.ndarray

    def design(self) -> np.ndarray:
        """How far the limb moves along each ray for a shift by rows and by columns, and for a growth (ray, 3)."""
        return np.stack([np.sin(self.angle), np.cos(self.angle), np.ones_like(self.angle)], -1)


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
    errors = np.sqrt(np.diag(excess**2 * look.covariance + mountains))
    return Limb(
        circle=circle,
        blur=look.blur,
        rms=rms,
        fraction=float(limb.mean()),
        centre_error=float(errors[:2].max()),
        radius_error=float(errors[2]),
    )


def rays_across(light: np.ndarray, saturated: np.ndarray, circle: Circle, half: float) -> Rays:
    """Rays to `half` pixels outside the circle; where samples are far apart they are means, not points."""
    factor = max(1, int(2 * half / (SAMPLES - 1)))
    if factor > 1:
        light, saturated = reduced(light, factor), reduced(saturated, factor)
    row, column = ((x - (factor - 1) / 2) / factor for x in (circle.row, circle.column))
    radius = circle.radius / factor
    count = int(np.clip(np.pi * radius, 60, 540))
    across = int(np.clip(2 * np.pi * radius / count / 1.5, 1, 6))
    angle = 2 * np.pi * np.arange(count) / count
    fine = (angle[:, None] + (2 * np.pi / count / across) * (np.arange(across) - (across - 1) / 2)).ravel()
    u = np.linspace(-INWARD * half, half, SAMPLES)
    at = [row + np.sin(fine)[:, None] * (radius + u / factor), column + np.cos(fine)[:, None] * (radius + u / factor)]
    shape = (count, across, SAMPLES)
    values = ndimage.map_coordinates(light, at, order=1, cval=np.nan).reshape(shape).mean(1)
    white = ndimage.map_coordinates(saturated, at, order=0, cval=0.0).reshape(shape).mean((1, 2))
    whole = np.isfinite(values).all(1)
    return Rays(angle, u, np.where(whole[:, None], values, 0.0).astype(float), whole, white > 0.02)


def noise_of(rays: Rays, margin: float, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Noise on the Moon and on the sky (ray,), from the differences of neighbouring rays."""
    squares = (rays.light - np.roll(rays.light, 1, 0)) ** 2 / 2
    both = (rays.whole & np.roll(rays.whole, 1))[:, None]
    count = np.maximum(ndimage.uniform_filter1d(both.astype(float), 9, axis=0, mode="wrap")[:, 0], 1e-3)
    moon, sky = (
        ndimage.uniform_filter1d((squares * both)[:, side].mean(1), 9, mode="wrap") / count
        for side in (rays.u < -margin, rays.u > margin)
    )
    return np.sqrt(np.maximum(moon, 0)) + floor, np.sqrt(np.maximum(sky, 0)) + floor


def step_fit(y: np.ndarray, u: np.ndarray, places: np.ndarray, blurs: np.ndarray, weight: np.ndarray):
    """Weighted squares left by a step, and its height, both (ray, blur, place); squares left by none (ray,)."""
    y = y * weight
    z = (u[:, None] - places)[None] / (np.sqrt(2) * blurs[:, None, None])
    step = erfc(z) / 2
    line = np.broadcast_to(u[:, None], step.shape)
    # The blurred ramp, not the ramp times the blurred step: that would move the edge by blur^2 / (length of the ramp).
    ramp = step * (u[:, None] - places) - blurs[:, None, None] / np.sqrt(2 * np.pi) * np.exp(-(z**2))
    matrix = np.stack([np.ones_like(step), line, step, ramp], -1) * weight[:, None, None]
    q, r = np.linalg.qr(np.moveaxis(matrix, 1, 2))  # (blur, place, sample, 4)
    projected = (y @ np.moveaxis(q, 2, 0).reshape(len(u), -1)).reshape(len(y), len(blurs), len(places), 4)
    flat, _ = np.linalg.qr(np.stack([np.ones_like(u), u], -1) * weight[:, None])
    squares = (y**2).sum(1)
    without = squares - ((y @ flat) ** 2).sum(1)
    left = np.maximum(squares[:, None, None] - (projected**2).sum(-1), 0.0)
    height = (projected * np.linalg.inv(r)[:, :, 2]).sum(-1)
    # An edge that is dark inside is the Earth's shadow, a mare or a cloud: not the limb.
    return np.where(height > 0, left, without[:, None, None]), height, without


def edge_gain(rays: Rays, places: np.ndarray, blurs: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Chi-square that an edge at each place explains (ray, place), blur of all rays, noise / height of the edge (ray,).

    The Moon is noisier than the sky, and a least-squares fit that does not know it is drawn inwards, by up to a pixel
    at low signal: rays are fitted in groups of equal ratio of the two noises. An error of the model of 2 % of the
    height is added to both, so that where there is light enough the whole step counts and not its faint foot.
    """
    u, light = rays.u, rays.light
    gain, contrast = np.zeros((len(light), len(places))), np.full(len(light), np.inf)
    floor = max(1e-4 * float(np.percentile(light, 99.5)), 1e-12)
    margin = 0.25 * u[-1]
    moon, sky = noise_of(rays, margin, floor)
    misfit = MISFIT * np.abs(light[:, u < -margin].mean(1) - light[:, u > margin].mean(1))
    octave = np.clip(np.round(np.log2(np.hypot(moon, misfit) / np.hypot(sky, misfit))), -1, 4)
    disc = erfc(u / (0.2 * u[-1])) / 2
    groups = [np.flatnonzero(rays.whole & (octave == k)) for k in np.unique(octave[rays.whole])]
    fits = [
        step_fit(light[group], u, places, blurs, 1 / np.sqrt(1 + (4.0 ** octave[group[0]] - 1) * disc))
        for group in groups
    ]
    score = np.zeros(len(blurs))
    for left, _, without in fits:
        noise = np.maximum(left.min(2) / (len(u) - 6), floor**2)
        score += np.log(noise[(without[:, None] / noise).max(1) > len(u) + SIGNIFICANT]).sum(0)
    best = int(np.argmin(score))
    correlated = min(1.0, (u[1] - u[0]) / 2)  # noise, over two pixels, by demosaicing and compression
    for group, (left, height, without) in zip(groups, fits, strict=True):
        noise = np.maximum(left[:, best].min(1) / (len(u) - 6), sky[group] ** 2)
        gain[group] = (without[:, None] - left[:, best]) / noise[:, None] * correlated
        height = height[np.arange(len(group)), best, left[:, best].argmin(1)]
        contrast[group] = moon[group] / np.maximum(height, floor)
    return gain, float(blurs[best]), contrast


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
    starts, limb = [np.zeros(3)], np.flatnonzero(gain.max(1) > SIGNIFICANT)
    if limb.size > 9:
        edge, weight = places[log.argmax(1)][limb], np.ones(limb.size)
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
