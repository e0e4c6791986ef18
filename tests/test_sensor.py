"""Camera RAW, by a DNG with known sensor values, and FITS."""

import sys

import numpy as np
import pytest
from astropy.io import fits

from eclipsejax.errors import InputError
from inverse.photo import read_photo
from tests import dng

BLACK, WHITE = (100, 110, 120, 130), 4095  # of the 2 x 2 cell in reading order


def bayer(colours: np.ndarray, letters: str = "RGGB", black=BLACK) -> np.ndarray:
    """Sensor values of linear light (row, column, 3) seen through a mosaic of twice its size."""
    rows, columns, _ = colours.shape
    sensor = np.empty((2 * rows, 2 * columns))
    for k, letter in enumerate(letters):
        light = colours[..., "RGB".index(letter)]
        sensor[k // 2 :: 2, k % 2 :: 2] = black[k] + light * (WHITE - black[k])
    return np.round(sensor).astype(np.uint16)


def off(found, expected) -> float:
    """Largest difference of two arrays; pytest.approx takes seconds for a picture."""
    return float(np.abs(np.asarray(found, float) - expected).max())


@pytest.fixture
def colours():
    """Linear light (80, 100, 3), never above 0.9, different in every pixel and channel."""
    return np.random.default_rng(0).uniform(0.05, 0.9, (80, 100, 3))


@pytest.mark.parametrize(("pattern", "letters"), [(dng.RGGB, "RGGB"), (dng.GRBG, "GRBG"), (dng.BGGR, "BGGR")])
def test_sensor_values_come_back_as_light(tmp_path, colours, pattern, letters):
    path = tmp_path / "moon.dng"
    dng.write_dng(path, bayer(colours, letters), black=BLACK, white=WHITE, pattern=pattern)
    photo = read_photo(path)
    assert (photo.format, photo.tone_curve, photo.camera) == ("RAW", "linear", "Synthetic One")
    # Half a code of rounding; no white balance, though the file asks for (2, 1, 5/3).
    assert off(photo.pixels, colours) < 0.6 / 3965
    assert photo.pixels.dtype == photo.variance.dtype == np.float32
    assert photo.usable.all() and not photo.saturated.any()


def test_the_two_greens_are_averaged(tmp_path, colours):
    sensor = bayer(colours, black=(0, 0, 0, 0))
    sensor[0::2, 1::2], sensor[1::2, 0::2] = 1000, 1400
    dng.write_dng(tmp_path / "moon.dng", sensor)
    photo = read_photo(tmp_path / "moon.dng")
    assert off(photo.pixels[..., 1], 1200 / 4095) < 1e-6
    red_like_green = np.abs(photo.pixels[..., 0] - 1200 / 4095) < 0.01
    assert np.median(photo.variance[..., 0][red_like_green]) == pytest.approx(
        2 * np.median(photo.variance[..., 1]), rel=0.05
    )


def test_below_black_is_kept_and_dead_samples_are_not(tmp_path, colours):
    """Noise around black must average to nothing; a sample of 0 where black is 100 is no noise."""
    sensor = bayer(colours)
    sensor[20:40, 20:40] = np.random.default_rng(1).integers(80, 141, (20, 20))
    sensor[50, 60] = 0  # a red sample
    dng.write_dng(tmp_path / "moon.dng", sensor, black=BLACK)
    photo = read_photo(tmp_path / "moon.dng")
    dark = photo.pixels[10:20, 10:20]
    assert dark.min() < 0 and abs(dark.mean() + 4.5 / 3980) < 0.002 and photo.usable[10:20, 10:20].all()
    assert photo.usable[25, 30].tolist() == [False, True, True]


def test_saturation_begins_at_95_per_cent_of_white(tmp_path, colours):
    light = colours.copy()
    light[10, 10] = (0.94, 0.96, 0.94)
    light[11, 10] = (0.96, 0.94, 1.0)
    sensor = bayer(light)
    sensor[41, 60] = WHITE  # one of the two greens of pixel (20, 30)
    dng.write_dng(tmp_path / "moon.dng", sensor, black=BLACK)
    photo = read_photo(tmp_path / "moon.dng")
    assert photo.saturated[10, 10].tolist() == [False, True, False]
    assert photo.saturated[11, 10].tolist() == [True, False, True]
    assert photo.saturated[20, 30].tolist() == [False, True, False]
    assert photo.saturated.sum() == 4 and (photo.usable == ~photo.saturated).all()


@pytest.mark.parametrize("tag", range(1, 9))
def test_the_orientation_of_raw_is_applied(tmp_path, colours, tag):
    dng.write_dng(tmp_path / "moon.dng", bayer(colours), black=BLACK, orientation=tag)
    upright = {  # EXIF 2.32, figure in 4.6.4: where row 0 and column 0 belong
        1: colours,
        2: colours[:, ::-1],
        3: np.rot90(colours, 2),
        4: colours[::-1],
        5: colours.swapaxes(0, 1),
        6: np.rot90(colours, -1),
        7: np.rot90(colours, 2).swapaxes(0, 1),
        8: np.rot90(colours, 1),
    }
    assert off(read_photo(tmp_path / "moon.dng").pixels, upright[tag]) < 1e-3


def test_the_exif_of_raw_is_read(tmp_path, colours):
    exif = {
        0x829A: (1, 4),
        0x829D: (0, 1),
        0x9003: "2022:05:16 01:06:00",
        0x9011: "-03:00",
        0x920A: (1390, 1),
    }
    dng.write_dng(tmp_path / "moon.dng", bayer(colours), black=BLACK, exif=exif)
    photo = read_photo(tmp_path / "moon.dng")
    assert (photo.time, photo.local_time) == ("2022-05-16T04:06:00Z", "2022-05-16T01:06:00")
    assert (photo.exposure_s, photo.f_number, photo.focal_length_mm, photo.iso) == (0.25, None, 1390, None)


def test_a_dng_is_known_by_its_tag_whatever_its_name(tmp_path, colours):
    dng.write_dng(tmp_path / "moon.tif", bayer(colours), black=BLACK)
    assert read_photo(tmp_path / "moon.tif").format == "RAW"


def test_a_demosaiced_dng_keeps_its_size(tmp_path, colours):
    sensor = np.round(100 + colours * 3995).astype(np.uint16)
    dng.write_dng(tmp_path / "moon.dng", sensor, black=(100, 100, 100, 100))
    photo = read_photo(tmp_path / "moon.dng")
    assert off(photo.pixels, colours) < 2e-4 and photo.tone_curve == "linear"


def refusal(path) -> str:
    with pytest.raises(InputError) as caught:
        read_photo(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)
    return str(caught.value)


def test_raw_that_cannot_be_used_is_refused(tmp_path, colours, monkeypatch):
    path = tmp_path / "moon.dng"
    dng.write_dng(path, bayer(colours), black=BLACK)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert "damaged" in refusal(path)
    dng.write_dng(path, bayer(colours[:30, :30]), black=BLACK)
    assert "64 x 64" in refusal(path)
    dng.write_dng(path, np.full((160, 160), 100, np.uint16), black=(100, 100, 100, 100))
    assert "black image" in refusal(path)
    monkeypatch.setitem(sys.modules, "rawpy", None)
    assert "eclipsejax[raw]" in refusal(path)


# FITS


def write_fits(path, data, **header):
    unit = fits.PrimaryHDU(data)
    unit.header.update({name.replace("_", "-"): value for name, value in header.items()})
    unit.writeto(path, overwrite=True)
    return path


def test_grey_and_colour_fits(tmp_path, colours):
    cube = np.moveaxis(colours, -1, 0).astype(np.float32)
    photo = read_photo(write_fits(tmp_path / "moon.fits", cube, ROWORDER="TOP-DOWN"))
    assert off(photo.pixels, colours) < 1e-6 and photo.format == "FITS"
    photo = read_photo(write_fits(tmp_path / "moon.fits", cube[1], DATE_OBS="2022-05-16T04:06:00", EXPTIME=0.5))
    assert off(photo.pixels, np.repeat(colours[::-1, :, 1:2], 3, axis=2)) < 1e-6
    assert (photo.time, photo.exposure_s, photo.tone_curve) == ("2022-05-16T04:06:00Z", 0.5, "linear")


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.int32, ">f8"])
def test_the_numbers_of_fits_are_scaled_to_one(tmp_path, colours, dtype):
    kind = np.dtype(dtype)
    full = np.iinfo(kind).max if kind.kind in "iu" and kind.itemsize < 4 else 50_000
    data = (colours[..., 0] * full).astype(kind)
    expected = data / (full if kind.itemsize < 4 else data.max())
    photo = read_photo(write_fits(tmp_path / "moon.fits", data, ROWORDER="TOP-DOWN"))
    assert off(photo.pixels[..., 0], expected) < 1e-5


def test_saturate_of_a_12_bit_camera_is_full_scale(tmp_path, colours):
    data = np.minimum(colours[..., 0] * 5000, 4095).astype(np.uint16)
    photo = read_photo(write_fits(tmp_path / "moon.fits", data, SATURATE=4095, ROWORDER="TOP-DOWN"))
    assert off(photo.pixels[..., 0], data / 4095) < 1e-5
    assert (photo.saturated[..., 0] == (data >= 0.98 * 4095)).all()


def test_compressed_and_later_units_are_found(tmp_path, colours):
    data = (colours[..., 0] * 60000).astype(np.uint16)
    units = fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(data)])
    units.writeto(tmp_path / "moon.fits")
    assert off(read_photo(tmp_path / "moon.fits").pixels[::-1, :, 0], data / 65535) < 1e-5
    write_fits(tmp_path / "moon.fits.gz", data)
    assert read_photo(tmp_path / "moon.fits.gz").pixels.shape == (80, 100, 3)


def test_holes_in_fits_are_not_usable(tmp_path, colours):
    data = colours[..., 0].astype(np.float32)
    data[7, 9] = np.nan
    photo = read_photo(write_fits(tmp_path / "moon.fits", data, ROWORDER="TOP-DOWN"))
    assert not photo.usable[7, 9].any() and photo.usable.sum() == photo.usable.size - 3
    assert np.isfinite(photo.pixels).all() and np.isfinite(photo.variance).all()


def test_fits_that_cannot_be_used_is_refused(tmp_path, colours, monkeypatch):
    path, data = tmp_path / "moon.fits", colours[..., 0].astype(np.float32)
    assert "finite" in refusal(write_fits(path, np.full((80, 80), np.nan)))
    assert "black image" in refusal(write_fits(path, np.zeros((80, 80))))
    assert "64 x 64" in refusal(write_fits(path, data[:10]))
    assert "shape (5, 80, 100)" in refusal(write_fits(path, np.repeat(data[None], 5, axis=0)))
    assert "BAYERPAT" in refusal(write_fits(path, data, BAYERPAT="RGGB"))
    fits.HDUList([fits.PrimaryHDU()]).writeto(path, overwrite=True)
    assert "no image" in refusal(path)
    whole = write_fits(path, data).read_bytes()
    path.write_bytes(whole[:6000])
    assert "damaged" in refusal(path)
    for axis, side in ((1, 100), (2, 80)):
        card = f"NAXIS{axis}  = {side:20d}".encode()
        assert whole.count(card) == 1
        whole = whole.replace(card, f"NAXIS{axis}  = {20000:20d}".encode())
    path.write_bytes(whole)
    assert "400 megapixels" in refusal(path)
    monkeypatch.setitem(sys.modules, "astropy.io", None)
    assert "eclipsejax[fits]" in refusal(path)
