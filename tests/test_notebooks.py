"""Every notebook runs from top to bottom, and is committed without what it prints."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SLOW = ("photographs_2015",)  # a minute, of what the others show as well but for the photographs beside it
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

each = pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)


def test_there_are_notebooks():
    assert len(NOTEBOOKS) > 1


@each
def test_notebook_is_committed_without_outputs(notebook):
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        assert cell["cell_type"] == "markdown" or (not cell["outputs"] and cell["execution_count"] is None)


@pytest.mark.parametrize(
    "notebook",
    [pytest.param(path, marks=pytest.mark.slow if path.stem in SLOW else (), id=path.stem) for path in NOTEBOOKS],
)
def test_notebook_runs(notebook):
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(notebook)], cwd=ROOT, capture_output=True, text=True, timeout=180,
        env=os.environ | {"MPLBACKEND": "Agg"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
