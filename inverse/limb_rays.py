"""Light along rays across the limb of a disc, and where on each of them the edge may be.

Along a ray from the disc's centre the light is a step blurred by the optics,

    f(u) = a + b u + (c + d (u - u0)) H(u0 - u) * Gauss(blur),        H the unit step, * the convolution,

with u the distance beyond the assumed circle: sky with a glare that falls outwards, Moon with a brightness that
varies inwards. For every u0 and blur of a grid the other four are a linear least-squares problem whose matrix all
rays share, so the likelihood of u0 on every ray costs one matrix product.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.special import erfc

from inverse.disc_search import Circle, reduced

SAMPLES = 65  # along a ray
INWARD = 0.75  # of the outer half of a ray: the sky is smooth, the Moon is not
MISFIT = 0.02  # error of the model of the step, of its height
SIGNIFICANT = 25.0  # chi-square that an edge must explain before its ray counts as limb


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
