"""The film of an eclipse: what is in it, how it is exposed, and how it is written."""

import os
import signal
from pathlib import Path

import equinox as eqx
import numpy as np
import pytest
from PIL import Image

from eclipsejax import cli
from eclipsejax.almanac import nearest_eclipse
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.camera import Camera
from eclipsejax.commands import movie as command
from eclipsejax.errors import InputError
from eclipsejax.movie import eclipse_on, instants, shutter_text, smooth_gains, whole_stops
from eclipsejax.movie_file import captioned, write_movie
from eclipsejax.render import render
from eclipsejax.response import LUMINANCE
from eclipsejax.scene import Scene
from eclipsejax.sequence import pictured, sequence
from tests.test_cli import check_refused

SMALL = ["--size", "48", "--tolerance", "1e-2"]


@pytest.mark.slow
def test_one_shadow_serves_all_instants():
    eclipse = nearest_eclipse("2010-12-21")
    camera = Camera(shape=(48, 48), scale=1.1e-2 / 48)
    site = (19.43, -99.13)  # Mexico; all of it is seen there, so the sky's part is in the comparison
    scenes = [Scene.at(utc, *site, camera=camera) for utc in instants(eclipse, 5)]
    pictures = sequence(scenes[0], [scene.geometry for scene in scenes], Atmosphere.typical(), tolerance=1e-2)
    one = eqx.filter_jit(render)
    errors = []
    for scene in scenes:
        exact = np.asarray(one(scene, Atmosphere.typical(), tolerance=1e-2)) @ LUMINANCE
        found = np.asarray(pictured(pictures, scene)) @ LUMINANCE
        lit = exact > 0.0
        assert np.all(found[~lit] == 0.0) and lit.mean() > 0.4
        errors.append(np.sqrt(np.mean((found[lit] / exact[lit] - 1.0) ** 2)))
    assert max(errors) < 5e-3


def test_frames_run_from_contact_to_contact():
    eclipse = nearest_eclipse("2010-12-21")
    times = instants(eclipse, 7)
    assert (times[0], times[-1]) == (eclipse.contacts["P1"], eclipse.contacts["P4"])
    assert times == sorted(times)
    umbral = instants(eclipse, 3, umbral=True)
    assert (umbral[0], umbral[-1]) == (eclipse.contacts["U1"], eclipse.contacts["U4"])
    assert abs(int(umbral[1][14:16]) - int(eclipse.greatest[14:16])) <= 1  # symmetric, all but a minute


def test_an_eclipse_is_found_by_its_local_date_too():
    for date in ("2010-12-20", "2010-12-21", "2010-12-22", "2010-12-21T08:00Z"):
        assert eclipse_on(date).greatest.startswith("2010-12-21T08:1")
    for date in ("2010-12-24", "2010-12-18", "2010-12-24T08:00Z"):
        with pytest.raises(InputError, match="2010-12-21T08:1"):
            eclipse_on(date)
    with pytest.raises(InputError, match="no umbral phase"):
        instants(eclipse_on("2020-11-30"), 5, umbral=True)


def test_smoothed_exposures_keep_a_steady_trend_and_soften_a_jump():
    steady = np.exp(0.3 * np.arange(60.0))
    np.testing.assert_allclose(smooth_gains(steady, 3.0)[13:-13], steady[13:-13])
    jump = np.where(np.arange(60) < 30, 1.0, 1e4)
    smooth = smooth_gains(jump, 3.0)
    assert np.all(np.diff(smooth) >= 0.0) and smooth[0] == 1.0 and smooth[-1] == pytest.approx(1e4)
    # The steepest of a Gaussian step: 1 / (sqrt(2 pi) width) of it.
    assert np.diff(np.log(smooth)).max() < 1.02 * np.log(1e4) / (np.sqrt(2 * np.pi) * 3.0)
    np.testing.assert_array_equal(smooth_gains(jump, 0.0), jump)


def test_a_photographer_changes_the_shutter_by_whole_stops_and_not_to_and_fro():
    wavering = 2.0 ** (0.5 + 0.15 * np.sin(np.arange(50.0)))
    assert len(set(whole_stops(wavering))) == 1
    stops = np.log2(whole_stops(2.0 ** np.linspace(-15.0, 8.0, 200)))
    assert np.all(stops == np.round(stops)) and (stops.min(), stops.max()) == (-13, 6)
    assert np.all(np.diff(stops) >= 0.0) and np.diff(stops).max() == 1.0


def test_shutter_speeds_are_written_as_on_a_camera():
    written = [shutter_text(x) for x in (2.0**-13, 1 / 64, 1 / 16, 0.25, 1.0, 16.0, 64.0, 1 / 333, 1.34, 0.0999)]
    assert written == "1/8000 1/60 1/15 1/4 1 15 60 1/330 1.3 1/10".replace(" ", " s,").split(",")[:-1] + ["1/10 s"]


def coloured(count, size=64):
    """Frames, each of one colour, that get brighter."""
    for number in range(count):
        yield np.full((size, size, 3), (100 + 20 * number, 60, 20), np.uint8)


def film(path: Path) -> np.ndarray:
    """The frames of a film, (frame, row, column, 3)."""
    if path.suffix == ".gif":
        with Image.open(path) as picture:
            frames = []
            for number in range(getattr(picture, "n_frames", 1)):
                picture.seek(number)
                frames.append(np.asarray(picture.convert("RGB")))
        return np.stack(frames)
    import subprocess

    from imageio_ffmpeg import get_ffmpeg_exe

    arguments = ["-loglevel", "error", "-i", str(path), "-vf", "scale=in_color_matrix=bt709"]
    done = subprocess.run(
        [get_ffmpeg_exe(), *arguments, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
    )
    values = np.frombuffer(done.stdout, np.uint8)
    side = 48 if values.size % (64 * 64 * 3) else 64
    return values.reshape(-1, side, side, 3)


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_films_hold_the_colours_of_their_frames(tmp_path, suffix):
    if suffix == ".mp4":
        pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / f"film{suffix}"
    assert write_movie(path, coloured(4), 24.0) == 4
    frames = film(path).astype(int)
    assert len(frames) == 4
    for found, frame in zip(frames, coloured(4), strict=True):
        assert np.abs(found - frame).max() <= 3


def test_writing_stays_in_the_corners():
    frame = np.zeros((512, 512, 3), np.uint8)
    written = np.max(captioned(frame, "2010-12-21 08:17:05 UT", "1/3200 s  f/5.6  ISO 1600"), axis=-1) > 0
    assert written[:32].any() and written[-32:].any() and not written[32:-32].any()
    rows, columns = np.nonzero(written)
    radius = np.hypot(rows - 255.5, columns - 255.5)
    assert radius.min() > 0.5 * 9.9e-3 / 1.1e-2 * 512  # the largest Moon


def test_a_film_of_totality(capsys, tmp_path):
    path = tmp_path / "film.gif"
    path.write_text("earlier")
    assert cli.main(["movie", "2010-12-21", "-o", str(path), "--frames", "5", *SMALL]) == 0
    said = capsys.readouterr()
    assert "5 frames of 48 x 48 pixels" in said.out and "Frame 5 of 5." in said.err
    frames = film(path).astype(float)
    assert frames.shape == (5, 48, 48, 3)
    disc = frames[:, 18:30, 18:30].mean(axis=(1, 2))
    full, middle = disc[0], disc[2]
    assert full[0] < 1.4 * full[2] and middle[0] > 1.5 * middle[1] > 1.5 * middle[2]
    assert [entry.name for entry in tmp_path.iterdir()] == ["film.gif"]


def test_frames_with_the_moon_below_the_horizon_are_left_out(capsys, tmp_path):
    times = instants(nearest_eclipse("2010-12-21"), 5)
    up, geometries = command._visible(times, (35.7, 139.7))  # moonrise in Tokyo is at 07:30
    assert up == times[2:] and len(geometries) == 3
    assert "The Moon is up in 3 of 5 frames" in capsys.readouterr().err
    noon = ["--site", "28.6,77.2"]  # Delhi
    check_refused(capsys, ["movie", "2010-12-21", "-o", str(tmp_path / "film.gif"), *noon], "below the horizon")


def test_control_c_keeps_the_frames_so_far_and_the_earlier_film(capsys, tmp_path, monkeypatch):
    def interrupted(times, geometries, options):
        def frames():
            for number, frame in enumerate(coloured(9)):
                if number == 3:
                    os.kill(os.getpid(), signal.SIGINT)
                yield frame

        return [0.5, 1.0], frames()

    monkeypatch.setattr(command, "_filmed", interrupted)
    path = tmp_path / "film.gif"
    path.write_text("earlier")
    before = signal.getsignal(signal.SIGINT)
    assert cli.main(["movie", "2010-12-21", "-o", str(path), "--frames", "9"]) == 130
    assert "film-partial.gif: 4 frames" in capsys.readouterr().out
    assert path.read_text() == "earlier" and len(film(tmp_path / "film-partial.gif")) == 4
    assert signal.getsignal(signal.SIGINT) is before and len(list(tmp_path.iterdir())) == 2


def test_what_cannot_be_filmed_is_refused_in_one_sentence(capsys, tmp_path):
    path = str(tmp_path / "film.gif")
    check_refused(capsys, ["movie", "2010-12-01", "-o", path], "no lunar eclipse", "2010-12-21")
    check_refused(capsys, ["movie", "2010-12-21", "-o", "film.avi"], "film.avi", "format")
    check_refused(capsys, ["movie", "2010-12-21", "-o", path, "--exposure", "long"], "auto or stops")
    check_refused(capsys, ["movie", "2020-11-30", "-o", path, "--umbral"], "no umbral phase")


def test_without_ffmpeg_an_mp4_is_refused_before_the_work(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    check_refused(capsys, ["movie", "2010-12-21", "-o", str(tmp_path / "film.mp4")], "eclipsejax[movie]", ".gif")
