"""`eclipsejax render`: one picture of an eclipse."""

from argparse import Namespace
from pathlib import Path

from eclipsejax import session
from eclipsejax.commands import options as shared
from eclipsejax.commands.output import check_writable, whole_file
from eclipsejax.errors import InputError

SUFFIXES = (".png", ".tif", ".tiff")


def add_to(commands) -> None:
    """Describe the command to the parser."""
    command = commands.add_parser(
        "render",
        help="render a picture of an eclipse",
        description="Render the eclipsed Moon at a time, as PNG or as linear 16-bit TIFF (sRGB primaries).",
    )
    command.set_defaults(action=_render)
    add = command.add_argument
    add("utc", metavar="UTC", help="time with its zone, such as 2008-02-21T03:26Z")
    add("-o", dest="output", required=True, type=Path, metavar="FILE", help=", ".join(SUFFIXES))
    shared.add_site(command)
    shared.add_air(command)
    shared.add_scattered(command)
    command.add_argument("--flattened", action="store_true", help="the shadow of the flattened Earth, not of a ball")
    number, add = session.number, shared.add_camera(command, size=512).add_argument
    add("--exposure", type=number(1e-6, 1e4), metavar="SECONDS", help="such as 4 or 1/60")
    add("--f-number", type=number(0.1, 1e3), metavar="N", help="with --exposure")
    add("--iso", type=number(1, 1e7), metavar="N", help="with --exposure")
    brightness = "instead of an exposure: 1 shows the full Moon at full scale; default: what shows this Moon"
    add("--gain", type=number(1e-6, 1e12), metavar="X", help=brightness)


def _render(options: Namespace) -> None:
    check_writable(options.output, SUFFIXES, "picture")
    shot = (options.exposure, options.f_number, options.iso)
    if any(x is not None for x in shot) and (None in shot or options.gain is not None):
        raise InputError("--exposure, --f-number and --iso belong together, without --gain: give all three or none.")
    session.start(keep_compiled=False)
    import jax.numpy as jnp
    import numpy as np

    from eclipsejax.camera import Exposure
    from eclipsejax.response import bright_gain, into_gamut
    from eclipsejax.scene import Scene
    from eclipsejax.snapshot import snapshot

    parts = {"camera": shared.camera(options), "scatterers": shared.scatterers(options), "flattened": options.flattened}
    scene = Scene.at(options.utc.strip(), *(options.site or ()), **parts)
    limb = shared.atmosphere(options)
    taken = snapshot(scene, limb, options.tolerance, session.cache_folder("programs"))
    image = np.asarray(taken.image)

    if options.exposure is not None:
        gain = float(Exposure(*shot).scale()[0])
        print(f"A full Moon would be at {gain:.3g} of full scale.")
    else:
        gain = options.gain or bright_gain(image)
        print(f"The Moon is brightened {f'{gain:,.0f}' if gain >= 10 else f'{gain:g}'} times.")

    seen = taken.brightness
    line = f"The whole Moon is dimmed by {seen.dimming:.1f} mag, to magnitude {seen.magnitude:.1f}"
    # Danjon's number is for a Moon that is wholly in the umbra.
    if taken.within_umbra:
        line += f"; Danjon's L would be {seen.danjon:.1f}"
    print(f"{line}.")

    with whole_file(options.output) as path:
        if path.suffix.lower() == ".png":
            from PIL import Image

            Image.fromarray(np.asarray(taken.developed(taken.image, jnp.asarray(gain)))).save(path)
        else:
            import tifffile

            linear = np.round(65535 * np.asarray(into_gamut(gain * image))).astype(np.uint16)
            tifffile.imwrite(path, linear, photometric="rgb")
    rows, columns = scene.camera.shape
    print(f"Wrote {options.output}: {scene.geometry.utc}, {columns} x {rows} pixels.")
