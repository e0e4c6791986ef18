"""Work that is done side by side: while NumPy and JAX compute, Python goes on with another thread.

What comes out is the same, bit for bit, on any number of processors.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import parent_process
from typing import TypeVar

MOST = 4  # more would hold the memory of as many parts, and one photograph has no more to do

Item = TypeVar("Item")
Done = TypeVar("Done")


def side_by_side(work: Callable[[Item], Done], items: Sequence[Item], compiled: bool = True) -> Iterator[Done]:
    """What `work` makes of each item, in their order.

    - `compiled`: False where the first has to be worked out alone, since all would compile the same at once.
    """
    alone = 0 if compiled else 1
    yield from map(work, items[:alone])
    with ThreadPoolExecutor(_threads()) as pool:
        yield from pool.map(work, items[alone:])


def _threads() -> int:
    """As many as processors; one in a process of several that share them, as an archive's are."""
    return 1 if parent_process() is not None else min(MOST, os.cpu_count() or 1)
