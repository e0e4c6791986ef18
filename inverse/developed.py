"""Pictures that were developed, by the camera or by a person: JPEG, PNG, TIFF."""

import re
import sys
from pathlib import Path

import numpy as np
import tifffile
from PIL import Image
from PIL.ImageFile import ImageFile
from PIL.JpegImagePlugin import JpegImageFile

from inverse import tone
from inverse.decoded import Decoded, check_size
from inverse.exif import facts, tags_of_file, tags_of_image

_LINEAR_RAW = 34892  # photometric interpretation of demosaiced sensor data, from the DNG standard


def jpeg_or_png(path: Path) -> Decoded:
    with Image.open(path, formats=("JPEG", "PNG")) as image:
        assert isinstance(image, ImageFile)
        check_size(path, image.height, image.width)
        curve, primaries = tone.profile(image.info.get("icc_profile"))
        gamma = image.info.get("gamma")  # PNG's gAMA; 0.45455 is written for sRGB too and decides nothing
        if curve is None and isinstance(gamma, float) and abs(gamma - 1) < 0.01:
            curve = tone.linear
        codes, noise = _codes(path, image), 0.0
        given = facts(tags_of_image(image))  # only now: Pillow decodes a PNG to find its EXIF
        if isinstance(image, JpegImageFile) and image.mode in ("L", "RGB"):
            noise = tone.jpeg_noise(np.broadcast_to(codes, (*codes.shape[:2], 3)), image.quantization, image.layer)
        kind = "PNG" if image.format == "PNG" else "JPEG"
    full_scale = float(np.iinfo(codes.dtype).max)
    return Decoded(codes, given, kind, "srgb", curve, primaries, full_scale=full_scale, noise=noise)


def _codes(path: Path, image: ImageFile) -> np.ndarray:
    """Codes (row, column, 1 or 3) of an image opened by Pillow, over black where it is transparent."""
    if image.mode.startswith("I"):
        return np.asarray(image).astype(np.uint16)[..., None]
    deep = re.fullmatch(r"(RGBA?;16)([BLN])", _raw_mode(image))
    if deep:
        # Pillow keeps the high bytes of 16-bit colour; told the other byte order, it keeps the low ones.
        mode, order = deep.groups()
        if order == "N":  # that of this machine
            order = "L" if sys.byteorder == "little" else "B"
        codes = _bytes_as(path, image.format, mode + order).astype(np.uint16) << 8
        codes |= _bytes_as(path, image.format, mode + ("B" if order == "L" else "L"))
    elif image.mode in ("L", "RGB") and "transparency" not in image.info:
        codes = np.asarray(image)
    elif image.mode == "1":
        codes = np.asarray(image.convert("L"))
    else:
        transparent = image.mode in ("RGBA", "LA", "PA", "RGBa", "La") or "transparency" in image.info
        codes = np.asarray(image.convert("RGBA" if transparent else "RGB"))
    return _over_black(codes if codes.ndim == 3 else codes[..., None])


def _raw_mode(image: ImageFile) -> str:
    arguments = image.tile[0].args if image.tile else ""
    return str(arguments[0] if isinstance(arguments, tuple) else arguments)


def _bytes_as(path: Path, format: str | None, raw_mode: str) -> np.ndarray:
    with Image.open(path, formats=(format or "PNG",)) as image:
        assert isinstance(image, ImageFile)
        tiles = []
        for tile in image.tile:
            rest = tile.args[1:] if isinstance(tile.args, tuple) else None
            tiles.append(tile._replace(args=raw_mode if rest is None else (raw_mode, *rest)))
        image.tile = tiles
        return np.asarray(image)


def _over_black(codes: np.ndarray) -> np.ndarray:
    """Codes (row, column, 1 or 3) from integer codes with or without a last channel of opacity."""
    if codes.shape[2] in (1, 3):
        return codes
    full = np.iinfo(codes.dtype).max
    colour, opacity = codes[..., :-1], codes[..., -1:]
    if (opacity == full).all():
        return np.ascontiguousarray(colour)
    return ((colour.astype(np.uint64) * opacity + full // 2) // full).astype(codes.dtype)


def tiff(path: Path) -> Decoded:
    """TIFF of 8, 16 or 32 bits or of floats.

    Integers of 8 and 16 bits are taken as sRGB unless their colour profile says otherwise or they are tagged
    as sensor data (LinearRaw); many astronomical programs write linear 16-bit files without a tag: say
    `linear=True` for those. Floats and integers of 32 bits are linear; floats above 1 are scaled by their
    maximum.
    """
    with tifffile.TiffFile(path) as file:
        # The first page can be a thumbnail.
        pages = [page for page in file.pages[:16] if isinstance(page, tifffile.TiffPage)]
        if not pages:
            raise ValueError("it holds no picture")
        page = max(pages, key=lambda page: page.imagelength * page.imagewidth * (not page.is_reduced))
        check_size(path, page.imagelength, page.imagewidth)
        samples = page.samplesperpixel * page.imagedepth
        if samples > 5:  # CMYK with opacity; a damaged header has thousands, and memory for them would be taken
            raise ValueError(f"it has {samples} channels")
        curve, primaries = tone.profile(page.tags.valueof("InterColorProfile"))
        if int(page.photometric) == _LINEAR_RAW:
            curve = tone.linear
        given = facts(tags_of_file(path))
        if int(page.photometric) in (0, 1, 2, _LINEAR_RAW):
            try:
                values = _channels_last(page, page.asarray())
            except ValueError as error:
                # tifffile knows few compressions by itself; Pillow's libtiff knows the rest, for integers.
                if "imagecodecs" not in str(error):
                    raise
                values = _by_pillow(path)
        else:  # palette, CMYK, YCbCr
            values = _by_pillow(path)
    if values.dtype in (np.uint8, np.uint16):
        values, full_scale = _over_black(values), float(np.iinfo(values.dtype).max)
        return Decoded(values, given, "TIFF", "srgb", curve, primaries, full_scale=full_scale)
    if values.shape[2] in (2, 4):
        values = values[..., :-1]
    kind, values = values.dtype, values.astype(np.float32)
    if np.issubdtype(kind, np.integer):
        full_scale, step = float(np.iinfo(kind).max), 1.0
    else:
        full_scale, step = scale_of_floats(values), 0.0
    return Decoded(values, given, "TIFF", "linear", None, primaries, full_scale=full_scale, step=step)


def scale_of_floats(values: np.ndarray) -> float:
    """The value that stands for full scale: 1 where nothing is brighter, else the brightest."""
    brightest = float(np.max(values, initial=0.0, where=np.isfinite(values)))
    return 1.0 if brightest <= 1 else brightest


def _channels_last(page: tifffile.TiffPage, values: np.ndarray) -> np.ndarray:
    """(row, column, channel) from a page of any layout, brighter always higher."""
    values = np.squeeze(values, axis=tuple(i for i in range(values.ndim - 2) if values.shape[i] == 1))
    if values.ndim == 2:
        values = values[..., None]
    elif values.shape[:2] != (page.imagelength, page.imagewidth):  # planes one after the other
        values = np.moveaxis(values, 0, -1)
    if int(page.photometric) == 0 and np.issubdtype(values.dtype, np.integer):  # white is zero
        values = np.iinfo(values.dtype).max - values
    if values.shape[2] > 4:
        raise ValueError(f"it has {values.shape[2]} channels")
    if np.iscomplexobj(values):
        raise ValueError("its numbers are complex")
    if values.dtype == bool:
        values = values.astype(np.uint8) * 255
    return values


def _by_pillow(path: Path) -> np.ndarray:
    with Image.open(path, formats=("TIFF",)) as image:
        assert isinstance(image, ImageFile)
        return _codes(path, image)
