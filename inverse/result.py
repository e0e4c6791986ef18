"""What a fit found: numbers, pictures to look at, and how it was done."""

import json
import warnings
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from eclipsejax.errors import InputError
from eclipsejax.whole_file import reason, whole_file
from inverse.diagnostics import arviz

NEAR_ZERO = 1.5  # times the lower end of the prior's 95 %
SIGNAL = 10.0  # times its noise: from there on a misfit of a cell is the model's


@dataclass(frozen=True)
class Estimate:
    """One quantity after the fit, in its own unit.

    - `map`, `sd`: at the optimum, by Laplace's approximation.
    - `median`, `ci68`, `ci95`: of the posterior; Laplace's where nothing was sampled.
    - `prior_sd`: standard deviation of the prior about `map`; `informed`: 1 - (sd / prior sd)^2 of z, the share of the
      variance that the photograph took away.
    - `ess`, `ess_tail`: effective samples for the middle and for the tails; by importance sampling one for both.
    - `r_hat`, `autocorrelation_time` [steps]: of the chains. None where nothing was sampled.
    """

    name: str
    unit: str
    map: float
    sd: float
    median: float
    ci68: tuple[float, float]
    ci95: tuple[float, float]
    prior_ci95: tuple[float, float]
    informed: float
    ess: float | None = None
    autocorrelation_time: float | None = None
    ess_tail: float | None = None
    r_hat: float | None = None

    @property
    def is_limit(self) -> bool:
        """Whether a positive quantity reaches down to where its prior ends: its upper end alone was found."""
        return self.ci95[0] < NEAR_ZERO * self.prior_ci95[0]


@dataclass(frozen=True)
class PhotoFit:
    """One photograph beside its model.

    - `name`: file name; `utc`: time as fitted, the clock's error included.
    - `registration`: None for a profile.
    - `offset`: of each cell from the shadow's axis [rad] (cell,); `on_disc`, `usable` (cell, 3).
    - `observed`, `predicted`: decoded pixel values [full scale] (cell, 3); `noise`: standard deviation of `observed`
      from noise of the pixels, and from what a file knows of black.
    - `albedo`: relative surface brightness that the model gives the cell (cell,).
    - `drawn`: `predicted` for draws from the posterior (draw, cell, 3).
    - `floor`: of logs: what is compared is the log of values above it, here as in the fit [full scale].
    - `image`, `model_image`: the same square around the disc, decoded [full scale] (row, column, 3), up to `reach`
      radii from the centre; NaN outside the frame. None for a profile.
    - `shadow`: place of each cell in the shadow, east and north of its axis [rad] (cell, 2). None for a profile.
    - `shared`: by how much the log of `observed` exceeds that of `predicted` according to all photographs of the fit
      together: errors of limb and map (`inverse.shared_errors`) (cell, 3). None for a profile; 0 in a fit of one.
    """

    name: str
    utc: str
    registration: Any | None
    offset: np.ndarray
    on_disc: np.ndarray
    usable: np.ndarray
    observed: np.ndarray
    predicted: np.ndarray
    noise: np.ndarray
    albedo: np.ndarray
    drawn: np.ndarray
    image: np.ndarray | None = None
    model_image: np.ndarray | None = None
    reach: float = 1.3
    floor: float = 0.0
    shadow: np.ndarray | None = None
    shared: np.ndarray | None = None

    @property
    def lit(self) -> np.ndarray:
        """Usable cells of the disc whose values have a logarithm (cell, 3)."""
        return self.usable & self.on_disc[:, None] & (self.observed > 0) & (self.predicted > 0)

    @property
    def bright(self) -> np.ndarray:
        """Those whose signal is more than `SIGNAL` times their noise (cell, 3)."""
        return self.lit & (self.observed > SIGNAL * self.noise)

    @property
    def residual_rms(self) -> float:
        """Of ln(observed / predicted), both above the floor, over `bright` cells, or over `lit` ones if none is [-]."""
        good = self.bright if self.bright.any() else self.lit
        observed, predicted = self.observed[good] + self.floor, self.predicted[good] + self.floor
        return float(np.sqrt(np.mean(np.log(observed / predicted) ** 2)))


@dataclass(frozen=True)
class Fit:
    """The atmosphere that coloured one eclipse.

    - `estimates`: by name: the limb, what follows from it, and the nuisances (their names begin with the
      photograph's number).
    - `draws`: posterior draws of the limb's quantities by name, (chain, draw); from Laplace's Gaussian where
      nothing was sampled. `prior_draws`: the same from the prior, (draw,).
    """

    estimates: dict[str, Estimate]
    draws: dict[str, np.ndarray]
    prior_draws: dict[str, np.ndarray]
    photos: tuple[PhotoFit, ...]
    diagnostics: dict[str, Any]
    warnings: tuple[str, ...]
    provenance: dict[str, Any]
    log_posterior: np.ndarray | None = field(default=None, repr=False)

    def summary(self) -> str:
        """A table of the limb's quantities with intervals."""
        lines = [
            f"{'':32}{'unit':>8}{'MAP':>12}{'sd':>11}{'median':>12}{'68 %':>25}{'95 %':>25}"
            f"{'informed':>10}{'ESS':>8}{'tau':>7}"
        ]
        for estimate in self.estimates.values():
            if estimate.name not in self.draws:
                continue
            ess = "" if estimate.ess is None else f"{estimate.ess:.0f}"
            tau = "" if estimate.autocorrelation_time is None else f"{estimate.autocorrelation_time:.0f}"
            lines.append(
                f"{estimate.name:32}{estimate.unit:>8}{estimate.map:12.4g}{estimate.sd:11.3g}{estimate.median:12.4g}"
                f"{_interval(estimate.ci68):>25}{_interval(estimate.ci95):>25}"
                f"{100 * estimate.informed:9.0f}%{ess:>8}{tau:>7}"
            )
        return "\n".join(lines)

    def sentence(self) -> str:
        """The result in words: alpha, and always the vertical optical depth that it means."""
        alpha, depth = self.estimates["dust.extinction"], self.estimates["stratospheric_optical_depth"]
        if alpha.is_limit:
            return (
                f"Stratospheric dust alpha is below {alpha.ci95[1]:.2g} /m (97.5 %), a vertical optical depth below "
                f"{depth.ci95[1]:.2g}: no lower limit was found."
            )
        return (
            f"Stratospheric dust alpha = {alpha.median:.2g} /m (95 %: {alpha.ci95[0]:.2g} to {alpha.ci95[1]:.2g}), "
            f"a vertical optical depth of {depth.median:.2g} (95 %: {depth.ci95[0]:.2g} to {depth.ci95[1]:.2g})."
        )

    @property
    def posterior(self):
        """The draws as arviz InferenceData, with those of the prior beside them."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="More chains")  # more walkers than steps are no mistake
            return arviz().from_dict(
                posterior=self.draws,
                prior={name: values[None] for name, values in self.prior_draws.items()},
                sample_stats=None if self.log_posterior is None else {"lp": self.log_posterior},
                attrs={key: str(value) for key, value in self.provenance.items()},
            )

    def to_dict(self) -> dict[str, Any]:
        """What `fit.json` holds."""
        return {
            "parameters": {
                name: {key: value for key, value in asdict(estimate).items() if key != "name"}
                for name, estimate in self.estimates.items()
            },
            "registration": [
                None
                if photo.registration is None
                else {"photo": photo.name, "utc": photo.utc, **asdict(photo.registration)}
                for photo in self.photos
            ],
            "diagnostics": self.diagnostics,
            "warnings": list(self.warnings),
            "provenance": self.provenance,
        }

    def save(self, folder: str | Path) -> list[Path]:
        """Write fit.json, posterior.nc, the pictures and report.html, each whole or not; returns what was written."""
        from inverse.html_report import write_html
        from inverse.report import write_pictures

        folder = Path(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            written = [folder / "fit.json", folder / "posterior.nc"]
            with whole_file(written[0]) as part:
                part.write_text(json.dumps(self.to_dict(), indent=2, default=_plain) + "\n")
            with whole_file(written[1]) as part:
                self.posterior.to_netcdf(str(part))
            pictures = write_pictures(self, folder)
            return [*written, *pictures, write_html(self, folder, pictures)]
        except OSError as error:
            raise InputError(
                f"The report cannot be written to {folder}: {reason(error)}; give --out a folder."
            ) from None


def _interval(ends: tuple[float, float]) -> str:
    return f"{ends[0]:.3g} .. {ends[1]:.3g}"


def _plain(value):
    """numpy for json."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
