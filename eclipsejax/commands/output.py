"""Where a command writes: refused before the work, and all of a file or nothing."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from eclipsejax.errors import InputError
from eclipsejax.whole_file import whole_file as whole


def check_writable(path: Path, suffixes: Sequence[str], what: str) -> None:
    """Before the work, not after it.

    - `what`: the thing to be written, for the message: "picture".
    """
    if path.suffix.lower() not in suffixes:
        raise InputError(f"The {what} {path} has no known format: end its name in {', '.join(suffixes)}.")
    # The folder as well as the file: what is there is replaced by a new file.
    touched = [path.parent, path] if path.exists() else [path.parent]
    if path.is_dir() or not all(os.access(place, os.W_OK) for place in touched):
        raise InputError(f"The {what} {path} cannot be written: name a file in a folder that exists and is writable.")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`, renamed to it at the end; what fails or is interrupted leaves nothing.

    Whoever moves the temporary file elsewhere leaves `path` as it was.
    """
    try:
        with whole(path, f".{os.getpid()}", path.suffix, optional=True) as temporary:
            yield temporary
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error}): choose another place.") from None
