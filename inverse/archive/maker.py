"""Many photographs of many eclipses, each fitted by itself and each eclipse as one: here, or on a cluster.

Whatever ends the work, what was finished is kept (`inverse.archive.rows`), and the same call does the rest. Workers are
processes, of this machine or of a Dask cluster whose machines all see the photographs and the folder of the archive.
"""

import logging
import signal
import tempfile
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import resource_tracker
from os import PathLike
from pathlib import Path
from typing import Any

from eclipsejax.errors import InputError
from inverse.archive.catalogue import Listed, listed
from inverse.archive.eclipses import Member, Row, by_eclipse, eclipse_row, member, photograph_row, together
from inverse.archive.fetch import file_of
from inverse.archive.limits import Limits
from inverse.archive.plot import optical_depth_plot
from inverse.archive.rows import FAILED, Task, failed, program, read_row, unwritable, write_row
from inverse.archive.tables import write_csv, write_parquet
from inverse.archive.work import Desk, alone, fitted, forget, prepared, work

MEMORY_OF_A_WORKER = 3e9  # bytes, of a fit of a few photographs of 24 megapixels
READERS = 8  # threads that fetch and hash
CONNECT = 30  # s, to find the scheduler and a first worker
TOGETHER = 12  # photographs of an eclipse that are fitted as one, at most


def make_archive(
    source: str | PathLike,
    out: str | PathLike,
    *,
    site: tuple[float, ...] | None = None,
    disc: int | None = None,
    draws: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    limits: Limits | None = None,
    most: int = TOGETHER,
    retry: bool = False,
    fit: Callable[[Task, Path, bool], Any] = fitted,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> list[Row]:
    """Fit all photographs of a catalogue or folder; the rows of `archive.csv`, which is written last.

    - `source`: a catalogue (`inverse.archive.catalogue` has the format) or a folder; `out`: folder of the archive.
    - `site`, `disc`: where a photograph has none of its own. `draws`, `seed`: those of `fit_atmosphere`.
    - `workers`: processes on this machine; 0 to work in this one; by default what cores and memory allow.
    - `scheduler`: address of a Dask scheduler, in place of `workers`.
    - `limits`: of each photograph; needs workers. `most`: photographs of an eclipse that are fitted together.
    - `retry`: do again what failed before.
    - `fit`: (task, file of the chain, whether to go on with it) -> `Fit`; a function that workers can import.
    - `progress`: called with the stage, what is done, and of how much.
    """
    if scheduler is not None and workers is not None:
        raise InputError("--workers and --scheduler exclude each other: a cluster has its own workers.")
    if workers == 0 and limits not in (None, Limits()):
        raise InputError("Limits of time and memory end the process that exceeds them: give --workers 1 or more.")
    out = Path(out).absolute()
    photographs = listed(source, out)
    prepared(out)
    with alone(out), _Crew(Desk(out, uuid.uuid4().hex, limits or Limits(), fit), workers, scheduler) as crew:
        members = _photographs(crew, photographs, site, disc, draws, seed, retry, progress)
        rows = [photograph_row(one) for one in members]
        rows += _eclipses(crew, by_eclipse(members), most, retry, progress)
        write_csv(out, rows)
        write_parquet(out, rows)
        try:
            optical_depth_plot(rows, out / "optical_depth.png")
        except OSError as error:
            raise unwritable(out, error) from None
    return rows


def _photographs(crew, photographs: Sequence[Listed], site, disc, draws, seed, retry, progress) -> list[Member]:
    """Every photograph by itself."""
    tasks: list[tuple[Listed, Task | None, str | None]] = []

    def each() -> Iterator[Task]:
        seen = set()
        with ThreadPoolExecutor(READERS) as pool:
            for one, path, sha256, refused in pool.map(lambda one: file_of(one, crew.desk.out), photographs):
                task = None
                if path is not None and sha256 is not None:
                    place, which = one.site or site, one.disc or disc
                    task = Task((str(path),), (sha256,), (one.time,), (place,), (which,), draws, seed)
                tasks.append((replace(one, site=one.site or site, disc=one.disc or disc), task, refused))
                if task is not None and task.key not in seen:
                    seen.add(task.key)
                    yield task

    done = _all(crew, each(), retry, lambda number: progress("photographs", number, len(photographs)))
    return [member(one, task, done.get(task.key) if task else None, refused) for one, task, refused in tasks]


def _eclipses(crew, groups: dict[str, list[Member]], most: int, retry: bool, progress) -> list[Row]:
    """Every eclipse from all its photographs; one that has a single photograph has its row."""
    fits = {greatest: together(group, most) for greatest, group in groups.items()}
    tasks = {task.key: task for task, _ in fits.values() if task is not None}
    done = _all(crew, tasks.values(), retry, lambda number: progress("eclipses", number, len(tasks)))
    return [
        eclipse_row(group, done[task.key] if task else None, remark)
        for group, (task, remark) in zip(groups.values(), fits.values(), strict=True)
    ]


def _all(crew, tasks: Iterable[Task], retry: bool, report: Callable[[int], None]) -> dict[str, Row]:
    """Contents of the rows by key."""

    def wanted() -> Iterator[Task]:
        for task in tasks:
            if retry and (read_row(crew.desk.out, task.key) or {}).get("status") == FAILED:
                forget(crew.desk.out, task.key)
            yield task

    done: dict[str, Row] = {}
    report(0)
    for content in crew.do(wanted()):
        done[content["key"]] = content
        report(len(done))
    return done


class _Crew:
    """Those who do the work: this process, or processes of this machine or a cluster, called when first needed."""

    def __init__(self, desk: Desk, workers: int | None, scheduler: str | None):
        self.desk, self.workers, self.scheduler = desk, workers, scheduler
        self.client: Any = None
        self.cluster: Any = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for one in (self.client, self.cluster):
            if one is not None:
                one.close()

    def do(self, tasks: Iterable[Task]) -> Iterator[Row]:
        """Contents of the rows of tasks, as they come."""
        waiting: Any = None
        by_future: dict[Any, Task] = {}
        for task in tasks:
            kept = read_row(self.desk.out, task.key)
            if kept is not None or self.workers == 0:
                yield kept or work(task, self.desk)
                continue
            waiting = self._called() if waiting is None else waiting
            future = self.client.submit(work, task, self.desk, key=f"fit-{self.desk.run}-{task.key}", pure=False)
            by_future[future] = task
            waiting.add(future)
            for future in waiting.next_batch(block=False):
                yield self._row(future, by_future.pop(future))
        while by_future:
            future = next(waiting)
            yield self._row(future, by_future.pop(future))

    def _row(self, future, task: Task) -> Row:
        from distributed import KilledWorker

        try:
            return future.result(timeout=CONNECT)
        except InputError:
            raise
        except KilledWorker:
            content = failed(task, "The processes that fitted it died: too little memory, perhaps.")
            write_row(self.desk.out, content)
            return content
        except Exception as error:
            what = f"{type(error).__name__} {error}".split("\n")[0][:200].strip().rstrip(".")
            raise InputError(
                f"The workers were lost ({what}): run the same command again; what is finished is kept."
            ) from None

    def _called(self):
        """A queue of futures, and workers for them."""
        try:
            from dask import config
            from distributed import Client, LocalCluster, as_completed
        except ImportError:
            raise InputError(
                "Work by several processes needs Dask: pip install 'eclipsejax[cluster]', or give --workers 0."
            ) from None
        if self.client is not None:
            return as_completed(loop=self.client.loop)
        config.set({"distributed.scheduler.allowed-failures": 1000})  # `work` counts for itself
        for name in ("distributed", "distributed.client", "distributed.scheduler", "distributed.worker"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what is lost is said in one sentence
        try:
            if self.scheduler is None:
                with _children_deaf_to_control_c():
                    self.cluster = LocalCluster(
                        n_workers=self.workers or most_workers(), threads_per_worker=1, processes=True, memory_limit=0,
                        dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL,
                        local_directory=tempfile.gettempdir(),
                    )  # fmt: skip
            self.client = Client(self.cluster or self.scheduler, timeout=CONNECT, set_as_default=False)
            self.client.wait_for_workers(1, timeout=CONNECT)
        except (OSError, ValueError, TimeoutError) as error:
            where = self.scheduler or "this machine"
            raise InputError(f"No worker could be had at {where} ({error}): check the scheduler.") from None
        self._check()
        return as_completed(loop=self.client.loop)

    def _check(self) -> None:
        """Every worker has this program and sees the folder of the archive."""
        ours, token = program(), self.desk.out / "attempts" / self.desk.run
        token.touch()
        try:
            for worker, answer in self.client.run(_sees, str(token), on_error="return").items():
                if answer != (ours, True):
                    lacks = f"does not see {self.desk.out}" if answer == (ours, False) else f"lacks eclipsejax {ours}"
                    raise InputError(f"The worker {worker} {lacks}: all need the same program and a shared folder.")
        finally:
            token.unlink(missing_ok=True)


def _sees(token: str) -> tuple[str, bool]:
    return program(), Path(token).exists()


@contextmanager
def _children_deaf_to_control_c() -> Iterator[None]:
    """A terminal sends Ctrl-C to workers too: only this process is to act on it. Threads and processes inherit this."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which would undo it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def most_workers() -> int:
    """Processes that this machine has cores and memory for."""
    from dask.system import CPU_COUNT
    from distributed.system import MEMORY_LIMIT

    return max(1, min(CPU_COUNT, int(MEMORY_LIMIT // MEMORY_OF_A_WORKER)))
