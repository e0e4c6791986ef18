"""The command `eclipsejax`, as a person meets it: what it prints, what it writes, how it refuses."""

import re
import subprocess
import sys
import types
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import tifffile
from PIL import Image

import eclipsejax
import inverse
from eclipsejax import cli, session, snapshot
from eclipsejax.commands import listing
from eclipsejax.photometry import pictured_brightness
from eclipsejax.programs import program
from eclipsejax.response import displayed

TOTALITY = "2022-05-16T04:11:30Z"
SMALL = ["--size", "48", "--tolerance", "1e-2"]


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch, compiled_anew):
    """The commands keep whole programs; the tests keep them out of the user's home."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp()))


def check_refused(capsys, arguments, *words):
    """Exit status 2, nothing on stdout, one sentence on stderr with these words in it."""
    assert cli.main(arguments) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("eclipsejax: ") and said.err.endswith(".\n") and said.err.count("\n") == 1
    for word in words:
        assert word in said.err


def listed(capsys, *arguments):
    assert cli.main(["list", *arguments]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_year_alone_is_listed_to_its_end(capsys):
    for year, next_year in (("2008", "2009"), ("-1000", "-999"), ("2998", "2999"), ("-1", "0")):
        assert listed(capsys, year) == listed(capsys, year, next_year)


def test_eclipses_of_a_year_have_their_kind_magnitudes_and_contacts(capsys):
    heading, may, november = listed(capsys, "2022", "2023")
    assert heading.split()[-6:] == ["P1", "U1", "U2", "U3", "U4", "P4"]
    greatest, kind, gamma, umbral, penumbral, *contacts = may.split()
    assert kind == "total" and greatest.startswith("2022-05-16T04:11:")
    # Espenak & Meeus, Five Millennium Canon of Lunar Eclipses.
    assert float(gamma) == pytest.approx(-0.2532, abs=1e-3)
    assert (float(umbral), float(penumbral)) == pytest.approx((1.4137, 2.3726), abs=2e-3)
    assert [text[:5] for text in contacts] == ["01:32", "02:27", "03:29", "04:53", "05:55", "06:50"]
    assert november.startswith("2022-11-08")


def test_contacts_that_do_not_happen_are_left_out(capsys):
    assert listed(capsys, "2020-11-01", "2020-12-31")[1].split()[1:].count("-") == 4  # penumbral
    assert listed(capsys, "2023-10-01", "2023-12-01")[1].split()[1:].count("-") == 2  # partial


def test_kinds_add_up(capsys):
    every = listed(capsys, "2000", "2010")
    chosen = [line for kind in listing.KINDS for line in listed(capsys, "2000", "2010", "--kind", kind)[1:]]
    assert sorted(chosen) == sorted(every[1:]) and len(chosen) > 20


def test_years_before_our_era_are_not_taken_for_options(capsys):
    _, first, *_ = listed(capsys, "-584", "-583")
    assert first.startswith("-0584-")
    assert len(listed(capsys, "-0584-05-01", "-0584-12-31")) == 3


def test_a_site_shows_where_the_moon_is_up(capsys):
    lines = listed(capsys, "2022-05-01", "2022-06-01", "--site", "-10.94,-37.06")
    altitudes = lines[-1].split()
    assert len(altitudes) == 7 and all(0.0 < float(text) < 90.0 for text in altitudes)  # up all night
    lines = listed(capsys, "2022-05-01", "2022-06-01", "--site", "35.7,139.7")
    assert lines[-1].split() == ["below"] * 7 and "below horizon" in lines[1]  # noon in Tokyo


def test_a_month_without_eclipse_says_so(capsys):
    (line,) = listed(capsys, "2022-06-01", "2022-07-01")
    assert line == "No lunar eclipse from 2022-06-01 until before 2022-07-01."


def test_the_readme_shows_what_the_command_prints(capsys):
    lines = listed(capsys, "2025", "2027")
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    assert "\n".join(["    $ eclipsejax list 2025 2027", *("    " + line for line in lines), ""]) in readme


def test_chart_prints_where_the_moon_stands_and_draws_it(capsys, tmp_path):
    picture = tmp_path / "chart.png"
    assert cli.main(["chart", "2008-02-21", "--site", "42.73,-73.68", "-o", str(picture)]) == 0
    kind, heading, *rows, wrote = capsys.readouterr().out.splitlines()
    assert kind.startswith("total, umbral magnitude 1.106") and len(rows) == 7 and "chart.png" in wrote
    cells = dict(zip(heading.replace(":", "").split(), rows[3].split()[1:], strict=True))
    assert rows[3].startswith("greatest") and cells["UTC"].startswith("2008-02-21T03:26")
    found = {name: float(text) for name, text in cells.items() if name != "UTC"}
    assert found == pytest.approx(
        dict(altitude=50.3, azimuth=138.0, radius=15.77, libration=5.22, latitude=0.92, axis=19.4, tilt=49.4), abs=0.06
    )
    with Image.open(picture) as image:
        assert image.width > 1000
    assert cli.main(["chart", "2025-09-07"]) == 0
    assert capsys.readouterr().out.splitlines()[2].split()[2:4] == ["-", "-"]  # no horizon at the Earth's centre
    check_refused(capsys, ["chart", "2008-02-25"], "no lunar eclipse", "2008-02-21")
    check_refused(capsys, ["chart", "2008-02-21", "--site", "91,0"], "latitude")
    check_refused(capsys, ["chart", "2008-02-21", "-o", str(tmp_path / "chart.pdf")], "format")


def test_totality_is_rendered_red_and_bright_enough_to_see(capsys, tmp_path):
    assert cli.main(["render", TOTALITY, "-o", str(tmp_path / "moon.png"), *SMALL]) == 0
    brightened, dimmed, wrote = capsys.readouterr().out.splitlines()
    lost, magnitude, number = map(float, re.findall(r"-?\d+\.\d", dimmed))
    assert 9.5 < lost < 12.5 and magnitude == pytest.approx(lost - 12.9, abs=0.4) and 1.0 < number < 4.0
    match = re.fullmatch(r"The Moon is brightened ([\d,]+) times\.", brightened)
    assert match and float(match[1].replace(",", "")) > 100
    assert "moon.png" in wrote and TOTALITY in wrote and "48 x 48" in wrote
    picture = np.asarray(Image.open(tmp_path / "moon.png"))
    assert picture.shape == (48, 48, 3) and picture.dtype == np.uint8
    assert not picture[:2].any() and 180 < picture.max() < 256  # dark sky, bright limb
    red, green, blue = picture[picture.any(axis=-1)].mean(axis=0)
    assert red > 1.3 * green > 1.3 * blue
    # The Moon passes south of the axis (gamma < 0): its southern half is the brighter one, and north is up.
    assert picture[30:].mean() > 2.0 * picture[:18].mean()

    # The same in linear light, half as bright and upside down.
    gain = float(match[1].replace(",", ""))
    turned = ["--gain", f"{gain / 2:g}", "--roll", "180"]
    assert cli.main(["render", TOTALITY, "-o", str(tmp_path / "moon.tif"), *SMALL, *turned]) == 0
    linear = tifffile.imread(tmp_path / "moon.tif")
    assert linear.shape == (48, 48, 3) and linear.dtype == np.uint16
    code = picture[::-1, ::-1] / 255.0
    decoded = np.where(code > 0.04045, ((code + 0.055) / 1.055) ** 2.4, code / 12.92)
    inside = (code.min(axis=-1) > 0.1) & (code.max(axis=-1) < 0.97)
    assert inside.sum() > 200
    np.testing.assert_allclose(2.0 * linear[inside] / 65535.0, decoded[inside], rtol=0.06)


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["yesterday"], ["'yesterday' cannot be read", "2008-02-21T03:26:00Z"]),
        (["2022-05-16T04:11"], ["no time zone"]),
        (["2022-05-20T04:11Z"], ["No lunar eclipse", "2022-05-16T04:11"]),
        (["2022-05-16T08:00Z"], ["no eclipse", "2022-05-16T04:11"]),  # near enough for the table, but over
        ([TOTALITY, "--site", "35.7,139.7"], ["below the horizon"]),
        ([TOTALITY, "--site", "Boston"], ["--site", "'Boston' is not LAT,LON"]),
        ([TOTALITY, "--site", "95,0"], ["latitude 95"]),
        ([TOTALITY, "--clouds", "8"], ["--clouds", "TOP_KM,COVER"]),
        ([TOTALITY, "--alpha", "much"], ["--alpha", "'much' is not a number"]),
        ([TOTALITY, "--temperature", "15"], ["--temperature", "217 to 345"]),
        ([TOTALITY, "--clear", "--typical"], ["--typical", "not allowed with"]),
        ([TOTALITY, "--exposure", "1/60"], ["--exposure", "--f-number", "--iso"]),
        ([TOTALITY, "--gain", "nan"], ["--gain"]),
        ([], ["UTC", "--help"]),
    ],
)
def test_what_cannot_be_rendered_is_refused_in_one_sentence(capsys, tmp_path, arguments, words):
    check_refused(capsys, ["render", *arguments, "-o", str(tmp_path / "moon.png")], *words)
    assert not list(tmp_path.iterdir())


def test_places_that_cannot_be_written_are_refused_before_the_work(capsys, tmp_path):
    for name, word in (("missing/moon.png", "cannot be written"), ("moon.jpg", "format"), ("moon", "format")):
        check_refused(capsys, ["render", TOTALITY, "-o", str(tmp_path / name)], str(tmp_path / name), word)
    (tmp_path / "folder.png").mkdir()
    check_refused(capsys, ["render", TOTALITY, "-o", str(tmp_path / "folder.png")], "cannot be written")


def test_dates_that_cannot_be_listed_are_refused_in_one_sentence(capsys):
    check_refused(capsys, ["list", "2030", "2000"], "later than")
    check_refused(capsys, ["list", "2030", "2030"], "leave it out")
    check_refused(capsys, ["list", "2030-01-01"], "STOP is missing")
    check_refused(capsys, ["list", "2022-02-30", "2023"], "no such date")
    check_refused(capsys, ["list", "3000", "3010"], "-1000 to 2998")
    check_refused(capsys, ["list", "2022", "2023", "--kind", "annular"], "annular")
    check_refused(capsys, ["list", "2022", "2023", "--site", "10,500"], "longitude")


def test_an_exposure_is_a_brightness(capsys, tmp_path, monkeypatch):
    def full_moon(scene, atmosphere, tolerance, folder):
        image = jnp.ones((*scene.camera.shape, 3))
        return snapshot.Snapshot(
            image, pictured_brightness(scene, image), jnp.asarray(False), program(displayed, image, 1.0)
        )

    monkeypatch.setattr(snapshot, "snapshot", full_moon)
    shot = ["--exposure", "1/50", "--f-number", "8", "--iso", "200"]
    assert cli.main(["render", TOTALITY, "-o", str(tmp_path / "moon.tif"), "--size", "8", *shot]) == 0
    assert capsys.readouterr().out.startswith("A full Moon would be at 1.36 of full scale.")
    assert (tifffile.imread(tmp_path / "moon.tif") == 65535).all()
    darker = ["--exposure", "1/500", "--f-number", "8", "--iso", "200"]
    assert cli.main(["render", TOTALITY, "-o", str(tmp_path / "moon.tif"), "--size", "8", *darker]) == 0
    # The looney 11 (1/100 s, f/11, ISO 100) puts the full Moon at 0.18; this is 0.2 x 2 x (11 / 8)^2 of that.
    linear = tifffile.imread(tmp_path / "moon.tif") / 65535
    np.testing.assert_allclose(linear, 0.18 * 0.4 * (11 / 8) ** 2, atol=1e-4)


def test_control_c_ends_quietly(capsys):
    def interrupted():
        raise KeyboardInterrupt

    assert session.run("eclipsejax", interrupted) == 130
    assert capsys.readouterr() == ("", "")


def test_the_installed_command_refuses_quietly_and_a_closed_pipe_is_no_error():
    command = [sys.executable, "-c", "import sys; from eclipsejax.cli import main; sys.exit(main())"]
    done = subprocess.run([*command, "render", "never", "-o", "x.png"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
    listing = subprocess.Popen(
        [*command, "list", "0", "1000"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert listing.stdout and listing.stderr and listing.stdout.readline().startswith("greatest")
    listing.stdout.close()
    assert listing.stderr.read() == "" and listing.wait() == 0
    listing.stderr.close()


def test_importing_the_packages_loads_nothing_heavy():
    program = "import sys, eclipsejax, inverse, eclipsejax.cli; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    heavy = {"jax", "numpy", "skyfield", "matplotlib", "colour", "skimage", "emcee"}
    assert not heavy & set(done.stdout.split())


@pytest.mark.parametrize("package", [eclipsejax, inverse])
def test_every_public_name_is_there(package):
    for name in package.__all__:
        assert getattr(package, name).__name__ == name
    assert set(package.__all__) <= set(dir(package))
    with pytest.raises(AttributeError, match="Penumbra"):
        package.Penumbra  # noqa: B018


def test_a_module_does_not_hide_the_function_of_its_name():
    program = (
        "import eclipsejax.render, eclipsejax as ej; from eclipsejax.render import renderer_at;"
        "from eclipsejax import render; assert ej.render is render and callable(render)"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_gallery_says_what_it_draws(capsys, tmp_path, monkeypatch):
    def stand_in(directory, *, size, progress):
        progress(f"drawing at {size}")
        return directory / "index.html"

    package, module = types.ModuleType("eclipsejax.figures"), types.ModuleType("eclipsejax.figures.gallery")
    monkeypatch.setattr(module, "write_gallery", stand_in, raising=False)
    monkeypatch.setitem(sys.modules, "eclipsejax.figures", package)
    monkeypatch.setitem(sys.modules, "eclipsejax.figures.gallery", module)
    assert cli.main(["gallery", "-o", str(tmp_path / "new"), "--size", "100"]) == 0
    said = capsys.readouterr()
    assert said.err == "drawing at 100\n" and said.out == f"Wrote {tmp_path / 'new' / 'index.html'}.\n"
    (tmp_path / "file").touch()
    check_refused(capsys, ["gallery", "-o", str(tmp_path / "file")], "is a file")
