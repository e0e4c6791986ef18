"""One measurement of a benchmark, and how it is timed, printed and kept."""

import json
import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import jax

RESULTS = Path(__file__).parent / "results"
PACKAGES = ("jax", "numpy", "scipy", "diffrax", "sasktran2")


@dataclass(frozen=True)
class Measurement:
    """Time and error of one method with one setting.

    - `cold_s`: first call, with compilation [s]; None where nothing is compiled.
    - `warm_s`: shortest of the later calls [s].
    - `max_error`: largest relative error.
    - `note`: what was left out, scaled or is otherwise to be known.
    """

    method: str
    setting: str
    cold_s: float | None
    warm_s: float
    max_error: float | None
    note: str = ""

    def scaled(self, factor: float, note: str) -> "Measurement":
        """With the warm time multiplied: the whole from a part."""
        return Measurement(self.method, self.setting, self.cold_s, factor * self.warm_s, self.max_error, note)


def timed(function: Callable[[], Any], repeats: int = 3) -> tuple[Any, float, float]:
    """(value, first time [s], shortest of `repeats` later times [s]) of a call, results computed to the end."""

    def once():
        start = time.perf_counter()
        value = jax.block_until_ready(function())
        return value, time.perf_counter() - start

    value, cold = once()
    return value, cold, min((once()[1] for _ in range(repeats)), default=cold)


def report(name: str, case: str, measurements: list[Measurement], facts: dict[str, Any] | None = None) -> None:
    """Print a table and write it to results/`name`.json.

    - `case`: what is computed, in a sentence.
    - `facts`: other figures worth keeping.
    """
    print(f"{case}\n")
    print(f"{'method':<38}{'setting':<26}{'cold s':>9}{'warm s':>11}{'error':>10}  note")
    for m in measurements:
        cold = "" if m.cold_s is None else f"{m.cold_s:.2f}"
        error = "" if m.max_error is None else f"{m.max_error:.1e}"
        print(f"{m.method:<38}{m.setting:<26}{cold:>9}{m.warm_s:>11.4g}{error:>10}  {m.note}")
    for key, value in (facts or {}).items():
        print(f"{key}: {value}")
    record = {
        "case": case,
        "machine": machine(),
        "facts": facts or {},
        "measurements": [asdict(m) for m in measurements],
    }
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.json").write_text(json.dumps(record, indent=1) + "\n")


def machine() -> dict[str, Any]:
    """What a time depends on, without the machine's name."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = None
    return {
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),  # more than one: others were computing too
        "architecture": platform.machine(),
        "python": platform.python_version(),
        **versions,
    }
