"""A plate: a matplotlib Figure on a dark page, with a title and a caption, drawn by Agg without any global state."""

import base64
import html
import io
from collections.abc import Callable, Iterable
from functools import wraps
from typing import ParamSpec

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecBase

PAPER, PANEL, INK, FAINT, GRID = "#0c0f14", "#12161d", "#e4e7ec", "#98a1af", "#28303b"
BLUE, GREEN, RED, GOLD, VIOLET = "#6cb4ff", "#63d297", "#ff7b6b", "#f0c060", "#c39bff"
COLOURS = {450.0: BLUE, 550.0: GREEN, 650.0: RED}
"""Of lines, by wavelength [nm]."""
DPI = 130
_P = ParamSpec("_P")

_STYLE = {
    "figure.facecolor": PAPER,
    "axes.facecolor": PANEL,
    "axes.edgecolor": "#4a5361",
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlesize": 10.5,
    "axes.titlepad": 7,
    "axes.labelsize": 9.5,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.6,
    "text.color": INK,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.5,
    "legend.facecolor": PANEL,
    "legend.edgecolor": PANEL,
    "legend.framealpha": 0.8,
    "image.interpolation": "antialiased",
    "mathtext.fontset": "dejavusans",
}


class Plate(Figure):
    """A figure that knows its title and its caption; notebooks show all three."""

    def __init__(self, title: str, width: float, height: float):
        """- `title`: of a few words. - `width`, `height`: [inch]."""
        super().__init__(figsize=(width, height), dpi=DPI)
        FigureCanvasAgg(self)
        self.title = title
        self.caption = ""

    def png(self, dpi: float = DPI) -> bytes:
        """The figure as a PNG file."""
        file = io.BytesIO()
        with matplotlib.style.context(["default", _STYLE]):
            self.savefig(file, format="png", dpi=dpi, facecolor=PAPER, metadata={"Title": self.title, "Software": None})
        return file.getvalue()

    def html(self) -> str:
        """The figure and its caption, self-contained."""
        data = base64.b64encode(self.png()).decode()
        picture = f'<img alt="{html.escape(self.title)}" src="data:image/png;base64,{data}" style="max-width:100%">'
        return f"<figure>{picture}<figcaption>{html.escape(self.caption)}</figcaption></figure>"

    def _repr_html_(self) -> str:
        return self.html()


def styled(draw: Callable[_P, Plate]) -> Callable[_P, Plate]:
    """Decorator: draws in the style of the page, whatever the user's own settings are."""

    @wraps(draw)
    def drawn(*arguments: _P.args, **options: _P.kwargs) -> Plate:
        with matplotlib.style.context(["default", _STYLE]):
            return draw(*arguments, **options)

    return drawn


def photograph(panel: Axes, picture: np.ndarray, title: str = "", below: str = "") -> None:
    """A picture without axes: a title above, a line below."""
    panel.imshow(picture)
    panel.set(xticks=[], yticks=[], facecolor="black")
    panel.grid(False)
    for side in panel.spines.values():
        side.set_visible(False)
    panel.set_title(title, fontsize=9.5)
    panel.set_xlabel(below, fontsize=8.5, color=FAINT, labelpad=5)


def panels(grid: GridSpecBase, *, share: bool = False) -> list[Axes]:
    """The axes of a grid, row by row.

    - `share`: one scale along x for all.
    """
    return list(np.ravel(np.asarray(grid.subplots(squeeze=False, sharex=share))))


def row(plate: Plate, pictures: Iterable[tuple[np.ndarray, str, str]], *, top: float, bottom: float, margin=0.015):
    """Pictures side by side, each with the title above it and the line below it.

    - `top`, `bottom`: of the row [figure height].
    """
    pictures = list(pictures)
    grid = plate.add_gridspec(
        1, len(pictures), left=margin, right=1 - margin, top=top, bottom=bottom, wspace=0.04, hspace=0.0
    )
    for panel, picture in zip(panels(grid), pictures, strict=True):
        photograph(panel, *picture)
