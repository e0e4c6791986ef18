"""`eclipsejax doctor`: facts that a report of a fault needs, and figures that are right or said to be wrong."""

import os
import re
import subprocess
import sys

import jax
import numpy as np
import pytest

from eclipsejax import cli, selftest
from eclipsejax.commands import doctor


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """A folder of its own, as a user has one who sets nothing else; then that of the tests again."""
    common = os.environ["JAX_COMPILATION_CACHE_DIR"]
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    yield
    jax.config.update("jax_compilation_cache_dir", common)


def test_the_folder_that_jax_is_told_of_is_used_before_ours(capsys, quick, tmp_path, monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "chosen"))
    assert cli.main(["doctor"]) == 0
    assert f"{tmp_path}/chosen, writable" in capsys.readouterr().out


@pytest.fixture
def quick(monkeypatch):
    """The figures without the work."""
    checks = [selftest.Check("bending", "'", 66.02, 66.02, 0.01), selftest.Check("light", "-", 1e-3, 1e-3, 1e-6)]
    monkeypatch.setattr(selftest, "selftest", lambda: iter(checks))
    return checks


def test_facts_are_told_and_all_is_well(capsys, quick, tmp_path):
    assert cli.main(["doctor"]) == 0
    said = capsys.readouterr().out
    for word in ("eclipsejax", "jaxlib", "python", "devices", "float64", "cores", "memory", "extra cluster"):
        assert word in said
    assert re.search(
        rf"compile cache +{re.escape(str(tmp_path))}/eclipsejax/jax, writable, \d+ files, [\d.]+ MB\n", said
    )
    assert said.count(" ok\n") == 2 and said.endswith("All is well.\n")


def test_a_wrong_figure_fails_and_the_rest_is_still_told(capsys, quick):
    quick.insert(1, selftest.Check("depth", "-", 3.0, np.nan, 0.1))
    assert cli.main(["doctor"]) == 1
    said = capsys.readouterr().out
    assert said.count("FAILED") == 1 and said.count(" ok\n") == 2 and "1 of the figures are wrong" in said


def test_missing_extras_are_told_with_what_to_install(capsys, quick, monkeypatch):
    there = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: None if name in ("dask", "emcee") else there(name))
    assert cli.main(["doctor"]) == 0
    said = capsys.readouterr().out
    assert "dask missing" in said and "pip install 'eclipsejax[cluster]'" in said
    assert re.search(r"^emcee +MISSING$", said, re.MULTILINE)


def test_a_cache_that_cannot_be_used_is_told(tmp_path):
    assert "cannot be made" in doctor.compile_cache(None)
    assert "cannot be read" in doctor.compile_cache(str(tmp_path / "nowhere"))
    (tmp_path / "broken").touch()
    assert "1 of them EMPTY" in doctor.compile_cache(str(tmp_path))


def test_a_cache_that_takes_and_gives_nothing_is_no_flood_of_warnings(tmp_path):
    program = "from eclipsejax import session; session.start(); import jax; print(jax.jit(lambda x: x + 1)(1.0))"

    def ran(folder):
        environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(folder), "PYTHONWARNINGS": "always"}
        return subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)

    for folder in ("/proc", tmp_path / "whole", tmp_path / "whole"):  # nobody may make a file in the first
        done = ran(folder)
        assert done.stdout == "2.0\n" and "persistent compilation cache" not in done.stderr
        for path in tmp_path.glob("whole/*-cache"):
            path.write_bytes(b"")  # as a full disk leaves it


def test_what_raises_is_a_figure_that_is_wrong(monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("no device")

    monkeypatch.setattr(selftest, "shadow_irradiance", broken)
    checks = list(selftest.selftest())
    assert [check.passed for check in checks] == [True, True, *[False] * 4, *[True] * 6]


def test_figures_are_right():
    checks = list(selftest.selftest())
    assert len(checks) == 12 and all(check.passed for check in checks)
    assert not selftest.Check("x", "-", 1.0, 1.2, 0.1).passed
