"""What mkdocs fills into the pages from the program itself, so that it cannot be out of date.

`{{ public eclipsejax }}` becomes the documentation of every public name of a package, by module; `{{ help render }}`
what a command prints with --help; `{{ opening eclipsejax.limb }}` the docstring of a module.
"""

import os
import re
from importlib import import_module
from itertools import groupby
from subprocess import run
from sys import executable


def on_page_markdown(markdown: str, **_) -> str:
    """Hook of mkdocs: the page with its placeholders filled."""
    makers = {"public": _public, "help": _help, "opening": _opening}
    return re.sub(r"\{\{ (\w+) ([\w. -]+) \}\}", lambda match: makers[match[1]](match[2]), markdown)


def _public(package: str) -> str:
    home = import_module(package)._HOME
    names = sorted(home, key=lambda name: (home[name], name))
    sections = []
    for module, members in groupby(names, key=home.__getitem__):
        blocks = [f"::: {package}.{module}.{name}" for name in members]
        sections += [f"## `{package}.{module}`", _opening(f"{package}.{module}"), *blocks]
    return "\n\n".join(sections)


def _opening(module: str) -> str:
    return (import_module(module).__doc__ or "").strip()


def _help(command: str) -> str:
    programs = {"fit_atmosphere": ["inverse.cli"]}
    module, *words = programs.get(command, ["eclipsejax.cli", command])
    done = run(
        [executable, "-m", module, *words, "--help"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "COLUMNS": "74"},  # what a page holds without scrolling
    )
    return f"```text\n{done.stdout.strip().replace('cli.py', command)}\n```"
