"""Hostile files: whatever the bytes, a reader ends in what it promises or in one sentence, soon and in little memory.

Files of every kind are made, then cut short, overwritten, spliced; `tests/test_photo.py` and `tests/test_exif.py` have
what single faults must be called. A case that fails is found again by its number: `case(folder, number)`.
"""

import gzip
import io
import resource
import signal
import struct
import warnings
import zlib
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import tifffile
from astropy.io import fits
from PIL import Image, ImageCms, PngImagePlugin

from eclipsejax.errors import InputError
from inverse import cli
from inverse.archive.catalogue import Listed, listed
from inverse.photo import Photo, read_photo
from inverse.profile import Profile, read_profile
from tests import dng
from tests.test_photo import check_photo, png, png16, tiff_lzw
from tests.test_profile import GOOD as PROFILE

PATIENCE = 30  # s, after which a case hangs
MEMORY = 800e6  # bytes, beyond what was held before: files here are of 80 x 90 pixels
CATALOGUE = """# a catalogue
file,utc,local_time,zone,site,disc,sha256,eclipse,licence,credit,notes
moon.jpg,2022-05-16T04:06:00Z,,,"-10.94,-37.06",4,,2022-05-16,CC BY 4.0,"A, ""Big"" Moon",
https://example.org/m.png,,2022-05-16T01:06:00,America/Recife,"-8,-34.9,10",,,,,,two
moon.jpg,-0584-05-22T16:00Z,,,,,,,,,
"""


def pixels(channels: int = 3, dtype="uint8") -> np.ndarray:
    row, column = np.mgrid[:80, :90]
    disc = 0.8 * (np.hypot(row - 40, column - 45) < 30) + 0.05
    noise = np.random.default_rng(0).uniform(0, 0.1, (80, 90, channels))
    values = np.clip(disc[..., None] * (1 + noise), 0, 1)
    return values.astype(dtype) if np.dtype(dtype).kind == "f" else (values * np.iinfo(dtype).max).astype(dtype)


def saved(mode: str, array: np.ndarray, **options) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(array).save(buffer, mode, **options)
    return buffer.getvalue()


def tiff(array: np.ndarray, **options) -> bytes:
    buffer = io.BytesIO()
    tifffile.imwrite(buffer, array, metadata=None, **options)
    return buffer.getvalue()


def fits_of(*units) -> bytes:
    buffer = io.BytesIO()
    fits.HDUList(list(units)).writeto(buffer)
    return buffer.getvalue()


def exif() -> Image.Exif:
    tags = Image.Exif()
    tags[0x0110], tags[0x0112] = "Camera", 6
    tags.get_ifd(0x8769).update({0x9003: "2022:05:16 01:06:00", 0x9011: "-03:00", 0x829A: 0.5, 0x8827: 800})
    tags.get_ifd(0x8825).update({1: "S", 2: (10.0, 56.0, 0.0), 3: "W", 4: (37.0, 3.0, 0.0), 29: "2022:05:16"})
    return tags


def sensor() -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "raw.dng"
        dng.write_dng(path, np.kron(pixels(1, "uint16")[..., 0] >> 4, np.ones((2, 2), "uint16")))
        return path.read_bytes()


@cache
def originals() -> dict[str, bytes]:
    """Whole files by name."""
    grey = pixels(1)[..., 0]
    nan = pixels(3, "float32")
    nan[10:20, :, 1], nan[30, 30] = np.nan, np.inf
    cube = np.moveaxis(nan, -1, 0)
    header = fits.Header({"DATE-OBS": "2022-05-16T04:06:07", "SITELAT": -10.9, "EXPTIME": 0.5, "ROWORDER": "TOP-DOWN"})
    flat = fits_of(fits.PrimaryHDU(pixels(1, "int16")[..., 0], header))
    icc = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    text = PngImagePlugin.PngInfo()
    text.add_text("Comment", "moon " * 50, zip=True)
    return {
        "rgb.jpg": saved("JPEG", pixels(), quality=90, exif=exif(), icc_profile=icc),
        "progressive.jpeg": saved("JPEG", pixels(), progressive=True, subsampling=2),
        "grey.jpg": saved("JPEG", grey),
        "rgb.png": saved("PNG", pixels(), pnginfo=text, icc_profile=icc, exif=exif()),
        "alpha.png": saved("PNG", pixels(4)),
        "palette.png": png(90, 80, 8, 3, zlib.compress(np.pad(grey, ((0, 0), (1, 0))).tobytes())),
        "deep.png": png16(pixels(3, "uint16")),
        "rgb.tif": tiff(pixels(), photometric="rgb", extratags=[(306, 2, 20, "0000:00:00 00:00:00", True)]),
        "deep.tiff": tiff(pixels(3, "uint16"), photometric="rgb", compression="zlib", rowsperstrip=7),
        "float.tif": tiff(nan, photometric="rgb"),
        "tiles.tif": tiff(pixels(1, "uint16")[..., 0], tile=(32, 32), compression="zlib", predictor=True),
        "planes.tif": tiff(np.moveaxis(pixels(), -1, 0), photometric="rgb", planarconfig="separate", bigtiff=True),
        "lzw.tif": tiff_lzw(pixels(3, "uint16")),
        "pillow.tif": saved("TIFF", pixels(), compression="tiff_lzw", exif=exif()),
        "pages.tif": tiff(np.stack([pixels()] * 3), photometric="rgb"),
        "flat.fits": flat,
        "cube.fits": fits_of(fits.PrimaryHDU(cube)),
        "scaled.fit": fits_of(fits.PrimaryHDU(pixels(1, "uint16")[..., 0])),
        "packed.fits": fits_of(fits.PrimaryHDU(), fits.CompImageHDU(pixels(1, "int16")[..., 0])),
        "flat.fits.gz": gzip.compress(flat),
        "raw.dng": sensor(),
        "profile.csv": PROFILE.encode(),
        "catalogue.csv": CATALOGUE.encode(),
    }


HOSTILE = [
    b"\0\0\0\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\x80",
    b"\0",
    b"\xff\xff",
]
WORDS = [
    b"nan",
    b"inf",
    b"1e999",
    b"-1",
    b"9" * 400,
    b'"',
    b"'",
    b",",
    b"\n",
    b"\r",
    b"\xe2\x80\xa8",
    b"=cmd()",
    b"../",
]


def harmed(original: bytes, random: np.random.Generator, other: bytes, text: bool) -> bytes:
    """A file after one to four harms."""
    data = bytearray(original)
    for _ in range(random.integers(1, 5)):
        if not data:
            break
        # Headers are at the beginning, and at the end of many a TIFF.
        reach = len(data) if random.random() < 0.4 else min(len(data), 600)
        place = (
            int(random.integers(reach))
            if random.random() < 0.8
            else max(0, len(data) - 1 - int(random.integers(reach)))
        )
        length = int(random.integers(1, 200))
        match random.integers(8):
            case 0:
                del data[place:]
            case 1:
                data[place] ^= 1 << int(random.integers(8))
            case 2:
                data[place : place + 4] = random.bytes(4)
            case 3:
                chosen = (WORDS if text else HOSTILE)[int(random.integers(len(WORDS if text else HOSTILE)))]
                data[place : place + len(chosen)] = chosen
            case 4:
                del data[place : place + length]
            case 5:
                data[place:place] = data[place : place + length] * int(random.integers(1, 20))
            case 6:
                data[place:] = other[int(random.integers(len(other))) :]
            case 7:
                data[place:place] = random.bytes(length) if not text else WORDS[int(random.integers(len(WORDS)))]
    return bytes(data)


def with_sums(data: bytes) -> bytes:
    """A PNG whose chunks have right check sums again, so that what is in them is looked at."""
    fixed, place = bytearray(data), 8
    while place + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, place)
        end = place + 8 + size
        if end + 4 > len(data):
            break
        struct.pack_into(">I", fixed, end, zlib.crc32(data[place + 4 : end]))
        place = end + 4
    return bytes(fixed)


def case(folder: Path, number: int) -> tuple[str, Path]:
    """The name of the original and the harmed file of a case."""
    random = np.random.default_rng([7, number])
    names = list(originals())
    name = names[number % len(names)]
    other = originals()[names[int(random.integers(len(names)))]]
    path = folder / ("harmed" + name[name.index(".") :])
    data = harmed(originals()[name], random, other, name.endswith(".csv"))
    path.write_bytes(with_sums(data) if name.endswith(".png") and random.random() < 0.7 else data)
    return name, path


@contextmanager
def bounded(what):
    """Fails where something hangs, or takes memory that no file here should."""

    def hangs(*_):
        raise AssertionError(f"{what}: it hangs")

    try:
        Path("/proc/self/clear_refs").write_text("5")  # the peak of memory counts from now
    except OSError:
        pass
    before, held = signal.signal(signal.SIGALRM, hangs), peak()
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    assert peak() < held + MEMORY, f"{what}: {(peak() - held) / 1e6:.0f} MB"


def peak() -> float:
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(1e3 * float(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    except OSError:
        return 1e3 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def check(name: str, path: Path):
    """Reads a file as what it was made from; whether it was accepted."""
    try:
        if name == "catalogue.csv":
            for one in listed(path, path.parent / "out"):
                assert isinstance(one, Listed)
                check_sentence(one.refused)
                below = one.path is None or path.parent.resolve() in one.path.resolve().parents
                assert one.refused or (below and (one.path or one.source.startswith("https://")))
        elif name == "profile.csv":
            profile = read_profile(path)
            assert isinstance(profile, Profile) and profile.offset.size >= 5
            assert (
                (profile.surface > 0).all() and not np.isinf(profile.value).any() and np.isfinite(profile.offset).all()
            )
        else:
            photo = read_photo(path)
            assert isinstance(photo, Photo)
            check_photo(photo, photo.pixels.shape)
            assert photo.time is None or photo.time.endswith("Z")
    except InputError as error:
        check_sentence(str(error))
        return False
    return True


def check_sentence(text: str | None):
    if text is not None:
        assert text.isprintable() and text.endswith(".") and len(text) < 1100, text[:300]


def run(folder: Path, numbers) -> int:
    (folder / "moon.jpg").touch()
    accepted = 0
    for number in numbers:
        name, path = case(folder, number)
        with bounded((number, name)), warnings.catch_warnings():
            warnings.simplefilter("error")
            accepted += check(name, path)
    return accepted


def test_originals_are_read(tmp_path):
    (tmp_path / "moon.jpg").touch()
    for name, data in originals().items():
        path = tmp_path / name
        path.write_bytes(data)
        assert check(name, path), name


def test_two_hundred_harmed_files(tmp_path):
    assert 20 < run(tmp_path, range(200)) < 180


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_ten_thousand_harmed_files(tmp_path, part):
    assert run(tmp_path, range(1000 * part, 1000 * (part + 1))) > 100


# What somebody made on purpose


def tagged(data: bytes, **values: int) -> bytes:
    """A TIFF with other values in tags of its first page."""
    changed = bytearray(data)
    with tifffile.TiffFile(io.BytesIO(data)) as file:
        for name, value in values.items():
            tag = file.pages.first.tags[name]
            kind = {3: "H", 4: "I", 16: "Q"}[int(tag.dtype)]
            struct.pack_into(file.byteorder + kind, changed, tag.valueoffset, value)
    return bytes(changed)


def packed_fits(megabytes: int, cards: str) -> bytes:
    """A packed FITS file of zeros behind an extension's header: a thousandth of what it unpacks to."""
    block = "".join(card.ljust(80) for card in cards.splitlines()).ljust(2880).encode()
    primary = "".join(c.ljust(80) for c in ("SIMPLE  =                    T", "BITPIX  =                    8",
        "NAXIS   =                    0", "EXTEND  =                    T", "END")).ljust(2880).encode()  # fmt: skip
    packer = zlib.compressobj(1, zlib.DEFLATED, 31)
    parts = [packer.compress(primary + block), *(packer.compress(bytes(10**6)) for _ in range(megabytes))]
    return b"".join([*parts, packer.flush()])


def card(name: str, value) -> str:
    return f"{name:8}= {value:>20}"


def hostile() -> dict[str, bytes]:
    rgb, deep = originals()["rgb.tif"], originals()["deep.tiff"]
    loop = bytearray(rgb)
    with tifffile.TiffFile(io.BytesIO(rgb)) as file:
        first = file.pages.first.offset
        entries = struct.unpack_from("<H", rgb, first)[0]
    struct.pack_into("<I", loop, first + 2 + 12 * entries, first)  # the next page is this one
    table = [card("XTENSION", "'BINTABLE'"), card("BITPIX", 8), card("NAXIS", 2), card("NAXIS1", 10**9),
             card("NAXIS2", 9), card("PCOUNT", 0), card("GCOUNT", 1), card("TFIELDS", 0), "END"]  # fmt: skip
    flat = originals()["flat.fits"]
    dated = saved("JPEG", pixels(), exif=dated_exif("0000:00:00 00:00:00"))
    return {
        "bomb.png": png(60_000, 60_000, 8, 2, zlib.compress(bytes(10**7), 9)),
        "one-bit.png": png(60_000, 60_000, 1, 0, zlib.compress(bytes(10**6), 9)),
        "thin.png": png(2**31 - 1, 64, 8, 2, zlib.compress(bytes(10**5))),
        "nothing.png": png(0, 0, 8, 2, b""),
        "text.png": text_bomb(),
        "wide.tif": tagged(rgb, ImageWidth=65535),
        "planes.tif": tagged(originals()["planes.tif"], SamplesPerPixel=65280),
        "samples.tif": tagged(rgb, SamplesPerPixel=65535),
        "compression.tif": tagged(rgb, Compression=34933),
        "rows.tif": tagged(deep, RowsPerStrip=1),
        "loop.tif": bytes(loop),
        "nan.tif": tiff(np.full((80, 90), np.nan, "float32")),
        "infinite.tif": tiff(np.full((80, 90), np.inf, "float32")),
        "huge.tif": tiff(np.full((80, 90), 1e308, "float64")),
        "negative.tif": tiff(np.full((80, 90), -1.0, "float32")),
        "complex.tif": tiff(np.full((80, 90), 1j, "complex64")),
        "bits.tif": tiff(np.eye(90, dtype=bool)),
        "nan.fits": fits_of(fits.PrimaryHDU(np.full((80, 90), np.nan))),
        "infinite.fits": fits_of(fits.PrimaryHDU(np.full((80, 90), np.inf))),
        "axes.fits": flat.replace(card("NAXIS1", 90).encode(), card("NAXIS1", 10**12).encode()),
        "minus.fits": flat.replace(card("NAXIS1", 90).encode(), card("NAXIS1", -90).encode()),
        "bitpix.fits": flat.replace(card("BITPIX", 16).encode(), card("BITPIX", 17).encode()),
        "scale.fits": fits_of(fits.PrimaryHDU(pixels(1, "float32")[..., 0], fits.Header({"SATURATE": 1e-44}))),
        "blank.fits": flat.replace(b"END     ", b"        ") + b" " * 10**6,
        "year.fits": flat.replace(b"2022-05-16T04:06:07", b"0000-00-00T00:00:00"),
        "table.fits.gz": packed_fits(300, "\n".join(table)),
        "year.jpg": dated,
        "loop.jpg": dated.replace(b"\x87\x69\x00\x04\x00\x00\x00\x01", b"\x87\x69\x00\x04\xff\xff\xff\xff"),
        "quotes.csv": b'"' * 10**6,
        "commas.csv": (PROFILE.splitlines()[3] + "\n" + "," * 10**6).encode(),
        "line.csv": b"1," * 10**6,
        "digits.csv": PROFILE.replace("0.10,", "1" * 10**5 + ",").encode(),
        "twice.csv": PROFILE.replace("red_sd", "red").encode(),
    }


def dated_exif(stamp: str) -> Image.Exif:
    tags = exif()
    tags.get_ifd(0x8769)[0x9003] = stamp
    return tags


def text_bomb() -> bytes:
    """A PNG whose compressed remark and colour profile unpack to 200 MB each."""
    body = zlib.compress(bytes(2 * 10**8), 9)
    data, end = originals()["alpha.png"], 33

    def chunk(name):
        inner = name + b"ICC\0\0" + body
        return struct.pack(">I", len(inner) - 4) + inner + struct.pack(">I", zlib.crc32(inner))

    return data[:end] + chunk(b"iCCP") + chunk(b"zTXt") + data[end:]


@pytest.fixture(scope="module")
def traps(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("traps")
    for name, data in hostile().items():
        (folder / name).write_bytes(data)
    return {path.name: path for path in sorted(folder.iterdir())}


ACCEPTED = {"loop.tif", "rows.tif", "year.fits", "year.jpg", "loop.jpg", "bits.tif", "scale.fits", "text.png"}


def test_traps_are_refused_in_a_sentence_or_read(traps):
    for name, path in traps.items():
        with bounded(name), warnings.catch_warnings():
            warnings.simplefilter("error")
            read = check("profile.csv" if name.endswith(".csv") else name, path)
        assert not read or name in ACCEPTED, name
        if name.endswith(".csv"):
            with bounded(name):
                check("catalogue.csv", path)


def test_a_date_in_the_year_0_is_no_date(traps):
    for name in ("year.fits", "year.jpg"):
        photo = read_photo(traps[name])
        assert photo.time is None and photo.local_time is None


NAMES = ["a moon.jpg", "a\nmoon.jpg", "a\r\x1b[31mmoon.jpg", "Mond-\u6708-\u0646\u0631.jpg", "\udcff\udcfe.jpg",
         "-o.jpg", "%s{0}$HOME`.jpg", "a" * 240 + ".jpg"]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_names_of_any_kind_are_read_and_told_on_one_line(tmp_path, name, capsys):
    path = tmp_path / name
    with pytest.raises(InputError) as caught:
        read_photo(path)
    check_sentence(str(caught.value))
    path.write_bytes(originals()["rgb.jpg"])
    assert read_photo(path).pixels.shape == (90, 80, 3)
    assert [one.path for one in listed(tmp_path, tmp_path / "out")] == [path]
    assert listed(tmp_path, tmp_path / "out")[0].source.isprintable()
    path.write_bytes(b"no Moon")
    assert cli.main([str(path), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_loops_of_links_are_refused(tmp_path):
    for name in ("loop.jpg", "loop.csv"):
        (tmp_path / name).symlink_to(tmp_path / name)
    (tmp_path / "folder").symlink_to(tmp_path)
    for read, name in (
        (read_photo, "loop.jpg"),
        (read_profile, "loop.csv"),
        (lambda p: listed(p, tmp_path), "loop.csv"),
    ):
        with pytest.raises(InputError) as caught:
            read(tmp_path / name)
        check_sentence(str(caught.value))
    (tmp_path / "catalogue.csv").write_text("file\nloop.jpg\nfolder/folder/folder/x.jpg\n")
    assert all(one.refused for one in listed(tmp_path / "catalogue.csv", tmp_path / "out"))


def test_the_command_ends_in_a_sentence(traps, tmp_path, capsys):
    for name in set(traps) - ACCEPTED:
        with bounded(name):
            status = cli.main([str(traps[name]), "--time", "2022-05-16T04:06:00Z", "--out", str(tmp_path / "out")])
        said = capsys.readouterr()
        assert status == 2, name
        check_sentence(said.err.splitlines()[-1])
        assert said.err.count("\n") - said.err.count("\r") <= 2 and "Traceback" not in said.err
