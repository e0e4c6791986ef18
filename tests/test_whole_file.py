"""A file is what it was or what it was to become, and nothing lies beside it."""

import errno

import h5py
import pytest

from eclipsejax.whole_file import reason, whole_file


def test_a_file_is_there_once_it_is_whole(tmp_path):
    path = tmp_path / "moon.txt"
    with whole_file(path) as part:
        part.write_text("new")
        assert not path.exists() and part.parent == tmp_path and part.name.startswith(".")
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("trouble", [OSError("full"), KeyboardInterrupt(), ValueError("no JSON")])
def test_whatever_is_raised_leaves_what_was_there(tmp_path, trouble):
    path = tmp_path / "moon.txt"
    path.write_text("old")
    with pytest.raises(type(trouble)), whole_file(path) as part:
        part.write_text("half")
        raise trouble
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_what_a_kill_left_is_written_over(tmp_path):
    path = tmp_path / "moon.txt"
    (tmp_path / ".moon.txt.part").write_text("half of what was longer")
    with whole_file(path) as part:
        part.write_text("new")
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_two_writers_of_one_file_do_not_meet(tmp_path):
    path = tmp_path / "moon.txt"
    with whole_file(path, ".1") as one, whole_file(path, ".2") as two:
        one.write_text("one")
        two.write_text("two")
    assert path.read_text() == "one" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("place", ["missing/moon.txt", "folder"])
def test_a_place_that_takes_no_file_is_an_os_error(tmp_path, place):
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError), whole_file(tmp_path / place) as part:
        part.write_text("new")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_a_reason_is_a_few_words_whoever_gives_it(tmp_path):
    assert reason(OSError(errno.ENOSPC, "write failed: time = Mon\n, buf = 0x1")) == "No space left on device"
    assert reason(OSError("something\nelse")) == "something else"
    with pytest.raises(OSError) as caught:
        h5py.File(tmp_path / "missing" / "chain.h5", "w")
    assert reason(caught.value) == "No such file or directory"
