"""One fit of an archive, from files to a kept row; what a worker does, here or on another machine."""

import threading
import time as clock
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eclipsejax import session
from eclipsejax.errors import InputError
from inverse.archive.limits import Limits, limited
from inverse.archive.rows import (
    Task,
    Unwritable,
    disk_trouble,
    failed,
    found,
    read_row,
    row_file,
    unwritable,
    write_row,
    write_whole,
)

MOST_ATTEMPTS = 2  # after so many processes that died over a photograph in one run, it has failed
_one_at_a_time = threading.Lock()  # limits are those of the process


def fitted(task: Task, chain: Path, resume: bool):
    """The `Fit` of a task."""
    session.start()
    from inverse.fit import fit_atmosphere

    times = [time for time in task.times if time is not None]
    return fit_atmosphere(
        task.paths, time=times or None, site=list(task.sites), disc=list(task.discs), draws=task.draws, seed=task.seed,
        chain=chain, resume=resume, further=False,
    )  # fmt: skip


@dataclass(frozen=True)
class Desk:
    """Where and how fits are done.

    - `out`: folder of the archive, as every worker sees it; `run`: name of this run.
    - `fit`: (task, file of the chain, whether to go on with it) -> `Fit`.
    """

    out: Path
    run: str
    limits: Limits = Limits()
    fit: Callable[[Task, Path, bool], Any] = fitted


def work(task: Task, desk: Desk) -> dict[str, Any]:
    """The row of a task: the kept one, or that of a fit done now, which is kept.

    Raises only `Unwritable`: whatever else happens is what the row tells.
    """
    with _one_at_a_time:
        kept = read_row(desk.out, task.key)
        if kept is not None:
            return kept
        attempts = _attempt(task, desk)
        if attempts > MOST_ATTEMPTS:
            content = failed(
                task, f"The process that fitted it died, {MOST_ATTEMPTS} times: too little memory, perhaps."
            )
        else:
            content = _fit(task, desk)
        write_row(desk.out, content)
        _attempts(task, desk).unlink(missing_ok=True)
        return content


def _fit(task: Task, desk: Desk) -> dict[str, Any]:
    started = clock.perf_counter()
    folder = desk.out / "fits" / task.key
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(desk.out, error) from None

    def told(reason: str) -> dict[str, Any]:
        return failed(task, reason, clock.perf_counter() - started)

    with limited(desk.limits, len(task.paths), lambda reason: write_row(desk.out, told(reason))):
        try:
            fit = _with_chain(task, desk, folder / "chain.h5")
            held = tuple(photo["sha256"] for photo in fit.provenance["photographs"])
            if held != task.sha256:
                return told("The photograph was changed while the archive was made: run the same command again.")
            try:
                fit.save(folder)
            except InputError as error:  # of a folder that was there a moment ago
                raise Unwritable(f"{error} What is finished is kept.") from None
            return found(fit, task, clock.perf_counter() - started)
        except Unwritable:
            raise
        except Exception as error:
            if trouble := disk_trouble(error):
                raise unwritable(desk.out, trouble) from None
            write_whole(folder / "failure.txt", traceback.format_exc().encode())  # which finds an unwritable folder too
            if isinstance(error, InputError):
                return told(str(error))
            reason = f"{type(error).__name__}: {error}".strip().rstrip(".")[:300]
            return told(f"The program failed ({reason}): fits/{task.key}/failure.txt says where.")


def _with_chain(task: Task, desk: Desk, chain: Path):
    """The fit, going on with a chain that was interrupted; a chain that is not of this fit is thrown away."""
    if chain.exists():
        try:
            return desk.fit(task, chain, True)
        except InputError as error:
            if disk_trouble(error):
                raise
            chain.unlink(missing_ok=True)
    return desk.fit(task, chain, False)


def _attempts(task: Task, desk: Desk) -> Path:
    return desk.out / "attempts" / f"{task.key}-{desk.run}"


def _attempt(task: Task, desk: Desk) -> int:
    """Which attempt at a task this one is in this run, from 1; those before it ended with their process."""
    path = _attempts(task, desk)
    number = (path.stat().st_size if path.exists() else 0) + 1
    write_whole(path, b"." * number)
    return number


def prepared(out: Path) -> None:
    """Make the folders of an archive; `Unwritable` where they cannot be used."""
    try:
        for name in ("rows", "fits", "photographs", "attempts"):
            (out / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Unwritable(
            f"The archive cannot be written to {out} ({error.strerror or error}): give --archive a folder that can be "
            "written, with room in it."
        ) from None


@contextmanager
def alone(out: Path) -> Iterator[None]:
    """Two runs at once in one folder would do the same work twice; where locks are unknown, they may."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    try:
        file = (out / "lock").open("w")
    except OSError as error:
        raise unwritable(out, error) from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"Another command is at work on {out}: wait for it, or give another folder.") from None
        except OSError:  # a file system without locks
            pass
        _clear(out / "attempts")
        yield
        _clear(out / "attempts")


def _clear(folder: Path) -> None:
    for stale in folder.iterdir():
        stale.unlink(missing_ok=True)


def forget(out: Path, key: str) -> None:
    """Throw away the row of a fit that failed; a chain that was begun is gone on with."""
    for path in (row_file(out, key), out / "fits" / key / "failure.txt"):
        path.unlink(missing_ok=True)
