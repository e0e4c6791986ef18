"""A chain on disk survives a kill at any moment, goes on bit for bit, and is not mistaken for another's."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from eclipsejax.errors import InputError
from inverse.chain import Chain, Record, read_record
from tests.targets import IDENTITY, sample_to_file

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A chain of 40 steps, and its file."""
    path = tmp_path_factory.mktemp("chain") / "chain.h5"
    return sample_to_file(path, 40), path


def assert_same(one: Chain, two: Chain):
    for name in ("z", "log_posterior", "accepted"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    for a, b in zip(one.random, two.random, strict=True):
        assert a[0] == b[0] and np.array_equal(a[1], b[1]) and a[2:] == b[2:]


def test_a_file_gives_back_what_was_written(stored):
    chain, path = stored
    record = read_record(path, IDENTITY)
    assert_same(record.chain, chain)
    assert record.identity == IDENTITY and record.beginning["inflation"] == 1.0
    assert not path.with_name(".chain.h5.part").exists()
    assert 0.2 < chain.acceptance < 0.7


def test_a_chain_from_disk_goes_on_bit_for_bit(stored, tmp_path):
    chain, path = stored
    whole = sample_to_file(tmp_path / "whole.h5", 75)
    assert_same(sample_to_file(tmp_path / "part.h5", 75, read_record(path, IDENTITY).chain), whole)
    assert_same(read_record(tmp_path / "part.h5", IDENTITY).chain, whole)


def started(path: Path, *program: str) -> subprocess.Popen:
    process = subprocess.Popen([sys.executable, *program, str(path)], cwd=ROOT, stderr=subprocess.PIPE)
    until = time.monotonic() + 100
    while not path.exists():
        if process.poll() is not None or time.monotonic() > until:
            process.kill()
            raise AssertionError(process.communicate()[1].decode())
        time.sleep(0.01)
    return process


def killed(process: subprocess.Popen) -> None:
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL  # it was at work, and had not ended by itself


def test_sampling_that_was_killed_goes_on_as_if_it_had_not_been(tmp_path):
    path = tmp_path / "chain.h5"
    process = started(path, "-m", "tests.targets")
    time.sleep(0.3)
    killed(process)
    left = read_record(path, IDENTITY).chain
    steps = left.steps + 25
    whole = sample_to_file(tmp_path / "whole.h5", steps)
    assert_same(sample_to_file(path, steps, left), whole)


WRITER = """
import sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from inverse.chain import Record, read_record
from tests.targets import IDENTITY
path = Path(sys.argv[1])
first = read_record(Path(sys.argv[1]).with_name("first.h5"), IDENTITY)
count = 0
while True:
    count += 1
    chain = replace(first.chain, z=np.full((2, 20 * (count % 50 + 1), 32, 12), float(count)))
    replace(first, chain=chain).write(path)
"""


def test_a_file_is_whole_whenever_its_writer_is_killed(stored, tmp_path):
    record = read_record(stored[1], IDENTITY)
    record.write(tmp_path / "first.h5")
    random = np.random.default_rng(0)
    partial = 0
    for trial in range(8):
        path = tmp_path / "chain.h5"
        path.unlink(missing_ok=True)
        process = started(path, "-c", WRITER)
        time.sleep(random.uniform(0.0, 0.1))
        killed(process)
        z = read_record(path, IDENTITY).chain.z
        assert np.ptp(z) == 0.0 and z.shape[1] == 20 * (int(z.flat[0]) % 50 + 1), trial
        partial += path.with_name(".chain.h5.part").exists()
        record.write(path)  # what a kill left behind does not hinder the next
    assert partial > 0  # some kills did come amid the writing


def test_another_photograph_or_seed_is_refused_in_one_sentence(stored):
    for name, value in (("photographs", ["b"]), ("seed", 6), ("versions", {"jax": "1"})):
        with pytest.raises(InputError, match=f"another fit, which differs in {name}: ") as refused:
            read_record(stored[1], {**IDENTITY, name: value})
        assert "\n" not in str(refused.value) and "--resume" in str(refused.value)


def test_a_file_that_is_no_chain_is_refused_in_one_sentence(stored, tmp_path):
    half, text, other = tmp_path / "half.h5", tmp_path / "text.h5", tmp_path / "other.h5"
    half.write_bytes(stored[1].read_bytes()[:5000])
    text.write_text("chain")
    with h5py.File(other, "w") as file:
        file["z"] = 1.0
    for path in (half, text, other):
        with pytest.raises(InputError, match=f"{path.name} cannot be read as a chain"):
            read_record(path, IDENTITY)


def test_a_folder_that_takes_no_file_is_named(stored, tmp_path):
    with pytest.raises(InputError, match="The chain cannot be written to"):
        replace(Record(IDENTITY, {}, stored[0])).write(tmp_path / "missing" / "chain.h5")
