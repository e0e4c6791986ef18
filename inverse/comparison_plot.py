"""Photograph, model, and the logarithm of their ratio."""

import numpy as np

from eclipsejax.response import display
from inverse.page import CHANNELS, footer, heading
from inverse.result import PhotoFit

RESIDUAL = 0.5  # end of the colour scale of ln(photograph / model)
SATURATED = 0.97  # full scale: linear light of code 252 of 255, above which nothing is compared
BLOCKS = 60  # along a side of the residual: as fine as the cells of the fit, or noise is all there is to see
ON_PICTURE, ON_RESIDUAL = "#00c8ff", "#333333"  # colours of the limb


def comparison(photo: PhotoFit, remarks: tuple[str, ...], figure) -> None:
    """Photograph and model side by side, and the logarithm of their ratio, in all and channel by channel."""
    from matplotlib.patches import Circle

    image, model = np.asarray(photo.image), np.asarray(photo.model_image)
    foot = footer(figure, remarks, 12.0, 8.5)
    tall = figure.get_figheight()
    grid = figure.add_gridspec(
        2, 4, width_ratios=(1, 1, 1, 0.04), left=0.02, right=0.935, top=1 - 0.8 / tall, bottom=foot + 0.15 / tall,
        wspace=0.05, hspace=0.12,
    )  # fmt: skip
    gain = brightening(image)
    shown = "as in the file" if gain == 1 else f"brightness × {gain:.3g}"
    ratio = residual(image, model, photo.reach, photo.floor)
    seen = np.isfinite(ratio)
    mean = np.where(seen, ratio, 0.0).sum(axis=-1) / np.where(seen.any(axis=-1), seen.sum(axis=-1), np.nan)
    half = photo.reach * (1 + 1 / (image.shape[0] - 1))  # the centres of the outer pixels lie at `reach`
    scale = None
    for place, picture, title in (
        ((0, 0), _to_look_at(image, gain), f"photograph ({shown})"),
        ((0, 1), _to_look_at(model, gain), f"model ({shown})"),
        ((0, 2), mean, "ln (photograph / model), mean of channels"),
        *(((1, i), ratio[..., i], f"ln (photograph / model), {name}") for i, name in enumerate(CHANNELS)),
    ):
        panel = figure.add_subplot(grid[place])
        coloured = picture.ndim == 3
        style = {} if coloured else {"cmap": "RdBu_r", "vmin": -RESIDUAL, "vmax": RESIDUAL}
        drawn = panel.imshow(picture, extent=(-half, half, -half, half), interpolation="nearest", **style)
        panel.set_title(title, fontsize=11, pad=5)
        panel.set(xticks=[], yticks=[], xlim=(-half, half), ylim=(-half, half), facecolor="#cccccc")
        limb = ON_PICTURE if coloured else ON_RESIDUAL
        panel.add_patch(Circle((0, 0), 1, fill=False, linewidth=0.7, color=limb))
        _compass(panel, photo.registration, limb)
        scale = scale if coloured else drawn
    bar = figure.colorbar(scale, cax=figure.add_subplot(grid[:, 3]), extend="both")
    above = f", both above {photo.floor:.1g} of full scale" if photo.floor else ""
    bar.set_label(f"ln (photograph / model){above}      red: model too dark;  grey: not compared", fontsize=10)
    heading(figure, photo)


def brightening(image: np.ndarray) -> float:
    """Factor that brings a dark picture's disc up to the display's range; 1 for one that is bright already."""
    brightest = np.nanpercentile(np.nanmax(np.where(np.isfinite(image), image, 0.0), axis=-1), 97)
    return float(np.clip(0.8 / max(brightest, 1e-6), 1.0, 1e5))


def residual(image: np.ndarray, model: np.ndarray, reach: float, floor: float = 0.0) -> np.ndarray:
    """ln(image / model) of the disc, even over square blocks; NaN where most of a block cannot be compared.

    - `image`, `model`: decoded [full scale] (row, column, 3), `reach` radii from the disc's centre to outer pixels.
    - `floor`: added to both: no fit knows values near black to better than it [full scale].
    """
    side = image.shape[0]
    line = np.linspace(-reach, reach, side)
    good = np.isfinite(image) & np.isfinite(model) & (image < SATURATED)
    good &= (np.hypot(line, line[:, None]) < 1.0)[..., None]
    size = max(1, round(side / BLOCKS))
    starts = np.arange(0, side, size)

    def total(array):
        return np.add.reduceat(np.add.reduceat(np.where(good, array, 0.0), starts), starts, axis=1)

    light, expected = total(image + floor), total(model + floor)
    enough = (total(np.ones_like(image)) > 0.5 * size**2) & (light > 0) & (expected > 0)
    ratio = np.where(enough, np.log(np.where(enough, light, 1.0) / np.where(enough, expected, 1.0)), np.nan)
    # As many pixels as before, so that the last block, which may be cut, keeps its place.
    return np.repeat(np.repeat(ratio, size, axis=0), size, axis=1)[:side, :side]


def compass(roll: float, mirror: bool) -> tuple[tuple[float, float], tuple[float, float]]:
    """Unit vectors (right, up) of a picture towards celestial north and east; `roll`, `mirror` as of a `Camera`."""
    sine, cosine = float(np.sin(roll)), float(np.cos(roll))
    # Seen from inside the sphere with north up, east is on the left.
    across = 1.0 if mirror else -1.0
    return (-across * sine, cosine), (across * cosine, sine)


def _to_look_at(image: np.ndarray, gain: float) -> np.ndarray:
    """sRGB (row, column, 3), grey outside the frame."""
    picture = display(image, gain).copy()
    picture[~np.isfinite(image).all(axis=-1)] = 90
    return picture


def _compass(panel, registration, colour: str) -> None:
    """Ticks at the limb towards celestial north and east."""
    if registration is None:
        return
    for letter, (right, up) in zip("NE", compass(registration.roll, registration.mirror), strict=True):
        panel.plot([1.02 * right, 1.1 * right], [1.02 * up, 1.1 * up], color=colour, linewidth=1.2)
        panel.text(1.19 * right, 1.19 * up, letter, color=colour, fontsize=11, ha="center", va="center")
