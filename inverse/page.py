"""A page of the report: one matplotlib figure with a heading and the warnings, drawn by Agg, written as PNG.

Neither matplotlib's global state nor the user's settings play a part: no pyplot, and its default style.
"""

import textwrap
import warnings
from collections.abc import Callable
from pathlib import Path

from eclipsejax.whole_file import whole_file
from inverse.result import PhotoFit

CHANNELS = {"red": "#d62728", "green": "#2a8c2a", "blue": "#1f5fd0"}  # colours of lines
LINE = 0.16  # inch, of a warning
CHARACTERS = 15.5  # of a warning to the inch


def drawn(draw: Callable, path: Path) -> Path:
    """The file, once `draw(figure)` has filled its figure."""
    import matplotlib.style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.style.context("default"), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph", UserWarning)  # a file name in a script that the font lacks
        canvas = FigureCanvasAgg(Figure(dpi=100))
        draw(canvas.figure)
        with whole_file(path) as part, part.open("wb") as file:
            canvas.print_png(file)
    return path


def heading(figure, photo: PhotoFit) -> None:
    """Writes name, time and misfit of a photograph at the top, within half an inch."""
    name = photo.name if len(photo.name) <= 60 else f"{photo.name[:28]} … {photo.name[-28:]}"
    when = photo.utc.replace("T", " ").replace("Z", " UTC")
    text = f"{name}   ·   {when}   ·   residual rms {100 * photo.residual_rms:.1f} %"
    top = 1 - 0.14 / figure.get_figheight()
    figure.text(0.5, top, text, ha="center", va="top", fontsize=13, parse_math=False)


def footer(figure, remarks: tuple[str, ...], width: float, height: float) -> float:
    """Makes the figure as large as given [inch], and taller for warnings at its foot; their share of the height."""
    columns = int(CHARACTERS * width)
    lines = [line for text in remarks for line in textwrap.wrap(f"• {text}", columns, subsequent_indent="   ")]
    room = LINE * len(lines) + (0.15 if lines else 0.0)
    figure.set_size_inches(width, height + room)
    place = (0.03, 0.1 / (height + room))
    figure.text(*place, "\n".join(lines), fontsize=8, va="bottom", color="#8a3000", linespacing=1.25, parse_math=False)
    return room / (height + room)
