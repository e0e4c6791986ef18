"""The whole path: a photograph on disk in, the atmosphere that was put into it out."""

import json
from typing import Any

import h5py
import numpy as np
import pytest
from PIL import Image

from eclipsejax.errors import InputError
from inverse import cli
from inverse.catalogue import data_file
from inverse.chain import read_record
from inverse.evidence import gather
from inverse.fit import fit_atmosphere
from inverse.likelihood import LIMB
from inverse.optimum import best
from tests import synthetic
from tests.targets import draws_of

DRAWS = draws_of(20, LIMB)
FURTHER = {"utc": "2022-05-16T05:11:00Z", "stops": -3.0, "remains": {"dust.extinction": 0.4}, "bits": 3.0}
ADVICE = {"camera_of": "eclipse.jpg", "best_for_dust": [FURTHER], "most_bits": FURTHER}


@pytest.fixture(scope="module")
def descended():
    """What `best` found for the photograph: a minute's work, of which a second fit of it needs nothing new."""
    return []


@pytest.fixture(scope="module")
def fitted(tmp_path_factory, descended):
    """A dusty eclipse, noisy, JPEG-compressed, rolled by 137 degrees, off centre."""
    folder = tmp_path_factory.mktemp("fit")
    path = synthetic.photograph(folder / "eclipse.jpg", synthetic.limb())
    given: dict[str, Any] = {
        "time": synthetic.UTC, "site": synthetic.SITE, "seed": 3, "chain": folder / "chain.h5", "further": False,
    }  # fmt: skip

    def stop(progress):
        if progress.stage == "sampling" and progress.done >= 10:
            raise KeyboardInterrupt

    # Interrupted while it samples, then taken up again.
    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("inverse.fit.best", lambda *asked: descended.append(best(*asked)) or descended[0])
        fit_atmosphere(path, draws=DRAWS, progress=stop, **given)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("inverse.fit.advice", lambda *_: ADVICE)  # `test_further` has the real one
        fit = fit_atmosphere(path, resume=True, **{**given, "further": True})
    return fit, fit.save(folder / "out"), path, given


def test_a_fit_that_was_interrupted_ends_as_if_it_had_not_been(fitted, descended, monkeypatch):
    fit, _, path, given = fitted
    resumed = read_chain(given["chain"])
    assert resumed.steps == 20  # as many as the first command said
    again = given["chain"].with_name("again.h5")
    monkeypatch.setattr("inverse.fit.best", lambda *_: descended[0])
    whole = fit_atmosphere(path, draws=DRAWS, **{**given, "chain": again})
    assert np.array_equal(read_chain(again).z, resumed.z)
    assert {name: one.median for name, one in whole.estimates.items()} == {
        name: one.median for name, one in fit.estimates.items()
    }
    assert whole.diagnostics["sampler"]["steps"] == 20
    assert "a vertical" in whole.sentence() and any("--draws" in words for words in whole.warnings)


def read_chain(path):
    with h5py.File(path) as file:
        return read_record(path, json.loads(str(file.attrs["identity"]))).chain


def test_a_chain_of_another_seed_or_time_is_refused_before_the_fit(fitted):
    _, _, path, given = fitted
    stages = []
    for name, value in (("seed", 4), ("time", "2022-05-16T04:07:00Z")):
        with pytest.raises(InputError, match=f"another fit, which differs in {name}:"):
            fit_atmosphere(path, resume=True, progress=lambda p: stages.append(p.done), **{**given, name: value})
    assert max(stages) == 1  # a photograph registered, no start fitted


def test_dust_is_recovered(fitted):
    dust = fitted[0].estimates["dust.extinction"]
    assert dust.ci95[0] < synthetic.ALPHA < dust.ci95[1]
    assert dust.map == pytest.approx(synthetic.ALPHA, rel=0.25)
    assert fitted[0].diagnostics["converged"]


def test_alpha_comes_with_the_optical_depth_that_it_means(fitted):
    fit = fitted[0]
    alpha, depth = fit.estimates["dust.extinction"], fit.estimates["stratospheric_optical_depth"]
    assert depth.median == pytest.approx(alpha.median * 10e3, rel=1e-6)
    assert "optical depth" in fit.sentence()


def test_registration_is_right(fitted):
    registration = fitted[0].photos[0].registration
    assert registration.row == pytest.approx(synthetic.CENTRE[0], abs=0.3)
    assert registration.column == pytest.approx(synthetic.CENTRE[1], abs=0.3)
    assert registration.radius == pytest.approx(synthetic.RADIUS, abs=0.3)
    assert np.degrees(registration.roll) == pytest.approx(synthetic.ROLL, abs=1.0)
    assert not registration.mirror


def test_pressure_is_said_to_be_the_priors(fitted):
    assert fitted[0].estimates["air.surface_pressure"].informed < 0.5
    assert any("air.surface_pressure" in warning for warning in fitted[0].warnings)


def test_report_holds_what_it_should(fitted):
    names = {path.name for path in fitted[1]}
    assert {"fit.json", "posterior.nc", "fit.png", "profile.png", "corner.png", "report.html"} <= names
    for path in fitted[1]:
        assert path.stat().st_size > 1000
    report = json.loads(fitted[1][0].read_text())
    dust = report["parameters"]["dust.extinction"]
    assert set(dust) >= {"unit", "map", "sd", "median", "ci68", "ci95", "ess", "autocorrelation_time"}
    assert {"registration", "diagnostics", "warnings", "provenance"} <= set(report)
    assert report["provenance"]["seed"] == 3


def test_a_photograph_made_by_the_model_is_explained_and_says_something(fitted):
    diagnostics = json.loads(fitted[1][0].read_text())["diagnostics"]
    [check] = diagnostics["misfit_checks"]
    assert check["p"] > 0.01 and check["all"]["effective_data"] > 1000
    assert not any("cannot explain" in words for words in fitted[0].warnings)
    known = diagnostics["information"]
    assert known["parameters"]["dust.extinction"]["informed"] > 0.5
    assert known["parameters"]["air.surface_pressure"]["prior_dominated"]
    assert 3 < known["degrees_of_freedom"]["limb"] < known["degrees_of_freedom"]["total"]
    assert diagnostics["independent_errors"]["dust.extinction"]["ratio"] > 1
    assert diagnostics["further_photographs"] == ADVICE


def test_each_photograph_may_have_a_site_of_its_own():
    profile, there = data_file(cli.DEMO_PROFILE), (42.7, -73.7, 80.0)

    def gathered(site, disc):
        return gather([profile] * 2, time=None, site=site, disc=disc, progress=lambda *_: None)

    assert [item.site for item in gathered([cli.DEMO_SITE, there], [None, 1])] == [cli.DEMO_SITE, there]
    assert [item.site for item in gathered(there, 1)] == [there, there]
    with pytest.raises(InputError, match="Sites: 3 for 2 photographs"):
        gathered([there] * 3, None)
    for wrong in ([42.7, -73.7], "42.7,-73.7", (42.7,), (there, there), (42.7, "-73.7"), 42.7):
        with pytest.raises(InputError, match="list with one for each") as refused:
            gathered(wrong, None)
        assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match="Discs: 1 for 2 photographs"):
        gathered(there, [1])


def landscape(path):
    row, column = np.mgrid[:300, :400]
    random = np.random.default_rng(0)
    sky = np.stack([120 - 0.2 * row, 160 - 0.2 * row, 220 - 0.1 * row], axis=-1)
    land = np.stack([80 + 20 * np.sin(column / 9), 110 + 20 * np.sin(column / 13), 50 + 0 * row], axis=-1)
    pixels = np.where((row > 160 + 20 * np.sin(column / 60))[..., None], land, sky) + random.normal(0, 4, (300, 400, 3))
    Image.fromarray(pixels.clip(0, 255).astype(np.uint8)).save(path)


def saved(path, pixels):
    Image.fromarray(pixels).save(path)


BAD = {
    "missing": (lambda path: None, "does not exist"),
    "text": (lambda path: path.write_text("not a picture"), ""),
    "one pixel": (lambda path: saved(path, np.full((1, 1, 3), 90, np.uint8)), "1 x 1"),
    "black": (lambda path: saved(path, np.zeros((200, 200, 3), np.uint8)), "black"),
    "landscape": (landscape, "disc"),
    "directory": (lambda path: path.mkdir(), "photo.jpg is a folder: give"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_photograph_gets_one_sentence(tmp_path, capsys, kind):
    make, expected = BAD[kind]
    path = tmp_path / "photo.jpg"
    make(path)
    arguments = [str(path), "--time", "2022-05-16T04:06:00Z", "--out", str(tmp_path / "out")]
    assert cli.main(arguments) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0 and said.startswith("fit_atmosphere: ") and expected in said


def test_a_truncated_jpeg_gets_one_sentence(tmp_path, capsys):
    path = tmp_path / "photo.jpg"
    landscape(path)
    path.write_bytes(path.read_bytes()[:3000])
    assert cli.main([str(path), "--time", "2022-05-16T04:06:00Z", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.strip().count("\n") == 0


@pytest.mark.parametrize(
    ("time", "site", "expected"),
    [
        (None, "0,0", "--time"),
        ("2022-06-16T04:06:00Z", "0,0", "2022-05-16"),  # names the nearest eclipse
        ("2022-05-16T04:06:00Z", "35,139", "below the horizon"),  # Tokyo, in the afternoon
        ("2022-05-16T04:06:00", "0,0", "zone"),
    ],
)
def test_time_and_place_that_cannot_be_are_refused(tmp_path, capsys, time, site, expected):
    path = tmp_path / "photo.png"
    saved(path, np.full((100, 100, 3), 90, np.uint8))
    arguments = [str(path), "--site", site, "--out", str(tmp_path / "out")] + (["--time", time] if time else [])
    assert cli.main(arguments) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0 and expected in said


@pytest.mark.parametrize("option", ["--draws", "--seed"])
def test_negative_numbers_are_refused_before_the_work(tmp_path, capsys, option):
    path = tmp_path / "photo.png"
    saved(path, np.full((100, 100, 3), 90, np.uint8))
    assert cli.main([str(path), "--time", "2022-05-16T04:06:00Z", "--out", str(tmp_path / "out"), option, "-5"]) == 2
    assert "-5" in capsys.readouterr().err


def test_nothing_to_fit_is_refused(capsys):
    assert cli.main([]) == 2
    assert "--demo" in capsys.readouterr().err
