"""All plates as PNG files, and one page that shows them."""

import html
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from eclipsejax.almanac import nearest_eclipse
from eclipsejax.errors import InputError
from eclipsejax.figures.air import air_plate
from eclipsejax.figures.chart import chart_plate
from eclipsejax.figures.danjon import danjon_plate
from eclipsejax.figures.light import light_plate
from eclipsejax.figures.moonset import moonset_plate
from eclipsejax.figures.page import FAINT, INK, PAPER, Plate
from eclipsejax.figures.refraction import refraction_plate
from eclipsejax.figures.series import exposures_plate, mid_eclipse_plate, prediction_plate
from eclipsejax.figures.sun import sun_plate
from eclipsejax.figures.surface import surface_plate
from eclipsejax.figures.tank import tank_plate
from eclipsejax.figures.to_the_moon import moon_path_plate
from eclipsejax.figures.worlds import SITE, TOTAL, dust_plate, worlds_plate

PAGE = f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Lunar eclipses: the gallery of eclipsejax</title>
<style>
body {{ background: {PAPER}; color: {INK}; font: 16px/1.55 system-ui, sans-serif; margin: 0 auto; max-width: 1180px;
  padding: 2rem 1.2rem 4rem }}
h1 {{ font-weight: 600; font-size: 1.9rem; margin: 0 0 .4rem }}
h2 {{ font-weight: 600; font-size: 1.25rem; margin: 3.2rem 0 .6rem }}
figure {{ margin: 0 }}
img {{ display: block; margin: 0 auto; max-width: 100% }}
p, figcaption {{ max-width: 46rem; color: {FAINT} }}
figcaption {{ margin: .6rem auto 0 }}
</style></head><body>
<h1>Lunar eclipses</h1>
<p>The figures of Yapo &amp; Cutler, <i>Rendering Lunar Eclipses</i> (2009), and more, computed by eclipsejax: sunlight
bent, scattered and absorbed by the air of the Earth, on the Moon, through the air of the observer, in a camera.
Every picture is a simulation.</p>
"""


def plates(size: int = 320) -> dict[str, Callable[[], Plate]]:
    """What draws each plate, by the name of its file, in the order of the page.

    - `size`: pixels along a side of each picture of the Moon.
    """
    return {
        "mid-eclipse-2008": partial(mid_eclipse_plate, size),
        "exposures-2008": partial(exposures_plate, size),
        "prediction-2010": partial(prediction_plate, size),
        "worlds": partial(worlds_plate, size),
        "dust": partial(dust_plate, size),
        "danjon": partial(danjon_plate, size),
        "moonset-2022": partial(moonset_plate, size),
        "course-2008": partial(chart_plate, nearest_eclipse(TOTAL), SITE, size),
        "sun": partial(sun_plate, size),
        "air": air_plate,
        "tank": tank_plate,
        "refraction": refraction_plate,
        "to-the-moon": moon_path_plate,
        "light": light_plate,
        "surface": partial(surface_plate, size),
    }


def write_gallery(directory: Path, size: int = 320, progress: Callable[[str], None] = lambda line: None) -> Path:
    """Write every plate as PNG, and `index.html` with all of them inside; returns the page.

    Needs float64 (`jax_enable_x64`). Some 70 s of processor time, most of it compilation, which a session keeps.

    - `directory`: made if need be; files of the same names are replaced.
    - `size`: pixels along a side of each picture of the Moon.
    - `progress`: called with one line for each plate.
    """
    directory = Path(directory)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        sections = list(_sections(directory, size, progress))
        page = directory / "index.html"
        page.write_text(PAGE + "".join(sections) + "</body></html>\n", encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"The gallery cannot be written to {directory} ({error.strerror}): choose another folder."
        ) from None
    return page


def _sections(directory: Path, size: int, progress: Callable[[str], None]) -> Iterator[str]:
    for name, draw in plates(size).items():
        plate = draw()
        (directory / f"{name}.png").write_bytes(plate.png())
        progress(f"{name}.png: {plate.title}")
        yield f"<h2>{html.escape(plate.title)}</h2>{plate.html()}\n"
