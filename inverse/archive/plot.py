"""`optical_depth.png`: the dust of the stratosphere against time, eclipse by eclipse, with the big eruptions."""

import csv
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from eclipsejax.calendar import day_number, read_clock
from inverse.archive.rows import FAILED
from inverse.catalogue import data_file
from inverse.page import drawn

DEPTH = "stratospheric_optical_depth"
MARGIN = 0.06  # of the time spanned, on either side, and at least LEAST
LEAST = 1.0  # year
DECADE = 10.0  # least range of optical depths
ECLIPSE, PHOTOGRAPH, ERUPTION = "#1f5fd0", "#9aa5b5", "#d62728"


def year_of(utc: str) -> float:
    """Decimal year of a time or date, in the calendar of `eclipsejax.calendar`."""
    day = read_clock(utc, date_only=True).day
    year = int(utc[:5] if utc[0] in "+-" else utc[:4])
    first, last = day_number(year, 1, 1), day_number(year + 1, 1, 1)
    return year + (day - first) / (last - first)


def eruptions() -> list[tuple[str, float]]:
    """Name and decimal year of each eruption in `data/eruptions.csv`."""
    with data_file("eruptions.csv").open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [(row["name"], year_of(row["date"])) for row in rows]


def optical_depth_plot(rows: Sequence[Mapping[str, Any]], path: Path) -> Path | None:
    """Draws the rows of an archive that hold a number; None where none does."""
    shown = [row for row in rows if row["status"] != FAILED and (row.get(f"{DEPTH}_median") or 0.0) > 0.0]
    return drawn(partial(_draw, shown), path) if shown else None


def _draw(rows: Sequence[Mapping[str, Any]], figure) -> None:
    figure.set_size_inches(10, 5)
    axes = figure.add_axes((0.09, 0.12, 0.88, 0.76))
    years = [year_of(row["utc"]) for row in rows]
    margin = max(LEAST, MARGIN * (max(years) - min(years)))
    axes.set_xlim(min(years) - margin, max(years) + margin)
    axes.set_yscale("log")
    axes.ticklabel_format(axis="x", style="plain", useOffset=False)
    low, high = axes.get_xlim()
    for row, year in zip(rows, years, strict=True):
        _mark(axes, row, year)
    bottom, top = axes.get_ylim()
    axes.set_ylim(min(bottom, top / DECADE), max(top, bottom * DECADE))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    above = axes.get_xaxis_transform()
    for name, year in eruptions():
        if low < year < high:
            axes.axvline(year, color=ERUPTION, lw=0.8, alpha=0.7, zorder=0)
            axes.text(year, 1.01, name, color=ERUPTION, rotation=30, fontsize=8, transform=above)
    axes.set_xlabel("year")
    axes.set_ylabel("vertical optical depth of the dust, 15 to 25 km")
    axes.grid(alpha=0.25, which="both")
    told = (
        "blue: eclipses, grey: photographs; thick 68 %, thin 95 %; arrows: upper limits (97.5 %); open: not converged"
    )
    figure.text(0.09, 0.015, told, fontsize=7.5, color="#444444")


def _mark(axes, row: Mapping[str, Any], year: float) -> None:
    """One fit: its median and intervals, or an arrow down from its upper limit."""
    whole = row["kind"] == "eclipse"
    style = {"color": ECLIPSE if whole else PHOTOGRAPH, "zorder": 3 if whole else 2, "alpha": 1.0 if whole else 0.6}
    limit = row.get(f"{DEPTH}_upper_limit")
    if limit:
        axes.errorbar(year, limit, yerr=0.35 * limit, uplims=True, fmt="_", capsize=3, **style)
        return
    for level, width in (("ci95", 0.8), ("ci68", 2.5)):
        ends = [row.get(f"{DEPTH}_{level}_{end}") for end in ("low", "high")]
        if all(end and end > 0.0 for end in ends):
            axes.plot([year, year], ends, lw=width if whole else 0.6 * width, solid_capstyle="butt", **style)
    filled = style["color"] if row["status"] == "ok" else "white"
    axes.plot(
        year,
        row[f"{DEPTH}_median"],
        "o",
        ms=6 if whole else 3.5,
        mfc=filled,
        mec=style["color"],
        zorder=style["zorder"] + 2,
    )
