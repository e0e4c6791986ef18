"""The limb as a circle, to a fraction of a pixel, from the light on both sides of it.

Along each ray from the disc's centre the light is a step blurred by the optics,

    f(u) = a + b u + (c + d (u - u0)) H(u0 - u) * Gauss(blur),        H the unit step, * the convolution,

with u the distance beyond the assumed circle: sky with a glare that falls outwards, Moon with a brightness that varies
inwards. For every u0 and blur of a grid the other four are a linear least-squares problem whose matrix all rays share, so
the likelihood of u0 on every ray costs one matrix product. The circle is the maximum of the sum of the rays' log-likelihoods:
a ray without an edge (the limb in deep umbra, or beyond the frame) says nothing, a ray with the wrong one is outvoted.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage, optimize
from scipy.special import erfc

from inverse.disc_search import Circle, reduced

SAMPLES = 65  # along a ray
PLACES = 81  # positions of the edge tried on each ray
MISFIT = 0.02  # error of the model of the step, of its height
RELIEF = 7e-4  # height of the mountains on the limb, of the radius: 1.2 km rms
SIGNIFICANT = 25.0  # chi-square that an edge must explain before its ray counts as limb
INWARD = 0.75
STAGES = 8  # of ever shorter rays
OUTLIERS = 0.1  # of the rays may show something else than the limb


@dataclass(frozen=True)
class Limb:
    """A fitted limb, lengths in pixels: circle, standard deviation of the blur, rms of the edge about the circle, fraction of
    the circle seen as limb, standard errors of the centre (larger coordinate) and of the radius."""

    circle: Circle
    blur: float
    rms: float
    fraction: float
    centre_error: float
    radius_error: float


@dataclass(frozen=True)
class Rays:
    """Light on rays across the limb: angle from the direction of growing columns towards growing rows (ray,) [rad],
    u (sample,) [pixel beyond the circle], light (ray, sample), whether a ray lies in the frame, whether it is overexposed."""

    angle: np.ndarray
    u: np.ndarray
    light: np.ndarray
    whole: np.ndarray
    overexposed: np.ndarray


def rays_across(light: np.ndarray, saturated: np.ndarray, circle: Circle, half: float) -> Rays:
    """Rays from `half` pixels inside to `half` outside; where samples are far apart they are means, not points."""
    factor = max(1, int(2 * half / (SAMPLES - 1)))
    if factor > 1:
        light, saturated = reduced(light, factor), reduced(saturated, factor)
    row, column, radius = ((x - shift) / factor for x, shift in zip(
        (circle.row, circle.column, circle.radius), ((factor - 1) / 2, (factor - 1) / 2, 0), strict=True))
    count = int(np.clip(np.pi * radius, 60, 540))
    across = int(np.clip(2 * np.pi * radius / count / 1.5, 1, 6))
    angle = 2 * np.pi * np.arange(count) / count
    fine = (angle[:, None] + (2 * np.pi / count / across) * (np.arange(across) - (across - 1) / 2)).ravel()
    u = np.linspace(-INWARD * half, half, SAMPLES)
    at = [row + np.sin(fine)[:, None] * (radius + u / factor), column + np.cos(fine)[:, None] * (radius + u / factor)]
    values = ndimage.map_coordinates(light, at, order=1, cval=np.nan).reshape(count, across, SAMPLES).mean(1)
    white = ndimage.map_coordinates(saturated, at, order=0, cval=0.0).reshape(count, across, SAMPLES).mean((1, 2))
    whole = np.isfinite(values).all(1)
    return Rays(angle, u, np.where(whole[:, None], values, 0.0).astype(float), whole, white > 0.02)


def noise_of(rays: Rays, margin: float, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Noise on the Moon and on the sky (ray,), from the differences of neighbouring rays."""
    squares = (rays.light - np.roll(rays.light, 1, 0)) ** 2 / 2
    both = (rays.whole & np.roll(rays.whole, 1))[:, None]
    count = np.maximum(ndimage.uniform_filter1d(both.astype(float), 9, axis=0, mode="wrap")[:, 0], 1e-3)
    sides = (rays.u < -margin, rays.u > margin)
    means = (ndimage.uniform_filter1d((squares * both)[:, side].mean(1), 9, mode="wrap") / count for side in sides)
    moon, sky = (np.sqrt(np.maximum(mean, 0)) + floor for mean in means)
    return moon, sky


def step_fit(y: np.ndarray, u: np.ndarray, places: np.ndarray, blurs: np.ndarray, weight: np.ndarray):
    """Weighted squares left over by a step (ray, blur, place), its height likewise, and squares left without a step (ray,)."""
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


def edge_gain(rays: Rays, places: np.ndarray, blurs: np.ndarray, floor: float):
    """Chi-square that an edge at each place explains (ray, place), the blur common to all rays [pixel], and the ratio of
    noise to the height of the edge (ray,).

    The Moon is noisier than the sky, and a least-squares fit that does not know it is drawn inwards, by up to a pixel at low
    signal: rays are fitted in groups of equal ratio of the two noises. An error of the model of 2 % of the height is added
    to both, so that where there is light enough the whole step counts and not its faint foot.
    """
    u, light = rays.u, rays.light
    gain, contrast = np.zeros((len(light), len(places))), np.full(len(light), np.inf)
    margin = 0.25 * u[-1]
    moon, sky = noise_of(rays, margin, floor)
    misfit = MISFIT * np.abs(light[:, u < -margin].mean(1) - light[:, u > margin].mean(1))
    octave = np.clip(np.round(np.log2(np.hypot(moon, misfit) / np.hypot(sky, misfit))), -1, 4)
    disc = erfc(u / (0.2 * u[-1])) / 2
    groups = [np.flatnonzero(rays.whole & (octave == k)) for k in np.unique(octave[rays.whole])]
    fits = [step_fit(light[g], u, places, blurs, 1 / np.sqrt(1 + (4.0 ** octave[g[0]] - 1) * disc)) for g in groups]
    score = np.zeros(len(blurs))
    for left, _, without in fits:
        noise = np.maximum(left.min(2) / (len(u) - 6), floor**2)
        score += np.log(noise[(without[:, None] / noise).max(1) > len(u) + SIGNIFICANT]).sum(0)
    best = int(np.argmin(score))
    for group, (left, height, without) in zip(groups, fits, strict=True):
        noise = np.maximum(left[:, best].min(1) / (len(u) - 6), sky[group] ** 2)
        correlated = min(1.0, (u[1] - u[0]) / 2)  # over two pixels, by demosaicing and compression
        gain[group] = (without[:, None] - left[:, best]) / noise[:, None] * correlated
        height = height[np.arange(len(group)), best, left[:, best].argmin(1)]
        contrast[group] = moon[group] / np.maximum(height, floor)
    return gain, float(blurs[best]), contrast


def best_shift(gain: np.ndarray, rays: Rays, places: np.ndarray, scatter: np.ndarray, outward: np.ndarray, prior):
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
    design = np.stack([np.sin(rays.angle), np.cos(rays.angle), np.ones_like(rays.angle)], -1)
    every = np.arange(len(design))

    def cost(shift):
        # Catmull-Rom: with straight pieces every node would be a small trap, and at no shift all rays stand on one.
        at = np.clip((design @ shift - places[0]) / spacing, 1, len(places) - 2.001)
        low = at.astype(int)
        t = at - low
        p, q, r, s = (log[every, low + k] for k in (-1, 0, 1, 2))
        value = q + 0.5 * t * (r - p + t * (2 * p - 5 * q + 4 * r - s + t * (3 * (q - r) + s - p)))
        return -value.sum() + (0.0 if prior is None else 0.5 * ((shift[2] - prior[0]) / prior[1]) ** 2)

    size = max(float(scatter.min()), spacing)
    options = {"initial_simplex": 3 * size * np.vstack([np.zeros(3), np.eye(3)]), "xatol": 1e-3 * size, "fatol": 1e-3}
    shift = optimize.minimize(cost, np.zeros(3), method="Nelder-Mead", options=options | {"maxfev": 600}).x
    axes = size * np.eye(3)
    curvature = [[sum(i * j * cost(shift + i * a + j * b) for i in (1, -1) for j in (1, -1)) for a in axes] for b in axes]
    values, vectors = np.linalg.eigh(np.array(curvature) / (4 * size**2))
    return shift, (vectors / np.maximum(values, 1e-6)) @ vectors.T


def fit_limb(light: np.ndarray, saturated: np.ndarray, circle: Circle, radius_hint: float | None = None) -> Limb:
    """Limb in linear light (row, column), starting from a circle good to a few per cent of its radius.

    The rays shorten from stage to stage until their samples are half a pixel apart or as short as the blur allows. An
    overexposed limb stands too far out, by an unknown part of the blur; one near the noise too far in, because the sky
    was clipped to black: both keep a say, with an error of that size.

    - `saturated`: 1 where the light is a lower bound, else 0 (row, column).
    - `radius_hint`: a radius known beforehand to 5 % [pixel].
    """
    half = 0.12 * circle.radius
    floor = 1e-4 * float(np.percentile(light, 99.9))
    blurs = np.geomspace(0.03, 0.35, 7) * half
    for stage in range(STAGES):
        rays = rays_across(light, saturated, circle, half)
        step = rays.u[1] - rays.u[0]
        places = (0.6 if stage < 2 else 0.4) * half * np.linspace(-1, 1, PLACES)
        gain, blur, contrast = edge_gain(rays, places, blurs, floor)
        faint = blur * np.minimum(contrast, 1)
        relief = max(RELIEF * circle.radius, 0.15, 0.5 * step)
        scatter = np.sqrt(relief**2 + (1.2 * faint) ** 2 + np.where(rays.overexposed, blur, 0.0) ** 2)
        prior = None if radius_hint is None else (radius_hint - circle.radius, 0.05 * radius_hint)
        shift, covariance = best_shift(gain, rays, places, scatter, np.where(rays.overexposed, blur, -0.8 * faint), prior)
        circle = replace(circle, row=circle.row + shift[0], column=circle.column + shift[1], radius=circle.radius + shift[2])
        shortest = max(16.0, 8 * blur)
        if DEBUG: print(round(half,1), round(step,2), circle, 'blur', round(blur,2), shift.round(2), np.sqrt(np.diag(covariance)).round(3), (gain.max(1)>SIGNIFICANT).mean(), rays.overexposed.mean())
        if half <= 1.5 * shortest and np.abs(shift).max() < 0.3 * max(step, 0.5):
            break
        half = max(half / 2.5, shortest)
        # What is shorter than the samples cannot be told, nor what is longer than the rays.
        trial = blur * np.geomspace(0.35, 1.6, 7) if stage == 0 else blur * np.array([0.6, 0.8, 1.0, 1.25])
        blurs = np.clip(trial, max(0.4, 1.4 * half / (SAMPLES - 1)), 0.35 * half)
    design = np.stack([np.sin(rays.angle), np.cos(rays.angle), np.ones_like(rays.angle)], -1)
    off = places[gain.argmax(1)] - design @ shift
    limb = (gain.max(1) > SIGNIFICANT) & (np.abs(off) < np.maximum(4 * scatter, blur))
    rms = float(np.sqrt((off[limb] ** 2).mean())) if limb.any() else float("nan")
    errors = np.sqrt(np.diag(covariance))
    return Limb(circle, blur, rms, float(limb.mean()), float(errors[:2].max()), float(errors[2]))
DEBUG=False
