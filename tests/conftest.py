"""Every test runs as the commands do: float64, one thread for NumPy, compiled code kept. And material not committed."""

import atexit
import os
import shutil
import tempfile
from pathlib import Path

import jax
import matplotlib
import pytest
from jax.experimental.compilation_cache import compilation_cache

from eclipsejax import session
from inverse.catalogue import data_file
from inverse.evidence import gather, prepare

# What one process of a run has compiled (a worker, a notebook, a command), the others need not; no later run sees it,
# unless the variable is set.
if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    os.environ["JAX_COMPILATION_CACHE_DIR"] = tempfile.mkdtemp(prefix="eclipsejax-tests-")
    atexit.register(shutil.rmtree, os.environ["JAX_COMPILATION_CACHE_DIR"], ignore_errors=True)
session.start()
matplotlib.use("Agg")

LONGEST = (
    "test_fit", "test_notebooks", "test_shadow_table", "test_photometry", "test_scattered", "test_render",
    "test_hard_cases", "test_shadow",
)  # fmt: skip
SHARED = Path(os.environ.get("ECLIPSEJAX_SHARED", Path(__file__).parents[2] / "shared"))


def pytest_collection_modifyitems(items):
    """What takes minutes is begun first: begun last, it would keep one process busy and the other waiting."""
    items.sort(key=lambda item: LONGEST.index(item.path.stem) if item.path.stem in LONGEST else len(LONGEST))


@pytest.fixture
def compiled_anew():
    """JAX's cache is off: what it takes from there could not be kept as a program (`eclipsejax.programs`)."""
    jax.config.update("jax_enable_compilation_cache", False)
    compilation_cache.reset_cache()
    yield
    jax.config.update("jax_enable_compilation_cache", True)
    compilation_cache.reset_cache()


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of reference tables and photographs that may be read but not committed."""
    if not SHARED.is_dir():
        pytest.skip(f"reference material not found at {SHARED.name}/ beside the checkout")
    return SHARED


@pytest.fixture(scope="module")
def likelihood():
    """Of the measured profile of 2022-05-16, as a fit begins with it."""
    profile = data_file("2022-05-16-profile.csv")
    return prepare(gather([profile], time=None, site=None, disc=None, progress=lambda *_: None))
