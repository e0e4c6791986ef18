"""What a fit says and saves: numbers that come back as they were, and one sentence where they cannot be written."""

import errno
import json
import os
from dataclasses import replace

import numpy as np
import pytest

from eclipsejax.errors import InputError
from inverse.result import Fit
from tests.test_report import fake_fit, photograph

# ArviZ announces its next major version once a day.
pytestmark = pytest.mark.filterwarnings(r"ignore:\s*ArviZ is undergoing:FutureWarning")


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fake_fit()


def strict(name):
    raise AssertionError(f"{name} is no JSON")


def test_json_holds_every_estimate_and_where_the_disc_was(fit):
    stored = json.loads(json.dumps(fit.to_dict(), default=lambda x: x.tolist()), parse_constant=strict)
    assert set(stored["parameters"]) == set(fit.estimates) and "1.gain" in stored["parameters"]
    for name, estimate in fit.estimates.items():
        parameter = stored["parameters"][name]
        assert "name" not in parameter and parameter["unit"] == estimate.unit
        for key in ("map", "sd", "median", "informed", "ess", "autocorrelation_time"):
            assert parameter[key] == getattr(estimate, key)
        assert tuple(parameter["ci95"]) == estimate.ci95 and tuple(parameter["prior_ci95"]) == estimate.prior_ci95
    [place] = stored["registration"]
    assert place["photo"] == "IMG_8742.jpg" and place["radius"] == 240 and place["mirror"] is False
    assert stored["warnings"] == list(fit.warnings)
    assert stored["diagnostics"] == {"converged": True, "costs_of_starts": [3.0, 2.0], "method": "emcee"}
    profile = replace(photograph(), registration=None)
    assert replace(fit, photos=(profile,)).to_dict()["registration"] == [None]


def test_saved_files_come_back_as_they_were(fit, tmp_path, monkeypatch):
    import arviz

    folder = tmp_path / "new" / "out"
    # A second run may write over the report of the first.
    with monkeypatch.context() as patch:
        patch.setattr("inverse.report.write_pictures", lambda fit, folder: [])
        assert len(fake_fit(sampled=False).save(folder)) == 3
    paths = fit.save(folder)
    names = ["fit.json", "posterior.nc", "fit.png", "profile.png", "corner.png", "report.html"]
    assert [path.name for path in paths] == names and all(path.stat().st_size > 1000 for path in paths)
    stored = json.loads(paths[0].read_text(), parse_constant=strict)
    assert stored["parameters"]["dust.extinction"]["median"] == fit.estimates["dust.extinction"].median
    back = arviz.from_netcdf(paths[1])
    assert set(back.groups()) == {"posterior", "prior", "sample_stats"}
    assert set(back["posterior"].data_vars) == set(fit.draws)
    for name, values in fit.draws.items():
        assert back["posterior"][name].dims == ("chain", "draw")
        np.testing.assert_array_equal(back["posterior"][name].to_numpy(), values)
        np.testing.assert_array_equal(back["prior"][name].to_numpy()[0], fit.prior_draws[name])
    assert fit.log_posterior is not None
    np.testing.assert_array_equal(back["sample_stats"]["lp"].to_numpy(), fit.log_posterior)
    assert back.attrs["seed"] == "0"


def test_laplace_alone_has_no_log_posterior_and_no_effective_samples():
    fit = fake_fit(sampled=False)
    assert "sample_stats" not in fit.posterior.groups()
    row = next(line for line in fit.summary().splitlines() if line.startswith("clouds.top"))
    assert row.rstrip().endswith("%")


def test_summary_has_a_row_for_each_quantity_of_the_limb(fit):
    head, *rows = fit.summary().splitlines()
    assert [row.split()[0] for row in rows] == list(fit.draws)
    assert len({len(row) for row in rows}) == 1 and len(head) == len(rows[0])
    dust = fit.estimates["dust.extinction"]
    fields = rows[0].split()
    assert fields[1] == "1/m" and float(fields[2]) == pytest.approx(dust.map, rel=1e-3)
    assert float(fields[5]) == pytest.approx(dust.ci68[0], rel=5e-3) and fields[-2:] == ["310", "42"]


def test_sentence_gives_alpha_and_the_optical_depth_that_it_means(fit):
    alpha, depth = fit.estimates["dust.extinction"], fit.estimates["stratospheric_optical_depth"]
    told = replace(
        fit,
        estimates={
            "dust.extinction": replace(alpha, median=4.7e-6, ci95=(3.1e-6, 6.2e-6)),
            "stratospheric_optical_depth": replace(depth, median=0.047, ci95=(0.031, 0.062)),
        },
    )
    assert told.sentence() == (
        "Stratospheric dust alpha = 4.7e-06 /m (95 %: 3.1e-06 to 6.2e-06), "
        "a vertical optical depth of 0.047 (95 %: 0.031 to 0.062)."
    )


def test_residual_counts_usable_cells_of_the_disc_only():
    photo = photograph()
    photo.noise[:] = 1e-3 * photo.predicted
    photo.observed[:] = photo.predicted * np.exp(0.25)
    photo.usable[:] = True
    assert photo.residual_rms == pytest.approx(0.25, rel=1e-12)
    photo.observed[:5], photo.usable[:5] = 1e6, False
    photo.observed[5:9], photo.on_disc[5:9] = 1e6, False
    photo.observed[9:12, 0] = 0.0  # has no logarithm
    assert photo.residual_rms == pytest.approx(0.25, rel=1e-12)


def test_residual_is_of_bright_cells_where_there_are_any():
    photo = photograph()
    photo.usable[:], photo.noise[:] = True, 0.02 * photo.predicted
    photo.observed[:] = photo.predicted * np.exp(0.25)
    photo.observed[:5] = photo.predicted[:5] * np.exp(-3.0)
    photo.noise[:5] = photo.predicted[:5]
    assert photo.residual_rms == pytest.approx(0.25, rel=1e-12)
    photo.noise[:] = photo.predicted
    assert photo.residual_rms > 0.25  # none: all are counted
    photo.observed[5:8, 0] = 0.0  # has no logarithm
    assert np.isfinite(photo.residual_rms)


def test_a_report_that_cannot_be_written_leaves_the_one_before(fit, tmp_path, monkeypatch):
    fit.save(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(number):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left on device"):
        replace(fit, warnings=("another",)).save(tmp_path)
    assert before == {path.name: path.read_bytes() for path in tmp_path.iterdir()}


def test_a_place_that_cannot_be_written_gets_one_sentence(fit, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("a file, no folder")
    blocked = tmp_path / "blocked"
    (blocked / "posterior.nc").mkdir(parents=True)
    for folder in (taken, taken / "below", blocked):
        with pytest.raises(InputError, match="The report cannot be written to") as caught:
            fit.save(folder)
        assert "\n" not in str(caught.value) and "give --out" in str(caught.value)
