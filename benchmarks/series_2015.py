"""The Canon series of 2015-09-28: do its photographs agree, and how near to them does the model come?

    python -m benchmarks.series_2015                # wants the photographs (`inverse.catalogue`)
    python -m benchmarks.series_2015 --draws 0      # all of them by Laplace's approximation: a quarter of an hour

All 18 together, and four of totality each by itself, as users get them fitted: optical depths, and how many standard
deviations they are apart. Then the misfit of the joint fit, rms of the log brightness over cells of the disc whose
noise is below a tenth, beside the floor: what is left of the same cells by the best smooth function of the offset from
the shadow's axis in each photograph and channel, times the model's map of the Moon. And the same of an uneven limb: the
misfit less the errors that the photographs share, beside the floor where one function of the place in the shadow is
taken away from all of them. Last, how much of the misfits goes with that place, and how much with the place on the
Moon; and the misfits by place, which `notebooks/real_photographs.ipynb` draws. Writes
benchmarks/results/series_2015.json.
"""

import argparse
import json
from itertools import combinations

import numpy as np

from benchmarks.measure import RESULTS
from benchmarks.shared_misfits import KNOTS, Seen, beside_offset, beside_shadow, by_place, rms, variances
from eclipsejax import session
from inverse.catalogue import Entry, catalogue, photograph
from inverse.error_modes import MOON
from inverse.fit import fit_atmosphere
from inverse.result import Fit, PhotoFit

SERIES = "2015-09-28-canon-t2i/"
SINGLE = ("IMG_8672.jpg", "IMG_8718.jpg", "IMG_8742.jpg", "IMG_8757.jpg")
CLOCK = 240.0  # s: as little is believed of the catalogue's times, that the fit may say what is wrong with them
WANTED_RATIO, WANTED_FLOOR, WANTED_APART = 1.25, 0.12, 2.0
CHANNELS = ("red", "green", "blue")


def fitted(entries: list[Entry], draws: int | None = None) -> Fit:
    """The fit of some photographs, of one clock."""
    return fit_atmosphere(
        [photograph(entry.file) for entry in entries], time=entries[0].utc, clock=CLOCK, draws=draws
    )  # fmt: skip


def part_of(photo: PhotoFit, index: int) -> dict[str, np.ndarray] | None:
    """Of one channel, the cells with enough signal; None where they are too few.

    `shadow`, `moon`: where they lie; `light`, log of the light by the map's albedo; `missed`, log of observed by
    predicted, and `left`, the same less the errors that the photographs share.
    """
    good = photo.bright[:, index]
    if good.sum() < 4 * KNOTS or photo.shadow is None or photo.shared is None:
        return None
    observed, predicted = photo.observed[good, index], photo.predicted[good, index]
    missed = np.log((observed + photo.floor) / (predicted + photo.floor))
    return {
        "shadow": photo.shadow[good],
        "moon": (photo.shadow[good] - photo.shadow[photo.on_disc].mean(axis=0)) / MOON,
        "light": np.log(observed / photo.albedo[good]),
        "missed": missed,
        "left": missed - photo.shared[good, index],
    }


def told(parts: list[dict[str, np.ndarray]]) -> dict[str, float]:
    """Of one channel: cells, and rms of misfits and floors over all of them."""
    seen = [Seen(part["shadow"], part["moon"], part["light"]) for part in parts]
    misfit, left = (rms(np.concatenate([part[name] for part in parts])) for name in ("missed", "left"))
    floor = rms(np.concatenate([beside_offset(one.offset, one.log_light) for one in seen]))
    uneven = rms(beside_shadow(seen))
    return {
        "cells": sum(one.log_light.size for one in seen), "misfit": misfit, "floor": floor, "uneven misfit": left,
        "uneven floor": uneven,
    }  # fmt: skip


def log_depth(fit: Fit) -> tuple[float, float]:
    """Mean and standard deviation of the log of the optical depth."""
    values = np.log(fit.draws["stratospheric_optical_depth"].ravel())
    return float(values.mean()), float(values.std())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, metavar="N", help="of the fit of all; as of fit_atmosphere")
    options = parser.parse_args()
    session.start()
    entries = [entry for entry in catalogue() if entry.file.startswith(SERIES)]
    joint = fitted(entries, options.draws)
    fits = {"all": joint}
    for entry in entries:
        if entry.file.removeprefix(SERIES) in SINGLE:
            fits[entry.file.removeprefix(SERIES)] = fitted([entry])
    depths = {name: log_depth(fit) for name, fit in fits.items()}
    apart = {
        f"{one}, {other}": abs(depths[one][0] - depths[other][0]) / float(np.hypot(depths[one][1], depths[other][1]))
        for one, other in combinations(fits, 2)
    }
    channels, shares, places, frames = {}, {}, {}, {}
    for index, channel in enumerate(CHANNELS):
        parts = {photo.name: part for photo in joint.photos if (part := part_of(photo, index)) is not None}
        channels[channel] = told(list(parts.values()))
        for limb in ("", "uneven "):
            channels[channel][f"{limb}ratio"] = channels[channel][f"{limb}misfit"] / channels[channel][f"{limb}floor"]
        missed = [Seen(part["shadow"], part["moon"], part["missed"]) for part in parts.values()]
        shares[channel], places[channel] = variances(missed), by_place(missed)
        for name, part in parts.items():
            frames.setdefault(name, {})[channel] = {
                "cells": part["missed"].size, "misfit": rms(part["missed"]), "uneven misfit": rms(part["left"])
            }  # fmt: skip
    clocks = {name: next(one for key, one in fit.estimates.items() if key.endswith(".clock"))
              for name, fit in fits.items()}  # fmt: skip
    found = {
        "draws": options.draws,
        "optical depth": {name: fit.estimates["stratospheric_optical_depth"].ci95 for name, fit in fits.items()},
        "clock [s]": {name: [clock.map, clock.sd] for name, clock in clocks.items()},
        "standard deviations apart": apart, "channels": channels, "variance of misfits": shares,
        "misfits by place in the shadow": places,
        "photographs": frames,
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
            f"{channel:<6}{one['cells']:>7.0f} cells, misfit {one['misfit']:.3f}, {one['ratio']:.2f} times the floor "
            f"{one['floor']:.3f} (wanted {WANTED_RATIO:g}); of an uneven limb {one['uneven misfit']:.3f}, "
            f"{one['uneven ratio']:.2f} times {one['uneven floor']:.3f} (floor wanted {WANTED_FLOOR:g})"
        )
    for channel, one in shares.items():
        between = one["between"]
        print(
            f"{channel:<6}variance of misfits between photographs {between['shadow']:.3f} by the place in the shadow, "
            f"{between['moon']:.3f} by that on the Moon; within one {one['within']['all']:.3f}"
        )
    good = [
        max(one["ratio"], one["uneven ratio"]) <= WANTED_RATIO and one["uneven floor"] <= WANTED_FLOOR
        for one in channels.values()
    ]
    return 0 if all(good) and max(apart.values()) <= WANTED_APART else 1


if __name__ == "__main__":
    raise SystemExit(main())
