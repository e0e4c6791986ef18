"""Whether a photograph could have come from the model with the errors that were found for it.

The misfits at the optimum, multiplied by the inverse root of their covariance, are standard normal if it could. A fit
takes its own degrees of freedom away: of n misfits n - trace(J S J') are left, J being their slopes and S the
covariance of the posterior. Counted three times: over all of the data; over the smooth patterns alone, where smooth
errors exceed the independent ones: a model that fails does so smoothly; and over the `BROAD` broadest of these alone,
since fine ones are less rough than is believed, and hundreds of them outvote a disc whose one side is too dark. The
sizes of the errors were fitted to these same misfits, and outliers given less weight: a chi-squared near its
expectation proves little, one far above it says that only the priors of those sizes held them back.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import chi2

from inverse.likelihood import Likelihood
from inverse.map_estimate import Optimum

# Amplitude of smooth errors above which a model does not explain a photograph: 2.5 times what is thought beforehand; of
# a limb's differences six times, as the cloudiest and the clearest sides of the Earth differ.
UNEXPLAINED = {"smooth": 0.25, "chromatic": 0.10, "uneven": 0.60}
WRONG = {
    "smooth": "it is wrong by {:.0f} % in patches as large as a mare",
    "chromatic": "its colours are wrong by {:.0f} % in patches as large",
    "uneven": "one side of it is wrong by {:.0f} %",
}
BROAD = 12  # patterns: as broad as a third of the disc and more
IMPROBABLE = 0.01  # probability of misfits as large, below which it does not either
CHECKED = {"all": "the misfits", "smooth": "the smooth misfits", "broad": "the misfits all across the disc"}
RULED = 1.0 / np.sqrt(2.0) - 1.0  # `Whitener.shrink` of a pattern whose smooth and independent variance are equal


def misfit_checks(likelihood: Likelihood, optimum: Optimum) -> list[dict[str, Any]]:
    """For each photograph, for `Fit.diagnostics`.

    In each: `all`, `smooth` and `broad`, with the `chi_squared` found, the `effective_data` it is expected to be,
    `per_datum`, their ratio, and `p`, the probability of more; `p` is the smallest of them, times their number.
    """
    covariance = optimum.covariance
    found = []
    for number, (misfit, slopes) in enumerate(likelihood.misfits_and_slopes(optimum.z)):
        white = likelihood.errors[number].whitener
        columns = likelihood.columns(number)
        misfit, slopes = white(misfit), white(slopes)
        patterns = white.basis[:, white.shrink < RULED]
        block = covariance[np.ix_(columns, columns)]
        every = _check(misfit, slopes, block, float(np.sum(np.asarray(likelihood.observed[number].measured) > 0)))
        smooth = _check(patterns.T @ misfit, patterns.T @ slopes, block, float(patterns.shape[1]))
        patterns = np.linalg.qr(white(_broad(likelihood, number)))[0]
        broad = _check(patterns.T @ misfit, patterns.T @ slopes, block, float(patterns.shape[1]))
        checks = {"all": every, "smooth": smooth, "broad": broad}
        found.append({**checks, "p": min(1.0, len(checks) * min(check["p"] for check in checks.values()))})
    return found


def _broad(likelihood: Likelihood, number: int) -> np.ndarray:
    """The modes of one photograph's smooth errors that are largest on its disc (datum, mode)."""
    errors = likelihood.errors[number]
    modes = errors.modes[:, : errors.common]
    on_disc = np.repeat(likelihood.sources[number].on_disc > 0, len(modes) // len(errors.cells))
    return modes[:, np.argsort(np.linalg.norm(modes[on_disc], axis=0))[-BROAD:]]


def _check(misfit: np.ndarray, slopes: np.ndarray, covariance: np.ndarray, count: float) -> dict[str, float]:
    """Chi-squared of whitened misfits (datum,) of which `count` can vary.

    Its variance is a little below twice its expectation, which is taken here: p errs towards belief.
    """
    expected = count - float(np.sum((slopes @ covariance) * slopes))
    value = float(misfit @ misfit)
    if expected < 1.0:  # as many parameters as data: nothing is left to judge by
        return {"chi_squared": value, "effective_data": expected, "per_datum": 1.0, "p": 1.0}
    p = float(chi2.sf(value, expected))
    return {"chi_squared": value, "effective_data": expected, "per_datum": value / expected, "p": p}


def all_unexplained(names: Sequence[str], diagnostics: Mapping[str, Any]) -> list[str]:
    """Sentences for the photographs that the model does not explain.

    - `names`: of all of them; `diagnostics`: those of the `Fit`, which may lack what this is judged by.
    """
    if "errors" not in diagnostics or "misfit_checks" not in diagnostics:
        return []
    each = zip(names, diagnostics["errors"], diagnostics["misfit_checks"], strict=True)
    return [sentence for one in each if (sentence := unexplained(*one)) is not None]


def unexplained(name: str, errors: Mapping[str, float], check: Mapping[str, Any]) -> str | None:
    """The sentence for a photograph that the model does not explain; None where it does.

    - `errors`: amplitudes of the `smooth`, `chromatic` and `uneven` errors found; `check`: of `misfit_checks`.
    """
    begin = f"This model cannot explain {name}: "
    wrong = [words.format(100 * errors[kind]) for kind, words in WRONG.items() if errors[kind] > UNEXPLAINED[kind]]
    if wrong:
        return f"{begin}{' and '.join(wrong)}, and the intervals were widened by as much."
    if check["p"] < IMPROBABLE:
        worse = min(CHECKED, key=lambda which: check[which]["p"])
        what = CHECKED[worse]
        return begin + (
            f"even with the errors found for it, {what} are {check[worse]['per_datum']:.2f} times the expected "
            f"chi-squared (p = {check['p']:.1g}), so that the intervals are too narrow."
        )
    return None
