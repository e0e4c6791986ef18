"""Work side by side comes out in its order, the first alone where it has to, and its errors are not lost."""

import multiprocessing
import threading
import time

import pytest

from inverse.threads import MOST, side_by_side


def threads_of(items: int) -> int:
    """How many threads work on so many items."""

    def work(_):
        time.sleep(0.02)
        return threading.get_ident()

    return len(set(side_by_side(work, range(items))))


def test_what_is_done_comes_in_order_though_the_first_ends_last():
    def work(item):
        time.sleep(0.05 if item == 0 else 0.0)
        return 10 * item

    assert list(side_by_side(work, range(5))) == [0, 10, 20, 30, 40]
    assert list(side_by_side(work, [])) == list(side_by_side(work, [], compiled=False)) == []


def test_the_first_compiles_alone():
    done, began = [], []

    def work(item):
        began.append((item, len(done), threading.current_thread() is threading.main_thread()))
        time.sleep(0.02)
        done.append(item)
        return item

    assert list(side_by_side(work, range(4), compiled=False)) == [0, 1, 2, 3]
    assert began[0] == (0, 0, True) and all(before >= 1 for _, before, _ in began[1:])


def test_an_error_reaches_the_caller():
    def work(item):
        if item == 2:
            raise ValueError("two")
        return item

    with pytest.raises(ValueError, match="two"):
        list(side_by_side(work, range(4)))


def test_a_process_of_several_has_one_thread():
    assert threads_of(20) <= MOST
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(threads_of, (20,)) == 1
