"""How much the photographs say, and how much of the answer is the prior's.

All of it follows from Laplace's Gaussian in z, where the prior's covariance is the identity: S is the posterior's,
and A = I - S the averaging kernel (Rodgers 2000, equation 2.80), how far the answer moves when the truth does.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from inverse.likelihood import LIMB, Likelihood
from inverse.map_estimate import Optimum, quadratic

NOT_INFORMED = 0.5  # share of the prior's variance taken away, below which a quantity is the prior's
PAIRS = 3  # of correlated quantities that are named


def information(optimum: Optimum, labels: Sequence[str]) -> dict[str, Any]:
    """What was learnt at an optimum, for `Fit.diagnostics`.

    - `labels`: names of all parameters, those of the limb first.

    In it: `degrees_of_freedom`, the trace of A, of all parameters (`total`) and of the limb's (`limb`); `bits`, of all
    and of the limb with the nuisances marginalised, -1/2 log2 det S; `parameters`, by name the `informed` share A_ii,
    the `bits` -1/2 log2 S_ii and whether it is `prior_dominated`; `averaging_kernel`, the limb's block of A, row by
    row; `correlations` of the posterior, the strongest `within_limb` and of `limb_with_nuisance`.
    """
    covariance = optimum.covariance
    kernel = np.eye(len(covariance)) - covariance
    variance = np.diag(covariance)
    correlation = covariance / np.sqrt(np.outer(variance, variance))
    within = [(i, j) for i in range(LIMB) for j in range(i)]
    across = [(i, j) for i in range(LIMB) for j in range(LIMB, len(covariance))]
    return {
        "degrees_of_freedom": {"total": float(np.trace(kernel)), "limb": float(np.trace(kernel[:LIMB, :LIMB]))},
        "bits": {"total": _bits(covariance), "limb": _bits(covariance[:LIMB, :LIMB])},
        "parameters": {
            labels[index]: {
                "informed": float(kernel[index, index]),
                "bits": _bits(covariance[index : index + 1, index : index + 1]),
                "prior_dominated": bool(kernel[index, index] < NOT_INFORMED),
            }
            for index in range(len(covariance))
        },
        "averaging_kernel": {"parameters": list(labels[:LIMB]), "rows": kernel[:LIMB, :LIMB].tolist()},
        "correlations": {
            "within_limb": _strongest(correlation, within, labels),
            "limb_with_nuisance": _strongest(correlation, across, labels),
        },
    }


def under_independent_errors(likelihood: Likelihood, optimum: Optimum) -> dict[str, Any]:
    """Laplace's standard deviations, were the same variance of every datum independent from cell to cell.

    At the same optimum: no new descent. By name of the limb's parameters `sd`, the `sd_independent` that such errors
    would give, both in the parameter's unit, and `ratio`, the first by the second.
    """
    alone = replace(likelihood, errors=tuple(errors.without_smooth() for errors in likelihood.errors))
    bare = replace(optimum, information=quadratic(alone, optimum.z).information)
    found = {}
    for index in range(LIMB):
        parameter = likelihood.parameters[index]
        slope = abs(float(parameter.slope(float(optimum.z[index]), np)))
        sd, sd_alone = (float(np.sqrt(one.covariance[index, index])) for one in (optimum, bare))
        found[parameter.name] = {"sd": slope * sd, "sd_independent": slope * sd_alone, "ratio": sd / sd_alone}
    return found


def in_words(information: dict[str, Any]) -> str:
    """The information in two sentences."""
    freedom, bits = information["degrees_of_freedom"], information["bits"]
    count = len(information["averaging_kernel"]["parameters"])
    pairs = information["correlations"]
    tied = "; ".join(
        f"{' and '.join(pair['names'])} ({pair['coefficient']:+.2f})"
        for pair in (*pairs["within_limb"][:2], *pairs["limb_with_nuisance"][:1])
    )
    return (
        f"The photographs fix {freedom['limb']:.1f} of the {count} quantities of the limb ({bits['limb']:.1f} bits), "
        f"and with the nuisances {freedom['total']:.1f} of {len(information['parameters'])} "
        f"({bits['total']:.1f} bits). Hardest to tell apart (correlation): {tied}."
    )


def independent_in_words(independent: dict[str, Any]) -> str:
    """What the comparison with independent errors is for, and its result for the dust."""
    dust = independent["dust.extinction"]
    return (
        "Were errors of the same size independent from cell to cell, the sd of the dust would be "
        f"{dust['sd_independent']:.2g} /m; it is {dust['sd']:.2g} /m, {dust['ratio']:.2f} times as much. This shows "
        "what the intervals owe to errors that hang together over the disc, which is usually left out; the sd under "
        "independent errors is not one to be quoted."
    )


def _bits(covariance: np.ndarray) -> float:
    """Shannon's information against a prior of unit covariance."""
    return float(-0.5 * np.linalg.slogdet(covariance)[1] / np.log(2.0))


def _strongest(correlation: np.ndarray, pairs: list[tuple[int, int]], labels: Sequence[str]) -> list[dict[str, Any]]:
    """Names and coefficients of the most correlated pairs."""
    best = sorted(pairs, key=lambda pair: -abs(correlation[pair]))[:PAIRS]
    return [{"names": [labels[i], labels[j]], "coefficient": float(correlation[i, j])} for i, j in best]
