"""The light in and around a disc: is it a Moon on a dark sky, and which mixture of channels shows its limb best."""

import numpy as np

from inverse.disc_search import Circle

DISC, RIM, SKY = (0.0, 0.97), (0.8, 0.97), (1.08, 1.3)  # what counts as inside, at the edge and outside [radii]


def ring(image: np.ndarray, circle: Circle, radii: tuple[float, float]) -> np.ndarray:
    """Samples of an image (row, column) between two multiples of the radius, as far as they are in the frame."""
    angle = np.linspace(0, 2 * np.pi, 180, endpoint=False)[:, None]
    radius = circle.radius * np.linspace(*radii, 24)
    row = np.round(circle.row + radius * np.sin(angle)).astype(int)
    column = np.round(circle.column + radius * np.cos(angle)).astype(int)
    inside = (row >= 0) & (row < image.shape[0]) & (column >= 0) & (column < image.shape[1])
    return image[row[inside], column[inside]]


def on_sky(luminance: np.ndarray, circle: Circle) -> bool:
    """Whether what surrounds the circle is darker and smoother than what is in it, and the picture mostly dark."""
    outside, inside = ring(luminance, circle, SKY), ring(luminance, circle, RIM)
    if min(outside.size, inside.size) < 50:
        return False
    sky, moon = np.median(outside), np.percentile(inside, 95)
    smooth = np.percentile(outside, 90) - sky < 0.3 * (moon - sky)
    # By day most of the picture outshines any round thing in it.
    elsewhere = np.mean(luminance[::7, ::7] > (sky + moon) / 2)
    return bool(smooth and sky < 0.5 * moon and elsewhere < 0.4)


def limb_light(pixels: np.ndarray, saturated: np.ndarray, circle: Circle) -> tuple[np.ndarray, np.ndarray]:
    """One image from the channels, weighted by signal over noise squared, and 1 where it is a lower bound, else 0.

    Channels that are overexposed where others are not count little. In a picture whose whites were pulled down from
    full scale (tone mapping), what piles up at the top of the disc's histogram counts as overexposed too.

    - `pixels`, `saturated`: (row, column, channel).
    """
    weights, white = [], []
    for channel in range(pixels.shape[-1]):
        plane = pixels[..., channel]
        inside, outside = ring(plane, circle, DISC), ring(plane, circle, SKY)
        step = np.abs(np.diff(plane[:: max(1, plane.shape[0] // 400)], axis=1))
        noise = 1.4826 * np.median(step[step > 0]) if (step > 0).any() else 0.0
        contrast = max(float(np.mean(inside) - np.median(outside)), 0.0)
        over = saturated[..., channel]
        top = np.percentile(inside, 99.5)
        below = np.mean((inside > 0.89 * top) & (inside <= 0.96 * top))
        if top > 0.3 and np.mean(inside > 0.96 * top) > 4 * below + 0.02:
            over = over | (plane > 0.96 * top)
        lost = ring(over.astype(np.float32), circle, DISC).mean()
        weights.append(contrast / max(noise, 0.003 * contrast, 1e-9) ** 2 * np.exp(-20 * lost))
        white.append(over)
    weight = np.array(weights, dtype=np.float32)
    weight = weight / weight.sum() if weight.sum() > 0 else np.full_like(weight, 1 / len(weight))
    bound = np.any([over for over, share in zip(white, weight, strict=True) if share > 0.1], axis=0)
    return pixels @ weight, bound.astype(np.float32)
