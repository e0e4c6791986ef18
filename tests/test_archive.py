"""Archives: catalogues that cannot be believed, rows that can, photographs of one eclipse together."""

import csv
import io
import json
import socket
from email.message import Message
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.request import BaseHandler
from urllib.response import addinfourl

import numpy as np
import pytest
from PIL import Image

import inverse
from eclipsejax.errors import InputError
from inverse import cli
from inverse.archive import fetch
from inverse.archive.catalogue import listed
from inverse.archive.maker import make_archive
from inverse.archive.plot import eruptions, optical_depth_plot, year_of
from inverse.archive.rows import Task, files_of_a_fit, program, read_row, row_file
from inverse.archive.tables import COLUMNS, write_csv
from tests import archive_fakes as fakes
from tests import synthetic

TOTALITY = "2022-05-16T04:06:00Z"


@pytest.fixture(autouse=True)
def plain(monkeypatch, request):
    """Archives without their plot, which takes a second, but where it is looked at."""
    if not request.node.name.startswith("test_rows_of"):
        monkeypatch.setattr("inverse.archive.maker.optical_depth_plot", lambda rows, path: None)


def made(folder: Path, **options):
    return make_archive(folder / "photographs", folder / "out", workers=0, fit=fakes.fit, **options)


def put(folder: Path, *names: str, what: str = "ok"):
    for name in names:
        fakes.photograph(folder / "photographs" / name, what, 0, name)


def catalogue(folder: Path, text: str) -> Path:
    path = folder / "photographs" / "catalogue.csv"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def entries(folder: Path, rows: str, header="file,utc,local_time,zone,site,disc,sha256,eclipse,notes") -> list[Any]:
    return listed(catalogue(folder, f"# made for a test\n{header}\n{rows}\n"), folder / "out")


# Catalogues


def test_a_row_says_all_that_is_known(tmp_path):
    put(tmp_path, "a moon.jpg", "sub/b.jpg")
    first, second, third = entries(
        tmp_path,
        f'a moon.jpg,{TOTALITY},,,"-10.94,-37.06,12",4,{"AB" * 32},2022-05-16 total,"two\nlines"\n'
        "sub/b.jpg,,2022-05-16T01:06:00,America/Recife,,,,,\n"
        "https://example.org/c.jpg,,2022-05-16 01:06:00,-03:00,,,,,",
    )
    assert (first.time, first.site, first.disc, first.sha256) == (TOTALITY, (-10.94, -37.06, 12.0), 4, "ab" * 32)
    assert first.eclipse == "2022-05-16" and first.refused is None and first.path.is_file()
    assert second.time == third.time == TOTALITY and second.path.name == "b.jpg" and third.path is None
    assert (first.line, second.line) == (4, 5)  # a row of two lines ends on its second


def test_dates_of_old_are_julian_and_years_astronomical(tmp_path):
    put(tmp_path, "a.jpg")
    one, two = entries(tmp_path, "a.jpg,1110-05-05T22:00:00Z,,,,,,1110-05-05,\na.jpg,-0584-05-28T16:00Z,,,,,,,")
    assert one.time == "1110-05-05T22:00:00Z" and one.refused is None and two.time == "-0584-05-28T16:00:00Z"


@pytest.mark.parametrize(
    "row, words",
    [
        (",,,,,,,,", None),
        ("a.jpg,,,,,,,", "it has 8 fields where the header has 9"),
        (" ,2022-05-16T04:06:00Z,,,,,,,", "file is empty"),
        ("/etc/passwd,,,,,,,,", "not below the folder of the catalogue"),
        ("../a.jpg,,,,,,,,", "not below the folder of the catalogue"),
        ("sub/../../a.jpg,,,,,,,,", "not below the folder of the catalogue"),
        ("C:\\a.jpg,,,,,,,,", "not below the folder of the catalogue"),
        ("..\\a.jpg,,,,,,,,", "not below the folder of the catalogue"),
        ("nowhere.jpg,,,,,,,,", "nowhere.jpg does not exist"),
        ("sub,,,,,,,,", "sub does not exist"),
        ("x" * 5000 + ",,,,,,,,", "does not exist"),
        ("http://example.org/a.jpg,,,,,,,,", "is not an https address"),
        ("file:///etc/passwd,,,,,,,,", "is not an https address"),
        ("https:///a.jpg,,,,,,,,", "is not an https address"),
        ("https://user:secret@example.org/a.jpg,,,,,,,,", "is not an https address"),
        ("https://example.org:99999/a.jpg,,,,,,,,", "is not an https address"),
        ("a.jpg,2022-05-16T04:06:00,,,,,,,", "has no time zone"),
        ("a.jpg,yesterday,,,,,,,", "'yesterday' cannot be read"),
        ("a.jpg,2022-02-30T04:06:00Z,,,,,,,", "no such date"),
        ("a.jpg,,2022-05-16T01:06:00,Mars/Tharsis,,,,,", "Mars/Tharsis cannot be read"),
        ("a.jpg,,2022-05-16T01:06:00,../../etc/passwd,,,,,", "cannot be read"),
        ("a.jpg,,yesterday,Europe/Rome,,,,,", "yesterday in zone Europe/Rome cannot be read"),
        ("a.jpg,,2022-10-30T02:30:00,Europe/Rome,,,,,", "two times or none"),
        ("a.jpg,,2022-03-27T02:30:00,Europe/Rome,,,,,", "two times or none"),
        ('a.jpg,,,,"95,0",,,,', "site is 95,0"),
        ('a.jpg,,,,"0,nan",,,,', "site is 0,nan"),
        ('a.jpg,,,,"0,0,1e9",,,,', "no place to stand"),
        ("a.jpg,,,,,0,,,", "disc is 0"),
        ("a.jpg,,,,,1.5,,,", "disc is 1.5"),
        ("a.jpg,,,,,,abc,,", "sha256 is abc"),
        ("a.jpg,2022-05-16T04:06:00Z,,,,,,2021-05-26,", "nearest to its time"),
        ("a.jpg,2022-05-16T04:06:00Z,,,,,,soon,", "'soon' cannot be read"),
        ("a.jpg,9999-05-16T04:06:00Z,,,,,,2021-05-26,", "outside the table"),
    ],
)
def test_a_bad_row_keeps_one_sentence_with_its_line_and_the_others_go_on(tmp_path, row, words):
    put(tmp_path, "a.jpg", "sub/b.jpg")
    *bad, good = entries(tmp_path, f"{row}\na.jpg,,,,,,,,")
    assert good.refused is None and good.path is not None
    assert len(bad) == (words is not None)
    for one in bad:
        assert one.path is None and one.refused.startswith("catalogue.csv, line 3: ") and words in one.refused
        assert "\n" not in one.refused and one.refused.endswith(".") and len(one.refused) < 400


@pytest.mark.parametrize(
    "content, words",
    [
        (b"", "no column file"),
        (b"name,utc\nx,y\n", "no column file"),
        (b"file\n", "names no photograph"),
        (b"\xff\xd8\xff\xe0", "not a text file"),
        (b"file\n\0\n", "not a text file"),
        (b'file\n"' + b"x" * 200_000 + b'"\n', "is not CSV"),
    ],
)
def test_what_is_no_catalogue_is_refused(tmp_path, content, words):
    path = tmp_path / "catalogue.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        listed(path, tmp_path / "out")
    assert "\n" not in str(caught.value)


def test_places_that_hold_no_catalogue_are_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    for path in (tmp_path / "empty", tmp_path / "nowhere", tmp_path / ("x" * 5000), "a\0b"):
        with pytest.raises(InputError):
            listed(path, tmp_path / "out")


def test_a_folder_is_searched_but_not_the_archive_in_it_nor_what_is_hidden(tmp_path):
    put(tmp_path, "b.JPG", "a/c.fits", ".d.jpg", "notes.txt", "out/fit.png")
    (tmp_path / "photographs" / "loop").symlink_to(tmp_path / "photographs")
    found = listed(tmp_path / "photographs", tmp_path / "photographs" / "out")
    assert [one.source for one in found] == ["b.JPG", "a/c.fits"]


# Fetching


class Answer:
    def __init__(self, data: bytes, promised: int):
        self.data, self.length = data, promised

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def read1(self, size):
        chunk, self.data = self.data[:size], self.data[size:]
        self.length -= len(chunk)
        return chunk


@pytest.fixture
def network(monkeypatch):
    """What the network answers, for any address; and the addresses that were asked for."""
    sent: dict = {"data": b"ok 0 moon", "asked": []}

    class Opener:
        def open(self, request, timeout):
            sent["asked"].append(request.full_url)
            if "error" in sent:
                raise sent["error"]
            return Answer(sent["data"], sent.get("promised", len(sent["data"])))

    monkeypatch.setattr(fetch, "_opener", Opener)
    return sent


def test_a_photograph_is_fetched_once_under_a_name_that_its_address_does_not_choose(tmp_path, network):
    path = catalogue(tmp_path, "file,utc\nhttps://example.org/../../%2e%2e/../moon.jpg?x=../y,2022-05-16T04:06:00Z\n")
    for _ in range(2):
        rows = make_archive(path, tmp_path / "out", workers=0, fit=fakes.fit)
        assert [row["status"] for row in rows] == ["ok", "ok"]
    assert len(network["asked"]) == 1
    (kept,) = (tmp_path / "out" / "photographs").iterdir()
    assert kept.read_bytes() == b"ok 0 moon" and kept.suffix == ".jpg" and len(kept.stem) == 32


@pytest.mark.parametrize(
    "answer, words",
    [
        ({"error": OSError("no route to host\nat all")}, "no route to host at all"),
        ({"error": TimeoutError()}, "TimeoutError"),
        ({"promised": 50}, "cut short"),
        ({"data": b"x" * 3000}, "sends more than"),
        ({"data": b"another"}, "another file than the catalogue says"),
    ],
)
def test_what_cannot_be_fetched_leaves_a_row_and_no_file(tmp_path, network, monkeypatch, answer, words):
    monkeypatch.setattr(fetch, "MOST_BYTES", 2000)
    network |= answer
    path = catalogue(tmp_path, f"file,sha256\nhttps://example.org/moon.jpg,{'0' * 64}\n")
    (row,) = make_archive(path, tmp_path / "out", workers=0, fit=fakes.fit)
    assert row["status"] == "failed" and words in row["error"] and row["source"] == "https://example.org/moon.jpg"
    assert not list((tmp_path / "out" / "photographs").iterdir())


def test_a_redirect_away_from_https_is_refused():
    with pytest.raises(InputError, match="not an https address"):
        fetch._OnlyHttps().redirect_request(None, None, 302, "", {}, "http://example.org/")


PRIVATE = (
    "127.0.0.1", "127.8.9.1", "10.1.2.3", "172.16.0.1", "172.31.255.255", "192.168.1.1", "169.254.169.254", "0.0.0.0",
    "100.64.0.1", "224.0.0.1", "::1", "::", "fc00::1", "fd12::1", "fe80::1%eth0", "::ffff:127.0.0.1",
)  # fmt: skip
PUBLIC = ("93.184.216.34", "172.32.0.1", "2606:2800:220:1::1")


@pytest.fixture
def names(monkeypatch):
    """What names stand for, for a resolver without a network; numbers stand for themselves."""
    known = {"example.org": [PUBLIC[0]], "localhost": ["::1", "127.0.0.1"]}

    def resolved(host, port, **_):
        if host == "unknown.example":
            raise socket.gaierror(-2, "Name or service not known")
        return [
            (socket.AF_INET6 if ":" in number else socket.AF_INET, socket.SOCK_STREAM, 6, "", (number, port))
            for number in known.get(host, [host])
        ]

    monkeypatch.setattr(fetch.socket, "getaddrinfo", resolved)
    return known


def test_hosts_that_are_not_on_the_open_internet_are_refused_by_name_and_by_number(names):
    for number in PRIVATE:
        names["inside.example"] = [PUBLIC[0], number]  # one bad place suffices
        written = f"[{number.partition('%')[0]}]" if ":" in number else number
        for host in ("inside.example", written):
            with pytest.raises(InputError, match="not on the open internet") as refused:
                fetch.check_public(f"https://{host}/moon.jpg")
            assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match="leads to ::1"):
        fetch.check_public("https://localhost:8443/moon.jpg")
    for number in PUBLIC:
        names["outside.example"] = [number]
        fetch.check_public("https://outside.example/moon.jpg")
    fetch.check_public("https://unknown.example/moon.jpg")  # the connection will tell


class Told(addinfourl):
    """An answer with a phrase, which urllib wants of it."""

    msg = ""


class Redirecting(BaseHandler):
    """Answers in the place of the network: from example.org it sends on to an address."""

    handler_order = 100

    def __init__(self, onward):
        self.onward, self.asked = onward, []

    def https_open(self, request):
        self.asked.append(request.full_url)
        first = request.host == "example.org"
        headers = Message()
        if first:
            headers["Location"] = self.onward
        return Told(io.BytesIO(b"ok 0 moon"), headers, request.full_url, 302 if first else 200)


@pytest.mark.parametrize(
    "onward, words",
    [
        ("https://inside.example/moon.jpg", "leads to 10.0.0.1, which is not on the open internet"),
        ("https://127.0.0.1/moon.jpg", "leads to 127.0.0.1"),
        ("http://outside.example/moon.jpg", "not an https address"),
        ("file:///etc/passwd", "cannot be fetched"),
        ("https://outside.example/moon.jpg", ""),
    ],
)
def test_redirects_lead_to_the_open_internet_by_https_or_nowhere(tmp_path, monkeypatch, names, onward, words):
    names |= {"inside.example": ["10.0.0.1"], "outside.example": [PUBLIC[1]]}
    opener, network = fetch._opener(), Redirecting(onward)
    opener.add_handler(network)
    monkeypatch.setattr(fetch, "_opener", lambda: opener)
    if words == "":
        with opener.open("https://example.org/moon.jpg") as answer:
            assert answer.read() == b"ok 0 moon"
        assert network.asked == ["https://example.org/moon.jpg", onward]
        return
    with pytest.raises(InputError, match=words):
        fetch.fetched("https://example.org/moon.jpg", tmp_path)
    assert network.asked == ["https://example.org/moon.jpg"] and not list(tmp_path.iterdir())


# Rows


def test_rows_of_photographs_and_eclipses(tmp_path):
    put(tmp_path, "a.jpg", "b.jpg", "c.jpg")
    put(tmp_path, "d.jpg", what="refuse")
    path = catalogue(
        tmp_path,
        "file,utc,site,credit,disc\n"
        f'a.jpg,{TOTALITY},"-10.94,-37.06",=HYPERLINK(),\nb.jpg,2022-05-16T04:10:00Z,,,2\n'
        "c.jpg,2015-09-28T02:47:00Z,,,\nd.jpg,2018-01-31T13:00:00Z,,,\nnot/there.jpg,,,,\n",
    )
    rows = make_archive(path, tmp_path / "out", workers=0, fit=fakes.fit, most=5)
    photographs, eclipses = ([row for row in rows if row["kind"] == kind] for kind in ("photograph", "eclipse"))
    assert [row["status"] for row in photographs] == ["ok", "ok", "ok", "failed", "failed"]
    assert [row["eclipse"] for row in photographs] == ["2022-05-16"] * 2 + ["2015-09-28", "2018-01-31", None]
    assert [(row["eclipse"], row["status"], row["photographs"]) for row in eclipses] == [
        ("2015-09-28", "ok", 1), ("2018-01-31", "failed", 0), ("2022-05-16", "ok", 2),
    ]  # fmt: skip
    assert eclipses[0]["key"] == photographs[2]["key"]  # a single photograph is not fitted again
    assert len(list((tmp_path / "out" / "rows").iterdir())) == 5
    first = photographs[0]
    assert (
        first["stratospheric_optical_depth_median"] == fakes.DEPTH
        and first["stratospheric_optical_depth_upper_limit"] is None
    )
    assert (first["latitude"], first["longitude"], first["height"]) == (-10.94, -37.06, None)
    assert first["not_finite"] == 3 and photographs[4].get("not_finite") is None
    assert first["k_hat"] is None  # infinite, which JSON has not
    assert "line 6: not/there.jpg does not exist" in photographs[4]["error"]
    assert (tmp_path / "out" / "optical_depth.png").stat().st_size > 5000
    assert all(set(row) <= set(COLUMNS) for row in rows)

    with (tmp_path / "out" / "archive.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert list(table[0]) == list(COLUMNS) and len(table) == 8
    assert table[0]["credit"] == "'=HYPERLINK()" and table[0]["sha256"] == first["sha256"]
    parquet = pytest.importorskip("pyarrow.parquet").read_table(tmp_path / "out" / "archive.parquet").to_pylist()
    assert [row["stratospheric_optical_depth_median"] for row in parquet] == [
        row.get("stratospheric_optical_depth_median") for row in rows
    ]
    assert [row["converged"] for row in parquet][:4] == [True, True, True, None]


def test_a_spreadsheet_finds_no_formula_and_years_before_christ_stay_dates(tmp_path):
    date = "-0584-05-28T16:00:00Z"
    formulae = ("=1+1", "+1", "@SUM(A1)", "-2+3", "-0584-05-28+cmd()", " =1", "\t-1")
    write_csv(tmp_path, [{"kind": "photograph", "utc": date, "eclipse": date[:11], "notes": one} for one in formulae])
    with (tmp_path / "archive.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {(row["utc"], row["eclipse"]) for row in rows} == {(date, date[:11])}
    assert [row["notes"] for row in rows] == [f"'{one.strip()}" for one in formulae]


def test_a_limit_is_told_and_a_fit_that_did_not_converge_is_not_used_for_its_eclipse(tmp_path):
    path = catalogue(tmp_path, f"file,utc\nlimit.jpg,{TOTALITY}\nbad.jpg,{TOTALITY}\n")
    put(tmp_path, "limit.jpg", what="limit")
    put(tmp_path, "bad.jpg", what="unconverged")
    limit, bad, eclipse = make_archive(path, tmp_path / "out", workers=0, fit=fakes.fit)
    assert limit["stratospheric_optical_depth_upper_limit"] == pytest.approx(1.2 * fakes.DEPTH)
    assert (bad["status"], bad["converged"]) == ("not converged", False) and eclipse["key"] == limit["key"]


def test_of_many_photographs_some_are_fitted_together_evenly_and_copies_count_once(tmp_path):
    names = [f"{minute:02d}.jpg" for minute in range(9)]
    put(tmp_path, *names)
    lines = [f"{name},2022-05-16T04:{name[:2]}:00Z\n" for name in names]
    path = catalogue(tmp_path, "file,utc\n" + "".join(lines) + lines[0])
    *photographs, eclipse = make_archive(path, tmp_path / "out", workers=0, fit=fakes.fit, most=3)
    assert len(photographs) == 10 and photographs[0]["key"] == photographs[9]["key"]
    assert eclipse["sha256"].split() == [photographs[n]["sha256"] for n in (0, 4, 8)]
    assert "Of 9 photographs 3 were fitted together" in eclipse["warnings_text"] and eclipse["warnings"] == 2
    eclipse = make_archive(path, tmp_path / "out", workers=0, fit=fakes.fit, most=1)[-1]
    assert eclipse["key"] == photographs[0]["key"]
    assert "Of 9 photographs the first was taken." in eclipse["warnings_text"]


def log_lines(folder: Path) -> int:
    return sum(len(path.read_text().split()) for path in (folder / "out" / "fits").glob("*/log"))


@pytest.mark.parametrize(
    "harm",
    [
        lambda path: path.write_bytes(path.read_bytes()[:100]),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_text(path.read_text().replace("0.02", "0.03")),
        lambda path: path.write_bytes(b"\xff" * 300),
        lambda path: path.write_text("[" * 100_000),
        lambda path: path.write_text('{"sha256": 1, "row": []}'),
        lambda path: path.unlink(),
    ],
)
def test_a_row_that_was_altered_is_done_again_and_no_other(tmp_path, harm):
    put(tmp_path, "a.jpg", "b.jpg")
    before = made(tmp_path)
    count = log_lines(tmp_path)
    harm(row_file(tmp_path / "out", before[0]["key"]))
    assert read_row(tmp_path / "out", before[0]["key"]) is None
    after = made(tmp_path)
    assert log_lines(tmp_path) == count + 1
    for row in (*before, *after):
        row.pop("seconds")
    assert after == before


def test_a_row_under_another_name_is_not_believed(tmp_path):
    put(tmp_path, "a.jpg", "b.jpg")
    first, second, _ = made(tmp_path)
    folder = tmp_path / "out"
    row_file(folder, first["key"]).write_bytes(row_file(folder, second["key"]).read_bytes())
    assert read_row(folder, first["key"]) is None and read_row(folder, second["key"]) is not None


def test_keys_depend_on_bytes_configuration_and_version_but_not_on_names(tmp_path, monkeypatch):
    one = Task(("a.jpg",), ("00",), (TOTALITY,), (None,), (None,))
    keys = {
        Task(("a.jpg",), ("01",), (TOTALITY,), (None,), (None,)).key,
        Task(("a.jpg",), ("00",), (None,), (None,), (None,)).key,
        Task(("a.jpg",), ("00",), (TOTALITY,), ((1.0, 2.0),), (None,)).key,
        Task(("a.jpg",), ("00",), (TOTALITY,), (None,), (1,)).key,
        Task(("a.jpg",), ("00",), (TOTALITY,), (None,), (None,), 100).key,
        Task(("a.jpg",), ("00",), (TOTALITY,), (None,), (None,), None, 1).key,
        one.key,
    }
    assert (
        len(keys) == 7
        and Task(("b.jpg",), *(getattr(one, n) for n in ("sha256", "times", "sites", "discs"))).key == one.key
    )
    assert program().startswith(version("eclipsejax") + "+")
    monkeypatch.setattr("inverse.archive.rows.program", lambda: "99")
    assert one.key not in keys


def test_the_version_is_of_the_code_that_a_fit_goes_through():
    inside = {path.relative_to(Path(inverse.__file__).parents[1]).as_posix() for path in files_of_a_fit()}
    assert inside >= {
        "inverse/fit.py",
        "inverse/catalogue.py",
        "inverse/tables/scattered_light.csv",
        "eclipsejax/limb.py",
        "eclipsejax/tables/atmosphere_profiles_afgl1986.csv",
    }
    assert not any("archive" in name or name.endswith(("cli.py", "progress_bars.py")) for name in inside)


def test_what_failed_is_done_again_only_on_request(tmp_path):
    put(tmp_path, "a.jpg")
    put(tmp_path, "b.jpg", what="refuse")
    made(tmp_path)
    count = log_lines(tmp_path)
    made(tmp_path)
    assert log_lines(tmp_path) == count
    made(tmp_path, retry=True)
    assert log_lines(tmp_path) == count + 1
    assert [row["status"] for row in made(tmp_path)] == ["ok", "failed", "ok"]


def test_a_reason_names_no_file_since_copies_share_it(tmp_path):
    put(tmp_path, "a\nmoon.jpg", what="name")
    fakes.photograph(tmp_path / "photographs" / "b.jpg", "name", 0, "a\nmoon.jpg")
    first, second = (row for row in made(tmp_path) if row["kind"] == "photograph")
    assert first["key"] == second["key"] and second["source"] == "b.jpg"
    assert first["error"] == second["error"] == "The photograph is no picture of the Moon."


def test_an_interrupted_chain_is_gone_on_with_and_a_foreign_one_thrown_away(tmp_path):
    put(tmp_path, "a.jpg", what="chain")
    with pytest.raises(KeyboardInterrupt):
        made(tmp_path)
    (chain,) = (tmp_path / "out" / "fits").glob("*/chain.h5")
    assert chain.read_text() == "half" and not list((tmp_path / "out" / "rows").iterdir())
    assert made(tmp_path)[0]["status"] == "ok" and chain.exists()

    row_file(tmp_path / "out", chain.parent.name).unlink()
    resumed = []

    def fit(task, chain, resume):
        resumed.append(resume)
        if resume:
            raise InputError("That is the chain of another fit.")
        return fakes.fit(Task(task.paths, task.sha256, task.times, task.sites, task.discs), chain_made(chain), False)

    def chain_made(chain):
        assert not chain.exists()
        chain.write_text("new")
        return chain

    (row, _) = make_archive(tmp_path / "photographs", tmp_path / "out", workers=0, fit=fit)
    assert resumed == [True, False] and row["status"] == "ok"


def test_a_photograph_that_changes_meanwhile_is_told(tmp_path):
    put(tmp_path, "a.jpg")

    def fit(task, chain, resume):
        Path(task.paths[0]).write_text("ok 0 changed")
        return fakes.fit(task, chain, resume)

    assert "was changed" in make_archive(tmp_path / "photographs", tmp_path / "out", workers=0, fit=fit)[0]["error"]


def test_an_eclipse_that_the_file_itself_contradicts(tmp_path):
    put(tmp_path, "a.jpg")
    path = catalogue(tmp_path, "file,eclipse\na.jpg,2015-09-28\n")  # its own time, by the fake fit, is of 2022
    row = make_archive(path, tmp_path / "out", workers=0, fit=fakes.fit)[0]
    assert row["status"] == "failed" and "said to be that of 2015-09-28" in row["error"]
    assert "stratospheric_optical_depth_median" not in row


# The command


def command(capsys, *arguments) -> tuple[int, str, str]:
    status = cli.main([str(argument) for argument in arguments])
    return status, *capsys.readouterr()


@pytest.fixture
def faked(monkeypatch):
    assert make_archive.__kwdefaults__
    monkeypatch.setitem(make_archive.__kwdefaults__, "fit", fakes.fit)


def test_exit_statuses(tmp_path, capsys, faked):
    put(tmp_path, "a.jpg")
    given = (tmp_path / "photographs", "--archive", tmp_path / "out", "--workers", 0)
    status, said, _ = command(capsys, *given)
    assert status == 0 and "1 photograph: 1 ok, 0 not converged, 0 failed." in said and "archive.csv" in said
    put(tmp_path, "b.jpg", what="unconverged")
    status, _, told = command(capsys, *given)
    assert status == 3 and "b.jpg: The fit did not converge." in told
    put(tmp_path / "two", "c.jpg", what="refuse")
    status, _, told = command(
        capsys, tmp_path / "two" / "photographs", "--archive", tmp_path / "two" / "out", "--workers", 0
    )
    assert status == 2 and "There is no Moon in it" in told and "None of the photographs could be fitted" in told


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["nowhere"], "does not exist"),
        (["photographs", "more"], "one folder or catalogue, and not 2 names"),
        (["photographs", "--time", TOTALITY], "not --time"),
        (["photographs", "--demo"], "not --demo"),
        (["photographs", "--workers", "0", "--seconds-per-photograph", "9"], "give --workers 1 or more"),
        (["photographs", "--workers", "1", "--scheduler", "tcp://x:1"], "exclude each other"),
        (["photographs", "--workers", "1.5"], "not a whole number"),
        (["photographs", "--workers", "-1"], "--workers"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(tmp_path, capsys, monkeypatch, faked, arguments, words):
    put(tmp_path, "a.jpg")
    monkeypatch.chdir(tmp_path)
    status, said, told = command(capsys, *arguments, "--archive", tmp_path / "out")
    assert status == 2 and words in told and told.count("\n") == 1 and not said


def test_a_folder_that_cannot_be_made_or_is_taken_is_one_sentence(tmp_path, capsys, faked):
    put(tmp_path, "a.jpg")
    (tmp_path / "file").touch()
    status, _, told = command(capsys, tmp_path / "photographs", "--archive", tmp_path / "file", "--workers", 0)
    assert status == 2 and "cannot be written to" in told and told.count("\n") == 1
    import fcntl

    out = tmp_path / "out"
    out.mkdir()
    with (out / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        status, _, told = command(capsys, tmp_path / "photographs", "--archive", out, "--workers", 0)
    assert status == 2 and "Another command is at work" in told


# The plot


def test_years_and_eruptions():
    assert year_of("2022-01-01T00:00:00Z") == 2022.0 and year_of("2020-07-02T12:00:00Z") == pytest.approx(2020.5)
    assert year_of("-0584-01-01T00:00:00Z") == -584.0
    known = dict(eruptions())
    assert list(known) == ["Agung", "El Chichon", "Pinatubo", "Calbuco", "Raikoke", "Hunga"]
    assert known["Pinatubo"] == pytest.approx(1991.45, abs=0.01) and sorted(known.values()) == list(known.values())


def test_the_plot_marks_eclipses_and_eruptions(tmp_path):
    depth = "stratospheric_optical_depth"
    rows = [
        {"kind": "eclipse", "status": "ok", "utc": f"{year}-12-09T23:00:00Z", f"{depth}_median": value,
         f"{depth}_upper_limit": None if value > 0.01 else 2 * value,
         **{f"{depth}_{level}_{end}": f * value for level, ends in (("ci68", (0.8, 1.2)), ("ci95", (0.6, 1.5)))
            for end, f in zip(("low", "high"), ends, strict=True)}}
        for year, value in ((1982, 0.1), (1992, 0.15), (2011, 0.005))
    ]  # fmt: skip
    path = optical_depth_plot(rows, tmp_path / "p.png")
    picture = np.asarray(Image.open(path).convert("RGB")).astype(int)
    red = (picture[..., 0] > 180) & (picture[..., 1] < 130) & (picture[..., 2] < 130)
    blue = (picture[..., 2] > 180) & (picture[..., 0] < 90)
    assert red.any(axis=0).sum() > 2 and blue.sum() > 100
    assert optical_depth_plot([{"kind": "eclipse", "status": "failed", "utc": None}], tmp_path / "none.png") is None


@pytest.mark.slow
def test_two_photographs_end_to_end_on_a_worker(tmp_path, capsys):
    folder = tmp_path / "photographs"
    folder.mkdir()
    for seed, name in ((1, "one.jpg"), (2, "two.jpg")):
        synthetic.photograph(folder / name, synthetic.limb(), seed=seed)
    site = ",".join(map(str, synthetic.SITE))
    path = catalogue(tmp_path, f'file,utc,site\none.jpg,{synthetic.UTC},"{site}"\ntwo.jpg,{synthetic.UTC},"{site}"\n')
    status, _, told = command(
        capsys, path, "--archive", tmp_path / "out", "--workers", 1, "--seconds-per-photograph", 900
    )
    assert status in (0, 3), told
    with (tmp_path / "out" / "archive.csv").open(newline="") as file:
        one, two, eclipse = csv.DictReader(file)
    assert (eclipse["kind"], eclipse["photographs"], eclipse["eclipse"]) == ("eclipse", "2", "2022-05-16")
    for row in (one, two, eclipse):
        low, high = (float(row[f"dust_extinction_ci95_{end}"]) for end in ("low", "high"))
        assert low < synthetic.ALPHA < high
        saved = json.loads((tmp_path / "out" / "fits" / row["key"] / "fit.json").read_text())
        assert saved["parameters"]["dust.extinction"]["median"] == pytest.approx(float(row["dust_extinction_median"]))
