"""Which photographs of an archive are of one eclipse, which of them are fitted together, and the rows of the tables."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from eclipsejax.almanac import Eclipse, nearest_eclipse
from eclipsejax.calendar import read_clock
from eclipsejax.errors import InputError
from inverse.archive.catalogue import Listed, check_eclipse
from inverse.archive.rows import FAILED, OK, Task

Row = dict[str, Any]


@dataclass(frozen=True)
class Member:
    """A photograph of an archive: what is known of it, its fit, and what that found; None where it came to none."""

    listed: Listed
    task: Task | None
    content: Row

    @property
    def eclipse(self) -> Eclipse | None:
        """The eclipse nearest to its time."""
        return _nearest(self.content.get("utc"))


@cache
def _nearest(utc: str | None) -> Eclipse | None:
    try:
        return None if utc is None else nearest_eclipse(utc)
    except InputError:  # a year outside the table
        return None


def member(listed: Listed, task: Task | None, content: Mapping[str, Any] | None, refused: str | None) -> Member:
    """A photograph with its row; one that the catalogue puts at another eclipse than its file does has failed."""
    if task is None or content is None:
        return Member(listed, None, {"status": FAILED, "error": refused, "utc": listed.time, "photographs": 1})
    if listed.eclipse and content.get("utc"):
        try:
            check_eclipse(listed.eclipse, content["utc"])
        except InputError as error:
            common = ("key", "configuration", "photographs", "sha256", "seconds", "version", "jax", "utc")
            content = {name: content.get(name) for name in common} | {"status": FAILED, "error": str(error)}
    return Member(listed, task, dict(content))


def by_eclipse(members: Iterable[Member]) -> dict[str, list[Member]]:
    """Photographs by the time of their eclipse's greatest phase, in the order of time."""
    groups: dict[str, list[Member]] = {}
    for one in sorted(members, key=lambda one: read_clock(one.content["utc"]) if one.eclipse else (0, 0.0)):
        if one.eclipse is not None:
            groups.setdefault(one.eclipse.greatest, []).append(one)
    return groups


def together(group: Sequence[Member], most: int) -> tuple[Task | None, str | None]:
    """The fit of an eclipse from its photographs, and a remark on it; None where none of them can be used.

    Photographs are used once, and only those whose own fit converged. Of more than `most`, that many are taken, evenly
    in the order of time: what a fit costs grows faster than their number.
    """
    usable: dict[tuple, Task] = {}
    for one in group:
        if one.task is not None and one.content["status"] == OK:
            task = Task(
                one.task.paths, one.task.sha256, (one.content["utc"],), one.task.sites, one.task.discs,
                one.task.draws, one.task.seed,
            )  # fmt: skip
            usable.setdefault((task.sha256, task.discs), task)
    tasks = list(usable.values())
    if not tasks:
        return None, None
    remark = None
    if len(tasks) > most:
        used = "the first was taken" if most == 1 else f"{most} were fitted together, evenly in the order of time"
        remark = f"Of {len(tasks)} photographs {used}."
        tasks = [tasks[round(k * (len(tasks) - 1) / max(1, most - 1))] for k in range(most)]
    if len(tasks) == 1:
        return next(one.task for one in group if one.content["status"] == OK), remark  # which is done

    def joined(name: str) -> tuple:
        return tuple(item for task in tasks for item in getattr(task, name))

    parts = {name: joined(name) for name in ("paths", "sha256", "times", "sites", "discs")}
    return Task(**parts, draws=tasks[0].draws, seed=tasks[0].seed), remark


def photograph_row(one: Member) -> Row:
    """The row of a photograph in the tables of an archive."""
    place = (*(one.listed.site or ()), None, None, None)
    told = {name: getattr(one.listed, name) for name in ("source", "line", "disc", "licence", "credit", "notes")}
    return {
        "kind": "photograph",
        **told,
        **dict(zip(("latitude", "longitude", "height"), place, strict=False)),
        **_of(one.eclipse),
        **one.content,
    }


def eclipse_row(group: Sequence[Member], content: Mapping[str, Any] | None, remark: str | None) -> Row:
    """The row of an eclipse in the tables of an archive."""
    row = {"kind": "eclipse", **_of(group[0].eclipse), "utc": group[0].content["utc"]}
    if content is None:
        reason = f"None of its {len(group)} photographs could be fitted."
        return row | {"status": FAILED, "error": reason, "photographs": 0}
    row |= {name: value for name, value in content.items() if name != "utc"}
    if remark:
        row["warnings"] = (row.get("warnings") or 0) + 1
        row["warnings_text"] = f"{row.get('warnings_text') or ''} {remark}".strip()
    return row


def _of(eclipse: Eclipse | None) -> Row:
    if eclipse is None:
        return {"eclipse": None, "eclipse_kind": None}
    return {"eclipse": eclipse.greatest.partition("T")[0], "eclipse_kind": eclipse.kind}
