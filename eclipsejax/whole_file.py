"""Files that are whole or not there: written beside their place, and put into it in one step."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(path: Path, writer: str = "", suffix: str = "", optional: bool = False) -> Iterator[Path]:
    """Where to write what is to become the file at `path`, once it is whole and on the disk.

    A kill at any moment leaves the file as it was, or whole and new; whatever is raised leaves it as it was, and
    nothing beside it. What a kill leaves beside it, the next to write it writes over. Raises `OSError`.

    - `writer`: tells those apart that may write the same file at once.
    - `suffix`: that the name needs, for a library that goes by it.
    - `optional`: nothing written, or what was written moved elsewhere, leaves the file as it was.
    """
    part = path.with_name(f".{path.name}{writer}.part{suffix}")
    try:
        yield part
        if part.exists() or not optional:
            with part.open("r+b") as file:
                os.fsync(file.fileno())
            os.replace(part, path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def reason(error: OSError) -> str:
    """What the system says was wrong, in a few words: HDF5 puts addresses and dates in their place."""
    return os.strerror(error.errno) if error.errno else " ".join(str(error).split())
