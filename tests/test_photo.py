"""From a file to linear pixels: values, masks, variance, orientation, and one sentence for each bad input."""

import io
import os
import struct
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageOps

from eclipsejax.errors import InputError
from inverse.photo import Photo, read_photo


def encoded(light):
    """sRGB from linear light, the direction that inverse/tone.py does not have."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def ramp(top: float = 0.97) -> np.ndarray:
    """Linear light (96, 160, 3), every channel from 0 to `top` in a direction of its own."""
    row, column = np.mgrid[:96, :160]
    return top * np.stack([column / 159, row / 95, (column + row) / 254], axis=-1)


def png16(values: np.ndarray) -> bytes:
    """A PNG of 16 bits per channel (row, column, 1-4), which Pillow cannot write."""
    rows, columns, channels = values.shape
    kind = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    lines = values.astype(">u2").reshape(rows, -1).view(np.uint8)
    # Filter 2 (difference to the row above) on all rows, so that the decoder has something to undo.
    lines = np.diff(lines, axis=0, prepend=np.zeros((1, lines.shape[1]), np.uint8))
    body = np.hstack([np.full((rows, 1), 2, np.uint8), lines]).tobytes()
    return png(columns, rows, 16, kind, zlib.compress(body))


def png(columns: int, rows: int, bits: int, kind: int, body: bytes) -> bytes:
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", columns, rows, bits, kind, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + (chunk(b"PLTE", bytes(range(256)) * 3) if kind == 3 else b"")
        + chunk(b"IDAT", body)
        + chunk(b"IEND", b"")
    )


def lzw(data: bytes) -> bytes:
    """TIFF's LZW of bytes, without compressing: a clear code comes before the codes could grow to 10 bits."""
    codes = [code for i in range(0, len(data), 250) for code in (256, *data[i : i + 250])] + [257]
    bits = "".join(f"{code:09b}" for code in codes)
    bits += "0" * (-len(bits) % 8)
    return int(bits, 2).to_bytes(len(bits) // 8, "big")


def tiff_lzw(values: np.ndarray) -> bytes:
    """A TIFF of 16-bit colour in one LZW strip, which tifffile cannot read by itself."""
    buffer = io.BytesIO()
    tifffile.imwrite(buffer, values, photometric="rgb", metadata=None, compression="zlib", rowsperstrip=96)
    buffer.seek(0)
    with tifffile.TiffFile(buffer) as file:
        tags = file.pages.first.tags
        offsets = {name: tags[name].valueoffset for name in ("Compression", "StripByteCounts", "StripOffsets")}
    strip = lzw(values.astype("<u2").tobytes())
    data = bytearray(buffer.getvalue())
    struct.pack_into("<H", data, offsets["Compression"], 5)
    struct.pack_into("<I", data, offsets["StripOffsets"], len(data))
    struct.pack_into("<I", data, offsets["StripByteCounts"], len(strip))
    return bytes(data) + strip


@pytest.fixture
def write(tmp_path):
    """write(name, array or bytes, **options of the writer) -> path."""

    def writer(name: str, content, **options) -> Path:
        path = tmp_path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif path.suffix == ".tif":
            tifffile.imwrite(path, content, metadata=None, **options)
        else:
            Image.fromarray(content).save(path, **options)
        return path

    return writer


def off(found, expected) -> float:
    """Largest difference of two arrays; pytest.approx takes seconds for a picture."""
    return float(np.abs(np.asarray(found, float) - expected).max())


def check_photo(photo: Photo, shape) -> None:
    """What holds for every photograph."""
    assert photo.pixels.shape == photo.variance.shape == photo.usable.shape == photo.saturated.shape == shape
    assert photo.pixels.dtype == photo.variance.dtype == np.float32
    assert photo.usable.dtype == photo.saturated.dtype == bool
    assert np.isfinite(photo.pixels).all() and (photo.variance > 0).all() and np.isfinite(photo.variance).all()
    assert not (photo.usable & photo.saturated).any()


# Values


def test_a_linear_ramp_survives_8_bit_srgb_within_half_a_code(write):
    truth = ramp()
    codes = np.round(encoded(truth) * 255).astype(np.uint8)
    for name in ("ramp.png", "ramp.tif"):
        photo = read_photo(write(name, codes))
        check_photo(photo, truth.shape)
        assert np.abs(encoded(photo.pixels.astype(float)) - encoded(truth)).max() * 255 < 0.501
        assert photo.tone_curve == "srgb"


def test_a_jpeg_of_a_smooth_ramp_is_right_within_a_code(write):
    truth = ramp()
    path = write("ramp.jpg", np.round(encoded(truth) * 255).astype(np.uint8), quality=95, subsampling=0)
    error = encoded(read_photo(path).pixels.astype(float)) - encoded(truth)
    assert np.sqrt(np.mean(error**2)) * 255 < 1 and abs(error.mean()) * 255 < 0.1


@pytest.mark.parametrize("channels", [1, 3])
def test_16_bit_png_keeps_all_its_bits(write, channels):
    truth = ramp()[..., :channels]
    photo = read_photo(write("ramp.png", png16(np.round(encoded(truth) * 65535))))
    check_photo(photo, (96, 160, 3))
    assert np.abs(encoded(photo.pixels.astype(float)) - encoded(truth)).max() * 65535 < 0.6


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"byteorder": ">"},
        {"compression": "zlib", "predictor": 2},
        {"planarconfig": "separate"},
        {"tile": (32, 32)},
        {"bigtiff": True},
    ],
)
def test_16_bit_tiff_of_any_layout_keeps_all_its_bits(write, options):
    truth = ramp()
    values = np.round(encoded(truth) * 65535).astype(np.uint16)
    if options.get("planarconfig"):
        values = np.moveaxis(values, -1, 0)
    photo = read_photo(write("ramp.tif", values, photometric="rgb", **options))
    check_photo(photo, truth.shape)
    assert np.abs(encoded(photo.pixels.astype(float)) - encoded(truth)).max() * 65535 < 0.6


def test_16_bit_tiff_compressed_by_lzw_keeps_all_its_bits(write):
    truth = ramp()
    photo = read_photo(write("ramp.tif", tiff_lzw(np.round(encoded(truth) * 65535).astype(np.uint16))))
    assert np.abs(encoded(photo.pixels.astype(float)) - encoded(truth)).max() * 65535 < 0.6


@pytest.mark.parametrize("dtype", ["uint16", "uint32", "float16", "float32", "float64"])
def test_linear_tiff_comes_back_unchanged(write, dtype):
    truth = ramp()
    scale = np.iinfo(dtype).max if dtype.startswith("u") else 1
    values = (truth * scale).astype(dtype)
    # 16 bits are sRGB by rule, the rest is linear by itself.
    photo = read_photo(write("ramp.tif", values, photometric="rgb"), linear=True if dtype == "uint16" else None)
    check_photo(photo, truth.shape)
    assert photo.tone_curve == "linear"
    assert off(photo.pixels, truth) < (1e-3 if dtype == "float16" else 2e-5)


def test_floats_above_one_are_scaled_by_their_maximum(write):
    photo = read_photo(write("hdr.tif", (ramp() * 5000).astype(np.float32), photometric="rgb"))
    assert off(photo.pixels, ramp() / ramp().max()) < 1e-5


def test_a_16_bit_tiff_without_a_tag_is_taken_as_srgb_and_linear_raw_as_linear(write):
    values = np.full((80, 80, 3), 32768, np.uint16)
    for photometric, expected in (("rgb", 0.21404), ("linear_raw", 0.5)):
        photo = read_photo(write("grey.tif", values, photometric=photometric))
        assert off(photo.pixels, expected) < 1e-4


def test_a_png_of_gamma_one_is_linear(write):
    from PIL.PngImagePlugin import PngInfo

    for gamma, expected in ((100000, 128 / 255), (45455, 0.2158605)):
        information = PngInfo()
        information.add(b"gAMA", struct.pack(">I", gamma))
        path = write("gamma.png", np.full((80, 80, 3), 128, np.uint8), pnginfo=information)
        assert off(read_photo(path).pixels, expected) < 1e-5


def test_grey_pictures_of_every_kind_get_three_equal_channels(write):
    light = ramp()[..., 0]
    grey = np.round(encoded(light) * 255).astype(np.uint8)
    bits = light > 0.5
    paths = {
        write("grey.png", grey): light,
        write("grey.jpg", grey, quality=98): light,
        write("grey.tif", grey, photometric="minisblack"): light,
        write("white_is_zero.tif", 255 - grey, photometric="miniswhite"): light,
        write("opacity.png", np.stack([grey, np.full_like(grey, 255)], -1)): light,
        write("bits.png", bits): bits.astype(float),
    }
    for path, expected in paths.items():
        photo = read_photo(path)
        check_photo(photo, (96, 160, 3))
        assert (photo.pixels == photo.pixels[..., :1]).all()
        assert off(photo.pixels[..., 0], expected) < 0.02


def test_palette_pictures_are_read_through_their_palette(write):
    picture = Image.fromarray(np.round(encoded(ramp()) * 255).astype(np.uint8)).quantize(64)
    expected = np.asarray(picture.convert("RGB")) / 255
    for name in ("palette.png", "palette.tif"):
        buffer = io.BytesIO()
        picture.save(buffer, Path(name).suffix[1:].replace("tif", "tiff"))
        photo = read_photo(write(name, buffer.getvalue()))
        assert off(encoded(photo.pixels.astype(float)), expected) < 1e-4


@pytest.mark.parametrize("name", ["clear.png", "clear.tif", "deep.png"])
def test_transparent_pixels_are_black_and_not_usable(write, name):
    values = np.full((80, 90, 4), 200, np.uint8)
    values[:, :30, 3], values[:, 30:60, 3], values[:, 60:, 3] = 0, 51, 255
    if name == "deep.png":
        path = write(name, png16(values.astype(np.uint16) * 257))
    else:
        options = {"photometric": "rgb", "extrasamples": ["unassalpha"]} if name == "clear.tif" else {}
        path = write(name, values, **options)
    photo = read_photo(path)
    assert (photo.pixels[:, :30] == 0).all() and not photo.usable[:, :30].any()
    assert off(encoded(photo.pixels[:, 30:60].astype(float)) * 255, 40) < 0.5
    assert off(encoded(photo.pixels[:, 60:].astype(float)) * 255, 200) < 0.1


# Masks and variance


def test_masks_of_8_bit_codes(write):
    codes = np.zeros((80, 80), np.uint8)
    codes[:, 10:] = [0, 1, 2, 3, 128, 250, 251, 252, 254, 255] * 7
    photo = read_photo(write("codes.png", codes))
    assert (photo.saturated[..., 0] == (codes >= 252)).all()
    assert (photo.usable[..., 0] == ((codes >= 2) & (codes < 252))).all()


def test_masks_are_channel_by_channel(write):
    codes = np.full((80, 80, 3), (255, 100, 0), np.uint8)
    photo = read_photo(write("codes.png", codes))
    assert photo.usable[40, 40].tolist() == [False, True, False]
    assert photo.saturated[40, 40].tolist() == [True, False, False]


def test_a_float_that_is_not_a_number_is_zero_and_not_usable(write):
    values = ramp().astype(np.float32)
    values[40, 50], values[41, 50] = np.nan, np.inf
    photo = read_photo(write("holes.tif", values, photometric="rgb"))
    check_photo(photo, values.shape)
    assert not photo.usable[40:42, 50].any() and (photo.pixels[40:42, 50] == 0).all()
    assert photo.pixels.max() < 1 and photo.usable[60, 60].all()


def _with_iso(iso: int) -> Image.Exif:
    exif = Image.Exif()
    exif[0x8769] = {0x8827: iso}
    return exif


def test_rounding_to_codes_has_the_stated_variance(write):
    truth = np.random.default_rng(0).uniform(0.01, 0.9, (200, 300, 3))
    # ISO 1: so many electrons that rounding is nearly all the noise.
    photo = read_photo(write("dither.png", np.round(encoded(truth) * 255).astype(np.uint8), exif=_with_iso(1)))
    for low, high in ((0.01, 0.03), (0.03, 0.1), (0.1, 0.4), (0.4, 0.9)):
        here = (truth > low) & (truth < high)
        assert np.mean((photo.pixels - truth)[here] ** 2) == pytest.approx(photo.variance[here].mean(), rel=0.12)


def test_photon_noise_of_a_simulated_sensor_has_the_stated_variance(write):
    electrons, random = 4e6 / 1600, np.random.default_rng(1)
    truth = np.broadcast_to(np.linspace(0.02, 0.8, 300)[:, None], (200, 300, 3))
    counted = random.poisson(truth * electrons) + random.normal(0, 2, truth.shape)
    codes = np.clip(np.round(counted / electrons * 65535), 0, 65535).astype(np.uint16)
    path = write("sensor.tif", codes, photometric="rgb", extratags=[(34855, "H", 1, 1600, True)])
    photo = read_photo(path, linear=True)
    assert photo.iso == 1600
    error = (photo.pixels - truth) ** 2
    for part in (slice(0, 30), slice(100, 200), slice(200, 300)):
        assert error[:, part].mean() == pytest.approx(photo.variance[:, part].mean(), rel=0.05)


def test_compression_and_sensitivity_raise_the_variance(write):
    random = np.random.default_rng(2)
    codes = np.round(encoded(ramp()) * 240 + random.normal(0, 3, (96, 160, 3))).clip(0, 255).astype(np.uint8)
    variances = [
        read_photo(write(f"{quality}.jpg", codes, quality=quality, exif=_with_iso(iso))).variance.mean()
        for quality, iso in ((98, 100), (60, 100), (60, 1600), (60, 12800))
    ]
    assert all(later > 1.5 * earlier for earlier, later in zip(variances, variances[1:], strict=False))


# Orientation, memory


@pytest.mark.parametrize("tag", range(1, 9))
@pytest.mark.parametrize("suffix", ["jpg", "png", "tif"])
def test_the_picture_stands_upright(write, tag, suffix):
    codes = np.round(encoded(ramp()) * 255).astype(np.uint8)
    codes[5:20, 10:60] = (250, 30, 90)
    exif = Image.Exif()
    exif[0x0112] = tag
    if suffix == "tif":
        path = write("turned.tif", codes, photometric="rgb", extratags=[(274, "H", 1, tag, True)])
    else:
        path = write(f"turned.{suffix}", codes, exif=exif)
    with Image.open(path) as image:
        expected = np.asarray(ImageOps.exif_transpose(image))  # Pillow's own reading of the tag
    photo = read_photo(path)
    check_photo(photo, expected.shape)
    assert np.round(encoded(photo.pixels.astype(float)) * 255) == pytest.approx(expected, abs=0)


def test_reading_takes_little_memory(write):
    rows, columns = 1500, 2000
    codes = np.random.default_rng(0).integers(0, 256, (rows, columns, 3), dtype=np.uint8)
    path = write("large.jpg", codes, quality=90)
    read_photo(path)  # imports
    tracemalloc.start()
    try:
        read_photo(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 50 * rows * columns  # 1.2 GB for 24 megapixels, besides Pillow's own copy of 4 bytes a pixel


# Bad input


def huge_jpeg(side: int) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.full((80, 80, 3), 99, np.uint8)).save(buffer, "JPEG")
    data = bytearray(buffer.getvalue())
    struct.pack_into(">HH", data, data.index(b"\xff\xc0") + 5, side, side)
    return bytes(data)


def sentence(path, **options) -> str:
    """The one sentence with which a file is refused."""
    with pytest.raises(InputError) as caught:
        read_photo(path, **options)
    text = str(caught.value)
    assert "\n" not in text and text.endswith(".") and str(path) in text and len(text) < 400
    assert caught.value.__suppress_context__ or caught.value.__context__ is None
    return text


def test_what_is_no_file_is_refused(tmp_path, write, monkeypatch):
    assert "does not exist" in sentence(tmp_path / "nowhere.jpg")
    assert "folder" in sentence(tmp_path)
    assert "empty" in sentence(write("empty.jpg", b""))
    os.mkfifo(tmp_path / "pipe.jpg")
    assert "regular file" in sentence(tmp_path / "pipe.jpg")
    assert "cannot be opened" in sentence(write("file", b"1") / "below.jpg")
    with pytest.raises(InputError, match="cannot be opened"):
        read_photo("null\0byte.jpg")
    path = write("locked.png", np.full((80, 80), 99, np.uint8))

    def refuse(*_, **__):  # root may read everything, so a mode of 000 proves nothing here
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    assert "permissions" in sentence(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("note.jpg", b"The Moon was red tonight.\n" * 40),
        ("moon.gif", b"GIF89a" + bytes(200)),
        ("moon.heic", b"\0\0\0\x18ftypheic" + bytes(200)),
        ("page.html", b"<!DOCTYPE html><html></html>"),
        ("moon.bmp", b"BM" + bytes(100)),
    ],
)
def test_files_that_are_no_supported_image_are_refused(write, name, content):
    assert "support" in sentence(write(name, content))


def test_a_text_named_like_camera_raw_is_refused(write):
    assert "camera RAW" in sentence(write("moon.cr2", b"The Moon was red tonight.\n" * 40))


@pytest.mark.parametrize("name", ["moon.jpg", "moon.png", "moon.tif", "packed.tif"])
@pytest.mark.parametrize("fraction", [0.02, 0.5, 0.97])
def test_truncated_files_are_refused(write, name, fraction):
    codes = np.random.default_rng(0).integers(0, 256, (100, 120, 3), dtype=np.uint8)
    options = {"compression": "zlib"} if name == "packed.tif" else {}
    path = write(name, codes, **options)
    path.write_bytes(path.read_bytes()[: int(fraction * path.stat().st_size)])
    assert "damaged" in sentence(path)


def test_damaged_files_never_escape_as_another_error(write):
    """Bytes are overwritten at random: the file is read or refused in one sentence, nothing else."""
    random = np.random.default_rng(3)
    codes = random.integers(0, 256, (70, 70, 3), dtype=np.uint8)
    refused = 0
    for name in ("moon.jpg", "moon.png", "moon.tif"):
        data = write(name, codes, **({"photometric": "rgb"} if name == "moon.tif" else {})).read_bytes()
        for _ in range(60):
            damaged = bytearray(data)
            for place in random.integers(4, 400, 4):
                damaged[place] = random.integers(256)
            path = write(name, bytes(damaged))
            try:
                read_photo(path)
            except InputError as error:
                assert "\n" not in str(error)
                refused += 1
    assert refused > 20


def test_pictures_too_small_are_refused(write):
    assert "1 x 1" in sentence(write("dot.png", np.full((1, 1), 99, np.uint8)))
    for shape in ((63, 500), (500, 63)):
        assert "64 x 64" in sentence(write("strip.png", np.full(shape, 99, np.uint8)))
    assert read_photo(write("small.png", np.full((64, 64), 99, np.uint8))).pixels.shape == (64, 64, 3)


@pytest.mark.parametrize("side", [13_000, 20_000, 60_000])
def test_pictures_too_large_are_refused_from_their_header(write, side):
    tracemalloc.start()
    try:
        for path in (
            write("huge.png", png(side, side, 8, 2, zlib.compress(bytes(100)))),
            write("huge.jpg", huge_jpeg(side)),
        ):
            text = sentence(path)
            assert f"{side * side / 1e6:.0f} megapixels" in text and "GB of memory" in text
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


def test_a_large_tiff_is_refused_from_its_header(write):
    path = write("huge.tif", np.zeros((80, 80), np.uint8))
    with tifffile.TiffFile(path) as file:
        places = [file.pages.first.tags[name].valueoffset for name in ("ImageWidth", "ImageLength")]
    data = bytearray(path.read_bytes())
    for place in places:
        struct.pack_into("<H", data, place, 20_000)
    path.write_bytes(bytes(data))
    assert "400 megapixels" in sentence(path)


@pytest.mark.parametrize("name", ["black.jpg", "black.png", "black.tif"])
@pytest.mark.parametrize("code", [0, 1])
def test_a_black_picture_is_refused(write, name, code):
    assert "black image" in sentence(write(name, np.full((90, 120, 3), code, np.uint8)))


def test_a_black_float_picture_is_refused(write):
    assert "black image" in sentence(write("black.tif", np.zeros((90, 120), np.float32)))


# Real photographs


def test_a_telescope_photograph_of_2015(shared):
    photo = read_photo(shared / "photos/2015-09-28-canon-t2i/IMG_8742.jpg")
    check_photo(photo, (1728, 2592, 3))
    assert (photo.time, photo.local_time) == (
        None,
        "2015-09-28T04:54:12",
    )  # a clock without a zone is not UTC
    assert (photo.exposure_s, photo.iso, photo.f_number, photo.focal_length_mm) == (1.0, 6400.0, None, None)
    assert (photo.camera, photo.site, photo.format) == ("Canon EOS REBEL T2i", None, "JPEG")
    assert photo.sha256 == "e026c160181b5a5b9ba0e3442f804a20456bc9dc326ee12794858079602a8a06"


def test_a_phone_photograph_of_2025_has_its_zone_and_colour_profile(shared):
    photo = read_photo(shared / "photos/2025-09-07-phone/IMG20250908005344.jpg")
    check_photo(photo, (1864, 4096, 3))
    assert (photo.time, photo.local_time) == ("2025-09-07T19:23:44.543Z", "2025-09-08T00:53:44")
    assert photo.exposure_s == pytest.approx(1 / 237) and photo.f_number == pytest.approx(2.6)
    assert photo.focal_length_mm == pytest.approx(13.85) and photo.camera == "OnePlus 13"
    assert photo.primaries[0] == pytest.approx([0.8225, 0.1775, 0], abs=1e-3)  # Display P3


def test_photographs_without_exif_say_nothing(shared):
    for name in ("2022-05-16-newtonian/final.png", "2022-11-08-phone-binoculars/camera-19-33.jpg"):
        photo = read_photo(shared / "photos" / name)
        assert photo.time is photo.local_time is photo.exposure_s is photo.iso is photo.site is None
        assert 0.1 < photo.usable.mean() <= 1
