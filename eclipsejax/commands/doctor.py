"""`eclipsejax doctor`: the facts of this machine and installation, so that a report of a fault begins with them."""

import os
import platform
import sys
from argparse import Namespace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryFile

from eclipsejax import session

NEEDED = ("eclipsejax", "jax", "jaxlib", "numpy", "scipy", "equinox", "emcee", "arviz", "scikit-image")
EXTRAS = {
    "raw": ("rawpy",),
    "fits": ("astropy",),
    "movie": ("imageio-ffmpeg",),
    "cluster": ("dask", "distributed", "pyarrow"),
}


class Unwell(Exception):
    """A check failed; everything was printed all the same."""


def add_to(commands) -> None:
    """Describe the command to the parser."""
    command = commands.add_parser(
        "doctor",
        help="print versions and devices, and test this installation",
        description="Print versions, devices, memory and the folder of compiled code, and compute some figures that "
        "are known: the exit status is 0 if all are right, 1 otherwise. Put what it prints into a report of a fault.",
    )
    command.set_defaults(action=_doctor)


def _doctor(options: Namespace) -> None:
    session.start()
    for what, fact in facts():
        print(f"{what:18}{fact}", flush=True)
    from eclipsejax.selftest import selftest

    print(f"\n{'self-test':38}{'figure':>14}{'got':>14}{'tolerance':>11}", flush=True)
    failed = 0
    for check in selftest():
        failed += not check.passed
        numbers = f"{check.figure:14.6g}{check.got:14.6g}{check.tolerance:11.2g} {check.unit:2}"
        print(f"{check.name:38}{numbers} {'ok' if check.passed else 'FAILED'}", flush=True)
    if failed:
        print(f"\n{failed} of the figures are wrong: nothing that this installation computes can be relied on.")
        raise Unwell
    print("\nAll is well.")


def facts():
    """What is to be known: pairs of texts."""
    import jax

    for name in NEEDED:
        yield name, _version(name) or "MISSING"
    yield "python", f"{platform.python_version()}, {platform.python_implementation()}, {sys.platform}"
    yield "machine", f"{platform.machine()}, {_processor()}"
    for extra, names in EXTRAS.items():
        held = [(name, _version(name)) for name in names]
        missing = not all(found for _, found in held)
        told = ", ".join(f"{name} {found or 'missing'}" for name, found in held)
        yield f"extra {extra}", f"{told}{f': pip install {chr(39)}eclipsejax[{extra}]{chr(39)}' if missing else ''}"
    # Before the devices: XLA ends the process over an option that it does not know.
    yield "XLA_FLAGS", os.environ.get("XLA_FLAGS", "").strip() or "none"
    try:
        yield "devices", ", ".join(f"{device.device_kind} ({device.platform})" for device in jax.devices())
    except RuntimeError as error:  # no backend can be started
        yield "devices", f"none: {' '.join(str(error).split())}"
    yield "precision", "float64" if jax.config.jax_enable_x64 else "float32"  # pyright: ignore[reportAttributeAccessIssue]
    yield "cores", f"{_cores()} of {os.cpu_count()}"
    yield "memory", memory()
    yield "compile cache", compile_cache(jax.config.jax_compilation_cache_dir)  # pyright: ignore[reportAttributeAccessIssue]


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or "unknown processor"


def memory() -> str:
    """Memory of the machine and what is free of it, where the system tells in /proc."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        kilobytes = {line.partition(":")[0]: float(line.split()[1]) for line in lines if len(line.split()) > 1}
        return f"{kilobytes['MemTotal'] / 1e6:.1f} GB, {kilobytes['MemAvailable'] / 1e6:.1f} GB of it available"
    except (OSError, KeyError, ValueError):
        return "unknown"


def compile_cache(folder: str | None) -> str:
    """Where compiled code is kept, and how it is there."""
    if not folder:
        return "none: its folder cannot be made, so every run compiles anew (set XDG_CACHE_HOME to a writable folder)"
    sizes, empty = [], 0
    try:
        for entry in os.scandir(folder):
            if entry.is_file():
                sizes.append(entry.stat().st_size)
                empty += sizes[-1] == 0
    except OSError as error:
        return f"{folder}, which cannot be read ({error.strerror}): correct its permissions"
    try:
        with TemporaryFile(dir=folder) as file:
            file.write(b"eclipsejax")
        state = "writable"
    except OSError as error:
        state = f"NOT writable ({error.strerror}): make room there or correct its permissions"
    damaged = f", {empty} of them EMPTY: delete the folder" if empty else ""
    return f"{folder}, {state}, {len(sizes)} files, {sum(sizes) / 1e6:.1f} MB{damaged}"
