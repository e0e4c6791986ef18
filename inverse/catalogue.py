"""The catalogue of eclipse photographs: what is known of each, and where its pixels can be had.

The project ships no photograph. One is looked for in $ECLIPSEJAX_PHOTOS, then in `../shared/photos` beside
the checkout, then fetched from the commit at which it was found. Its sha256 is always checked.
"""

import csv
import difflib
import hashlib
import os
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from urllib.parse import quote

from eclipsejax.errors import InputError

_HERE = Path(__file__).resolve().parent
_CHECKOUT = _HERE.parent


@dataclass(frozen=True)
class Entry:
    """One photograph, or one disc of a montage; `None` where it is not known.

    - `file`: name below a folder of photographs, `disc`: number of the disc in reading order, from 1.
    - `utc`: ISO with Z; `local_time`: the camera's clock, of unknown zone.
    - `site`: latitude, longitude [degrees].
    """

    file: str
    disc: int | None
    event: str
    utc: str
    site: tuple[float, float] | None
    local_time: str | None
    exposure_s: float | None
    iso: float | None
    f_number: float | None
    focal_length_mm: float | None
    camera: str | None
    width: int
    height: int
    licence: str
    credit: str
    repository: str
    commit: str
    path: str
    sha256: str
    note: str

    @property
    def licensed(self) -> bool:
        """Whether its licence lets anyone copy it."""
        return "local use only" not in self.licence

    @property
    def address(self) -> str:
        """Where the picture is, at the commit at which its sha256 was taken."""
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{quote(self.path)}"


def data_file(name: str) -> Path:
    """A file of the folder `data`, which lies inside `inverse` once installed, at the top of a checkout."""
    for folder in (_HERE / "data", _CHECKOUT / "data"):
        if (folder / name).is_file():
            return folder / name
    raise InputError(f"the file data/{name} of this package is missing: install it again.")


@cache
def catalogue() -> tuple[Entry, ...]:
    """All photographs of the catalogue, in the order of `data/photographs.csv`."""
    with data_file("photographs.csv").open(encoding="utf-8", newline="") as file:
        return tuple(_entry(row) for row in csv.DictReader(line for line in file if not line.startswith("#")))


def _entry(row: dict[str, str]) -> Entry:
    def number(text: str) -> float | None:
        return float(Fraction(text)) if text else None

    latitude, _, longitude = row["site"].partition(",")
    return Entry(
        file=row["file"],
        disc=int(row["disc"]) if row["disc"] else None,
        event=row["event"],
        utc=row["utc"],
        site=(float(latitude), float(longitude)) if longitude else None,
        local_time=row["local_time"] or None,
        exposure_s=number(row["exposure_s"]),
        iso=number(row["iso"]),
        f_number=number(row["f_number"]),
        focal_length_mm=number(row["focal_length_mm"]),
        camera=row["camera"] or None,
        width=int(row["width"]),
        height=int(row["height"]),
        **{name: row[name] for name in ("licence", "credit", "repository", "commit", "path", "sha256", "note")},
    )


def photograph(name: str, *, allow_unlicensed: bool = False) -> Path:
    """Path of a photograph of the catalogue on this machine, fetched if need be.

    - `name`: its `file`, or the last part of it where that is unique.
    - `allow_unlicensed`: fetch even a picture whose owner allows no copies, for use on this machine only.
    """
    entry = _named(name)
    for folder in _folders():
        path = folder / entry.file
        if path.is_file():
            return _checked(path, entry)
    if not (entry.licensed or allow_unlicensed):
        raise InputError(
            f"{entry.file} has no licence that allows copies ({entry.licence.partition(':')[0]}), so it is "
            f"not fetched: put it into the folder $ECLIPSEJAX_PHOTOS or pass allow_unlicensed=True."
        )
    return _fetched(entry)


def _named(name: str) -> Entry:
    known = {entry.file: entry for entry in catalogue()}
    fitting = {file for file in known if file == name or file.endswith("/" + name)}
    if len(fitting) == 1:
        return known[fitting.pop()]
    if fitting:
        raise InputError(f"{name!r} fits several photographs of the catalogue: {', '.join(sorted(fitting))}.")
    names = list(known) + [file.rpartition("/")[2] for file in known]
    near = difflib.get_close_matches(name, names, 1, 0.0)
    raise InputError(f"no photograph {name!r} in the catalogue: the nearest name is {near[0]}.")


def _folders() -> list[Path]:
    """Where photographs may lie already."""
    folders = [_CHECKOUT.parent / "shared" / "photos"]
    given = os.environ.get("ECLIPSEJAX_PHOTOS")
    if given:
        if not Path(given).is_dir():
            raise InputError(f"ECLIPSEJAX_PHOTOS names {given}, which is not a folder: correct or unset it.")
        folders.insert(0, Path(given))
    return folders


def _checked(path: Path, entry: Entry) -> Path:
    try:
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}): correct its permissions.") from None
    if found != entry.sha256:
        raise InputError(f"{path} is not the photograph of the catalogue, its sha256 differs: remove it.")
    return path


def _fetched(entry: Entry) -> Path:
    import pooch

    folder = pooch.os_cache("eclipsejax")
    try:
        path = pooch.retrieve(
            entry.address,
            known_hash=f"sha256:{entry.sha256}",
            fname=entry.file.replace("/", "--"),
            path=folder,
            downloader=pooch.HTTPDownloader(timeout=30),  # pyright: ignore[reportArgumentType]
        )
    except Exception as error:  # requests, urllib3, the disk, a wrong hash: each raises its own kind
        reason = "the file there is another one" if "hash" in str(error) else type(error).__name__
        raise InputError(
            f"{entry.file} cannot be fetched from {entry.address} ({reason}): connect to the network, or put "
            f"it into the folder $ECLIPSEJAX_PHOTOS."
        ) from None
    return Path(path)
