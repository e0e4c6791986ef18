"""What an archive keeps of each fit: a small file of its own, whole or not believed.

A file is written beside its place and renamed into it, and holds the hash of its content: what a kill or a full disk
left half-written, and what was altered, is as if it were not there. Its name is the hash of all that the fit depends
on: the bytes of the photographs, the configuration, the version of the program.
"""

import errno
import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eclipsejax.errors import InputError, printable
from eclipsejax.whole_file import reason, whole_file
from inverse.chain import digest

FORMAT = 1
QUANTITIES = {"dust.extinction": "dust_extinction", "stratospheric_optical_depth": "stratospheric_optical_depth"}
NO_PART_OF_A_FIT = ("cli", "progress", "plot", "report", "page", "movie", "selftest")  # in names of modules
OK, NOT_CONVERGED, FAILED = "ok", "not converged", "failed"


class Unwritable(InputError):
    """The folder of the archive takes nothing more: no fault of a photograph."""


@dataclass(frozen=True)
class Task:
    """One fit: a photograph by itself, or several of one eclipse together. Tuples have an item for each.

    - `paths`, `sha256`: files and what they must hold; `times`, `sites`, `discs`: as `fit_atmosphere` takes them.
    - `draws`, `seed`: those of `fit_atmosphere`.
    """

    paths: tuple[str, ...]
    sha256: tuple[str, ...]
    times: tuple[str | None, ...]
    sites: tuple[tuple[float, ...] | None, ...]
    discs: tuple[int | None, ...]
    draws: int | None = None
    seed: int = 0

    @property
    def configuration(self) -> str:
        """Hash of what is asked of the photographs."""
        return digest({name: value for name, value in asdict(self).items() if name not in ("paths", "sha256")})

    @property
    def key(self) -> str:
        """Hash of all that the fit depends on: the name of what is kept of it."""
        return digest([FORMAT, list(self.sha256), self.configuration, program()])[:32]


@cache
def program() -> str:
    """Version of this program, with a hash of the code and tables that a fit goes through: a checkout changes daily."""
    total = hashlib.sha256()
    for path in files_of_a_fit():
        total.update(path.name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return f"{version('eclipsejax')}+{total.hexdigest()[:12]}"


def files_of_a_fit() -> list[Path]:
    """The code and tables that a fit goes through; packages within the two, such as this one, are no part of it."""
    home = Path(__file__).resolve().parents[2]
    parts = ("inverse/*.py", "inverse/tables/*", "eclipsejax/*.py", "eclipsejax/tables/*")
    every = [path for part in parts for path in home.glob(part)]
    return [
        path for path in sorted(every) if path.is_file() and not any(word in path.name for word in NO_PART_OF_A_FIT)
    ]


def found(fit, task: Task, seconds: float) -> dict[str, Any]:
    """The content of a row from a `Fit`; columns are those of `inverse.archive.tables`."""
    told: Mapping[str, Any] = fit.diagnostics
    sampler, weighed = told.get("sampler") or {}, told.get("psis") or {}
    converged = bool(told.get("converged", False)) and bool(sampler.get("converged", True))
    content = {
        **_common(task, seconds),
        "status": OK if converged else NOT_CONVERGED,
        "error": None,
        "utc": sorted(photo["utc"] for photo in fit.provenance["photographs"])[0],
        "converged": converged,
        "method": told.get("method"),
        "smooth_error": _number(max((one["smooth"] for one in told.get("errors") or []), default=math.nan)),
        "residual_rms": _number(max(told.get("residual_rms") or [math.nan])),
        "cells": sum(told.get("cells") or [0]),
        "k_hat": _number(weighed.get("k_hat")),
        "r_hat": _number(sampler.get("r_hat")),
        "not_finite": told.get("not_finite"),
        "warnings": len(fit.warnings),
        "warnings_text": " ".join(fit.warnings),
    }
    for name, column in QUANTITIES.items():
        estimate = fit.estimates[name]
        content |= {
            f"{column}_median": _number(estimate.median),
            f"{column}_sd": _number(estimate.sd),
            **{f"{column}_{level}_{end}": _number(value) for level in ("ci68", "ci95")
               for end, value in zip(("low", "high"), getattr(estimate, level), strict=True)},
            f"{column}_upper_limit": _number(estimate.ci95[1]) if estimate.is_limit else None,
        }  # fmt: skip
    dust = fit.estimates["dust.extinction"]
    return content | {"informed": _number(dust.informed), "ess": _number(dust.ess)}


def failed(task: Task, reason: str, seconds: float = 0.0) -> dict[str, Any]:
    """The content of a row of which nothing came, with the reason in one sentence.

    A row is that of its photographs' bytes: copies, and the file under another name, have it too. So it names no file.
    """
    times = sorted(time for time in task.times if time)
    for path in sorted(task.paths, key=len, reverse=True):
        reason = reason.replace(path, "The photograph").replace(printable(path), "The photograph")
    return _common(task, seconds) | {
        "status": FAILED,
        "error": printable(" ".join(reason.split())),
        "utc": (times or [None])[0],
    }


def _common(task: Task, seconds: float) -> dict[str, Any]:
    return {
        "key": task.key,
        "configuration": task.configuration,
        "photographs": len(task.sha256),
        "sha256": " ".join(task.sha256),
        "seconds": round(seconds, 3),
        "version": program(),
        "jax": version("jax"),
    }


def _number(value) -> float | None:
    """JSON has no infinity and no NaN."""
    return float(value) if value is not None and math.isfinite(value) else None


def row_file(out: Path, key: str) -> Path:
    """Where the row of a key is kept in an archive."""
    return out / "rows" / f"{key}.json"


def read_row(out: Path, key: str) -> dict[str, Any] | None:
    """The row of a key; None where there is none that can be believed."""
    try:
        stored = json.loads(row_file(out, key).read_bytes())
        content = stored["row"]
        return content if stored["sha256"] == digest(content) and content["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def write_row(out: Path, content: Mapping[str, Any]) -> None:
    """Keep a row, whole or not at all; `Unwritable` where it cannot be kept."""
    text = json.dumps({"sha256": digest(content), "row": content}, indent=1)
    write_whole(row_file(out, content["key"]), text.encode())


def write_whole(path: Path, data: bytes) -> None:
    """Put a file in its place in one step; `Unwritable` where that cannot be done."""
    try:
        with whole_file(path, f".{os.getpid()}") as part:
            part.write_bytes(data)
    except OSError as error:
        raise unwritable(path.parent, error) from None


def unwritable(folder: Path, error: OSError) -> Unwritable:
    """The sentence for a folder that takes nothing more."""
    return Unwritable(
        f"{folder} cannot be written to ({reason(error)}): make room or correct its permissions, and run the "
        "same command again; what is finished is kept."
    )


def disk_trouble(error: BaseException | None) -> OSError | None:
    """The error of a full or read-only disk behind an exception, if there is one."""
    seen = 0
    while error is not None and seen < 20:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG):
            return error
        error, seen = error.__cause__ or error.__context__, seen + 1
    return None
