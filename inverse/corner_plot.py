"""The posterior of the limb in pairs of quantities, with the prior beside it."""

import textwrap
import warnings
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from inverse.result import Estimate, Fit

QUANTITIES = 8  # more cannot be read
POSTERIOR, PRIOR, TRUTH = "#0072b2", "#e69f00", "#000000"  # Okabe & Ito's palette
METHODS = {
    "laplace": "Laplace's approximation only, nothing was sampled.",
    "laplace+psis": "Laplace's approximation with importance weights.",
    "emcee": "Sampled.",
}


class Words(NamedTuple):
    """How a quantity is shown: its name, its unit, the factor to that unit, and whether by its logarithm."""

    name: str
    unit: str = ""
    factor: float = 1.0
    logarithm: bool = False

    def scaled(self, values):
        """Values as they are shown."""
        return np.log10(self.factor * values) if self.logarithm else self.factor * values

    @property
    def label(self) -> str:
        """For an axis."""
        unit = f"\n[{self.unit}]" if self.unit else ""
        return f"log₁₀ {self.name}{unit}" if self.logarithm else self.name + unit


WORDS = {
    "dust.extinction": Words("dust α", "1/m", logarithm=True),
    "stratospheric_optical_depth": Words("dust depth", logarithm=True),
    "air.surface_temperature": Words("temperature", "K"),
    "air.surface_pressure": Words("pressure", "hPa", 1e-2),
    "air.density_18km": Words("density, 18 km", "g/m³", 1e3),
    "clouds.cover": Words("cloud cover"),
    "clouds.top": Words("cloud tops", "km", 1e-3),
    "clouds.width": Words("width of tops", "km", 1e-3),
    "haze.optical_depth": Words("haze depth"),
    "ozone.column_du": Words("ozone", "DU"),
    "scattered.amplitude": Words("scattered light", logarithm=True),
}


def corner_plot(fit: Fit, truths: Mapping[str, float], figure) -> None:
    """Posterior of the limb, pair by pair, and its prior on the diagonal."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of arviz, which corner imports
        from corner import corner

    names, left_out = shown_quantities(fit)
    words = [WORDS.get(name, Words(name)) for name in names]
    values = np.column_stack([w.scaled(fit.draws[name].ravel()) for w, name in zip(words, names, strict=True)])
    marks = [w.scaled(truths[name]) if name in truths else None for w, name in zip(words, names, strict=True)]
    ends = [_ends(column, mark) for column, mark in zip(values.T, marks, strict=True)]
    count = len(names)
    bins = 24 if len(values) > 2000 else 14  # of few draws the noise would show
    wide, head = 2.0 + 1.45 * count, 0.6 if count > 4 else 2.0  # the key needs a corner of its own beside few panels
    tall = wide - 0.6 + head
    figure.set_size_inches(wide, tall)
    corner(
        values, fig=figure, bins=bins, range=ends, labels=[w.label for w in words], color=POSTERIOR, truths=marks,
        truth_color=TRUTH, levels=(0.68, 0.95), smooth=1.0, plot_datapoints=False, plot_density=False,
        fill_contours=True, max_n_ticks=4, hist_kwargs={"density": True, "linewidth": 1.4},
        label_kwargs={"fontsize": 10}, labelpad=0.1,
    )  # fmt: skip
    panels = np.array(figure.axes[: count**2]).reshape(count, count)
    for panel, name, w, (low, high) in zip(np.diagonal(panels), names, words, ends, strict=True):
        before = w.scaled(fit.prior_draws[name].ravel())
        weight = np.full(before.size, bins / (high - low) / before.size)  # a density, of which the panel shows a part
        style = {"histtype": "step", "color": PRIOR, "linewidth": 1.4}
        density, *_ = panel.hist(before, np.linspace(low, high, bins + 1), weights=weight, **style)
        panel.set_ylim(0, max(panel.get_ylim()[1], 1.1 * density.max()))
        panel.set_title(_interval(fit, name, w), fontsize=9, pad=4)
    # Room for labels and titles, as corner leaves it, is for panels of two inches.
    figure.subplots_adjust(left=1.05 / wide, bottom=1.05 / tall, right=1 - 0.2 / wide, top=1 - head / tall)
    for row, column in zip(*np.tril_indices(count), strict=True):
        panels[row, column].tick_params(labelsize=8)
        panels[row, column].xaxis.set_major_locator(_ticks(*ends[column]))
        if row > column:
            panels[row, column].yaxis.set_major_locator(_ticks(*ends[row]))
    _key(figure, fit, left_out, any(mark is not None for mark in marks))


def shown_quantities(fit: Fit) -> tuple[list[str], list[str]]:
    """Names for the corner plot in the order of the draws, and those left out because they are too many.

    Not shown either: what does not vary, and what another quantity fixes (optical depth is alpha times the thickness
    of the layer). The dust stays, then the best informed.
    """
    ranks = {name: np.argsort(np.argsort(values.ravel())) for name, values in fit.draws.items()}
    names: list[str] = []
    for name, values in fit.draws.items():
        copy = any(abs(np.corrcoef(ranks[name], ranks[other])[0, 1]) > 0.99999 for other in names)
        if np.ptp(values) > 0 and not copy:
            names.append(name)
    best = sorted(names, key=lambda name: (name != "dust.extinction", -fit.estimates[name].informed))[:QUANTITIES]
    return [name for name in names if name in best], [name for name in names if name not in best]


def _ends(column: np.ndarray, mark: float | None) -> tuple[float, float]:
    """Range of a panel: all but the outermost draws, and the truth."""
    low, high = np.quantile(column, (0.0025, 0.9975))
    if mark is not None:
        low, high = min(low, mark), max(high, mark)
    return float(low - 0.06 * (high - low)), float(high + 0.06 * (high - low))


def _ticks(low: float, high: float):
    """Some three ticks away from the corners, where the next panel has its own."""
    from matplotlib.ticker import FixedLocator, MaxNLocator

    places = np.asarray(MaxNLocator(4).tick_values(low, high))
    edge = 0.08 * (high - low)
    return FixedLocator(places[(places > low + edge) & (places < high - edge)].tolist())


def _key(figure, fit: Fit, left_out: list[str], truths: bool) -> None:
    """Heading and key in the empty corner at the top right."""
    from matplotlib.lines import Line2D

    size = min(7.0 + figure.get_figwidth(), 18.0)
    line = size / 72 / figure.get_figheight()
    notes = [METHODS[fit.diagnostics["method"]]]
    if left_out:
        spelled = ", ".join(WORDS.get(name, Words(name)).name for name in left_out)
        notes += textwrap.wrap(f"Not shown, least informed: {spelled}.", 50)
    figure.text(0.985, 0.985, "Posterior of the Earth's limb", ha="right", va="top", fontsize=size, weight="bold")
    figure.text(0.985, 0.985 - 1.6 * line, "\n".join(notes), ha="right", va="top", fontsize=0.65 * size)
    keys = [
        Line2D([], [], color=POSTERIOR, label="posterior; contours hold 68 and 95 %"),
        Line2D([], [], color=PRIOR, label="prior"),
        *([Line2D([], [], color=TRUTH, label="truth")] if truths else []),
    ]
    place = (0.992, 0.985 - (1.9 + 0.8 * len(notes)) * line)
    figure.legend(handles=keys, loc="upper right", bbox_to_anchor=place, fontsize=0.65 * size, frameon=False)


def _interval(fit: Fit, name: str, words: Words) -> str:
    """Median and 68 %; for the dust the median of alpha and the optical depth that it means."""
    estimate = fit.estimates[name]
    if name != "dust.extinction":
        return f"{words.name}\n{_plus_minus(estimate, words.factor)} {words.unit}".strip()
    if estimate.is_limit:
        limit = fit.estimates["stratospheric_optical_depth"].ci95[1]
        return f"{words.name} < {words.factor * estimate.ci95[1]:.2g} {words.unit}\noptical depth < {limit:.2g}"
    depth = fit.estimates["stratospheric_optical_depth"].median
    return f"{words.name} = {words.factor * estimate.median:.2g} {words.unit}\noptical depth {depth:.2g}"


def _plus_minus(estimate: Estimate, factor: float) -> str:
    """Median with its 68 % interval, to the second digit of the smaller side."""
    low, middle, high = (factor * value for value in (estimate.ci68[0], estimate.median, estimate.ci68[1]))
    smaller = min(middle - low, high - middle)
    digits = int(np.clip(1 - np.floor(np.log10(smaller)), 0, 6)) if smaller > 0 else 3
    return f"${middle:.{digits}f}_{{-{middle - low:.{digits}f}}}^{{+{high - middle:.{digits}f}}}$"
