"""Every notebook runs from top to bottom, and is committed without what it prints: half of them; see `notebooks`."""

from tests.notebooks import NOTEBOOKS, check_committed_without_outputs, check_runs, half


def test_there_are_notebooks_for_both_files():
    assert len(NOTEBOOKS) > 1


@half(0)
def test_notebook_is_committed_without_outputs(notebook):
    check_committed_without_outputs(notebook)


@half(0)
def test_notebook_runs(notebook):
    check_runs(notebook)
