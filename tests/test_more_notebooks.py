"""The other half of the notebooks: see `test_notebooks`."""

from tests.notebooks import check_committed_without_outputs, check_runs, half


@half(1)
def test_notebook_is_committed_without_outputs(notebook):
    check_committed_without_outputs(notebook)


@half(1)
def test_notebook_runs(notebook):
    check_runs(notebook)
