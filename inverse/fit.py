"""From photographs on disk to the atmosphere that coloured them."""

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from eclipsejax.errors import InputError
from inverse import prior
from inverse.answer import Answer, answer, beginning, begun, identity
from inverse.chain import Record, read_record
from inverse.conditional import with_nuisances
from inverse.evidence import Evidence, gather, prepare
from inverse.likelihood import Likelihood
from inverse.map_estimate import Optimum, maximum
from inverse.result import Fit
from inverse.summary import estimates, photo_fit, provenance, warnings_of

STARTS = ((0.0, 0.0), (-1.5, 0.5), (1.2, -0.5))  # z of the clouds' top and cover
SHOWN = 40  # draws behind the bands of the plots


@dataclass(frozen=True)
class Progress:
    """What is going on, for a progress bar: `stage`, and how much of it is done."""

    stage: str
    done: int
    total: int


def fit_atmosphere(
    photographs: str | PathLike | Sequence[str | PathLike],
    *,
    time: str | Sequence[str] | None = None,
    site: tuple[float, float] | tuple[float, float, float] | None = None,
    disc: int | None = None,
    draws: int | None = None,
    seed: int = 0,
    chain: str | PathLike | None = None,
    resume: bool = False,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> Fit:
    """Infer dust, temperature and pressure of the air along the Earth's limb from photographs of one lunar eclipse.

    The optimum is Levenberg-Marquardt's over the limb and every nuisance of each photograph (exposure, white
    balance, tone curve, glare, pointing, clock), from several starts. The posterior is over the limb, with the
    nuisances marginalised about the optimum: Laplace's Gaussian, corrected by importance weights, where its
    diagnostics allow it and the dust is away from zero, otherwise sampled (`inverse.answer`). Priors:
    `inverse.prior`. Errors: `inverse.noise`, inflated until the best fit is as good as it claims. Raises `InputError`
    with one sentence where a photograph cannot be used.

    - `photographs`: one or several files of one eclipse, or profiles (`inverse.profile`, .csv).
    - `time`: UTC of each, or of the first if the others' clocks are known relative to its; by default what EXIF
      says, if it is certain.
    - `site`: latitude, longitude [degrees] and height [m]; by default from EXIF, else the Earth's centre.
    - `disc`: which of several discs in a picture, from 1.
    - `draws`: sample, with this many draws at most; 0 for Laplace's approximation alone; by default whatever the
      posterior needs.
    - `seed`: of the sampler: the same seed gives the same chain.
    - `chain`: file (HDF5) for the samples while they are drawn.
    - `resume`: go on with the chain in that file, if there is one, of the same photographs, seed and program.
    """
    if (draws or 0) < 0 or seed < 0:
        raise InputError(f"There can be no {draws} draws or seed {seed}: give whole numbers from 0.")
    started = clock.perf_counter()
    if isinstance(photographs, str | PathLike):
        photographs = [photographs]
    evidence = gather(photographs, time=time, site=site, disc=disc, progress=lambda *a: progress(Progress(*a)))
    progress(Progress("fitting", 0, len(STARTS) + 1))
    likelihood, smooth = prepare(evidence)
    depends_on = identity(evidence, likelihood.parameters, disc, seed)
    file = None if chain is None else Path(chain)
    record = read_record(file, depends_on) if resume and file is not None and file.exists() else None
    if record is None:
        optimum, likelihood, smooth, inflation = optimise(likelihood, smooth, progress)
    else:
        optimum, inflation, first_draws = begun(record.beginning)
        draws = first_draws if draws is None else draws
        likelihood, smooth = likelihood.inflated(inflation), [inflation * modes for modes in smooth]
        progress(Progress("fitting", len(STARTS) + 1, len(STARTS) + 1))
    numbers = beginning(optimum, inflation, draws)
    found = answer(
        likelihood, optimum, smooth, draws=draws, seed=seed,
        before=None if record is None else record.chain,
        keep=lambda samples: None if file is None else Record(depends_on, numbers, samples).write(file),
        progress=lambda stage, done, of: progress(Progress(stage, done, of)),
    )  # fmt: skip
    return conclude(evidence, likelihood, optimum, found, inflation, seed, clock.perf_counter() - started)


def optimise(likelihood: Likelihood, smooth, progress) -> tuple[Optimum, Likelihood, list[np.ndarray], float]:
    """The optimum, with the errors inflated so that the data's chi-squared is what it should be.

    The inflation is one factor, at least 1, on all errors of all photographs (Birge's ratio).
    """
    count = len(likelihood.parameters)
    starts = np.zeros((len(STARTS), count))
    names = [parameter.name for parameter in prior.ATMOSPHERE]
    for start, (top, cover) in zip(starts, STARTS, strict=True):
        start[names.index("clouds.top")], start[names.index("clouds.cover")] = top, cover
    optimum = maximum(likelihood, starts, lambda n: progress(Progress("fitting", n, len(STARTS) + 1)))
    squares = optimum.cost - float(np.sum(optimum.z**2))
    inflation = max(1.0, float(np.sqrt(squares / sum(float(usable.sum()) for usable in likelihood.usable))))
    if inflation > 1.0:
        likelihood, smooth = likelihood.inflated(inflation), [inflation * modes for modes in smooth]
        again = maximum(likelihood, optimum.z[None])
        optimum = replace(again, costs=optimum.costs)
    progress(Progress("fitting", len(STARTS) + 1, len(STARTS) + 1))
    return optimum, likelihood, smooth, inflation


def conclude(
    evidence: list[Evidence],
    likelihood: Likelihood,
    optimum: Optimum,
    found: Answer,
    inflation: float,
    seed: int,
    seconds: float,
) -> Fit:
    """Put everything that was found into a `Fit`."""
    random, size = np.random.default_rng(seed), len(prior.ATMOSPHERE)
    prior_draws = random.standard_normal((4000, size))
    quantities, named, named_prior = estimates(likelihood, optimum, found, prior_draws)
    shown = random.choice(found.z.reshape(-1, size), SHOWN)
    normal = random.standard_normal((SHOWN, len(optimum.z) - size))
    start = jnp.asarray(optimum.z[size:])
    joint = np.array(
        [with_nuisances(likelihood, jnp.asarray(z), start, jnp.asarray(n)) for z, n in zip(shown, normal, strict=True)]
    )
    photos = tuple(photo_fit(item, likelihood, i, optimum.z, joint) for i, item in enumerate(evidence))
    diagnostics = {
        "converged": optimum.converged,
        "steps": optimum.steps,
        "costs_of_starts": optimum.costs,
        "error_inflation": inflation,
        "condition_number": float(np.linalg.cond(optimum.covariance)),
        "residual_rms": [photo.residual_rms for photo in photos],
        "cells": [int(photo.usable.any(axis=1).sum()) for photo in photos],
        **found.report,
        "seconds": seconds,
    }
    return Fit(
        estimates=quantities,
        draws=named,
        prior_draws=named_prior,
        photos=photos,
        diagnostics=diagnostics,
        warnings=tuple(warnings_of(evidence, quantities, diagnostics)),
        provenance=provenance(evidence, seed),
        log_posterior=found.log_posterior,
    )
