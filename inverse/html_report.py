"""The report of a fit for a person to read: one file with everything, from a sentence to what reproduces it."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from eclipsejax.whole_file import whole_file
from inverse.corner_plot import METHODS
from inverse.further import in_words as further_in_words
from inverse.html_page import folded, heading, listed, page, paragraph, picture, table
from inverse.information import NOT_INFORMED, in_words, independent_in_words
from inverse.misfit_check import all_unexplained
from inverse.result import Estimate, Fit

PINATUBO = (0.10, 0.15)  # optical depth of the stratosphere in the two years after June 1991
CAPTIONS = {
    "fit": "Photograph, model and the logarithm of their ratio (red: the model is too dark).",
    "profile": "Brightness and colour against the distance from the shadow's axis; the bands hold the posterior.",
    "corner": "Posterior of the limb, pair by pair, with the prior on the diagonal.",
}


def write_html(fit: Fit, folder: str | Path, pictures: Sequence[Path]) -> Path:
    """Writes `report.html` into an existing folder, and returns its path.

    - `pictures`: PNG files, as `report.write_pictures` wrote them, which are put into it.
    """
    path = Path(folder) / "report.html"
    # A file name that is no Unicode has half characters in it, which no file can hold.
    with whole_file(path) as part:
        part.write_text(html_report(fit, pictures), encoding="utf-8", errors="replace")
    return path


def html_report(fit: Fit, pictures: Sequence[Path] = ()) -> str:
    """The whole document."""
    names = ", ".join(photo.name for photo in fit.photos)
    return page(
        f"Stratospheric dust from {names}",
        [
            heading(f"Stratospheric dust from {names}", 1),
            paragraph(plain_sentence(fit), "result"),
            *(paragraph(f"Do not rely on this number. {doubt}", "warning") for doubt in doubts(fit)),
            paragraph(fit.sentence()),
            *([heading("Warnings"), listed(fit.warnings, "warning")] if fit.warnings else []),
            heading("Pictures"),
            *(picture(path, CAPTIONS.get(path.stem.split("-")[0], path.stem)) for path in pictures),
            *_limb(fit),
            *_learnt(fit.diagnostics),
            *_further(fit.diagnostics.get("further_photographs")),
            *_errors(fit),
            *_drawing(fit.diagnostics),
            *_nuisances(fit),
            *_again(fit),
        ],
    )


def plain_sentence(fit: Fit) -> str:
    """The result for a layman: the optical depth beside Pinatubo's."""
    depth = fit.estimates["stratospheric_optical_depth"]
    low, high = depth.ci95
    after = f"after Pinatubo's eruption of 1991 it was {PINATUBO[0]:g} to {PINATUBO[1]:g}"
    if depth.is_limit:
        return (
            f"At most {_share(high)} of the light that falls straight through it was lost to dust in the "
            f"stratosphere: its optical depth was below {high:.2g} (97.5 % sure); {after}. How much less than "
            "that the photographs cannot tell."
        )
    if depth.informed < NOT_INFORMED:
        return (
            "The photographs hardly tell how much dust there was in the stratosphere: its optical depth, between "
            f"{low:.2g} and {high:.2g} (95 %), is more what was believed beforehand than what they show; {after}."
        )
    beside = "less than then" if high < PINATUBO[0] else "more than then" if low > PINATUBO[1] else "possibly as much"
    return (
        f"Dust in the stratosphere took {_share(depth.median)} of the light that falls straight through it: an optical "
        f"depth of {depth.median:.2g}, 95 % sure to lie between {low:.2g} and {high:.2g}; {after}: {beside}."
    )


def doubts(fit: Fit) -> list[str]:
    """Why the numbers may be worth nothing, one sentence each."""
    found = [] if fit.diagnostics.get("converged", True) else ["The optimiser did not converge."]
    return found + all_unexplained([photo.name for photo in fit.photos], fit.diagnostics)


def _limb(fit: Fit) -> list[str]:
    rows = [_row(estimate) for estimate in fit.estimates.values() if estimate.name in fit.draws]
    return [
        heading("The air along the Earth's limb"),
        table(["", *COLUMNS], rows),
        paragraph(
            "MAP and sd: at the optimum, by Laplace's approximation. Informed: the share of the prior's variance that "
            "the photographs took away; below 50 % the number is more the prior's than theirs. *: an upper "
            "limit. All of it, the temperature's narrow interval above all, supposes the same air all around the limb.",
            "note",
        ),
    ]


def _nuisances(fit: Fit) -> list[str]:
    rows = [_row(estimate) for estimate in fit.estimates.values() if estimate.name not in fit.draws]
    if not rows:
        return []
    return [heading("Camera, pointing and clock"), folded(f"{len(rows)} nuisances", table(["", *COLUMNS], rows))]


COLUMNS = ("unit", "MAP", "sd", "median", "68 %", "95 %", "prior's 95 %", "informed")


def _row(estimate: Estimate) -> list[str]:
    limit = "*" if estimate.name in ("dust.extinction", "stratospheric_optical_depth") and estimate.is_limit else ""
    intervals = (estimate.ci68, estimate.ci95, estimate.prior_ci95)
    return [
        estimate.name + limit, estimate.unit, f"{estimate.map:.4g}", f"{estimate.sd:.3g}", f"{estimate.median:.4g}",
        *(f"{low:.3g} … {high:.3g}" for low, high in intervals), f"{100 * estimate.informed:.0f} %",
    ]  # fmt: skip


def _learnt(diagnostics: Mapping[str, Any]) -> list[str]:
    if "information" not in diagnostics:
        return []
    known = diagnostics["information"]
    names, each = known["averaging_kernel"]["parameters"], known["parameters"]
    pairs = [
        [" and ".join(pair["names"]), f"{pair['coefficient']:+.2f}"]
        for pair in known["correlations"]["within_limb"] + known["correlations"]["limb_with_nuisance"]
    ]
    kernel = [
        [f"{number} {name}", *(f"{value:+.2f}" for value in row)]
        for number, (name, row) in enumerate(zip(names, known["averaging_kernel"]["rows"], strict=True), 1)
    ]
    share = [
        [name, f"{each[name]['informed']:.2f}", f"{each[name]['bits']:.1f}",
         "prior-dominated" if each[name]["prior_dominated"] else ""]
        for name in names
    ]  # fmt: skip
    return [
        heading("How much the photographs say"),
        paragraph(in_words(known)),
        table(["", "degrees of freedom", "bits", ""], share),
        heading("What cannot be told apart", 3),
        table(["", "correlation"], pairs),
        folded(
            "Averaging kernel: how far the answer (row) moves when the truth (column) moves by one sd of the prior",
            table(["", *(str(number) for number in range(1, len(names) + 1))], kernel),
        ),
    ]


def _further(advice: Mapping[str, Any] | None) -> list[str]:
    if advice is None:
        return []
    names = list(advice["most_bits"]["remains"])
    rows = [
        [one["utc"], f"{one['stops']:+g}", *(f"{one['remains'][name]:.0%}" for name in names), f"{one['bits']:.1f}"]
        for one in advice["best_for_dust"]
    ]
    title = "What is left of the standard deviations, by the time of the photograph, exposed as is best for the dust"
    return [
        heading("Which further photograph would help most"),
        paragraph(further_in_words(advice)),
        folded(title, table(["", "stops", *names, "bits"], rows)),
        paragraph(
            "By the same camera at the same place, its shutter known against that of the photograph there is; stops "
            "are powers of two of that exposure. From Fisher's information at the optimum, by the fit's own errors.",
            "note",
        ),
    ]


def _errors(fit: Fit) -> list[str]:
    found = fit.diagnostics
    if "errors" not in found or "misfit_checks" not in found:
        return []
    rows = []
    for photo, error, check in zip(fit.photos, found["errors"], found["misfit_checks"], strict=True):
        every, smooth, broad = check["all"], check["smooth"], check["broad"]
        rows.append([
            photo.name, f"{error['independent']:.2f}", f"{100 * error['smooth']:.1f} %",
            f"{100 * error['chromatic']:.1f} %", f"{100 * error['uneven']:.1f} %",
            f"{every['per_datum']:.2f} of {every['effective_data']:.0f}",
            f"{smooth['per_datum']:.2f} of {smooth['effective_data']:.0f}",
            f"{broad['per_datum']:.2f} of {broad['effective_data']:.0f}", f"{check['p']:.2g}",
        ])  # fmt: skip
    head = [
        "", "independent", "smooth", "chromatic", "uneven",
        "chi² per datum", "of smooth patterns", "of broad ones", "p",
    ]  # fmt: skip
    parts = [
        heading("Errors that the photographs ask for"),
        table(head, rows),
        paragraph(
            "Independent: as a multiple of what was thought beforehand. Smooth: of the model's brightness, in patches; "
            "chromatic: of its colour; uneven: of its brightness from one side of the shadow to another, as clouds "
            "along the limb make it. p: the chance of misfits as large in a right model; below 0.01 it is a verdict "
            "against the model. The errors were fitted to the same misfits, so that a large p proves little.",
            "note",
        ),
    ]
    if "independent_errors" in found:
        alone = found["independent_errors"]
        rows = [
            [name, *(f"{one[key]:.3g}" for key in ("sd", "sd_independent", "ratio"))] for name, one in alone.items()
        ]
        head = ["", "sd", "sd if errors were independent", "ratio"]
        parts += [paragraph(independent_in_words(alone)), table(head, rows)]
    return parts


def _drawing(diagnostics: Mapping[str, Any]) -> list[str]:
    method = str(diagnostics.get("method", "laplace"))
    rows = [
        [name, value]
        for key in ("psis", "sampler", "evaluated", "not_finite")
        for name, value in _flat(diagnostics.get(key) or {}, key)
    ]
    others = [
        [name, value]
        for key in (
            "converged",
            "steps",
            "other_ends",
            "costs_of_starts",
            "steps_not_finite",
            "condition_number",
            "residual_rms",
            "cells",
            "seconds",
        )
        if key in diagnostics
        for name, value in _flat(diagnostics[key], key)
    ]
    return [
        heading("How the posterior was found"),
        paragraph(METHODS.get(method, method)),
        table([], rows, "words") if rows else "",
        folded("The optimum", table([], others, "words")),
    ]


def _again(fit: Fit) -> list[str]:
    rows = list(_flat(fit.provenance, ""))
    for number, photo in enumerate(fit.photos, 1):
        if photo.registration is not None:
            rows += _flat(asdict(photo.registration), f"disc of photograph {number}")
    return [heading("To do it again"), table([], rows, "words")]


def _flat(value: Any, name: str):
    """Rows of name and text of what may be a dict, or a list of dicts."""
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _flat(one, f"{name}: {key}" if name else str(key))
    elif isinstance(value, list | tuple) and any(isinstance(one, Mapping) for one in value):
        for number, one in enumerate(value, 1):
            yield from _flat(one, f"{name} {number}")
    elif isinstance(value, list | tuple | np.ndarray):
        yield [name, ", ".join(_text(one) for one in value) or "none"]
    else:
        yield [name, _text(value)]


def _text(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if value is None:
        return "not known"
    return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)


def _share(depth: float) -> str:
    """What an optical depth takes from vertical light."""
    return f"{100 * -np.expm1(-depth):.2g} %"
