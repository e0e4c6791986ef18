"""Float64 for every test, compiled quickly, and the material that is not committed."""

import os
from pathlib import Path

import jax
import matplotlib
import pytest

from eclipsejax import session

session.compile_quickly()
jax.config.update("jax_enable_x64", True)
matplotlib.use("Agg")

SHARED = Path(os.environ.get("ECLIPSEJAX_SHARED", Path(__file__).parents[2] / "shared"))


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of reference tables and photographs that may be read but not committed."""
    if not SHARED.is_dir():
        pytest.skip(f"reference material not found at {SHARED.name}/ beside the checkout")
    return SHARED
