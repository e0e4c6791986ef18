"""Brightness and colour of the Moon against distance from the shadow's axis."""

import numpy as np

from eclipsejax.constants import ALMANAC_EARTH_RADIUS, ALMANAC_SUN_RADIUS, DANJON_ENLARGEMENT
from eclipsejax.ephemeris import geometry
from eclipsejax.errors import InputError
from inverse.page import CHANNELS, footer, heading
from inverse.profile import ARCMIN
from inverse.result import PhotoFit

RATIOS = {"red / green": (0, 1, "#d55e00", "o"), "blue / green": (2, 1, "#0072b2", "s")}  # Okabe & Ito's palette
KEY = "#777777"
TICKS = {  # decades at most, ticks in each
    0.4: (1, 1.1, 1.2, 1.3, 1.5, 1.7, 2, 2.5, 3, 4, 5, 6, 7, 8, 9),
    1.0: (1, 1.5, 2, 3, 4, 5, 7),
    3.0: (1, 2, 5),
    np.inf: (1,),
}


def profile_plot(photo: PhotoFit, remarks: tuple[str, ...], figure) -> None:
    """Brightness with the surface's own divided out, and colour: the photograph's, and the model's with its band."""
    foot = footer(figure, remarks, 9.0, 8.5)
    tall = figure.get_figheight()
    grid = figure.add_gridspec(
        2, 1, height_ratios=(3, 2), left=0.11, right=0.97, top=1 - 0.55 / tall, bottom=foot + 0.5 / tall, hspace=0.06
    )
    top = figure.add_subplot(grid[0])
    below = figure.add_subplot(grid[1], sharex=top)
    arrays = _logarithms(photo)
    offset = photo.offset / ARCMIN
    for channel, (name, colour) in enumerate(CHANNELS.items()):
        _curve(top, _binned(offset, *(array[..., channel] for array in arrays)), colour, "o", name)
    for name, (one, other, colour, marker) in RATIOS.items():
        ratios = (array[..., one] - array[..., other] for array in arrays)
        _curve(below, _binned(offset, *ratios), colour, marker, name)
    _scales(top, below)
    _edge(top, below, photo.utc)
    _keys(top, below)
    heading(figure, photo)


def umbra_radius(utc: str) -> float | None:
    """Radius of the umbra by the almanac's rule (Danjon 1951), at the Earth's centre [rad]; None without an eclipse."""
    try:
        where = geometry(utc)
    except InputError:
        return None
    moon, sun = (float(np.linalg.norm(vector)) for vector in (where.moon, where.sun))
    parallaxes = DANJON_ENLARGEMENT * np.arcsin(ALMANAC_EARTH_RADIUS / moon) + np.arcsin(ALMANAC_EARTH_RADIUS / sun)
    return float(parallaxes - np.arcsin(ALMANAC_SUN_RADIUS / sun))


def _logarithms(photo: PhotoFit) -> tuple[np.ndarray, ...]:
    """ln(light / surface) observed, predicted (cell, 3) and drawn (draw, cell, 3); NaN where not usable."""
    usable = photo.usable & (photo.on_disc & (photo.albedo > 0))[:, None]
    usable &= (photo.observed > 0) & (photo.predicted > 0)
    surface = np.where(photo.albedo > 0, photo.albedo, 1.0)[:, None]
    arrays = (photo.observed, photo.predicted, photo.drawn)
    return tuple(np.log(np.where(usable, np.maximum(array, 1e-12) / surface, np.nan)) for array in arrays)


def _binned(offset, observed, model, drawn) -> np.ndarray:
    """Medians in bins of an arcmin: offset, observed and its 16 and 84 %, model and its, (7, bin), as ratios."""
    good = np.isfinite(observed)
    number = np.floor(offset)
    columns = []
    for chosen in np.unique(number[good]):
        at = good & (number == chosen)
        band = np.quantile(np.median(drawn[:, at], axis=1), (0.16, 0.84))
        spread = np.quantile(observed[at], (0.5, 0.16, 0.84))
        columns.append([np.median(offset[at]), *np.exp([*spread, np.median(model[at]), *band])])
    return np.array(columns).reshape(-1, 7).T


def _curve(panel, binned: np.ndarray, colour: str, marker: str, name: str) -> None:
    offset, middle, low, high, model, lower, upper = binned
    if not offset.size:
        return
    panel.fill_between(offset, lower, upper, color=colour, alpha=0.25, linewidth=0)
    panel.plot(offset, model, color=colour, linewidth=1.4)
    spread = np.maximum([middle - low, high - middle], 0.0)
    panel.errorbar(offset, middle, spread, fmt=marker, color=colour, markersize=3.5, linewidth=0.8, label=name)


def _scales(top, below) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for panel in (top, below):
        panel.set_yscale("log")
        panel.grid(True, color="#dddddd", linewidth=0.6)
        panel.tick_params(which="both", direction="in", top=True, right=True)
        low, high = panel.get_ylim()
        decades = np.log10(high / low)
        steps = next(steps for most, steps in TICKS.items() if decades < most)
        panel.yaxis.set_major_locator(LogLocator(subs=steps, numticks=30))
        panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
        panel.yaxis.set_minor_formatter(NullFormatter())
    top.tick_params(labelbottom=False)
    top.set_ylabel("brightness / surface  [full scale of the file]", fontsize=10)
    below.set_ylabel("colour  [ratio of channels]", fontsize=10)
    below.set_xlabel("distance from the shadow's axis, at the Earth's centre  [arcmin]", fontsize=10)


def _keys(top, below) -> None:
    lines, _ = top.get_legend_handles_labels()
    line = top.plot([], [], color=KEY, linewidth=1.4, label="model")
    area = top.fill_between([], [], color=KEY, alpha=0.25, linewidth=0, label="model, 68 % of the posterior")
    points = top.errorbar([], [], yerr=[], fmt="o", color=KEY, markersize=3.5, linewidth=0.8)
    points.set_label("photograph, 68 % of its cells")
    top.legend(handles=[*lines, points, *line, area], fontsize=9, loc="best", framealpha=0.9)
    if below.get_legend_handles_labels()[0]:
        below.legend(fontsize=9, loc="best", framealpha=0.9)


def _edge(top, below, utc: str) -> None:
    """A line at the edge of the umbra, where it crosses the disc."""
    radius, (low, high) = umbra_radius(utc), top.get_xlim()
    if radius is None or not low < radius / ARCMIN < high:
        return
    at = radius / ARCMIN
    for panel in (top, below):
        panel.axvline(at, color="#555555", linestyle=(0, (5, 3)), linewidth=1)
    side, shift = ("right", -5) if at > 0.5 * (low + high) else ("left", 5)
    top.annotate(
        "edge of the umbra\n(almanac)", (at, 0.03), (shift, 0), xycoords=("data", "axes fraction"),
        textcoords="offset points", ha=side, va="bottom", fontsize=9, color="#555555",
    )  # fmt: skip
