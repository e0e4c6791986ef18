"""Which reader a file needs, and one sentence where none can read it.

The kind is told from the first bytes, not from the suffix, except where camera RAW disguises itself as TIFF.
Each reader checks the size in the header before it decodes a pixel.
"""

import logging
import os
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import tifffile
from PIL import Image

from eclipsejax.errors import InputError
from inverse.decoded import MAXIMUM_PIXELS, Decoded, too_large
from inverse.developed import jpeg_or_png, tiff
from inverse.sensor import camera_raw, fits

_RAW_SUFFIXES = frozenset(
    (
        ".3fr .arw .cr2 .cr3 .crw .dcr .dng .erf .fff .iiq .kdc .mef .mos .mrw .nef .nrw .orf .pef .raf .rw2 "
        ".rwl .sr2 .srf .srw .x3f"
    ).split()
)
_FITS_SUFFIXES = frozenset((".fits", ".fit", ".fts"))
SUFFIXES = frozenset((".jpg", ".jpeg", ".png", ".tif", ".tiff")) | _FITS_SUFFIXES | _RAW_SUFFIXES
_RAW_HEADS = (b"FUJIFILMCCD-RAW", b"IIU\0", b"IIRO", b"IIRS", b"MMOR", b"FOVb")
_TIFF_HEADS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_DNG_VERSION = 50706

for _name in ("tifffile", "exifread"):  # what they would print of a damaged file is said in one sentence
    logging.getLogger(_name).addHandler(logging.NullHandler())


def decode(path: Path, head: bytes) -> Decoded:
    """Decodes `path`, whose first bytes are `head`; `InputError` where that cannot be done."""
    name, reader = _kind(path, head)
    try:
        with warnings.catch_warnings(), _no_words_on_stderr():
            warnings.simplefilter("ignore")  # Pillow's on size, tifffile's and astropy's on sloppy headers
            return reader(path)
    except InputError:
        raise
    except Image.DecompressionBombError as error:  # Pillow's own limit, above ours
        pixels = re.search(r"(\d+) pixels", str(error))
        raise too_large(path, int(pixels.group(1)) if pixels else 2 * MAXIMUM_PIXELS) from None
    except MemoryError:
        raise InputError(f"{path} does not fit in memory: crop it to the Moon.") from None
    except Exception as error:  # decoders of foreign code raise anything on a damaged file
        text = error.args[0] if error.args else ""
        text = text.decode(errors="replace") if isinstance(text, bytes) else str(error)
        reason = " ".join(text.split()).strip(" .") or type(error).__name__
        raise InputError(
            f"{path} cannot be read as {name}: it is damaged, cut short or of a rare kind ({reason})."
        ) from None


@contextmanager
def _no_words_on_stderr() -> Iterator[None]:
    """libtiff and LibRaw write of a damaged file to the process's stderr: what is wrong is said in one sentence."""
    try:
        kept = os.dup(2)
    except OSError:  # there is none
        yield
        return
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _kind(path: Path, head: bytes) -> tuple[str, Callable[[Path], Decoded]]:
    suffixes = [suffix.lower() for suffix in path.suffixes]
    suffix = suffixes[-1] if suffixes else ""
    if head.startswith(_RAW_HEADS) or (head[4:8] == b"ftyp" and head[8:11] == b"crx"):
        return "camera RAW", camera_raw
    if head.startswith(_TIFF_HEADS):
        if suffix in _RAW_SUFFIXES or head[8:10] == b"CR" or _is_dng(path):
            return "camera RAW", camera_raw
        return "TIFF", tiff
    if head.startswith(b"\xff\xd8\xff"):
        return "JPEG", jpeg_or_png
    if head.startswith(b"\x89PNG\r\n\x1a\n"):
        return "PNG", jpeg_or_png
    packed = head.startswith(b"\x1f\x8b") and not _FITS_SUFFIXES.isdisjoint(suffixes)
    if head.startswith(b"SIMPLE  =") or packed:
        return "FITS", fits
    if head[4:8] == b"ftyp":
        raise InputError(f"{path} is HEIC, AVIF or video, which is not supported: export it as JPEG or TIFF.")
    if suffix in _RAW_SUFFIXES:
        return "camera RAW", camera_raw
    raise InputError(f"{path} is not an image of a supported kind (JPEG, PNG, TIFF, FITS, camera RAW).")


def _is_dng(path: Path) -> bool:
    try:
        with tifffile.TiffFile(path) as file:
            return _DNG_VERSION in file.pages.first.tags
    except Exception:  # damaged: the TIFF reader will say so
        return False
