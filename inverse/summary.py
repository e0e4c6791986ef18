"""Turning the optimum and the draws into what a `Fit` says."""

from importlib.metadata import version
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from inverse import prior
from inverse.answer import Answer, by_ensemble
from inverse.diagnostics import autocorrelation_time, quality
from inverse.information import NOT_INFORMED
from inverse.likelihood import LIMB, Likelihood
from inverse.map_estimate import Optimum
from inverse.misfit_check import all_unexplained
from inverse.result import Estimate

DENSITY_HEIGHT = 18e3  # m: temperature and pressure at the ground are seen through the density up there


def estimates(likelihood: Likelihood, optimum: Optimum, answer: Answer, prior_draws):
    """Every quantity by name, and the draws of the limb's by name, posterior and prior.

    - `prior_draws`: z of the limb (draw, parameter).
    """
    found, named, named_prior = {}, {}, {}
    sd_z = np.sqrt(np.diag(optimum.covariance))
    draws = answer.z

    def add(name, unit, function, z_map, sd, samples, before, index):
        values, priors = np.asarray(function(samples)), np.asarray(function(before))
        informed = max(0.0, 1.0 - float(np.var(samples[..., index]) / np.var(before[..., index])))
        found[name] = Estimate(
            name=name,
            unit=unit,
            map=float(function(z_map[None])[0]),
            sd=float(sd),
            median=float(np.median(values)),
            ci68=_interval(values, 0.68),
            ci95=_interval(values, 0.95),
            prior_ci95=_interval(priors, 0.95),
            informed=informed,
            **_worth(values, answer),
        )
        named[name], named_prior[name] = values, priors

    z_limb = optimum.z[:LIMB]
    for index, parameter in enumerate(prior.ATMOSPHERE):
        one = lambda z, parameter=parameter, index=index: parameter.value(z[..., index], np)
        slope = abs(float(parameter.slope(z_limb[index], np)))
        add(parameter.name, parameter.unit, one, z_limb, slope * sd_z[index], draws, prior_draws, index)

    derived = {
        "stratospheric_optical_depth": ("-", lambda air: air.dust.optical_depth, 0),
        "air.density_18km": ("kg/m3", lambda air: air.air.density(jnp.asarray(DENSITY_HEIGHT)), 1),
    }
    for name, (unit, quantity, index) in derived.items():
        of_limb = lambda z, quantity=quantity: quantity(prior.atmosphere(z))
        every = jax.jit(jax.vmap(of_limb))
        function = lambda z, every=every: np.asarray(every(z.reshape(-1, LIMB))).reshape(z.shape[:-1])
        gradient = np.asarray(jax.jit(jax.grad(of_limb))(jnp.asarray(z_limb)))
        covariance = optimum.covariance[:LIMB, :LIMB]
        add(name, unit, function, z_limb, np.sqrt(gradient @ covariance @ gradient), draws, prior_draws, index)

    for index, parameter in enumerate(likelihood.parameters[LIMB:], LIMB):
        name, z, sd = likelihood.labels[index], float(optimum.z[index]), float(sd_z[index])
        at = lambda z, parameter=parameter: float(parameter.value(z, np))
        found[name] = Estimate(
            name=name,
            unit=parameter.unit,
            map=at(z),
            sd=abs(float(parameter.slope(z, np))) * sd,
            median=at(z),
            ci68=(at(z - sd), at(z + sd)),
            ci95=(at(z - 1.96 * sd), at(z + 1.96 * sd)),
            prior_ci95=(at(-1.96), at(1.96)),
            informed=max(0.0, 1.0 - sd**2),
        )
    return found, named, named_prior


def _worth(values: np.ndarray, answer: Answer) -> dict[str, float | None]:
    """What the draws of one quantity (chain, draw) are worth, for its `Estimate`."""
    if answer.method.endswith("+psis") and answer.weighed is not None:
        return {"ess": answer.weighed.effective_samples}
    if answer.method != "emcee":
        return {}
    chains = by_ensemble(values)
    found = quality(chains)
    return {
        "ess": found.ess_bulk,
        "ess_tail": found.ess_tail,
        "r_hat": found.r_hat if np.isfinite(found.r_hat) else None,
        "autocorrelation_time": float(autocorrelation_time(chains[..., None])[0]),
    }


def _interval(values, level: float) -> tuple[float, float]:
    """Central interval that holds a share of the values."""
    low, high = np.quantile(values, (0.5 - level / 2, 0.5 + level / 2))
    return float(low), float(high)


def other_ends(optimum: Optimum) -> list[dict[str, float]]:
    """For `Fit.diagnostics`: the limbs of the rivals, and their `mass` after Laplace in units of the optimum's."""
    return [
        {
            "mass": float(np.exp(end.log_mass - optimum.log_mass)),
            **{name: float(value) for name, value in prior.values(prior.ATMOSPHERE, jnp.asarray(end.z)).items()},
        }
        for end in optimum.rivals
    ]


def warnings_of(evidence, found, diagnostics) -> list[str]:
    """What a reader must know before believing the numbers."""
    sentences = [remark for item in evidence for remark in item.remarks]
    if not diagnostics["converged"]:
        sentences.append("The optimiser did not converge: the numbers are those of its last step.")
    if lost := diagnostics["not_finite"]:
        sentences.append(
            f"The posterior was not a finite number at {lost} of the {diagnostics['evaluated']} points where it was "
            "asked for, and was taken as zero there: the intervals leave out whatever lies there."
        )
    if (others := diagnostics["other_ends"]) and diagnostics["method"] == "laplace":
        mass = sum(end["mass"] for end in others)
        sentences.append(
            f"The posterior has another peak, with some {mass / (1.0 + mass):.0%} of its probability, which was left "
            "out: fit without --draws, which looks at all of them."
        )
    sentences += all_unexplained([item.name for item in evidence], diagnostics)
    sampler = diagnostics["sampler"]
    if sampler is not None and not sampler["converged"]:
        sentences.append(
            f"The sampler was stopped after {sampler['steps']} steps, before it was done: "
            f"{'; '.join(sampler['unmet'])}. The intervals are rough: give more --draws, and --resume to go on."
        )
    dull = [
        name for name, estimate in found.items()
        if not name[0].isdigit() and estimate.informed < NOT_INFORMED and name != "stratospheric_optical_depth"
    ]  # fmt: skip
    if dull:
        sentences.append(f"Prior-dominated, the photograph says less than the prior: {', '.join(dull)}.")
    depth = found["stratospheric_optical_depth"]
    if depth.is_limit:
        sentences.append(
            f"The dust is an upper limit: optical depth below {depth.ci95[1]:.2g} (97.5 %); "
            "its lower end is the prior's."
        )
    return sentences


def provenance(evidence, clock: float | str | None, exposure: float | str, response: str, seed: int) -> dict:
    """What it takes to do it again."""
    return {
        "eclipsejax": version("eclipsejax"),
        "jax": version("jax"),
        "numpy": version("numpy"),
        "scipy": version("scipy"),
        "seed": seed,
        "clock": clock,
        "exposure": exposure,
        "response": response,
        "photographs": [
            {
                "name": Path(item.photo.path).name,
                "sha256": item.photo.sha256,
                "utc": item.where.utc,
                "site": None if item.site is None else [float(value) for value in item.site],
            }
            for item in evidence
        ],
    }
