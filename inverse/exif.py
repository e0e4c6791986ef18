"""What a file says about when, where and how the picture was taken.

Cameras write nonsense: year 0, an f-number of 0 behind a telescope, rationals over 0, text in number fields.
Whatever cannot be read is `None`; nothing in this module raises on a tag.
"""

import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image

from inverse.maker_note import canon_balance

_EXIF_IFD, _GPS_IFD = 0x8769, 0x8825
_BALANCE = "gains of the white balance"  # beside the names of tags: no tag of EXIF holds them
# A GPS stamp is that of the last fix, which can be minutes old; a camera clock can be wrong by hours.
_STALE_FIX = timedelta(minutes=10)


@dataclass(frozen=True)
class Facts:
    """Time, place and exposure of a photograph; `None` where the file does not say.

    - `time`: UTC, ISO with a final Z, only where the file fixes it (a zone offset, GPS, or the FITS
      standard).
    - `local_time`: ISO without a zone, to the second: the camera's own clock, of unknown zone.
    - `balanced_once`: whether the white balance was set by hand, and so is the same in all pictures; False where the
      camera chose it for this one. `balance`: its log gains of red and blue against green.
    - `orientation`: EXIF tag 274, 1 to 8.
    """

    time: str | None = None
    local_time: str | None = None
    exposure_s: float | None = None
    iso: float | None = None
    f_number: float | None = None
    focal_length_mm: float | None = None
    camera: str | None = None
    site: tuple[float, float] | None = None
    balanced_once: bool | None = None
    balance: tuple[float, float] | None = None
    orientation: int = 1


def tags_of_image(image: Image.Image) -> dict[str, Any]:
    """EXIF tags by name of an image opened by Pillow, without decoding its pixels."""
    tags: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow warns of corrupt EXIF; what is left of it is used
        try:
            exif = image.getexif()
            # `getexif()` itself shows IFD0 only; exposure and time live in the Exif IFD, the place in GPS.
            for folder, names in (
                (exif, ExifTags.TAGS),
                (exif.get_ifd(_EXIF_IFD), ExifTags.TAGS),
                (exif.get_ifd(_GPS_IFD), ExifTags.GPSTAGS),
            ):
                tags |= {names[key]: value for key, value in folder.items() if key in names}
            if str(tags.get("Make", "")).startswith("Canon"):
                block = image.info["exif"].removeprefix(b"Exif\0\0")
                tags[_BALANCE] = canon_balance(block, tags["MakerNote"])
        except Exception:  # a foreign parser on a damaged block raises anything at all
            pass
    return tags


def tags_of_file(path: Path) -> dict[str, Any]:
    """EXIF tags by name of a TIFF or camera RAW file, through exifread."""
    import exifread

    try:
        with path.open("rb") as file:
            found = exifread.process_file(file, details=False, extract_thumbnail=False)
    except Exception:  # as above
        return {}
    tags: dict[str, Any] = {}
    for folder in ("Image ", "EXIF ", "GPS "):  # the Exif IFD overrides IFD0; thumbnails are left out
        for name, tag in found.items():
            if name.startswith(folder):
                tags[name.removeprefix(folder)] = getattr(tag, "values", tag)
    return tags


def facts(tags: Mapping[str, Any]) -> Facts:
    """Facts from EXIF tags by name (CIPA DC-008-2019, Exif 2.32)."""
    local = _clock(tags.get("DateTimeOriginal"))  # not DateTime, which is that of the last edit
    return Facts(
        time=_utc(tags, local),
        local_time=local.isoformat(timespec="seconds") if local else None,
        exposure_s=positive(tags.get("ExposureTime"), at_most=86400.0),
        iso=_iso(tags),
        f_number=positive(tags.get("FNumber"), at_most=1000.0),
        focal_length_mm=positive(tags.get("FocalLength"), at_most=1e6),
        camera=text(tags.get("Model")),
        site=_site(tags),
        balanced_once=_balanced_once(tags.get("WhiteBalance")),
        balance=tags.get(_BALANCE),
        orientation=_orientation(tags.get("Orientation")),
    )


def facts_of_fits(header: Mapping[str, Any]) -> Facts:
    """Facts from a FITS header; DATE-OBS is UTC by the standard (4.0, section 9) unless TIMESYS differs."""
    time = None
    stamp = text(header.get("DATE-OBS"))
    zone = text(header.get("TIMESYS")) or "UTC"
    if stamp and "T" in stamp and zone.upper() in ("UTC", "UT", "GMT"):
        start = _clock(stamp)
        digits = re.search(r"\.(\d+)", stamp)
        time = _iso_utc(start, digits.group(1) if digits else "") if start else None
    latitude, longitude = (
        _degrees(next((header[key] for key in keys if key in header), None))
        for keys in (("SITELAT", "LAT-OBS", "OBSGEO-B"), ("SITELONG", "LONG-OBS", "OBSGEO-L"))
    )
    return Facts(
        time=time,
        exposure_s=positive(header.get("EXPTIME", header.get("EXPOSURE")), at_most=86400.0),
        iso=positive(header.get("ISOSPEED"), at_most=1e7),
        f_number=positive(header.get("FOCRATIO"), at_most=1000.0),
        focal_length_mm=positive(header.get("FOCALLEN"), at_most=1e6),
        camera=text(header.get("INSTRUME")),
        site=_place(latitude, longitude),
    )


def text(value: Any) -> str | None:
    """A tag as text without padding; `None` where it is empty."""
    if isinstance(value, bytes):
        value = value.decode("ascii", errors="replace")
    return (value.replace("\0", " ").strip() or None) if isinstance(value, str) else None


def number(value: Any) -> float | None:
    """A tag as a finite number; `None` for text, for 1/0, for 0/0."""
    if isinstance(value, (list, tuple)):
        value = value[0] if len(value) == 1 else None
    if value is None or isinstance(value, (str, bytes, bool)):
        return None
    # exifread keeps x/0 as a Fraction of value 0 with the true denominator at the side.
    if getattr(value, "_denominator", 1) == 0:
        return None
    try:
        result = float(value)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return result if math.isfinite(result) else None


def positive(value: Any, *, at_most: float) -> float | None:
    """A tag as a number above 0; cameras write 0 for "not known"."""
    result = number(value)
    return result if result is not None and 0 < result <= at_most else None


def _iso(tags: Mapping[str, Any]) -> float | None:
    """The sensitivity; 65535 in the old 16-bit tag means "see the longer tags"."""
    for name in ("ISOSpeedRatings", "PhotographicSensitivity", "ISOSpeed", "RecommendedExposureIndex",
                 "StandardOutputSensitivity"):  # fmt: skip
        value = tags.get(name)
        value = value[:1] if isinstance(value, (list, tuple)) else value
        speed = positive(value, at_most=1e7)
        if speed is not None and speed != 65535:
            return speed
    return None


def _balanced_once(value: Any) -> bool | None:
    """From tag 0xA403: 0 is automatic, 1 by hand."""
    tag = number(value)
    return bool(tag) if tag in (0.0, 1.0) else None


def _orientation(value: Any) -> int:
    tag = number(value)
    return int(tag) if tag is not None and tag in range(1, 9) else 1


def _clock(value: Any) -> datetime | None:
    stamp = re.match(r"\s*(\d{4})\D(\d\d)\D(\d\d)\D(\d\d)\D(\d\d)\D(\d\d)", text(value) or "")
    try:
        return datetime.strptime(" ".join(stamp.groups()), "%Y %m %d %H %M %S") if stamp else None
    except ValueError:  # 0000:00:00 00:00:00, the 31st of February
        return None


def _iso_utc(clock: datetime, fraction: str) -> str:
    """ISO with Z; milliseconds where the file gives a fraction of the second, as digits after the point."""
    if not re.fullmatch(r"\d+", fraction):
        return clock.isoformat(timespec="seconds") + "Z"
    clock = clock.replace(microsecond=int(fraction[:6].ljust(6, "0")))
    return clock.isoformat(timespec="milliseconds") + "Z"


def _utc(tags: Mapping[str, Any], local: datetime | None) -> str | None:
    """UTC where it is certain: the clock with its zone; GPS where there is no zone or the two contradict."""
    satellite = _gps_clock(tags)
    zone = re.fullmatch(r"([+-])(\d\d):?(\d\d)|Z", text(tags.get("OffsetTimeOriginal")) or "")
    try:
        if local and zone:
            offset = timedelta()
            if zone.group(1):
                offset = timedelta(hours=int(zone.group(2)), minutes=int(zone.group(3)))
                offset = -offset if zone.group(1) == "-" else offset
            clock = local - offset
            if abs(offset) <= timedelta(hours=14) and (not satellite or abs(clock - satellite) < _STALE_FIX):
                # Exif spells it SubSecTimeOriginal, Pillow SubsecTimeOriginal.
                fraction = text(tags.get("SubSecTimeOriginal", tags.get("SubsecTimeOriginal"))) or ""
                return _iso_utc(clock, fraction)
    except OverflowError:
        pass
    return _iso_utc(satellite, "") if satellite else None


def _gps_clock(tags: Mapping[str, Any]) -> datetime | None:
    day = re.match(r"\s*(\d{4})\D(\d\d)\D(\d\d)", text(tags.get("GPSDateStamp", tags.get("GPSDate"))) or "")
    parts = _three(tags.get("GPSTimeStamp"))
    if not (day and parts):
        return None
    try:
        midnight = datetime.strptime(" ".join(day.groups()), "%Y %m %d")
    except ValueError:
        return None
    seconds = 3600 * parts[0] + 60 * parts[1] + parts[2]
    return midnight + timedelta(seconds=round(seconds)) if 0 <= seconds < 86401 else None


def _site(tags: Mapping[str, Any]) -> tuple[float, float] | None:
    """Latitude (north positive) and longitude (east positive) [degrees]."""
    angles = []
    for name, positive_letter, negative_letter in (("GPSLatitude", "N", "S"), ("GPSLongitude", "E", "W")):
        parts, letter = _three(tags.get(name)), (text(tags.get(name + "Ref")) or "")[:1].upper()
        if parts is None or letter not in (positive_letter, negative_letter) or not letter:
            return None
        angle = parts[0] + parts[1] / 60 + parts[2] / 3600
        angles.append(-angle if letter == negative_letter else angle)
    return _place(*angles)


def _three(value: Any) -> tuple[float, float, float] | None:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        return None
    parts = [number(part) for part in value]
    first, second, third = parts
    if first is None or second is None or third is None or min(first, second, third) < 0:
        return None
    return first, second, third


def _degrees(value: Any) -> float | None:
    """Degrees from a number or from sexagesimal text such as "-10 56 38.4" or "37:03:22"."""
    if isinstance(value, str):
        parts = re.fullmatch(r"\s*([+-]?)(\d+)(?:[\s:d°]+(\d+)[\s:m']*(\d*\.?\d*)[s\"]*)?(\.\d+)?\s*", value)
        if not parts:
            return None
        sign, whole, minutes, seconds, fraction = parts.groups()
        angle = float(whole + (fraction or "")) + float(minutes or 0) / 60 + float(seconds or 0) / 3600
        return -angle if sign == "-" else angle
    return number(value)


def _place(latitude: float | None, longitude: float | None) -> tuple[float, float] | None:
    """The pair where both are angles on the Earth; exactly (0, 0) is what a phone without a fix writes."""
    if latitude is None or longitude is None or abs(latitude) > 90 or not -180 <= longitude <= 360:
        return None
    longitude = longitude - 360 if longitude > 180 else longitude
    return None if latitude == longitude == 0 else (latitude, longitude)
