"""How the calibration goes through its photographs: rows are kept, a failure is one of them, time may run out."""

import json
import sys
from unittest.mock import ANY

from benchmarks.calibration import QUANTITIES, main, pack, run, unpack

FAILS = 2


def fitted(number, draws, folder, how):
    """In place of a fit: leaves a file, so that it is seen how often it was asked for."""
    (folder / f"{number}.asked").touch(exist_ok=False)
    if number == FAILS:
        raise ValueError("no disc")
    return {"number": number, "method": "none", "seconds": 0.0, "rank": dict.fromkeys(QUANTITIES, 0.5)}


def test_rows_are_kept_and_a_failure_is_a_row(tmp_path):
    first = run(range(3), None, 2, tmp_path, fitted=fitted)
    assert [row["number"] for row in first] == [0, 1, 2]
    assert first[FAILS]["error"] == "ValueError: no disc" and "error" not in first[0]
    more = run(range(4), None, 2, tmp_path, fitted=fitted)  # asks for none of the three again, or `touch` would fail
    assert more[:3] == first and "error" not in more[3]


def test_what_there_is_no_time_for_is_not_begun(tmp_path):
    kept = run(range(1), None, 1, tmp_path, fitted=fitted)
    assert run(range(2), None, 1, tmp_path, fitted=fitted, minutes=0.0) == kept
    assert not (tmp_path / "1.asked").exists()
    assert len(run(range(2), None, 1, tmp_path, fitted=fitted, minutes=1.0)) == 2


def test_rows_can_be_carried_to_another_machine(tmp_path):
    here, there, packed = tmp_path / "here", tmp_path / "there", tmp_path / "rows.jsonl"
    unpack(packed, here)  # nothing there yet
    pack(first := run(range(1), None, 1, here, fitted=fitted), packed)
    row = first[0]
    with packed.open("a") as file:
        file.write(json.dumps(row | {"number": 1, "key": "of another version"}) + "\n")
    unpack(packed, there)
    assert run(range(2), None, 1, there, fitted=fitted) == [row, row | {"number": 1, "key": ANY}]
    assert [path.name for path in there.glob("*.asked")] == ["1.asked"]


def test_a_calibration_of_no_photographs_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["calibration", "--count", "2", "--minutes", "0", "--out", str(tmp_path)])
    assert main() == 1
    assert "none could be fitted" in capsys.readouterr().out
