"""The notebooks, and what every one is asked.

Two files of tests ask it of one half each: a file is what `--dist loadfile` gives to one process, and in a single one
the notebooks, which take minutes, would all wait for each other.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
# Cells are run as a plain program: all that a notebook of ours needs of Jupyter is the showing of pictures.
RUN = """
import json, sys
import matplotlib
matplotlib.use("Agg")
for cell in json.load(open(sys.argv[1], encoding="utf-8"))["cells"]:
    if cell["cell_type"] == "code":
        exec(compile("".join(cell["source"]), sys.argv[1], "exec"))
"""


def half(number: int) -> pytest.MarkDecorator:
    """Gives a test every second notebook as `notebook`, from the first (0) or the second (1)."""
    return pytest.mark.parametrize("notebook", NOTEBOOKS[number::2], ids=lambda path: path.stem)


def check_committed_without_outputs(notebook: Path) -> None:
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        assert cell["cell_type"] == "markdown" or (not cell["outputs"] and cell["execution_count"] is None)


def check_runs(notebook: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(notebook)], cwd=ROOT, capture_output=True, text=True, timeout=180,
        env=os.environ | {"MPLBACKEND": "Agg"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
