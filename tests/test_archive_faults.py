"""Whatever ends workers, client or scheduler of an archive: what is finished is kept, the rest is done next time."""

import csv
import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests import archive_fakes as fakes

ROOT = Path(__file__).parents[1]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "default"}
COMMAND = [sys.executable, "-m", "tests.archive_fakes"]


def command(folder, *options) -> list[str]:
    return [*COMMAND, str(folder / "photographs"), "--archive", str(folder / "out"), *map(str, options)]


def run(folder, *options, **more) -> subprocess.CompletedProcess:
    done = subprocess.run(
        command(folder, *options), capture_output=True, text=True, timeout=120, cwd=folder, env=ENVIRONMENT, **more
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


def started(folder, *options) -> subprocess.Popen:
    return subprocess.Popen(
        command(folder, *options), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder,
        env=ENVIRONMENT, start_new_session=True,
    )  # fmt: skip


def table(folder) -> dict[str, dict[str, str]]:
    """Rows of photographs by name; that of the eclipse under ""."""
    with (folder / "out" / "archive.csv").open(newline="") as file:
        return {row["source"]: row for row in csv.DictReader(file)}


def put(folder, count, *, seconds=0.0):
    for number in range(count):
        fakes.photograph(folder / "photographs" / f"{number}.jpg", "ok", seconds, number)


def kept(folder) -> set[str]:
    return {path.name for path in (folder / "out" / "rows").glob("*.json")}


def wait_for(what, process=None, most=60.0):
    end = time.monotonic() + most
    while not what():
        assert time.monotonic() < end, "it did not happen in time"
        assert process is None or process.poll() is None, process.communicate()
        time.sleep(0.05)


def fits_of(folder) -> list[str]:
    """Process ids of all fits that were begun, one for each."""
    return [line for path in (folder / "out" / "fits").glob("*/log") for line in path.read_text().split()]


def workers_of(process) -> list[int]:
    """Processes of its session that spawned workers run in."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and b"spawn_main" in (entry / "cmdline").read_bytes():
                if os.getsid(int(entry.name)) == process.pid:
                    found.append(int(entry.name))
        except OSError:
            continue
    return found


def gone(pids) -> bool:
    return not any(Path(f"/proc/{pid}").exists() for pid in pids)


def test_photographs_that_kill_hang_and_break_leave_rows_and_the_others_are_fitted(tmp_path):
    put(tmp_path, 3)
    for what in ("die", "die-once", "hang", "break", "refuse"):
        fakes.photograph(tmp_path / "photographs" / f"{what}.jpg", what, 0)
    limit = ("--seconds-per-photograph", 5)
    done = run(tmp_path, "--workers", 2, *limit)
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path)
    assert {name for name, row in rows.items() if row["status"] == "ok"} == {
        "",
        *(f"{n}.jpg" for n in range(3)),
        "die-once.jpg",
    }
    assert rows[""]["photographs"] == "4"
    for name, words in (
        ("die", "process that fitted it died"),
        ("hang", "longer than the 5 s"),
        ("break", "ZeroDivisionError: a fault of the program"),
        ("refuse", "There is no Moon in it"),
    ):
        assert words in rows[f"{name}.jpg"]["error"] and rows[f"{name}.jpg"]["status"] == "failed"
    assert "photographs: 4 ok, 0 not converged, 4 failed" in done.stdout and not list(
        (tmp_path / "out/attempts").iterdir()
    )

    before = len(fits_of(tmp_path))
    assert run(tmp_path, "--workers", 2, *limit).returncode == 0
    assert len(fits_of(tmp_path)) == before  # nothing is done twice


def test_a_photograph_that_eats_memory_leaves_a_row_and_the_others_are_fitted(tmp_path):
    put(tmp_path, 2)
    fakes.photograph(tmp_path / "photographs" / "eat.jpg", "eat", 0)
    done = run(tmp_path, "--workers", 2, "--memory-per-photograph", 0.6)
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path)
    assert {name for name, row in rows.items() if row["status"] == "ok"} == {"", "0.jpg", "1.jpg"}
    assert rows["eat.jpg"]["status"] == "failed" and "GB of memory, more than the 0.6 GB" in rows["eat.jpg"]["error"]


def test_a_killed_worker_costs_one_fit(tmp_path):
    put(tmp_path, 6, seconds=0.7)
    process = started(tmp_path, "--workers", 2)
    wait_for(lambda: len(kept(tmp_path)) >= 1, process)
    victim = int(fits_of(tmp_path)[-1])
    os.kill(victim, signal.SIGKILL)
    said = process.communicate(timeout=100)
    assert process.returncode == 0, said
    assert {row["status"] for row in table(tmp_path).values()} == {"ok"} and len(table(tmp_path)) == 7
    assert len(set(fits_of(tmp_path))) <= 3  # two processes, and the one that took the place of the victim
    assert len(fits_of(tmp_path)) <= 6 + 1 + 6  # by themselves, the one that was lost, and together


@pytest.mark.parametrize("how", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_a_stopped_client_is_taken_up_where_it_was(tmp_path, how):
    put(tmp_path, 6, seconds=0.7)
    process = started(tmp_path, "--workers", 2)
    wait_for(lambda: len(kept(tmp_path)) >= 2, process)
    workers = workers_of(process)
    assert len(workers) >= 2
    if how == signal.SIGKILL:
        process.kill()
    else:
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    _, said = process.communicate(timeout=60)
    wait_for(lambda: gone(workers), most=20)
    if how == signal.SIGINT:
        assert process.returncode == 130, said
        assert "the same command does the rest" in said and "Traceback" not in said
    before = kept(tmp_path)
    assert 2 <= len(before) < 7
    times = {name: (tmp_path / "out" / "rows" / name).stat().st_mtime_ns for name in before}
    assert run(tmp_path, "--workers", 2).returncode == 0
    assert len(table(tmp_path)) == 7 and len(kept(tmp_path)) == 7
    assert times == {name: (tmp_path / "out" / "rows" / name).stat().st_mtime_ns for name in before}


@pytest.mark.slow
def test_a_scheduler_that_dies_is_one_sentence_and_a_new_one_does_the_rest(tmp_path):
    put(tmp_path, 6, seconds=0.5)
    # The scheduler and its worker, as on a cluster.
    with Cluster(tmp_path) as cluster:
        process = started(tmp_path, "--scheduler", cluster.address)
        wait_for(lambda: len(kept(tmp_path)) >= 2, process)
        cluster.scheduler.kill()
        _, said = process.communicate(timeout=100)
    assert process.returncode == 2 and "workers were lost" in said and "Traceback" not in said, said
    with Cluster(tmp_path) as cluster:
        assert run(tmp_path, "--scheduler", cluster.address).returncode == 0
    assert {row["status"] for row in table(tmp_path).values()} == {"ok"} and len(table(tmp_path)) == 7


class Cluster:
    """A Dask scheduler and one worker, as processes of their own."""

    def __init__(self, folder):
        self.folder = folder

    def __enter__(self):
        self.scheduler = self._begun("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        assert self.scheduler.stderr
        for line in self.scheduler.stderr:
            if found := re.search(r"Scheduler at:\s+(tcp://\S+)", line):
                self.address = found[1]
                break
        self.worker = self._begun("worker", self.address, "--nthreads", "1", "--no-dashboard", "--local-directory", ".")
        return self

    def _begun(self, *words):
        return subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]], cwd=self.folder, env=ENVIRONMENT,
            stdout=subprocess.DEVNULL, text=True,
            stderr=subprocess.PIPE if words[0] == "scheduler" else subprocess.DEVNULL,
        )  # fmt: skip

    def __exit__(self, *_):
        for process in (self.worker, self.scheduler):
            process.terminate()
            process.wait(30)
        if self.scheduler.stderr:
            self.scheduler.stderr.close()


def test_no_scheduler_is_one_sentence(tmp_path, monkeypatch):
    put(tmp_path, 1)
    program = "import tests.archive_fakes as f, inverse.archive.maker as a; a.CONNECT = 2; raise SystemExit(f.main())"
    done = subprocess.run(
        [sys.executable, "-c", program, *command(tmp_path, "--scheduler", "tcp://127.0.0.1:9")[3:]],
        capture_output=True, text=True, timeout=60, cwd=tmp_path, env=ENVIRONMENT,
    )  # fmt: skip
    assert done.returncode == 2 and "No worker could be had at tcp://127.0.0.1:9" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def test_without_dask_one_sentence_says_what_to_install(tmp_path):
    put(tmp_path, 1)
    program = (
        "import sys; sys.modules['distributed'] = sys.modules['pyarrow'] = None\n"
        "import tests.archive_fakes as f; raise SystemExit(f.main())"
    )
    whole = [sys.executable, "-c", program, *command(tmp_path)[3:]]
    done = subprocess.run(whole, capture_output=True, text=True, cwd=tmp_path, env=ENVIRONMENT)
    assert done.returncode == 2 and "pip install 'eclipsejax[cluster]'" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    done = subprocess.run([*whole, "--workers", "0"], capture_output=True, text=True, cwd=tmp_path, env=ENVIRONMENT)
    assert done.returncode == 0 and "There is no archive.parquet" in done.stderr and len(table(tmp_path)) == 2


@pytest.mark.filterwarnings("ignore:os.fork:RuntimeWarning")  # the child execs at once
def test_a_full_disk_is_one_sentence_and_what_exists_is_kept(tmp_path):
    """Files may grow to 700 bytes only: rows of the first run exist, those of the second cannot be written."""
    put(tmp_path, 2)
    assert run(tmp_path, "--workers", 0).returncode == 0
    before = {name: (tmp_path / "out/rows" / name).read_bytes() for name in kept(tmp_path)}
    put(tmp_path, 4)

    def small():
        resource.setrlimit(resource.RLIMIT_FSIZE, (700, 700))

    done = run(tmp_path, "--workers", 0, preexec_fn=small)
    assert done.returncode == 2 and "cannot be written to (File too large)" in done.stderr
    assert "what is finished is kept" in done.stderr
    assert before == {name: (tmp_path / "out/rows" / name).read_bytes() for name in kept(tmp_path)}
    assert not list((tmp_path / "out/rows").glob(".*"))
    assert run(tmp_path, "--workers", 0).returncode == 0 and len(table(tmp_path)) == 5


@pytest.mark.slow
def test_a_truly_full_disk(tmp_path):
    """A file system of 200 kB in memory, where this user may mount one."""
    out = tmp_path / "out"
    out.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(out)], capture_output=True)
    if mounted.returncode:
        pytest.skip("nothing can be mounted here")
    try:
        put(tmp_path, 60)
        done = run(tmp_path, "--workers", 2)
        assert done.returncode == 2 and "No space left on device" in done.stderr
        whole = kept(tmp_path)
        assert whole
        subprocess.run(["mount", "-o", "remount,size=20m", str(out)], check=True)
        times = {name: (out / "rows" / name).stat().st_mtime_ns for name in whole}
        assert run(tmp_path, "--workers", 2).returncode == 0
        again = {name: (out / "rows" / name).stat().st_mtime_ns for name in whole}
        assert sum(times[name] == again[name] for name in whole) >= len(whole) - 1  # the last one may be cut short
        assert len(table(tmp_path)) == 61
    finally:
        subprocess.run(["umount", str(out)], check=True)
