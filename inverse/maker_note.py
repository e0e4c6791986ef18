"""The white balance that a camera gave a picture, which EXIF leaves to the maker's own notes.

Automatic balance takes the redness of an eclipsed Moon for that of a lamp: from the partial phase to totality a Canon
550D turned its red down by 29 % and its blue up by 33 %. Of Canon's notes it can be read; of others it stays unknown.
"""

import io
import math

from PIL.TiffImagePlugin import ImageFileDirectory_v2

_COLOUR_DATA = 0x4001
# Where the gains of red, green, green and blue as shot stand in it, for most EOS of 2005-2018, from memory; checked on
# the 550D. Green is 1024 both times, so that another version of the table does not pass for this one.
_AS_SHOT, _GREEN = 63, 1024


def canon_balance(exif: bytes, note: bytes) -> tuple[float, float] | None:
    """Log gains of red and blue against green; None where the notes are not Canon's, or do not tell.

    - `exif`: the block, from its TIFF header, which offsets in the notes count from; `note`: EXIF tag 0x927C.
    """
    start = exif.find(note) if note else -1
    if start < 0:
        return None
    directory = ImageFileDirectory_v2(exif[:8])
    file = io.BytesIO(exif)
    file.seek(start)
    directory.load(file)
    red, *green, blue = directory[_COLOUR_DATA][_AS_SHOT : _AS_SHOT + 4]
    if green != [_GREEN, _GREEN] or min(red, blue) <= 0:
        return None
    return math.log(red / _GREEN), math.log(blue / _GREEN)
