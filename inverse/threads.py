"""Work that is done side by side: while NumPy and JAX compute, Python goes on with another thread.

What comes out is the same, bit for bit, on any number of processors.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Done = TypeVar("Done")


def side_by_side(work: Callable[[Item], Done], items: Sequence[Item], compiled: bool = True) -> Iterator[Done]:
    """What `work` makes of each item, in their order.

    - `compiled`: False where the first has to be worked out alone, since all would compile the same at once.
    """
    alone = 0 if compiled else 1
    yield from map(work, items[:alone])
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(work, items[alone:])
