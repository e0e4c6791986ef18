"""`eclipsejax gallery`: the figures of Yapo & Cutler (2009) and more, on one page."""

import sys
from argparse import Namespace
from functools import partial
from pathlib import Path

from eclipsejax import session
from eclipsejax.errors import InputError


def add_to(commands) -> None:
    """Describe the command to the parser."""
    command = commands.add_parser(
        "gallery",
        help="draw all figures, on one page",
        description="Draw the figures of Yapo & Cutler (2009) and more as PNG, and a page, index.html, that holds them "
        "all with captions. It takes some minutes.",
    )
    command.set_defaults(action=_gallery)
    add = command.add_argument
    add("-o", dest="output", required=True, type=Path, metavar="DIR", help="folder; made if there is none")
    add("--size", type=session.number(64, 2048), default=320, metavar="PIXELS", help="of each Moon; default 320")


def _gallery(options: Namespace) -> None:
    if options.output.exists() and not options.output.is_dir():
        raise InputError(f"The gallery cannot be written to {options.output}, which is a file: name a folder.")
    session.start()
    from eclipsejax.figures.gallery import write_gallery

    said = partial(print, file=sys.stderr)
    page = write_gallery(options.output, size=round(options.size), progress=said)
    print(f"Wrote {page}.")
