"""The command `fit_atmosphere`: from a photograph of a lunar eclipse to the dust in the air that coloured it."""

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from eclipsejax import session
from eclipsejax.errors import InputError
from inverse.archive import command as archive_command
from inverse.progress_bars import Bars

DEMO_PHOTOGRAPH = "2022-05-16-newtonian/final.png"
DEMO_DISC, DEMO_TIME, DEMO_SITE = 4, "2022-05-16T04:06:00Z", (-10.944, -37.056)
DEMO_PROFILE = "2022-05-16-profile.csv"
NOT_CONVERGED = 3
RELATIVE, FREE, ERRORS = "relative", "free", (0.05, 3.0)  # ln, of exposures
UNKNOWN, CLOCKS = "unknown", (0.1, 86400.0)  # s: the day is believed


class NotConverged(Exception):
    """The optimiser gave up, once at least; what it found was written all the same."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status: 0, 2 for what cannot be used, 3 for a fit that did not converge."""
    try:
        return session.run("fit_atmosphere", partial(_command, arguments))
    except NotConverged:
        return NOT_CONVERGED


def _command(arguments: Sequence[str] | None) -> None:
    session.one_blas_thread()
    options = _parser().read(arguments)
    if options.archive is not None:
        if not archive_command.archive(options):
            raise NotConverged
        return
    if bool(options.photographs) == options.demo:
        raise InputError("Name photographs of one eclipse, or give --demo for an example (see fit_atmosphere --help).")
    out = Path(options.out)
    if out.exists() and not out.is_dir():
        raise InputError(f"The report cannot be written to {out}, which is a file: give --out a folder.")
    try:
        out.mkdir(parents=True, exist_ok=True)  # before the work, not after it
    except OSError as error:
        raise InputError(f"The folder {out} cannot be made ({error.strerror}): give --out another place.") from None
    session.start()
    from inverse.camera_colours import ASSUMED
    from inverse.fit import fit_atmosphere
    from inverse.report import text_report

    photographs, time, site, disc = options.photographs, options.time, options.site, options.disc
    if options.demo:
        photographs, time, site, disc = _demo()
    chain = out / "chain.h5"
    if options.resume and not chain.exists():
        print(f"There is no {chain} to go on with: the fit begins anew.")
    try:
        with Bars() as bars:
            fit = fit_atmosphere(
                photographs, time=time, site=site, disc=disc, clock=options.clock,
                exposure=options.exposure or RELATIVE, response=options.response or ASSUMED,
                draws=options.draws, seed=options.seed, chain=chain, resume=options.resume,
                progress=lambda now: bars(now.stage, now.done, now.total),
            )  # fmt: skip
    except KeyboardInterrupt:
        if chain.exists():
            print(f"Stopped: the same command with --resume goes on from {chain}.", file=sys.stderr)
        raise
    print(text_report(fit))
    for path in fit.save(out):
        print(f"Wrote {path}")
    if not fit.diagnostics["converged"]:
        raise NotConverged


def _parser() -> session.Arguments:
    parser = session.Arguments(
        prog="fit_atmosphere",
        description="Infer the stratospheric dust, surface temperature and surface pressure of the air along the "
        "Earth's limb from photographs of one lunar eclipse (JPEG, PNG, TIFF, FITS, camera RAW), or from a measured "
        "profile (CSV).",
    )
    add = parser.add_argument
    add("photographs", nargs="*", metavar="PHOTO", help="photographs of one eclipse, or profiles (.csv)")
    add("--demo", action="store_true", help="fit the eclipse of 2022-05-16 as an example")
    add("--time", action="append", metavar="UTC", help="such as 2022-05-16T04:06:00Z; once for each photograph, "
        "or once for the first where the others' clocks are known relative to its")  # fmt: skip
    add("--site", type=session.site, metavar="LAT,LON[,HEIGHT]", help="of the camera [degrees, north and east; m]")
    add("--disc", type=int, metavar="N", help="which of several discs in the picture, in reading order from 1")
    add("--clock", type=_clock, metavar="SECONDS", help="standard deviation of the error of the times, default 60; or "
        "unknown: the time is searched over the eclipse by the shadow's place on the Moon")  # fmt: skip
    add("--exposure", type=_exposure, metavar="ERROR", help="of what files state: "
        f"{RELATIVE} (default), those of a camera against each other; {FREE}: nothing; or the error of the light that "
        "shutter, focal ratio and ISO tell, such as 0.25")  # fmt: skip
    add("--response", metavar="CSV", help="spectral sensitivities of the camera: wavelength [nm], red, green, blue; "
        "default: those of a Nikon D5100")  # fmt: skip
    add("--out", default="out", metavar="DIR", help="folder of the report; default out")
    add(
        "--draws",
        type=int,
        metavar="N",
        help="sample the posterior with N draws at most, 0 for Laplace's approximation alone; by default that "
        "approximation is corrected where it can be, and else sampled until it can be believed",
    )
    add("--seed", type=int, default=0, metavar="N", help="of the sampler")
    add("--resume", action="store_true", help="go on with the sampling that was interrupted, from chain.h5 in DIR")
    archive_command.add_to(parser)
    return parser


def _clock(text: str) -> float | str:
    """Type of the option: a number, or the word."""
    return UNKNOWN if text.strip().lower() == UNKNOWN else session.number(*CLOCKS)(text)


def _exposure(text: str) -> float | str:
    """Type of the option: a word, or a number."""
    word = text.strip().lower()
    return word if word in (RELATIVE, FREE) else session.number(*ERRORS)(text)


def _demo():
    """The photograph where it can be had, else the profile measured from it."""
    from inverse.catalogue import data_file, photograph

    try:
        path = photograph(DEMO_PHOTOGRAPH)
    except InputError as error:
        print(f"{error} The brightness profile measured from it takes its place.")
        return [data_file(DEMO_PROFILE)], None, DEMO_SITE, None
    return [path], DEMO_TIME, DEMO_SITE, DEMO_DISC


if __name__ == "__main__":
    raise SystemExit(main())
