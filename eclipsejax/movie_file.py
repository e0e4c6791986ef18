"""Frames of a film: the writing in them, and the file, MP4 or GIF."""

import subprocess
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import chain
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from eclipsejax.errors import InputError

Frame = UInt8[np.ndarray, "row column 3"]

TYPE = 36  # the height of the picture over that of the type
LEAST_TYPE = 10  # pixels


def captioned(frame: Frame, upper: str, lower: str) -> Frame:
    """The frame with a line of small type in its upper and one in its lower left corner."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(frame)
    size = max(round(picture.height / TYPE), LEAST_TYPE)
    draw, font, margin = ImageDraw.Draw(picture), _font(size), size // 2
    draw.text((margin, margin), upper, fill=(170, 170, 170), font=font, anchor="lt")
    draw.text((margin, picture.height - margin), lower, fill=(170, 170, 170), font=font, anchor="ls")
    return np.asarray(picture)


@cache
def _font(size: int):
    from PIL import ImageFont

    return ImageFont.load_default(size)  # Aileron, bundled with Pillow


def write_movie(path: Path, frames: Iterable[Frame], fps: float) -> int:
    """Write frames as they come, as MP4 (H.264) or GIF by the name's ending; returns their number.

    MP4 takes even sizes. GIF has 256 colours for each frame, shows each for a multiple of 10 ms, and keeps all frames
    in memory until the last has come.
    """
    return (_write_gif if path.suffix.lower() == ".gif" else _write_mp4)(path, iter(frames), fps)


def check_writer(path: Path) -> None:
    """Before the work: raise `InputError` if what writes such a file is not installed."""
    if path.suffix.lower() != ".gif":
        try:
            import imageio_ffmpeg  # noqa: F401
        except ImportError:
            raise InputError(
                f"{path} needs imageio-ffmpeg: pip install 'eclipsejax[movie]', or name a file that ends in .gif."
            ) from None


def _write_mp4(path: Path, frames: Iterator[Frame], fps: float) -> int:
    from imageio_ffmpeg import get_ffmpeg_exe

    first = next(frames, None)
    if first is None:
        return 0
    # The colours of the picture are those of BT.709; players take an untagged small film for BT.601.
    colours = "-colorspace bt709 -color_primaries bt709 -color_trc bt709 -color_range tv"
    command = [get_ffmpeg_exe(), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{first.shape[1]}x{first.shape[0]}", "-r", f"{fps:g}", "-i", "-"]
    command += ["-vf", "scale=out_color_matrix=bt709:out_range=tv", "-pix_fmt", "yuv420p", *colours.split()]
    command += ["-c:v", "libx264", "-crf", "16", "-movflags", "+faststart", str(path)]
    # Not through imageio_ffmpeg.write_frames: that forks, which JAX's threads may not survive. In a group of its own
    # Ctrl-C does not reach it, and it ends the file properly.
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, process_group=0) as encoder:
        assert encoder.stdin and encoder.stderr
        count = 0
        try:
            for frame in chain([first], frames):
                encoder.stdin.write(frame.tobytes())
                count += 1
            encoder.stdin.close()
        except BrokenPipeError:
            pass  # what it says tells why
        except BaseException:
            encoder.kill()
            raise
        said = encoder.stderr.read().decode(errors="replace").strip()
    if encoder.returncode:
        raise OSError(said.splitlines()[-1] if said else f"ffmpeg ended with status {encoder.returncode}")
    return count


def _write_gif(path: Path, frames: Iterator[Frame], fps: float) -> int:
    from PIL import Image

    pictures = [Image.fromarray(frame).quantize(256, dither=Image.Dither.NONE) for frame in frames]
    if pictures:
        duration = max(10 * round(100.0 / fps), 20)  # faster ones are shown slowly by most programs
        pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=duration, loop=0, format="GIF")
    return len(pictures)
