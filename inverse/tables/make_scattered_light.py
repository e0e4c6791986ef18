"""Writes scattered_light.csv, the coefficients of `inverse.scattered_light`, and prints how far they are off.

    python -m inverse.tables.make_scattered_light

At each of a few levels of dust the light of limbs drawn from the prior is fitted by least squares, the Moon anywhere
between perigee and apogee. Then other limbs are drawn, with dust of the prior, too. Fifteen seconds.
"""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax import session
from eclipsejax.constants import MOON_MEAN_DISTANCE
from eclipsejax.moon import Moon
from eclipsejax.scattered import scattered_irradiance
from eclipsejax.sun import Sun
from eclipsejax.wavelengths import channel_weights
from inverse import prior
from inverse.scattered_light import LITTLE, TERMS, log_dust, log_scattered, terms

TARGET = Path(__file__).parent / "scattered_light.csv"
LEVELS, LEAST, MOST = 11, 2e-9, 6e-5  # 1/m
FITTED, CHECKED = 200, 1000  # limbs, at each level and with any dust
OFFSETS = np.radians(np.array([20.0, 0.0, 40.0]) / 60.0)  # the first one is fitted
APSIDES = (0.945, 1.055)  # mean distances

HEADER = """\
# Log of the light that the limb scatters into the umbra, 20' from the axis, in the channels of a Nikon 5100, white on
# the uneclipsed Moon: dust [1/m], then coefficients of the terms of inverse.scattered_light, fitted to limbs drawn from
# the prior under eclipsejax.scattered_irradiance. Written by make_scattered_light.py.
"""


def extinctions() -> np.ndarray:
    """Levels of dust, Chebyshev's in the scale that the curve has (level,) [1/m]."""
    low, high = np.asarray(log_dust(np.array([LEAST, MOST])))
    place = 0.5 * (1.0 - np.cos(np.pi * np.arange(LEVELS) / (LEVELS - 1)))
    return np.exp(low + (high - low) * place) - LITTLE


def limbs(random, count: int, extinction: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Parameters z (limb, parameter) and distances of the Moon [m] (limb,), all with one dust if it is given."""
    z = random.standard_normal((count, len(prior.ATMOSPHERE)))
    if extinction is not None:
        dust = prior.ATMOSPHERE[0]
        z[:, 0] = np.log(extinction / dust.centre) / dust.width
    return z, MOON_MEAN_DISTANCE * random.uniform(*APSIDES, count)


def main() -> None:
    session.start()
    wavelength, weights = channel_weights(Sun(), Moon(), "nikon_5100", 24)
    weights = weights / weights.sum(axis=0)

    @eqx.filter_jit
    def light(z, distance):
        return scattered_irradiance(prior.atmosphere(z), OFFSETS, wavelength, moon_distance=distance) @ weights

    def log_light(z, distances):
        return np.log([np.asarray(light(jnp.asarray(one), far)) for one, far in zip(z, distances, strict=True)])

    @jax.vmap
    def every_term(z, distance):
        return terms(prior.values(prior.ATMOSPHERE, z), distance)

    random = np.random.default_rng(20221108)
    lines = ["extinction,term,red,green,blue"]
    for extinction in extinctions():
        z, distances = limbs(random, FITTED, extinction)
        columns = np.asarray(every_term(z, distances))
        found, *_ = np.linalg.lstsq(columns, log_light(z, distances)[:, 0], rcond=None)
        for term, row in zip(TERMS, found, strict=True):
            lines.append(f"{extinction:.4e},{term}," + ",".join(f"{value:.4f}" for value in row))
    TARGET.write_text(HEADER + "\n".join(lines) + "\n")
    print(f"Wrote {TARGET.name}")

    z, distances = limbs(random, CHECKED)
    told = jax.vmap(lambda z, d: log_scattered(prior.values(prior.ATMOSPHERE, z), d))(z, distances)
    off = log_light(z, distances) - np.asarray(told)[:, None]
    for offset, apart in zip(OFFSETS, off.swapaxes(0, 1), strict=True):
        rms, most = np.sqrt(np.mean(apart**2, axis=0)), np.quantile(np.abs(apart), 0.99, axis=0)
        print(
            f"{60 * np.degrees(offset):.0f}' from the axis: mean {apart.mean(axis=0).round(3)}, rms {rms.round(3)}, "
            f"99 % within {most.round(3)} (red, green, blue; natural log)"
        )


if __name__ == "__main__":
    main()
