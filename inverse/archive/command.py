"""`fit_atmosphere DIR_OR_CATALOGUE --archive OUT`: its options, and what it prints."""

import argparse
import sys
from argparse import Namespace
from pathlib import Path

from eclipsejax import session
from eclipsejax.errors import InputError
from inverse.progress_bars import Bars

SHOWN = 20  # sentences on what failed
MOST_SECONDS = 7200.0  # sampling takes a quarter of an hour
EXCLUDED = ("time", "clock", "exposure", "response", "resume", "demo")


def add_to(parser: argparse.ArgumentParser) -> None:
    """Describe the options to the parser."""
    group = parser.add_argument_group("many photographs", "of many eclipses, from a folder or a catalogue (CSV)")
    add = group.add_argument
    add("--archive", type=Path, metavar="OUT", help="fit each photograph and each eclipse; OUT gets archive.csv, "
        "archive.parquet, optical_depth.png, a folder for each fit; the same command does what is left")  # fmt: skip
    add("--workers", type=_count, metavar="N", help="processes; 0: in this one; default: by cores and memory")
    add("--scheduler", metavar="ADDRESS", help="of a Dask cluster, such as tcp://10.0.0.1:8786, instead")
    add("--seconds-per-photograph", type=session.number(1e-3, 1e7), metavar="S", default=MOST_SECONDS,
        help=f"end a fit that takes longer; default {MOST_SECONDS:g}, but none with --workers 0")  # fmt: skip
    add("--memory-per-photograph", type=session.number(1e-3, 1e5), metavar="GB", help="end a process that takes more")
    add("--together", type=_count, metavar="N", help="photographs of an eclipse that are fitted as one; default 12")
    add("--retry", action="store_true", help="do again what failed before")


def archive(options: Namespace) -> bool:
    """Make the archive and say what came of it; whether every fit converged."""
    from inverse.archive.limits import Limits
    from inverse.archive.maker import TOGETHER, make_archive
    from inverse.archive.rows import FAILED, NOT_CONVERGED, OK

    wrong = [name for name in EXCLUDED if getattr(options, name)]
    if wrong or len(options.photographs) != 1:
        what = f"--{wrong[0]}" if wrong else f"{len(options.photographs)} names"
        raise InputError(
            f"--archive takes one folder or catalogue, and not {what}: a catalogue has a column for times."
        )
    memory = options.memory_per_photograph
    seconds = options.seconds_per_photograph
    if options.workers == 0 and seconds == MOST_SECONDS:
        seconds = None
    limits = Limits(seconds, None if memory is None else 1e9 * memory)
    try:
        with Bars() as bars:
            rows = make_archive(
                options.photographs[0].strip(), options.archive, site=options.site, disc=options.disc,
                draws=options.draws, seed=options.seed, workers=options.workers, scheduler=options.scheduler,
                limits=limits, most=max(1, TOGETHER if options.together is None else options.together),
                retry=options.retry, progress=bars,
            )  # fmt: skip
    except KeyboardInterrupt:
        print(
            f"Stopped: the same command does the rest; what is finished is kept in {options.archive}.", file=sys.stderr
        )
        raise
    _report(rows, options.archive)
    states = {row["status"] for row in rows}
    if states == {FAILED}:
        raise InputError(f"None of the photographs could be fitted: {options.archive / 'archive.csv'} has the reasons.")
    return OK in states and NOT_CONVERGED not in states


def _report(rows: list[dict], out: Path) -> None:
    lacking = [row for row in rows if row["status"] != "ok" and row["kind"] == "photograph"]
    for row in lacking[:SHOWN]:
        why = row["error"] or "The fit did not converge."
        print(f"{row['source']}: {why}", file=sys.stderr)
    if len(lacking) > SHOWN:
        print(f"{len(lacking) - SHOWN} more are in archive.csv.", file=sys.stderr)
    for kind in ("photograph", "eclipse"):
        of_kind = [row["status"] for row in rows if row["kind"] == kind]
        counts = ", ".join(f"{of_kind.count(state)} {state}" for state in ("ok", "not converged", "failed"))
        print(f"{len(of_kind)} {kind}{'' if len(of_kind) == 1 else 's'}: {counts}.")
    for name in ("archive.csv", "archive.parquet", "optical_depth.png"):
        if (out / name).exists():
            print(f"Wrote {out / name}")
    if not (out / "archive.parquet").exists():
        print("There is no archive.parquet: it needs pip install 'eclipsejax[cluster]'.", file=sys.stderr)


def _count(text: str) -> int:
    value = session.number(0, 1e5)(text)
    if value != int(value):
        raise argparse.ArgumentTypeError(f"{text.strip()} is not a whole number")
    return int(value)
