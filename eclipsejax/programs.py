"""Programs for a command that has just been started: compiled side by side, and kept on disk from one run to the next.

JAX's own cache keeps what XLA has compiled, but a program must be traced before it is found there, which takes longer
than to run it. Here a program is known by what it would be traced from: the files of this package, the versions of
what compiles it, the processor, and the shapes of what it is given. A file that is none of that any more is not
found; one that is cut short or cannot be loaded is passed over and written anew.
"""

import hashlib
import os
import pickle
import platform
import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from eclipsejax.whole_file import whole_file

SUFFIX = ".program"
KEPT = 100  # programs, of 1-2 MB


class Program(NamedTuple):
    """A function for arguments of certain shapes, which may still be being compiled."""

    shape: Any
    """What it returns, with shapes for arrays."""
    compiled: Future[Callable]

    def __call__(self, *arguments):
        """The function's value; waits for the compiler."""
        leaves, _ = _parts(arguments)
        values = self.compiled.result()(*jax.tree.leaves(leaves))
        arrays, others = _parts(self.shape)
        return eqx.combine(jax.tree.unflatten(jax.tree.structure(arrays), values), others)


def program(function: Callable, *arguments, folder: Path | None = None) -> Program:
    """Compile a function in the background, or take it from a folder.

    - `function`: of this package, by its name; what it returns depends on nothing but its arguments and this package.
    - `arguments`: trees of arrays, or of their shapes, and of other things by which they can be told apart in print.
    - `folder`: where programs are kept; None keeps none. Nor are any kept while JAX's own cache is on: what comes from
      there cannot be written to disk again, it would crash when run.
    """
    fresh = partial(_fresh, function, arguments)
    if folder is None or (
        jax.config.values["jax_enable_compilation_cache"] and jax.config.values["jax_compilation_cache_dir"]
    ):
        whole, compiled = fresh(None)
        return Program(whole, _compilers().submit(compiled))
    place = folder / f"{_name(function, arguments)}{SUFFIX}"
    kept = _read(place)
    if kept is None:
        whole, compiled = fresh(place)
        return Program(whole, _compilers().submit(compiled))
    whole, *made = kept

    def loaded():
        try:
            return deserialize_and_load(*made)
        except Exception:  # whatever a library may say that has changed since
            return fresh(place)[1]()

    return Program(whole, _compilers().submit(loaded))


def _fresh(function, arguments, place: Path | None) -> tuple[Any, Callable]:
    """What a function returns, with shapes for arrays, and how to compile it."""
    leaves, rest = _parts(arguments)
    shape = {}

    def of_leaves(*values):
        given = eqx.combine(jax.tree.unflatten(jax.tree.structure(leaves), values), rest)
        value = function(*given)
        arrays, shape["rest"] = _parts(value)
        shape["structure"] = jax.tree.structure(arrays)
        return jax.tree.leaves(arrays)

    traced = jax.jit(of_leaves).trace(*jax.tree.leaves(leaves))
    outlines = [jax.ShapeDtypeStruct(out.shape, out.dtype) for out in traced.out_info]
    whole = eqx.combine(jax.tree.unflatten(shape["structure"], outlines), shape["rest"])

    def compiled():
        lowered = traced.lower()
        made = lowered.compile()
        # What calls LAPACK or other code outside itself would, loaded untraced, find it not there and crash.
        if place is not None and "custom_call" not in lowered.as_text():
            with suppress(RuntimeError):  # Python is about to end
                _compilers().submit(_write, place, whole, made)
        return made

    return whole, compiled


@cache
def _compilers() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(2)


def _parts(tree):
    return eqx.partition(tree, lambda leaf: hasattr(leaf, "shape") and hasattr(leaf, "dtype"))


def _name(function: Callable, arguments) -> str:
    leaves, rest = _parts(arguments)
    outline = jax.tree.map(lambda leaf: f"{leaf.shape}{leaf.dtype}{getattr(leaf, 'weak_type', False)}", leaves)
    told = f"{function.__module__} {function.__qualname__} {jax.tree.structure(leaves)} {rest} {outline}"
    return hashlib.sha256(f"{_surroundings()} {told}".encode()).hexdigest()[:40]


@cache
def _surroundings() -> str:
    """All on which a program depends besides its function and arguments."""
    package = Path(__file__).parent
    files = sorted(path for path in package.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    sources = [(str(path.relative_to(package)), path.stat().st_mtime_ns, path.stat().st_size) for path in files]
    versions = [version(name) for name in ("jax", "jaxlib", "equinox", "numpy")]
    settings = [
        os.environ.get("XLA_FLAGS"),
        jax.config.values["jax_enable_x64"],
        jax.default_backend(),
        jax.device_count(),
    ]
    return repr((sources, sys.version, versions, settings, _processor()))


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    return repr(
        (platform.machine(), platform.processor(), [x for x in lines if x.startswith(("flags", "Features"))][:1])
    )


def _write(place: Path, shape, made) -> None:
    """Keep a program, if that is possible; it is of use without."""
    try:
        content = pickle.dumps((shape, *serialize(made)))
        with whole_file(place, f".{os.getpid()}", SUFFIX, optional=True) as temporary:
            temporary.write_bytes(hashlib.sha256(content).digest() + content)
        oldest = sorted(place.parent.glob(f"*{SUFFIX}"), key=lambda path: path.stat().st_mtime)[:-KEPT]
        for path in oldest:
            path.unlink(missing_ok=True)
    except Exception:  # a full disc; what a library cannot write
        pass


def _read(place: Path) -> tuple | None:
    """What `_write` has kept in a file; None if it is not there or not whole."""
    try:
        content = place.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(content[32:]).digest() != content[:32]:
        return None
    try:
        return pickle.loads(content[32:])
    except Exception:  # whatever a library may say that has changed since
        return None
