"""Brightness profiles: a photograph of the Moon boiled down to brightness against distance from the shadow's axis.

A profile is a CSV file (UTF-8, commas, decimal points) that a fit accepts in place of a photograph:

    # utc: 2022-05-16T04:06:00Z
    # tone: srgb
    # source: name of the photograph and of who took it
    # licence: CC BY 4.0
    offset_arcmin,surface,red,green,blue,red_sd,green_sd,blue_sd,cells
    8.52,1.031,0.1204,0.04411,0.01806,0.0009,0.0004,0.0003,57

- `utc` (needed): ISO time with its zone. `tone`: how the values were encoded before they were decoded, `srgb`
  (also where it is left out: the camera's true curve is then free in a fit) or `linear`. `source`, `licence`:
  free text.
- `offset_arcmin`: mean angle of the bin's cells from the shadow's axis, seen from the Earth's centre [arcmin].
- `surface`: mean relative brightness of their surface under full sunlight, albedo x photometric function;
  1 = mean disc.
- `red`, `green`, `blue`: mean decoded, linear pixel values [full scale]; `red_sd`, ...: standard deviations of
  those means. Both are left empty for a channel that is clipped or saturated in this bin.
- `cells`: how many cells (squares of a photograph) went into the bin; may be missing.

Columns may come in any order; further columns are ignored.
"""

import csv
import hashlib
import io
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from eclipsejax.calendar import read_clock
from eclipsejax.errors import InputError
from inverse.result import PhotoFit

CHANNELS = ("red", "green", "blue")
COLUMNS = ("offset_arcmin", "surface", *CHANNELS, *(f"{name}_sd" for name in CHANNELS))
LEAST_ROWS = 5
LEAST_CELLS = 5  # of a bin
LEAST_SHARE = 0.5  # of a bin's cells that a channel must have: the few left by clipping are the brightest
LARGEST_FILE = 10e6  # bytes
ARCMIN = np.pi / 180.0 / 60.0


@dataclass(frozen=True, eq=False)
class Profile:
    """Brightness against offset from the shadow's axis.

    - `offset`: seen from the Earth's centre [rad] (bin,).
    - `surface`: relative brightness of the surface under full sunlight, 1 = mean disc (bin,).
    - `value`: mean linear pixel values [full scale] (bin, 3); NaN where a channel cannot be used.
    - `sigma`: standard deviations of `value` (bin, 3).
    - `cells`: how many went into each bin (bin,); 0 where the file does not tell.
    - `utc`: ISO; `tone_curve`: "srgb" or "linear", as of a `Photo`.
    - `source`, `licence`: free text. `path`, `sha256`: of the file; empty for what was not read from one.
    """

    offset: np.ndarray
    surface: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    cells: np.ndarray
    utc: str
    tone_curve: str
    source: str = ""
    licence: str = ""
    path: str = ""
    sha256: str = ""

    @property
    def time(self) -> str:
        """As of a `Photo` whose file is certain of its time."""
        return self.utc


def read_profile(path: str | PathLike[str]) -> Profile:
    """Reads a profile; `InputError`, one sentence, for whatever cannot be used. Format: see the module."""
    data = _content(Path(path))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path} is not a text file: a profile is a CSV file, such as a spreadsheet exports.")
    lines = [line.strip() for line in text.splitlines()]
    facts = dict(_fact(line) for line in lines if line.startswith("#") and ":" in line)
    if not facts.get("utc"):
        raise InputError(
            f"{path} does not say when it was taken: add a line such as # utc: 2022-05-16T04:06:00Z at its top."
        )
    try:
        read_clock(facts["utc"])
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    tone = facts.get("tone", "srgb").lower()
    if tone not in ("srgb", "linear"):
        raise InputError(f"{path} has the tone {tone!r}: write # tone: srgb or # tone: linear.")
    table = _table(path, lines)
    return Profile(
        offset=table["offset_arcmin"] * ARCMIN,
        surface=table["surface"],
        value=np.stack([table[name] for name in CHANNELS], axis=1),
        sigma=np.stack([table[f"{name}_sd"] for name in CHANNELS], axis=1),
        cells=table["cells"].astype(int),
        utc=facts["utc"],
        tone_curve=tone,
        source=facts.get("source", ""),
        licence=facts.get("licence", ""),
        path=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
    )


def write_profile(profile: Profile, path: str | PathLike[str]) -> None:
    """Writes a profile, to nine digits; `InputError` where the file cannot be written."""
    text = io.StringIO()
    facts = {
        "utc": profile.utc,
        "tone": profile.tone_curve,
        "source": profile.source,
        "licence": profile.licence,
    }
    text.writelines(f"# {key}: {' '.join(value.split())}\n" for key, value in facts.items() if value)
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow([*COLUMNS, "cells"])
    numbers = np.column_stack([profile.offset / ARCMIN, profile.surface, profile.value, profile.sigma])
    for row, cells in zip(numbers, profile.cells, strict=True):
        rows.writerow([*("" if np.isnan(number) else f"{number:.9g}" for number in row), int(cells)])
    try:
        Path(path).write_text(text.getvalue(), encoding="utf-8")
    except OSError as error:
        raise InputError(f"The profile cannot be written to {path}: {error.strerror or error}.") from None


def profile_of(photo_fit: PhotoFit, tone_curve: str, source: str, licence: str = "") -> Profile:
    """The profile of a photograph that was fitted: its usable cells of the disc in bins of 1 arcmin.

    What is averaged is linear light, whose mean over a bin is not its value at the mean offset: at the umbra's
    edge, where light doubles in an arcmin, the mean is 2 % too high. The standard deviation is that of
    value / surface within the bin, the trend across it included, over the square root of the number of cells.

    - `tone_curve`: "srgb" or "linear", as of the `Photo`.
    """
    disc = photo_fit.on_disc & np.isfinite(photo_fit.offset) & (photo_fit.albedo > 0)
    number = np.floor(photo_fit.offset / ARCMIN)
    rows = []
    for chosen in np.unique(number[disc]):
        bin_ = np.flatnonzero(disc & (number == chosen))
        albedo = photo_fit.albedo[bin_]
        usable = photo_fit.usable[bin_] & np.isfinite(photo_fit.observed[bin_])
        value, sigma = np.full((2, 3), np.nan)
        for channel in range(3):
            good = usable[:, channel]
            if good.sum() >= LEAST_CELLS and good.sum() >= LEAST_SHARE * bin_.size:
                light = photo_fit.observed[bin_[good], channel]
                value[channel] = light.mean() * albedo.mean() / albedo[good].mean()
                sigma[channel] = (light / albedo[good]).std(ddof=1) * albedo.mean() / np.sqrt(good.sum())
        value[~(sigma > 0)] = sigma[~(sigma > 0)] = np.nan
        if np.isfinite(value).any():
            rows.append((photo_fit.offset[bin_].mean(), albedo.mean(), value, sigma, usable.any(axis=1).sum()))
    if len(rows) < LEAST_ROWS:
        raise InputError(
            f"{photo_fit.name} has too few usable cells for a profile: {LEAST_ROWS} bins of 1 arcmin with "
            f"{LEAST_CELLS} cells each are needed, take a larger picture of the Moon."
        )
    offset, surface, value, sigma, cells = (np.array(column) for column in zip(*rows, strict=True))
    return Profile(offset, surface, value, sigma, cells, photo_fit.utc, tone_curve, source, licence)


def _content(path: Path) -> bytes:
    """The bytes of a file that may be a profile."""
    try:
        if path.is_dir():
            raise InputError(f"{path} is a folder: give the profile itself.")
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path} is too large for a profile, which has a line for each arcmin: check the name.")
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path} does not exist: check the name of the profile.") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{str(path)!r} cannot be read ({getattr(error, 'strerror', None) or error}).") from None


def _fact(line: str) -> tuple[str, str]:
    key, _, value = line.lstrip("#").partition(":")
    # A spreadsheet gives every row as many commas as the table has.
    return key.strip().lower(), value.strip().rstrip(",")


def _table(path, lines: list[str]) -> dict[str, np.ndarray]:
    """The columns by name, (bin,) each, with `cells` 0 where there is no such column."""
    numbered = [(number, line) for number, line in enumerate(lines, 1) if line and not line.startswith("#")]
    if not numbered:
        raise InputError(f"{path} holds no table: it needs the columns {', '.join(COLUMNS)}.")
    header = [name.strip().lower() for name in numbered[0][1].split(",")]
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise InputError(
            f"{path} has no column {', '.join(missing)}: its first row must name {', '.join(COLUMNS)}, "
            "with commas between them."
        )
    rows = []
    for number, line in numbered[1:]:
        fields = next(csv.reader([line]))
        if len(fields) != len(header):
            raise InputError(f"{path}, line {number}, has {len(fields)} fields where its header has {len(header)}.")
        row = dict(zip(header, fields, strict=True))
        rows.append([_number(path, number, name, row.get(name, "0")) for name in (*COLUMNS, "cells")])
        _check(path, number, dict(zip(COLUMNS, rows[-1], strict=False)))
    # A colour may be missing throughout: the blue of many an umbra is black.
    full = sum(bool(np.isfinite(row[2:5]).any()) for row in rows)
    if full < LEAST_ROWS:
        raise InputError(
            f"{path} holds {full} row{'' if full == 1 else 's'} with any colour: a fit needs at least {LEAST_ROWS}."
        )
    return {name: np.array(column) for name, column in zip((*COLUMNS, "cells"), zip(*rows, strict=True), strict=True)}


def _number(path, line: int, name: str, text: str) -> float:
    """A finite number; NaN for an empty field of a channel."""
    text = text.strip()
    if not text and name.removesuffix("_sd") in CHANNELS:
        return np.nan
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"{path}, line {line}: {name} is {text!r}, which is not a number.")
    return value


def _check(path, line: int, row: dict[str, float]) -> None:
    """Raises `InputError` for numbers that no photograph gives."""
    if not 0 <= row["offset_arcmin"] < 180:
        raise InputError(
            f"{path}, line {line}: offset_arcmin is {row['offset_arcmin']:g}, but an eclipse is within 0 to 180."
        )
    if row["surface"] <= 0:
        raise InputError(f"{path}, line {line}: surface is {row['surface']:g}, but it must be above 0 (1 = mean disc).")
    for name in CHANNELS:
        if np.isnan(row[name]) != np.isnan(row[f"{name}_sd"]):
            raise InputError(f"{path}, line {line}: {name} and {name}_sd must both be given, or both be left empty.")
        if row[f"{name}_sd"] <= 0:
            raise InputError(f"{path}, line {line}: {name}_sd is {row[f'{name}_sd']:g}, but it must be above 0.")
