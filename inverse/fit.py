"""From photographs on disk to the atmosphere that coloured them."""

import time as timer
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from eclipsejax.errors import InputError
from inverse.answer import Answer, answer, beginning, begun, identity
from inverse.camera_colours import ASSUMED, checked_response
from inverse.chain import Record, read_record
from inverse.compared import photo_fits
from inverse.conditional import with_nuisances
from inverse.evidence import Evidence, gather, prepare
from inverse.exposures import RELATIVE, check_exposure
from inverse.further import advice
from inverse.information import information, under_independent_errors
from inverse.likelihood import LIMB, Likelihood
from inverse.map_estimate import Optimum
from inverse.misfit_check import misfit_checks
from inverse.optimum import STAGES, best
from inverse.result import Fit
from inverse.summary import estimates, other_ends, provenance, warnings_of
from inverse.threads import side_by_side

SHOWN = 24  # draws behind the bands of the plots


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
    site: tuple[float, ...] | list[tuple[float, ...] | None] | None = None,
    disc: int | list[int | None] | None = None,
    clock: float | str | None = None,
    exposure: float | str = RELATIVE,
    response: str | PathLike = ASSUMED,
    draws: int | None = None,
    seed: int = 0,
    chain: str | PathLike | None = None,
    resume: bool = False,
    further: bool = True,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> Fit:
    """Infer dust, temperature and pressure of the air along the Earth's limb from photographs of one lunar eclipse.

    The optimum is over the limb and every nuisance of each photograph (exposure, white balance, tone curve, glare,
    pointing, clock), the best of those from several starts (`inverse.optimum`); photographs of one camera share its
    tone curve, white balance, sensitivity and clock, and those of one eclipse what the model misses of limb and map
    (`inverse.shared_errors`). The posterior is over the limb, with the nuisances at their best
    under each (`inverse.posterior`): by importance weights where they can be trusted, otherwise sampled
    (`inverse.answer`).
    Priors: `inverse.prior`. Errors: `inverse.noise`, as large as the photographs say (`inverse.noise_fit`). Raises
    `InputError` with one sentence where a photograph cannot be used.

    - `photographs`: one or several files of one eclipse, or profiles (`inverse.profile`, .csv).
    - `time`: UTC of each, or of the first if the others' clocks are known relative to its; by default what EXIF
      says, if it is certain.
    - `site`: latitude, longitude [degrees] and, where known, height [m]; or a list with one for each photograph. By
      default, and for each None in a list, from EXIF, else the Earth's centre.
    - `disc`: which of several discs in a picture, from 1; or a list with one for each photograph.
    - `clock`: standard deviation of the error of the clock that gave the times [s], by default 60; or "unknown" if no
      more than the day is to be believed, which `time` may give alone. If unknown, or above 300 s, the time is searched
      by the shadow's place on the Moon (`inverse.clock_search`), for all photographs of the one camera together.
    - `exposure`: what is believed of stated exposures: "relative", those of one camera against each other; "free",
      nothing; or by how much the light that seconds, focal ratio and ISO tell may be wrong, in its logarithm. That is
      good to a factor of 2 (`eclipsejax.camera.LOONEY_11`), of processed files often not so.
    - `response`: the camera's spectral sensitivities: a CSV table of wavelength [nm] and those of red, green and blue,
      or a name that `eclipsejax.response.responses` knows; by default those of a Nikon D5100. Of all photographs.
    - `draws`: sample, with this many draws at most; 0 for Laplace's approximation alone; by default whatever the
      posterior needs.
    - `seed`: of the sampler: the same seed gives the same chain.
    - `chain`: file (HDF5) for the samples while they are drawn.
    - `resume`: go on with the chain in that file, if there is one, of the same photographs, seed and program.
    - `further`: say which further photograph would tell most, as well (`inverse.further`).
    """
    if (draws or 0) < 0 or seed < 0:
        raise InputError(f"There can be no {draws} draws or seed {seed}: give whole numbers from 0.")
    check_exposure(exposure)
    response = checked_response(response)
    started = timer.perf_counter()
    if isinstance(photographs, str | PathLike):
        photographs = [photographs]
    evidence = gather(
        photographs, time=time, site=site, disc=disc, clock=clock, progress=lambda *a: progress(Progress(*a))
    )  # fmt: skip
    progress(Progress("fitting", 0, STAGES))
    likelihood = prepare(evidence, exposure, response)
    depends_on = identity(evidence, likelihood.parameters, disc, clock, exposure, response, seed)
    file = None if chain is None else Path(chain)
    record = read_record(file, depends_on) if resume and file is not None and file.exists() else None
    if record is None:
        around = [item.neighbours() for item in evidence]
        optimum, likelihood = best(likelihood, around, lambda done: progress(Progress("fitting", done, STAGES)))
    else:
        optimum, likelihood, first_draws = begun(record.beginning, likelihood)
        draws = first_draws if draws is None else draws
        progress(Progress("fitting", STAGES, STAGES))
    numbers = beginning(optimum, likelihood, draws)
    found = answer(
        likelihood, optimum, draws=draws, seed=seed,
        before=None if record is None else record.chain,
        keep=lambda samples: None if file is None else Record(depends_on, numbers, samples).write(file),
        progress=lambda stage, done, of: progress(Progress(stage, done, of)),
    )  # fmt: skip
    seconds = timer.perf_counter() - started
    how = provenance(evidence, clock, exposure, response, seed)
    others = advice(evidence, likelihood, optimum) if further else None
    return conclude(
        evidence, likelihood, optimum, found, how, {"further_photographs": others, "seconds": seconds}
    )  # fmt: skip


def conclude(
    evidence: list[Evidence],
    likelihood: Likelihood,
    optimum: Optimum,
    found: Answer,
    how: dict[str, Any],
    more: dict[str, Any],
) -> Fit:
    """Put everything that was found into a `Fit`; `how` is its `provenance`, `more` are other diagnostics."""
    random = np.random.default_rng(how["seed"])
    prior_draws = random.standard_normal((4000, LIMB))
    quantities, named, named_prior = estimates(likelihood, optimum, found, prior_draws)
    shown = random.choice(found.z.reshape(-1, LIMB), SHOWN)
    normal = random.standard_normal((SHOWN, len(optimum.z) - LIMB))
    pairs = list(zip(shown, normal, strict=True))
    joint = np.array(list(side_by_side(lambda pair: with_nuisances(likelihood, optimum, *pair), pairs)))
    photos = tuple(photo_fits(evidence, likelihood, optimum.z, joint))
    diagnostics = {
        "converged": optimum.converged,
        "steps": optimum.steps,
        "other_ends": other_ends(optimum),
        "costs_of_starts": [cost if np.isfinite(cost) else None for cost in optimum.costs],
        "steps_not_finite": optimum.not_finite,
        "errors": [
            {name: getattr(errors, name) for name in ("independent", "smooth", "chromatic", "uneven")}
            for errors in likelihood.errors
        ],
        "misfit_checks": misfit_checks(likelihood, optimum),
        "information": information(optimum, likelihood.labels),
        "independent_errors": under_independent_errors(likelihood, optimum),
        "condition_number": float(np.linalg.cond(optimum.covariance)),
        "residual_rms": [photo.residual_rms for photo in photos],
        "cells": [int(photo.usable.any(axis=1).sum()) for photo in photos],
        **found.report,
        **more,
    }
    return Fit(
        estimates=quantities,
        draws=named,
        prior_draws=named_prior,
        photos=photos,
        diagnostics=diagnostics,
        warnings=tuple(warnings_of(evidence, quantities, diagnostics)),
        provenance=how,
        log_posterior=found.log_posterior,
    )
