"""Which photographs an archive is made of: a catalogue that somebody wrote, or a folder.

A catalogue is a CSV file (UTF-8, commas) whose first row names its columns, in any order; others are ignored:

    file,utc,local_time,zone,site,disc,sha256,eclipse,licence,credit,notes
    2022/moon.jpg,2022-05-16T04:06:00Z,,,"-10.94,-37.06",,,,,,
    https://example.org/moon.jpg,,2022-05-16T01:06:00,America/Recife,"-8.05,-34.9,10",2,,2022-05-16,CC BY 4.0,A. Moon,

- `file`: name relative to the catalogue, below its folder, or an https address. The rest may be empty.
- `utc`: ISO time with its zone. Or `local_time`, the time on the clock, and `zone`, an offset (-03:00) or a name of the
  IANA time zones. By default what the file itself is certain of.
- `site`: LAT,LON[,HEIGHT] [degrees, north and east positive; m]. `disc`: which of several in the picture, from 1.
- `sha256`: of the file. `eclipse`: its date, to be checked against the time. `licence`, `credit`, `notes`: free text.

Nothing in a catalogue is believed: a row that cannot be used keeps one sentence that says why, and the others go on.
"""

import csv
import io
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path, PurePosixPath, PureWindowsPath
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo

from eclipsejax.almanac import nearest_eclipse
from eclipsejax.calendar import read_clock, write_clock
from eclipsejax.errors import InputError, printable
from inverse.filetype import SUFFIXES

LARGEST_CATALOGUE = 50e6  # bytes
ALIASES = {"time": "utc", "event": "eclipse", "note": "notes"}
FREE_TEXT = ("licence", "credit", "notes")
SHOWN = 60  # characters of what a catalogue says, in a message


@dataclass(frozen=True)
class Listed:
    """One photograph of an archive.

    - `line`: of the catalogue, or its number in the folder, from 1; `source`: its name or address as written there.
    - `path`: where it lies; None for what is to be fetched from `source`.
    - `time`: UTC, ISO; `site`, `disc`: as `fit_atmosphere` takes them. None where it is not said.
    - `refused`: the sentence that says why it cannot be used, else None.
    """

    line: int
    source: str
    path: Path | None = None
    sha256: str | None = None
    time: str | None = None
    site: tuple[float, ...] | None = None
    disc: int | None = None
    eclipse: str | None = None
    licence: str = ""
    credit: str = ""
    notes: str = ""
    refused: str | None = None


def listed(source: str | os.PathLike, out: Path) -> list[Listed]:
    """The photographs of a catalogue or folder; `InputError` where there is none at all.

    - `out`: folder of the archive, which is not searched.
    """
    source = Path(source)
    try:
        folder = source.is_dir()
    except (OSError, ValueError) as error:
        raise InputError(f"{str(source)!r} cannot be opened ({getattr(error, 'strerror', None) or error}).") from None
    found = list(_in_folder(source, out)) if folder else list(_in_catalogue(source))
    if not found:
        raise InputError(f"{source} names no photograph: give a folder with some, or a catalogue (CSV) with rows.")
    return found


def _in_folder(folder: Path, out: Path) -> Iterator[Listed]:
    """Photographs in a folder and below it, by their suffixes; links to folders are not followed."""
    number = 0
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if (Path(place) / name).resolve() != out.resolve())
        for name in sorted(names):
            path = Path(place) / name
            if path.suffix.lower() in SUFFIXES and not name.startswith("."):
                number += 1
                yield Listed(number, printable(path.relative_to(folder).as_posix()), path)


def _in_catalogue(path: Path) -> Iterator[Listed]:
    rows = _rows(path)
    header = next(rows, (0, []))[1]
    names = [ALIASES.get(name.strip().lower(), name.strip().lower()) for name in header]
    if "file" not in names:
        raise InputError(f"{path} has no column file: the first row of a catalogue names its columns, with commas.")
    for line, fields in rows:
        row = {name: field.strip() for name, field in zip(names, fields, strict=False)}
        try:
            if len(fields) != len(names):
                raise InputError(f"it has {len(fields)} fields where the header has {len(names)}.")
            yield _entry(path, line, row)
        except InputError as error:
            yield Listed(line, _short(row.get("file", ""), 500), refused=f"{path.name}, line {line}: {error}")


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each row of a CSV file that is no comment and not empty."""
    try:
        with path.open("rb") as file:
            data = file.read(int(LARGEST_CATALOGUE) + 1)
    except FileNotFoundError:
        raise InputError(f"{path} does not exist: name a folder of photographs or a catalogue (CSV).") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{str(path)!r} cannot be read ({getattr(error, 'strerror', None) or error}).") from None
    if len(data) > LARGEST_CATALOGUE:
        raise InputError(f"{path} is larger than {LARGEST_CATALOGUE / 1e6:.0f} MB: split the catalogue.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path} is not a text file in UTF-8: a catalogue is CSV, such as a spreadsheet exports.")
    lines = ("\n" if line.startswith("#") else line for line in io.StringIO(text, newline=None))
    reader = csv.reader(lines)
    try:
        for fields in reader:
            if any(field.strip() for field in fields):
                yield reader.line_num, fields
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}, is not CSV ({error}): correct it.") from None


def _entry(catalogue: Path, line: int, row: dict[str, str]) -> Listed:
    """One row; `InputError` for what cannot be used of it."""
    sha256 = row.get("sha256", "").lower()
    if sha256 and not re.fullmatch(r"[0-9a-f]{64}", sha256):
        raise InputError(f"sha256 is {_short(sha256)}, which is not 64 hexadecimal digits.")
    disc = row.get("disc", "")
    if disc and not re.fullmatch(r"[1-9]\d{0,3}", disc, re.ASCII):
        raise InputError(f"disc is {_short(disc)}, which is not a whole number from 1.")
    time = _time(row.get("utc", ""), row.get("local_time", ""), row.get("zone", ""))
    eclipse = (row.get("eclipse") or " ").split(" ")[0] or None
    if eclipse and time:
        check_eclipse(eclipse, time)
    elif eclipse:
        read_clock(eclipse, date_only=True)
    return Listed(
        line, _short(row["file"], 500), _local(catalogue, row["file"]), sha256 or None, time,
        _site(row.get("site", "")), int(disc) if disc else None, eclipse,
        **{name: row.get(name, "") for name in FREE_TEXT},
    )  # fmt: skip


def _local(catalogue: Path, name: str) -> Path | None:
    """Where a file of a catalogue lies, None for an https address; `InputError` for a place that is not allowed."""
    if not name:
        raise InputError("file is empty: name a photograph.")
    if re.match(r"[a-z][a-z0-9+.-]*:/", name, re.IGNORECASE):
        check_address(name)
        return None
    posix, windows = PurePosixPath(name), PureWindowsPath(name)
    if posix.is_absolute() or windows.is_absolute() or windows.drive or ".." in {*posix.parts, *windows.parts}:
        raise InputError(
            f"{_short(name)} is not below the folder of the catalogue: move it there, or copy the catalogue."
        )
    path = catalogue.parent / name
    try:
        found = path.is_file()
    except (OSError, ValueError):
        found = False
    if not found:
        raise InputError(f"{_short(name)} does not exist below the folder of the catalogue: correct the name.")
    return path


def check_address(address: str) -> None:
    """`InputError` for anything but https, to a named host, without a password."""
    try:
        parts = urlsplit(address)
        plain = parts.scheme == "https" and bool(parts.hostname) and parts.username is None and (parts.port or 1)
    except ValueError:
        plain = False
    if not plain or not re.fullmatch(r"[!-~]+", address):
        raise InputError(f"{_short(address)} is not an https address: only those are fetched.")


def check_eclipse(eclipse: str, time: str) -> None:
    """`InputError` unless the eclipse nearest to a time is that of a date (or of the day before or after)."""
    greatest = nearest_eclipse(time).greatest
    if abs(read_clock(greatest).day - read_clock(eclipse, date_only=True).day) > 1:
        raise InputError(
            f"The eclipse is said to be that of {_short(eclipse)}, but nearest to its time, {time}, is that of "
            f"{greatest.partition('T')[0]}: correct one of them."
        )


def _time(utc: str, local: str, zone: str) -> str | None:
    """UTC, ISO, from what a row says; None where it says nothing certain."""
    if utc:
        return write_clock(read_clock(utc))
    if not (local and zone):
        return None
    if re.fullmatch(r"Z|UTC|[+-]\d\d:?\d\d", zone):
        return write_clock(read_clock(local + zone))
    try:
        there, naive = ZoneInfo(zone), datetime.fromisoformat(local)
    except (ValueError, OSError, LookupError):
        raise InputError(
            f"local_time {_short(local)} in zone {_short(zone)} cannot be read: write 2022-05-16T01:06:00 and -03:00 "
            "or America/Recife."
        ) from None
    if naive.tzinfo is not None:
        raise InputError(f"local_time {_short(local)} has a zone of its own: write it as utc.")
    early, late = (naive.replace(tzinfo=there, fold=fold).utcoffset() for fold in (0, 1))
    if early is None or early != late:  # clocks were turned
        raise InputError(f"The clocks of {zone} were turned at {local}, which is two times or none: give utc.")
    clock = read_clock(f"{naive.isoformat()}Z")
    return write_clock(clock._replace(second=clock.second - early.total_seconds()))


def _site(text: str) -> tuple[float, ...] | None:
    if not text:
        return None
    try:
        latitude, longitude, *height = (float(part) for part in text.split(","))
    except ValueError:
        latitude, longitude, height = 91.0, 0.0, []
    if len(height) > 1 or not (abs(latitude) <= 90 and -180 <= longitude <= 360):
        raise InputError(
            f"site is {_short(text)}, which is not LAT,LON[,HEIGHT] in degrees, north and east positive, and metres."
        )
    if height and not -500 <= height[0] <= 9000:
        raise InputError(f"site is at a height of {height[0]:g} m, which is no place to stand.")
    return latitude, longitude, *height


def _short(text: str, most: int = SHOWN) -> str:
    """What a catalogue says, for one line of a message."""
    plain = printable(text)
    return plain if len(plain) <= most else plain[: most - 1] + "…"
