"""The Canon series of 2015-09-28: do its photographs agree, and how near to them does the model come?

    python -m benchmarks.series_2015                # a quarter of an hour; wants the photographs (`inverse.catalogue`)
    python -m benchmarks.series_2015 --draws 0      # by Laplace's approximation alone

All 18 together, and four of totality each by itself: optical depths, and how many standard deviations they are apart.
Then the misfit of the joint fit, rms of the log brightness over cells of the disc whose noise is below a tenth, beside
the floor: what is left of the same cells by the best smooth function of the offset from the shadow's axis in each
photograph and channel, times the model's map of the Moon. Writes benchmarks/results/series_2015.json.
"""

import argparse
import json
from itertools import combinations
from typing import Any

import numpy as np
from scipy.interpolate import make_lsq_spline

from benchmarks.measure import RESULTS
from eclipsejax import session
from inverse.catalogue import Entry, catalogue, photograph
from inverse.fit import fit_atmosphere
from inverse.result import Fit, PhotoFit

SERIES = "2015-09-28-canon-t2i/"
SINGLE = ("IMG_8672.jpg", "IMG_8718.jpg", "IMG_8742.jpg", "IMG_8757.jpg")
CLOCK = 240.0  # s: as little is believed of the catalogue's times, that the fit may say what is wrong with them
KNOTS = 8  # of the smooth function
WANTED_RATIO, WANTED_FLOOR, WANTED_APART = 1.25, 0.12, 2.0
CHANNELS = ("red", "green", "blue")


def fitted(entries: list[Entry], draws: int | None) -> Fit:
    """The fit of some photographs, of one clock."""
    return fit_atmosphere(
        [photograph(entry.file) for entry in entries], time=entries[0].utc, clock=CLOCK, draws=draws
    )  # fmt: skip


def floor_of(offset: np.ndarray, log_light: np.ndarray) -> np.ndarray:
    """What the best cubic spline of the offset leaves of the log of the light (cell,)."""
    order = np.argsort(offset)
    x, y = offset[order] + 1e-12 * np.arange(offset.size), log_light[order]
    inner = np.quantile(x, np.linspace(0.0, 1.0, KNOTS)[1:-1])
    left = np.empty_like(y)
    left[order] = y - make_lsq_spline(x, y, np.r_[[x[0]] * 4, inner, [x[-1]] * 4])(x)
    return left


def misfits(photo: PhotoFit) -> dict[str, dict[str, Any]]:
    """By channel: cells with enough signal, rms of the misfit and of the floor."""
    found = {}
    for index, channel in enumerate(CHANNELS):
        observed, predicted = photo.observed[:, index], photo.predicted[:, index]
        good = photo.bright[:, index]
        if good.sum() < 4 * KNOTS:
            continue
        missed = np.log(observed[good] / predicted[good])
        left = floor_of(photo.offset[good], np.log(observed[good] / photo.albedo[good]))
        found[channel] = {"cells": int(good.sum()), "misfit": rms(missed), "floor": rms(left)}
    return found


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def log_depth(fit: Fit) -> tuple[float, float]:
    """Mean and standard deviation of the log of the optical depth."""
    values = np.log(fit.draws["stratospheric_optical_depth"].ravel())
    return float(values.mean()), float(values.std())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, metavar="N", help="as of fit_atmosphere")
    options = parser.parse_args()
    session.start()
    entries = [entry for entry in catalogue() if entry.file.startswith(SERIES)]
    joint = fitted(entries, options.draws)
    fits = {"all": joint}
    for entry in entries:
        if entry.file.removeprefix(SERIES) in SINGLE:
            fits[entry.file.removeprefix(SERIES)] = fitted([entry], options.draws)
    depths = {name: log_depth(fit) for name, fit in fits.items()}
    apart = {
        f"{one}, {other}": abs(depths[one][0] - depths[other][0]) / float(np.hypot(depths[one][1], depths[other][1]))
        for one, other in combinations(fits, 2)
    }
    frames = {photo.name: misfits(photo) for photo in joint.photos}
    channels = {}
    for channel in CHANNELS:
        parts = [frame[channel] for frame in frames.values() if channel in frame]
        cells = np.array([part["cells"] for part in parts])
        whole = {name: float(np.sqrt(np.average([part[name] ** 2 for part in parts], weights=cells)))
                 for name in ("misfit", "floor")}  # fmt: skip
        channels[channel] = {"cells": int(cells.sum()), **whole, "ratio": whole["misfit"] / whole["floor"]}
    clocks = {name: next(one for key, one in fit.estimates.items() if key.endswith(".clock"))
              for name, fit in fits.items()}  # fmt: skip
    found = {
        "draws": options.draws,
        "optical depth": {name: fit.estimates["stratospheric_optical_depth"].ci95 for name, fit in fits.items()},
        "clock [s]": {name: [clock.map, clock.sd] for name, clock in clocks.items()},
        "standard deviations apart": apart, "channels": channels, "photographs": frames,
        "seconds": {name: fit.diagnostics["seconds"] for name, fit in fits.items()},
        "method": {name: fit.diagnostics["method"] for name, fit in fits.items()},
    }  # fmt: skip
    (RESULTS / "series_2015.json").write_text(json.dumps(found, indent=1) + "\n")
    for name, (low, high) in found["optical depth"].items():
        print(f"{name:<14}optical depth {low:.4f} to {high:.4f} (95 %), {found['method'][name]}, "
              f"clock {clocks[name].map:+.0f} s (+-{clocks[name].sd:.0f}), {found['seconds'][name]:.0f} s")  # fmt: skip
    print(f"furthest apart: {max(apart.values()):.1f} standard deviations (wanted {WANTED_APART:g})")
    for channel, one in channels.items():
        print(
            f"{channel:<6}{one['cells']:>7} cells, misfit {one['misfit']:.3f}, floor {one['floor']:.3f} (wanted "
            f"{WANTED_FLOOR:g}), {one['ratio']:.2f} of it (wanted {WANTED_RATIO:g})"
        )
    good = [one["ratio"] <= WANTED_RATIO and one["floor"] <= WANTED_FLOOR for one in channels.values()]
    return 0 if all(good) and max(apart.values()) <= WANTED_APART else 1


if __name__ == "__main__":
    raise SystemExit(main())
