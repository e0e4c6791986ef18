"""Text and pictures of a fit, to be looked at by a person."""

import textwrap
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from inverse.comparison_plot import comparison
from inverse.corner_plot import corner_plot
from inverse.further import in_words as further_in_words
from inverse.information import in_words, independent_in_words
from inverse.page import drawn
from inverse.profile_plot import profile_plot
from inverse.result import Fit

TOLD = {  # of the diagnostics, in the report as text
    "information": in_words, "independent_errors": independent_in_words, "further_photographs": further_in_words,
}  # fmt: skip


def text_report(fit: Fit) -> str:
    """The result as the command prints it: the sentence, the table, what was learnt, the warnings."""
    cautions = [textwrap.fill(f"Warning: {text}", 110, subsequent_indent="  ") for text in fit.warnings]
    learnt = [
        textwrap.fill(words(fit.diagnostics[key]), 110)
        for key, words in TOLD.items()
        if fit.diagnostics.get(key) is not None
    ]
    return "\n\n".join([fit.sentence(), fit.summary(), *learnt, *(["\n".join(cautions)] if cautions else [])])


def write_pictures(fit: Fit, folder: str | Path, truths: Mapping[str, float] | None = None) -> list[Path]:
    """Writes PNG pictures of a fit into an existing folder, and returns their paths.

    `fit.png`: photograph, model and residual, with the warnings; none for a profile, which has no pixels.
    `profile.png`: brightness and colour against the distance from the shadow's axis. `corner.png`: posterior and
    prior of the limb. Of several photographs there are `fit-1.png`, `profile-1.png` and so on, in their order.

    - `truths`: true values by name, where they are known, to be marked in `corner.png`.
    """
    pages = {}
    for number, photo in enumerate(fit.photos, 1):
        which = f"-{number}" if len(fit.photos) > 1 else ""
        if photo.image is not None:
            pages[f"fit{which}.png"] = partial(comparison, photo, fit.warnings)
        # The warnings are wanted once for each photograph, and more would be overlooked.
        pages[f"profile{which}.png"] = partial(profile_plot, photo, fit.warnings if photo.image is None else ())
    pages["corner.png"] = partial(corner_plot, fit, truths or {})
    return [drawn(draw, Path(folder) / name) for name, draw in pages.items()]
