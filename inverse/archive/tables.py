"""The tables of an archive, `archive.csv` and `archive.parquet`: a row for each photograph and for each eclipse.

Times are UTC, ISO; angles degrees, north and east positive; heights m; `dust_extinction` 1/m, optical depths at 550 nm,
vertical; durations s. Intervals are `_low` to `_high`; an `_upper_limit` (97.5 %) stands where no lower one was found.
"""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from inverse.archive.rows import QUANTITIES, write_whole

_YEAR_BC = re.compile(r"-\d+-\d\d-\d\d(T[\d:.]+Z)?")
_ENDS = ("median", "sd", "ci68_low", "ci68_high", "ci95_low", "ci95_high", "upper_limit")
COLUMNS: dict[str, type] = {
    "kind": str,  # photograph, eclipse
    "status": str,  # ok, not converged, failed
    "error": str,  # why it failed
    "eclipse": str,  # date of greatest eclipse
    "eclipse_kind": str,
    "utc": str,  # of an eclipse: of its first photograph
    "source": str,  # as the catalogue has it
    "line": int,  # of the catalogue, or number in the folder
    "disc": int,
    "latitude": float,
    "longitude": float,
    "height": float,
    "photographs": int,  # in this fit
    **{f"{column}_{end}": float for column in QUANTITIES.values() for end in _ENDS},
    "converged": bool,
    "method": str,
    "informed": float,  # share of the variance of dust that the photographs took away
    "ess": float,
    "k_hat": float,
    "r_hat": float,
    "not_finite": int,  # points where the posterior was no finite number, and taken as zero
    "smooth_error": float,
    "residual_rms": float,  # of log brightness; the worst photograph
    "cells": int,
    "warnings": int,
    "warnings_text": str,
    "seconds": float,
    "version": str,
    "jax": str,
    "sha256": str,
    "configuration": str,
    "key": str,  # of rows/ and fits/
    "licence": str,
    "credit": str,
    "notes": str,
}


def write_csv(out: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """`archive.csv`, in one step; empty fields for what is not known."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for row in rows:
        table.writerow(["" if row.get(name) is None else _plain(row[name]) for name in COLUMNS])
    path = out / "archive.csv"
    write_whole(path, text.getvalue().encode())
    return path


def write_parquet(out: Path, rows: Sequence[Mapping[str, Any]]) -> Path | None:
    """`archive.parquet`, in one step; None where pyarrow is not installed."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        return None
    types = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64(), bool: pyarrow.bool_()}
    schema = pyarrow.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    plain = [{name: row.get(name) for name in COLUMNS} for row in rows]
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.Table.from_pylist(plain, schema=schema), sink)
    path = out / "archive.parquet"
    write_whole(path, sink.getvalue().to_pybytes())
    return path


def _plain(value: Any) -> Any:
    """One line; nothing that a spreadsheet takes for a formula."""
    if not isinstance(value, str):
        return value
    line = " ".join(value.split())
    return f"'{line}" if line and line[0] in "=+-@" and not _YEAR_BC.fullmatch(line) else line
