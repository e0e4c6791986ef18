"""What the EXIF and FITS headers say; and that no nonsense in them raises."""

import io
import math
import warnings
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from inverse.exif import Facts, facts, facts_of_fits, tags_of_file, tags_of_image

EXIF, GPS = 0x8769, 0x8825
ORIGINAL, OFFSET, OFFSET_OF_EDIT, SUBSECOND = 0x9003, 0x9011, 0x9010, 0x9291


def image_with(exif: dict | None = None, gps: dict | None = None, first: dict | None = None, kind="JPEG"):
    """An image as read back from a file with these tags in the Exif, the GPS and the first directory."""
    tags = Image.Exif()
    for tag, value in (first or {}).items():
        tags[tag] = value
    if exif:
        tags[EXIF] = exif
    if gps:
        tags[GPS] = gps
    buffer = io.BytesIO()
    Image.fromarray(np.full((80, 80, 3), 99, np.uint8)).save(buffer, kind, exif=tags)
    return Image.open(buffer)


def told(*directories, **options) -> Facts:
    return facts(tags_of_image(image_with(*directories, **options)))


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
def test_all_directories_are_read(kind):
    found = told(
        {
            ORIGINAL: "2022:05:16 01:06:07",
            0x829A: IFDRational(1, 4),
            0x829D: IFDRational(28, 5),
            0x8827: 1600,
            0x920A: IFDRational(300),
        },
        {1: "S", 2: (10, IFDRational(113, 2), 0), 3: "W", 4: (37, 3, IFDRational(216, 10))},
        {0x0110: "Canon EOS REBEL T3i\0", 0x0112: 6},
        kind=kind,
    )
    assert found == Facts(
        time=None,
        local_time="2022-05-16T01:06:07",
        exposure_s=0.25,
        iso=1600,
        f_number=5.6,
        focal_length_mm=300,
        camera="Canon EOS REBEL T3i",
        site=found.site,
        orientation=6,
    )
    assert found.site == pytest.approx((-10.941667, -37.056), abs=1e-6)


def test_a_time_without_a_zone_is_never_utc():
    found = told({ORIGINAL: "2015:09:28 04:54:12", SUBSECOND: "23"}, None, {0x0132: "2015:10:01 00:00:00"})
    assert (found.time, found.local_time) == (None, "2015-09-28T04:54:12")


@pytest.mark.parametrize(
    ("offset", "time"),
    [
        ("+00:00", "2022-05-16T01:06:00Z"),
        ("Z", "2022-05-16T01:06:00Z"),
        ("-03:00", "2022-05-16T04:06:00Z"),
        ("+05:30", "2022-05-15T19:36:00Z"),
        ("-0930", "2022-05-16T10:36:00Z"),
        ("+99:00", None),
        ("   :  ", None),
        ("local", None),
    ],
)
def test_the_zone_of_the_original_time_makes_it_utc(offset, time):
    assert told({ORIGINAL: "2022:05:16 01:06:00", OFFSET: offset}).time == time


def test_the_zone_of_the_last_edit_does_not_count():
    assert told({ORIGINAL: "2022:05:16 01:06:00", OFFSET_OF_EDIT: "+02:00"}).time is None


def test_fractions_of_a_second_enter_utc():
    exif = {ORIGINAL: "2025:09:07 23:31:16", OFFSET: "+05:30", SUBSECOND: "161"}
    assert told(exif).time == "2025-09-07T18:01:16.161Z"
    assert told(exif | {SUBSECOND: "5  "}).time == "2025-09-07T18:01:16.500Z"
    assert told(exif | {SUBSECOND: "x"}).time == "2025-09-07T18:01:16Z"


def test_satellite_time_is_utc_and_wins_where_the_clock_contradicts_it():
    gps = {29: "2022:05:16", 7: (4, 6, IFDRational(15, 2))}
    assert told({ORIGINAL: "2022:05:16 01:06:05"}, gps).time == "2022-05-16T04:06:08Z"
    # Within a stale fix of each other the clock is the better one; hours apart it is wrong.
    assert told({ORIGINAL: "2022:05:16 01:07:05", OFFSET: "-03:00"}, gps).time == "2022-05-16T04:07:05Z"
    assert told({ORIGINAL: "2022:05:16 02:06:05", OFFSET: "-03:00"}, gps).time == "2022-05-16T04:06:08Z"
    assert told(None, {7: (4, 6, 7)}).time is None  # no date


@pytest.mark.parametrize(
    "stamp",
    [
        "0000:00:00 00:00:00",
        "2022:02:31 01:00:00",
        "2022:05:16 25:00:00",
        "    :  :     :  :  ",
        "",
        "yesterday",
    ],
)
def test_dates_that_are_none(stamp):
    found = told({ORIGINAL: stamp, OFFSET: "+01:00"})
    assert found.time is None and found.local_time is None


def test_the_first_year_does_not_underflow():
    assert told({ORIGINAL: "0001:01:01 00:00:00", OFFSET: "+05:00"}).time is None


@pytest.mark.parametrize(
    "value",
    [IFDRational(1, 0), IFDRational(0, 0), IFDRational(0, 1), "fast", (1, 2, 3), b"\1", None, -1.0, 1e300],
)
def test_numbers_that_are_none(value):
    found = facts(dict.fromkeys(("ExposureTime", "FNumber", "FocalLength", "ISOSpeedRatings"), value))
    assert found.exposure_s is found.f_number is found.focal_length_mm is None
    assert found.iso in (None, 1)  # of several sensitivities the first counts


def test_zeros_of_a_telescope_are_none():
    found = told({0x829A: IFDRational(1, 80), 0x829D: IFDRational(0, 1), 0x920A: IFDRational(0, 1), 0x8827: 200})
    assert (found.exposure_s, found.f_number, found.focal_length_mm, found.iso) == (1 / 80, None, None, 200)


def test_sensitivities_beyond_16_bits_are_in_another_tag():
    assert told({0x8827: 65535, 0x8832: 102400}).iso == 102400
    assert told({0x8827: 65535}).iso is None


@pytest.mark.parametrize(
    "gps",
    [
        {1: "N", 2: (45, 0, 0)},
        {2: (45, 0, 0), 4: (127, 0, 0)},
        {1: "N", 2: (0, 0, 0), 3: "E", 4: (0, 0, 0)},
        {1: "N", 2: (95, 0, 0), 3: "E", 4: (127, 0, 0)},
        {1: "N", 2: (IFDRational(45, 0), 0, 0), 3: "E", 4: (127, 0, 0)},
        {1: "X", 2: (45, 0, 0), 3: "E", 4: (127, 0, 0)},
    ],
)
def test_places_that_are_none(gps):
    assert told(None, gps).site is None


@pytest.mark.parametrize("value", [0, 9, "up", None, 65535])
def test_orientations_that_are_none(value):
    assert facts({"Orientation": value}).orientation == 1


junk = st.recursive(
    st.none() | st.text() | st.binary() | st.integers() | st.floats() | st.fractions(),
    lambda inner: st.lists(inner, max_size=4).map(tuple),
    max_leaves=4,
)
names = st.sampled_from(
    (
        "DateTimeOriginal OffsetTimeOriginal SubsecTimeOriginal ExposureTime FNumber FocalLength Model "
        "ISOSpeedRatings Orientation GPSDateStamp GPSTimeStamp GPSLatitude GPSLatitudeRef GPSLongitude "
        "GPSLongitudeRef DATE-OBS EXPTIME SITELAT SITELONG TIMESYS INSTRUME"
    ).split()
)
plausible = st.sampled_from(
    ["2022:05:16 01:06:00", "9999:12:31 23:59:59", "-14:00", "99", "N", (1, 2, 3), (99, 99, 1e9)]
)


@given(st.dictionaries(names, junk | plausible))
@settings(max_examples=120, deadline=None)
def test_no_tag_whatever_raises(tags):
    for found in (facts(tags), facts_of_fits(tags)):
        for value in (
            found.exposure_s,
            found.iso,
            found.f_number,
            found.focal_length_mm,
            *(found.site or ()),
        ):
            assert value is None or math.isfinite(value)


def test_corrupt_blocks_do_not_raise(tmp_path):
    image = image_with({ORIGINAL: "2022:05:16 01:06:00", 0x829A: IFDRational(1, 4)}, {1: "N", 2: (1, 2, 3)})
    data = image.fp.getvalue()  # pyright: ignore
    random = np.random.default_rng(0)
    start = data.index(b"Exif")
    for _ in range(200):
        damaged = bytearray(data)
        for place in random.integers(start, start + 180, 5):
            damaged[place] = random.integers(256)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # as the readers do; what is tested comes after
            try:
                opened = Image.open(io.BytesIO(damaged))
            except OSError:
                continue
        assert isinstance(facts(tags_of_image(opened)), Facts)
        path = tmp_path / "damaged.tif"
        path.write_bytes(damaged[start + 6 :])  # the block is a small TIFF file
        assert isinstance(facts(tags_of_file(path)), Facts)


def test_exifread_and_pillow_agree(tmp_path):
    """The same file through both readers, as the block of a JPEG and as a TIFF."""
    exif = {
        ORIGINAL: "2022:05:16 01:06:00",
        OFFSET: "-03:00",
        SUBSECOND: "50",
        0x8827: 800,
        0x829A: IFDRational(1, 3),
    }
    image = image_with(exif, {1: "N", 2: (1, 2, 3), 3: "W", 4: (4, 5, 6)}, {0x0110: "One", 0x0112: 8})
    path = tmp_path / "one.jpg"
    path.write_bytes(image.fp.getvalue())  # pyright: ignore
    expected = facts(tags_of_image(image))
    found = facts(tags_of_file(path))
    assert found == expected and found.time == "2022-05-16T04:06:00.500Z" and found.site is not None


def test_a_fraction_over_zero_of_exifread_is_none():
    from exifread.utils import Ratio

    assert facts({"ExposureTime": [Ratio(1, 0)], "FNumber": [Ratio(28, 10)]}) == Facts(f_number=2.8)
    assert facts({"ExposureTime": [Fraction(1, 8)]}).exposure_s == 0.125


def test_fits_headers():
    found = facts_of_fits(
        {
            "DATE-OBS": "2022-05-16T04:06:07.25",
            "EXPTIME": 0.5,
            "FOCALLEN": 1390,
            "INSTRUME": "ASI533MC ",
            "SITELAT": "-10 56 38.4",
            "SITELONG": 322.944,
        }
    )
    assert found == Facts(
        time="2022-05-16T04:06:07.250Z",
        exposure_s=0.5,
        focal_length_mm=1390,
        camera="ASI533MC",
        site=found.site,
    )
    assert found.site == pytest.approx((-10.944, -37.056))
    assert facts_of_fits({"DATE-OBS": "2022-05-16T04:06:07", "TIMESYS": "TT"}).time is None
    assert facts_of_fits({"DATE-OBS": "2022-05-16"}).time is None


def canon_note(levels, at: int) -> bytes:
    """Canon's notes with a table of colours whose gains as shot are `levels`; the notes stand `at` in the block."""
    data = np.zeros(80, ">u2")  # the order of the whole block, which here is Pillow's
    data[63:67] = levels
    entry = np.array([0x4001, 3], ">u2").tobytes() + np.array([data.size, at + 18], ">u4").tobytes()
    return np.array([1], ">u2").tobytes() + entry + bytes(4) + data.tobytes()


@pytest.mark.parametrize(
    "make, levels, found",
    [
        ("Canon", (1540, 1024, 1024, 2250), (math.log(1540 / 1024), math.log(2250 / 1024))),
        ("Canon", (1540, 1024, 1000, 2250), None),  # another version of the table
        ("Canon", (0, 1024, 1024, 2250), None),
        ("NIKON CORPORATION", (1540, 1024, 1024, 2250), None),
    ],
)
def test_the_balance_that_a_canon_chose(make, levels, found):
    written = lambda at: image_with({0x927C: canon_note(levels, at), 0xA403: 0}, first={0x010F: make})
    # Where the notes will stand is known once they have been written.
    at = written(0).info["exif"].removeprefix(b"Exif\0\0").find(canon_note(levels, 0))
    known = facts(tags_of_image(written(at)))
    assert known.balance == (None if found is None else pytest.approx(found)) and known.balanced_once is False


@pytest.mark.parametrize("note", [b"", b"\0", b"\xff" * 40, b"\0\x01\x40\x01\0\x03" + b"\xff" * 8])
def test_damaged_notes_leave_the_other_tags(note):
    known = told({0x927C: note, 0x8827: 400}, first={0x010F: "Canon"})
    assert known.balance is None and known.iso == 400.0


def test_a_balance_set_by_hand():
    assert told({0xA403: 1}).balanced_once is True and told({}).balanced_once is None
