"""What the commands `eclipsejax` and `fit_atmosphere` share: set-up of JAX, options, and how they end."""

import argparse
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from eclipsejax.errors import InputError

XLA_KNOWN = (0, 10)  # version of jaxlib
FEW_EMITTERS = "--xla_cpu_use_fusion_emitters=false"


def start(keep_compiled: bool = True) -> None:
    """Float64, and compiled code kept on disk from one run to the next; before anything is computed.

    In `$JAX_COMPILATION_CACHE_DIR`, else `$XDG_CACHE_HOME/eclipsejax/jax`, else `~/.cache/eclipsejax/jax`; nowhere, if
    that cannot be made.

    - `keep_compiled`: False for a command that keeps whole programs (`programs`), which cannot be had from JAX's cache.
    """
    one_blas_thread()
    import jax

    compile_quickly()
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_enable_compilation_cache", keep_compiled)
    folder = cache_folder("jax", os.environ.get("JAX_COMPILATION_CACHE_DIR"))
    if folder is None:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    # One for each program that cannot be kept, or that another process has written half of: it is compiled anew.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache", UserWarning)


def cache_folder(name: str, chosen: str | None = None) -> Path | None:
    """A folder for what is kept from one run to the next, the one `chosen` if any; None if it cannot be made."""
    try:
        folder = Path(chosen or os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
        folder = folder if chosen else folder / "eclipsejax" / name
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # a home that is unknown
        return None
    return folder


def one_blas_thread() -> None:
    """Keep NumPy's linear algebra to one thread, unless the user has chosen; before NumPy is loaded.

    Our matrices are small, and threads that wait for work take the processor from the rest: a second photograph was
    fitted in 8 s instead of 23 on two cores.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def compile_quickly() -> None:
    """Halve the time that JAX takes to compile for a processor; before anything is computed.

    Without XLA's fusion emitters our programs compile in half the time and most run as fast (within 10 %); only large
    pictures take up to twice as long, a tenth of a second each, which a command that compiles for seconds earns back.
    Only where XLA is known to have that option: it ends the process for one that it does not know.
    """
    given = os.environ.get("XLA_FLAGS", "")
    known = tuple(int(part) for part in version("jaxlib").split(".")[:2]) == XLA_KNOWN
    if known and FEW_EMITTERS not in given:
        os.environ["XLA_FLAGS"] = f"{FEW_EMITTERS} {given}"  # what the user gives comes last, and counts


class Arguments(argparse.ArgumentParser):
    """A parser that says what is wrong in one sentence, and takes `-1000` and `-10.94,-37.06` for values."""

    def read(self, arguments: Sequence[str] | None) -> argparse.Namespace:
        """The options in a command's arguments; None for those of this process."""
        # A leading space keeps a text from being taken for an option; whatever reads a number ignores it.
        given = sys.argv[1:] if arguments is None else arguments
        return self.parse_args([" " + text if re.match(r"-\.?\d", text) else text for text in given])

    def error(self, message: str):
        raise InputError(f"{message} (see {self.prog} --help).")


def run(program: str, action: Callable[[], None]) -> int:
    """Exit status of an action: 0, or 2 after one sentence on what cannot be used, 130 after Ctrl-C."""
    try:
        action()
        sys.stdout.flush()
    except InputError as error:
        print(f"{program}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader, such as `head`, has seen enough; nothing is left to flush at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def number(least: float, most: float) -> Callable[[str], float]:
    """Type of an option: a number, or a fraction such as 1/60, between two bounds."""

    def read(text: str) -> float:
        numerator, _, denominator = text.partition("/")
        try:
            value = float(numerator) / float(denominator or 1.0)
        except (ValueError, ZeroDivisionError):
            raise argparse.ArgumentTypeError(f"{text.strip()!r} is not a number") from None
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text.strip()} is outside {least:g} to {most:g}")
        return value

    return read


def site(text: str) -> tuple[float, ...]:
    """Type of an option: LAT,LON or LAT,LON,HEIGHT [degrees, degrees, m], as `geometry` takes them."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) not in (2, 3):
        raise argparse.ArgumentTypeError(
            f"{text.strip()!r} is not LAT,LON[,HEIGHT], such as 42.73,-73.68 (degrees, north and east)"
        )
    return values
