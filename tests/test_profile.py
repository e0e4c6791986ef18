"""Profiles: what is written comes back, what is binned is the mean, what is broken is refused in one sentence."""

from dataclasses import replace

import numpy as np
import pytest

from eclipsejax.errors import InputError
from inverse.profile import ARCMIN, Profile, profile_of, read_profile, write_profile
from inverse.result import PhotoFit

GOOD = """# utc: 2022-05-16T04:06:00Z
# tone: srgb
# source: a photograph: by somebody
offset_arcmin,surface,red,green,blue,red_sd,green_sd,blue_sd,cells
10,1.0,0.10,0.05,0.020,0.001,0.001,0.001,40
12,0.9,0.11,0.05,0.021,0.001,0.001,0.001,42
14,1.1,0.15,0.07,0.030,0.001,0.001,0.001,45
16,1.0,0.17,0.08,0.035,0.001,0.001,0.001,45
18,1.0,0.20,0.10,0.044,0.001,0.001,0.001,41
20,1.0,0.25,0.13,,0.001,0.001,,39
"""


def photograph(number: int = 3000, seed: int = 0, noise: float = 0.03) -> PhotoFit:
    """Cells of brightness albedo x exp(offset / 10 arcmin), the channels 4 : 2 : 1, with relative noise."""
    random = np.random.default_rng(seed)
    offset = random.uniform(10, 40, number) * ARCMIN
    albedo = random.uniform(0.6, 1.4, number)
    clean = 0.01 * np.array([4.0, 2.0, 1.0]) * (albedo * np.exp(offset / (10 * ARCMIN)))[:, None]
    observed = clean * (1 + noise * random.standard_normal(clean.shape))
    return PhotoFit(
        name="moon.jpg", utc="2022-05-16T04:06:00Z", registration=None, offset=offset,
        on_disc=np.ones(number, dtype=bool), usable=np.ones((number, 3), dtype=bool),
        observed=observed, predicted=clean, noise=1e-3 * clean, albedo=albedo,
        drawn=np.stack([0.98 * clean, 1.02 * clean]),
    )  # fmt: skip


def test_reads_what_the_file_says(tmp_path):
    path = tmp_path / "profile.csv"
    path.write_text(GOOD)
    profile = read_profile(path)
    assert (profile.utc, profile.time, profile.tone_curve) == (*["2022-05-16T04:06:00Z"] * 2, "srgb")
    assert profile.source == "a photograph: by somebody" and profile.licence == ""
    np.testing.assert_allclose(profile.offset * 180 * 60 / np.pi, [10, 12, 14, 16, 18, 20])
    np.testing.assert_allclose(profile.value[2], [0.15, 0.07, 0.03])
    assert np.isnan(profile.value[5, 2]) and np.isnan(profile.sigma[5, 2]) and np.isfinite(profile.value[5, :2]).all()
    assert profile.cells.tolist() == [40, 42, 45, 45, 41, 39] and len(profile.sha256) == 64


def test_columns_in_any_order_spreadsheet_marks_and_missing_tone_are_fine(tmp_path):
    lines = GOOD.splitlines()
    table = [line.split(",") for line in lines[3:]]
    turned = [",".join([*reversed(row[:8]), "remark"]) for row in table]
    path = tmp_path / "p.csv"
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join([lines[0] + ",,,", "", *turned]).encode())
    profile = read_profile(path)
    assert profile.utc == "2022-05-16T04:06:00Z" and profile.tone_curve == "srgb" and profile.cells.tolist() == [0] * 6
    np.testing.assert_allclose(profile.value[0], [0.10, 0.05, 0.02])


def test_round_trip(tmp_path):
    """Through a file and back to nine digits, with a channel that was clipped."""
    clipped = photograph()
    clipped.usable[clipped.offset < 13 * ARCMIN, 2] = False
    profile = profile_of(clipped, "linear", "made up,\nwith a comma", "CC BY 4.0")
    write_profile(profile, tmp_path / "p.csv")
    again = read_profile(tmp_path / "p.csv")
    assert np.isnan(again.value[:3, 2]).all() and np.isfinite(again.value[3:]).all()
    for name in ("offset", "surface", "value", "sigma", "cells"):
        np.testing.assert_allclose(getattr(again, name), getattr(profile, name), rtol=1e-8)
    assert (again.utc, again.tone_curve) == (profile.utc, "linear")
    assert (again.source, again.licence) == ("made up, with a comma", "CC BY 4.0")
    write_profile(again, tmp_path / "q.csv")
    assert (tmp_path / "q.csv").read_bytes() == (tmp_path / "p.csv").read_bytes()


def test_bins_are_means_of_light_and_follow_the_law_behind_the_cells():
    """The mean over a bin against the integral; its deviation against the scatter of 40 photographs."""
    profiles = [profile_of(photograph(seed=seed), "srgb", "") for seed in range(40)]
    assert all(len(profile.offset) == 30 for profile in profiles)
    edge = np.arange(10, 41) / 10
    mean_light = 10 * np.diff(np.exp(edge))  # over a bin of 0.1 in x
    expected = 0.01 * mean_light[:, None] * np.array([4.0, 2.0, 1.0])
    found = np.stack([profile.value / profile.surface[:, None] for profile in profiles])
    stated = np.stack([profile.sigma for profile in profiles])
    np.testing.assert_allclose(found.mean(axis=0), expected, rtol=0.006)
    # value / surface keeps what noise and the trend across a bin leave: 4 % / sqrt(100 cells), by the stated deviation.
    assert 0.8 < np.median(found.std(axis=0) / stated.mean(axis=0)) < 1.25
    assert 0.003 < np.median(stated / found) < 0.005


def test_bins_that_clipping_left_few_cells_are_not_used():
    """Where only the brightest cells are above the black, their mean says nothing about the rest."""
    dark = photograph(noise=0.3)
    dark.usable[:, 2] = dark.observed[:, 2] > 0.06
    profile = profile_of(dark, "srgb", "")
    left = np.isfinite(profile.value[:, 2])
    assert 0 < left.sum() < 30 and np.isfinite(profile.value[:, 0]).all()
    truth = 0.01 * np.exp(profile.offset / (10 * ARCMIN)) * profile.surface
    assert np.abs(profile.value[left, 2] / truth[left] - 1).max() < 0.25  # 0.49 where all that is left is kept


def test_cells_off_the_disc_and_thin_bins_are_left_out():
    fit = photograph()
    thin = (fit.offset >= 20 * ARCMIN) & (fit.offset < 21 * ARCMIN)
    fit.on_disc[np.flatnonzero(thin)[4:]] = False
    fit.observed[~fit.on_disc] = 1e9
    profile = profile_of(fit, "srgb", "")
    assert len(profile.offset) == 29 and profile.value.max() < 10
    with pytest.raises(InputError, match="too few usable cells"):
        profile_of(replace(fit, usable=np.zeros_like(fit.usable)), "srgb", "")


def broken(old: str, new: str) -> bytes:
    assert old in GOOD
    return GOOD.replace(old, new).encode()


@pytest.mark.parametrize(
    "content, message",
    [
        (broken("# utc: 2022-05-16T04:06:00Z\n", ""), "does not say when"),
        (broken("2022-05-16T04:06:00Z", "yesterday"), "'yesterday' cannot be read"),
        (broken("T04:06:00Z", "T04:06:00"), "no time zone"),
        (broken("tone: srgb", "tone: gamma 2.2"), "tone 'gamma 2.2'"),
        (broken("green,blue", "green,azure"), "no column blue"),
        (broken(",", ";"), "no column offset_arcmin"),
        (broken("0.07", "bright"), "line 7: green is 'bright'"),
        (broken("0.07", "nan"), "line 7: green is 'nan'"),
        (broken("0.07", "inf"), "line 7: green is 'inf'"),
        (broken("14,1.1", "14,"), "line 7: surface is ''"),
        (broken("14,1.1", "-14,1.1"), "line 7: offset_arcmin is -14"),
        (broken("14,1.1", "14,0"), "line 7: surface is 0"),
        (broken("0.15,0.07", "0.15,"), "line 7: green and green_sd"),
        (broken("0.030,0.001", "0.030,0"), "line 7: red_sd is 0"),
        (broken("14,1.1,", "14,1.1"), "line 7, has 8 fields where its header has 9"),
        ("\n".join(GOOD.splitlines()[:8]).encode(), "holds 4 rows with any colour"),
        ("\n".join(GOOD.splitlines()[:3]).encode(), "holds no table"),
        (b"", "does not say when"),
        (b"\xff\xd8\xff\xe0\x00\x10JFIF\x00" + bytes(range(256)), "is not a text file"),
        (bytes(1000), "is not a text file"),
    ],
)
def test_bad_files_get_one_sentence(tmp_path, content, message):
    path = tmp_path / "p.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_profile(path)
    assert "p.csv" in str(caught.value) and "\n" not in str(caught.value)


def test_missing_files_folders_and_unwritable_places(tmp_path):
    one, three = np.ones(5), np.ones((5, 3))
    profile = Profile(one, one, three, three, one, "2022-05-16T04:06:00Z", "srgb")
    with pytest.raises(InputError, match="does not exist"):
        read_profile(tmp_path / "none.csv")
    with pytest.raises(InputError, match="is a folder"):
        read_profile(tmp_path)
    with pytest.raises(InputError, match="cannot be written"):
        write_profile(profile, tmp_path / "none" / "p.csv")
    with pytest.raises(InputError, match="cannot be read"):
        read_profile("\0.csv")
