"""Limits of time and memory for one fit: the process that exceeds them is ended, as nothing else ends foreign code.

A thread watches; where it is kept from running, by code that never lets go of the interpreter, the system's own alarm
ends the process some time later.
"""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PERIOD = 0.1  # s
GRACE = 30.0  # s, from the limit to the alarm
ENDED = 77  # exit status of a process that was ended here


@dataclass(frozen=True)
class Limits:
    """Of one photograph: time [s], and memory of the process that fits it [byte]; None for no limit."""

    seconds: float | None = None
    memory: float | None = None


@contextmanager
def limited(limits: Limits, photographs: int, exceeded: Callable[[str], None]) -> Iterator[None]:
    """End this process when what is done here takes too long or too much memory.

    - `photographs`: fitted together: they may take so many times as long.
    - `exceeded`: called with the reason, a sentence, before the end.
    """
    seconds = None if limits.seconds is None else limits.seconds * photographs
    if seconds is None and limits.memory is None:
        yield
        return
    done, settled = threading.Event(), threading.Lock()
    end = time.monotonic() + (seconds or 0.0)

    def watch():
        while not done.wait(PERIOD):
            reason = None
            if seconds is not None and time.monotonic() > end:
                reason = f"It took longer than the {seconds:g} s that --seconds-per-photograph allows."
            elif limits.memory is not None and (used := memory_used()) > limits.memory:
                reason = (
                    f"It took {used / 1e9:.2f} GB of memory, more than the {limits.memory / 1e9:.2g} GB that "
                    "--memory-per-photograph allows."
                )
            with settled:
                if reason and not done.is_set():
                    try:
                        exceeded(reason)
                    finally:
                        os._exit(ENDED)

    alarm = hasattr(signal, "setitimer")
    if alarm and seconds is not None:
        signal.setitimer(signal.ITIMER_REAL, seconds + GRACE)
    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        with settled:
            done.set()
        if alarm:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


def memory_used() -> float:
    """Memory that this process holds [byte]; 0 where the system does not tell."""
    try:
        return float(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        try:
            import psutil
        except ImportError:
            return 0.0
        return float(psutil.Process().memory_info().rss)
