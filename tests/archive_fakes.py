"""A fit that takes no time and does what the photograph tells it to, for the faults of an archive.

A photograph is a text: what to do, then how long to take [s], then anything. It is imported by worker processes.
"""

import hashlib
import json
import os
import time
from dataclasses import dataclass
from pathlib import Path

from eclipsejax.errors import InputError
from inverse.result import Estimate, Fit

DEPTH = 0.02


@dataclass(frozen=True)
class QuickFit(Fit):
    """A `Fit` that saves a small file."""

    def save(self, folder):
        path = Path(folder) / "fit.json"
        try:
            path.write_text(json.dumps(self.provenance))
        except OSError as error:
            raise InputError(f"The report cannot be written to {folder}: {error.strerror}.") from None
        return [path]


def photograph(path: Path, *words) -> Path:
    """A photograph that makes `fit` do something."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(" ".join(map(str, words or ("ok", 0, path.name))))
    return path


def fit(task, chain: Path, resume: bool) -> Fit:
    """What `inverse.archive.work.fitted` does, without the work."""
    hashes, states = [], set()
    for path in task.paths:
        data = Path(path).read_bytes()
        hashes.append(hashlib.sha256(data).hexdigest())
        do, seconds, *_ = data.decode().split()
        with (chain.parent / "log").open("a") as log:
            log.write(f"{os.getpid()}\n")
        time.sleep(float(seconds))
        _do(do, chain, path)
        states.add(do)
    return made(task, hashes, "unconverged" not in states, "limit" in states)


def _do(what: str, chain: Path, path: str):
    if what == "name":
        raise InputError(f"{path} is no picture of the Moon.")
    if what == "refuse":
        raise InputError("There is no Moon in it: take another.")
    if what == "break":
        raise ZeroDivisionError("a fault\nof the program")
    if what == "die":
        os._exit(1)
    if what == "die-once":
        if (chain.parent / "died").exists():
            return
        (chain.parent / "died").touch()
        os._exit(1)
    if what == "hang":
        time.sleep(600)
    if what == "eat":
        eaten = []
        while True:
            eaten.append(bytearray(b"x" * 3 * 10**7))
            time.sleep(0.005)
    if what == "chain":
        if not chain.exists():
            chain.write_text("half")
            raise KeyboardInterrupt


def made(task, hashes, converged=True, limit=False) -> QuickFit:
    """A fit of dust with an optical depth of `DEPTH`."""
    names = {"dust.extinction": ("1/m", DEPTH / 1e4), "stratospheric_optical_depth": ("-", DEPTH)}
    estimates = {
        name: Estimate(
            name, unit, value, 0.1 * value, value, (0.9 * value, 1.1 * value), (0.8 * value, 1.2 * value),
            (0.8 * value if limit else 1e-3 * value, 50 * value), 0.9, 500.0,
        )
        for name, (unit, value) in names.items()
    }  # fmt: skip
    times = [time or "2022-05-16T04:06:00Z" for time in task.times]
    photographs = [{"name": "x", "sha256": sha256, "utc": utc} for sha256, utc in zip(hashes, times, strict=True)]
    diagnostics = {
        "converged": converged,
        "errors": [{"independent": 1.0, "smooth": 0.1, "chromatic": 0.04, "uneven": 0.1}],
        "residual_rms": [0.05], "cells": [100] * len(hashes),
        "method": "laplace+psis", "psis": {"k_hat": float("inf"), "effective_samples": 500.0}, "sampler": None,
        "evaluated": 2000, "not_finite": 3,
    }  # fmt: skip
    return QuickFit(estimates, {}, {}, (), diagnostics, ("A warning.",), {"photographs": photographs})


def main() -> int:
    """The command `fit_atmosphere`, with this fit in place of the real one."""
    from inverse import cli
    from inverse.archive.maker import make_archive
    from tests.archive_fakes import fit as importable  # by workers, which know no __main__

    assert make_archive.__kwdefaults__
    make_archive.__kwdefaults__["fit"] = importable
    return cli.main()


if __name__ == "__main__":
    raise SystemExit(main())
