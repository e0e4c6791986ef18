"""Makes few_wavelengths.csv: `python -m eclipsejax.tables.make_few_wavelengths`, about a minute.

Eight wavelengths and weights that stand for 200 between 380 and 780 nm in the CIE XYZ of the eclipsed Moon above the
air. They are fitted to the whole umbra, out to 46' from the axis, under 48 atmospheres: surface, ozone, dust to an
extinction of 1e-5 /m, haze and clouds at random. Of the 200 wavelengths one after the other is taken, each the one with
which the best weights leave the least error, then all are exchanged, one at a time, while that helps. Errors count
relative to the brightest of linear sRGB at each point, so that the darkest point counts like the brightest; rows that
are worst fitted weigh more from round to round. Prints the largest error over 48 other atmospheres, and that of three
wavelengths taken for R, G and B.
"""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone
from eclipsejax.constants import ASTRONOMICAL_UNIT, MOON_MEAN_DISTANCE
from eclipsejax.moon import Moon
from eclipsejax.response import SRGB_FROM_XYZ
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.sun import Sun
from eclipsejax.wavelengths import MANY, binned_weights

COUNT, ATMOSPHERES = 8, 48
OFFSETS = np.linspace(0.0, np.radians(46.0 / 60.0), 48)
THREE = (610.0, 550.0, 465.0)  # nm, for red, green and blue
HEADER = """# Eight wavelengths for the XYZ of the eclipsed Moon: weights of irradiance in units of full sunlight;
# the Sun of Gueymard (2004), the Moon of Apollo 16 soil 62231 and CIE 1931 are in them. By make_few_wavelengths.py.
wavelength_nm,x,y,z
"""


def spectra(seed: int, wavelength, offset: np.ndarray, atmospheres: int) -> np.ndarray:
    """Light of the shadow under random atmospheres, (atmosphere x offset, wavelength)."""
    distance = jnp.asarray([MOON_MEAN_DISTANCE])
    operator = eqx.filter_jit(shadow_operator)(
        Sun(), jnp.asarray(offset)[None], distance, ASTRONOMICAL_UNIT, wavelength, tolerance=1e-3
    )
    light = eqx.filter_jit(lambda operator, atmosphere: operator(atmosphere)[0])
    random, found = np.random.default_rng(seed), []
    for _ in range(atmospheres):
        atmosphere = Atmosphere(
            air=Air(random.uniform(260.0, 305.0), random.uniform(97e3, 104e3)),
            ozone=Ozone(random.uniform(220.0, 450.0)),
            dust=Dust(random.choice([0.0, 1.0]) * random.uniform(0.0, 1e-5)),
            haze=Haze(random.uniform(0.0, 0.3)),
            clouds=Clouds(random.uniform(0.0, 12e3), random.uniform(0.0, 0.99), random.uniform(1e3, 5e3)),
        )
        found.append(np.asarray(light(operator, atmosphere)))
    return np.concatenate(found)


def fitted(chosen, light, target, rows):
    """Best weights (wavelength, 3) of the chosen wavelengths."""
    return np.linalg.lstsq(light[:, chosen] * rows[:, None], target * rows[:, None], rcond=None)[0]


def errors(light, target) -> np.ndarray:
    """Largest error of linear sRGB at each point, relative to its brightest channel."""
    true, found = target @ SRGB_FROM_XYZ.T, light @ SRGB_FROM_XYZ.T
    return np.abs(found - true).max(axis=1) / true.max(axis=1)


def chosen_wavelengths(light, target, rows) -> list[int]:
    """Indices: greedily, then by exchanges."""

    def cost(chosen):
        return np.sum(rows**2 * np.sum((light[:, chosen] @ fitted(chosen, light, target, rows) - target) ** 2, axis=1))

    chosen: list[int] = []
    for _ in range(COUNT):
        chosen.append(min((k for k in range(MANY) if k not in chosen), key=lambda k: cost([*chosen, k])))
    while True:
        before = cost(chosen)
        for place in range(COUNT):
            rest = chosen[:place] + chosen[place + 1 :]
            near = {k for k in range(chosen[place] - 6, chosen[place] + 7) if 0 <= k < MANY and k not in rest}
            chosen[place] = min(near, key=lambda k: cost([*rest, k]))  # noqa: B023
        if cost(chosen) > 0.99 * before:
            return sorted(chosen)


def main():
    jax.config.update("jax_enable_x64", True)
    wavelength, weights = (np.asarray(part) for part in binned_weights(Sun(), Moon(), "xyz", MANY))
    light, other = (spectra(seed, jnp.asarray(wavelength), OFFSETS, ATMOSPHERES) for seed in (1, 2))
    target, other_target = light @ weights, other @ weights
    rows = 1.0 / (target @ SRGB_FROM_XYZ.T).max(axis=1)
    chosen, best = [], None
    for _ in range(6):
        chosen = chosen_wavelengths(light[::4], target[::4], rows[::4])
        few = fitted(chosen, light, target, rows)
        worst = errors(light[:, chosen] @ few, target)
        if best is None or worst.max() < best[0]:
            best = worst.max(), chosen, few
        rows = rows * np.sqrt(0.3 + worst / worst.max())
    assert best is not None
    _, chosen, few = best
    table = np.column_stack([wavelength[chosen], few])
    with Path(__file__).with_name("few_wavelengths.csv").open("w", encoding="utf-8") as file:
        file.write(HEADER)
        np.savetxt(file, table, delimiter=",", fmt=("%.0f", "%.9f", "%.9f", "%.9f"))
    left = errors(other[:, chosen] @ few, other_target)
    print(
        f"{COUNT} wavelengths {wavelength[chosen]}: largest error {left.max():.2%}, rms {np.sqrt(np.mean(left**2)):.2%}"
    )

    three = [int(np.argmin(np.abs(wavelength - one))) for one in THREE]
    full = weights.sum(axis=0) @ SRGB_FROM_XYZ.T  # of the uneclipsed Moon
    naive = other[:, three] * full @ np.linalg.inv(SRGB_FROM_XYZ).T
    left = errors(naive, other_target)
    print(f"3 wavelengths for R, G, B: largest error {left.max():.0%}, rms {np.sqrt(np.mean(left**2)):.0%}")


if __name__ == "__main__":
    main()
