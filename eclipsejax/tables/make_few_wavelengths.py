"""Makes few_wavelengths_*.csv: `python -m eclipsejax.tables.make_few_wavelengths`, about two minutes.

A few wavelengths and weights that stand for 200 between 380 and 780 nm in the light of the eclipsed Moon above the air:
eight for CIE XYZ, seven for the channels of a camera. They are fitted to the whole umbra, out to 46' from the axis,
under 48 atmospheres: surface, ozone, dust to an extinction of 1e-5 /m, haze and clouds at random. Of the 200
wavelengths one after the other is taken, each the one with which the best weights leave the least error, then all are
exchanged, one at a time, while that helps. Errors count relative to the light at each point, so that the darkest point
counts like the brightest: of XYZ relative to the brightest of linear sRGB, of a camera to each channel itself, since an
inference compares the channels' logarithms. Points that are worst fitted weigh more from round to round. Prints the
largest error over 48 other atmospheres, and that of three wavelengths taken for R, G and B.
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

ATMOSPHERES = 48
COUNTS = {"srgb": 8, "nikon_5100": 7}
ROUNDS = 6
RIDGE = 1e-11
OFFSETS = np.linspace(0.0, np.radians(46.0 / 60.0), 48)
THREE = (610.0, 550.0, 465.0)  # nm, for red, green and blue
HEADER = """# A few wavelengths for the {} of the eclipsed Moon: weights of irradiance in units of full sunlight;
# the Sun of Gueymard (2004) and the Moon of Apollo 16 soil 62231 are in them. By make_few_wavelengths.py.
wavelength_nm,{}
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
    """Best weights (wavelength, channel) of the chosen wavelengths; `rows`: of the points (point, channel)."""
    solved = [
        np.linalg.lstsq(light[:, chosen] * row[:, None], wanted * row, rcond=None)[0]
        for row, wanted in zip(rows.T, target.T, strict=True)
    ]
    return np.stack(solved, axis=1)


def chosen_wavelengths(count: int, light, target, rows) -> list[int]:
    """Indices: greedily, then by exchanges."""
    weighted = [light * row[:, None] for row in rows.T]
    grams = [part.T @ part for part in weighted]
    products = [part.T @ (wanted * row) for part, wanted, row in zip(weighted, target.T, rows.T, strict=True)]

    def gain(chosen):
        """By how much the best weights make the sum of squares less; large weights that cancel count against them."""
        ridge = RIDGE * np.eye(len(chosen))
        return sum(
            product[chosen] @ np.linalg.solve(gram[np.ix_(chosen, chosen)] + ridge * gram.max(), product[chosen])
            for gram, product in zip(grams, products, strict=True)
        )

    whole = np.sum((target * rows) ** 2)
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(max((k for k in range(MANY) if k not in chosen), key=lambda k: gain([*chosen, k])))
    while True:
        before = whole - gain(chosen)
        for place in range(count):
            rest = chosen[:place] + chosen[place + 1 :]
            near = {k for k in range(chosen[place] - 6, chosen[place] + 7) if 0 <= k < MANY and k not in rest}
            chosen[place] = max(near, key=lambda k: gain([*rest, k]))  # noqa: B023
        if whole - gain(chosen) > 0.99 * before:
            return sorted(chosen)


def best(count: int, light, weights, response: str):
    """Indices of the wavelengths and their weights (wavelength, channel)."""
    target = light @ weights
    rows = np.broadcast_to(1.0 / reference(target, response), target.shape)
    found = None
    for _ in range(ROUNDS):
        chosen = chosen_wavelengths(count, light, target, rows)
        few = fitted(chosen, light, target, rows)
        worst = errors(light[:, chosen] @ few, target, response)
        if found is None or worst.max() < found[0]:
            found = worst.max(), chosen, few
        rows = rows * np.sqrt(0.3 + worst / worst.max())[:, None]
    assert found is not None
    return found[1:]


def reference(target, response: str):
    """What an error is relative to (point, 1 or channel)."""
    return (target @ SRGB_FROM_XYZ.T).max(axis=1, keepdims=True) if response == "srgb" else target


def errors(light, target, response: str) -> np.ndarray:
    """Largest relative error of a channel at each point, for "srgb" of linear sRGB."""
    difference = light - target
    if response == "srgb":
        difference = difference @ SRGB_FROM_XYZ.T
    return np.max(np.abs(difference) / reference(target, response), axis=1)


def main():
    jax.config.update("jax_enable_x64", True)
    wavelength = np.asarray(binned_weights(Sun(), Moon(), "xyz", MANY)[0])
    light, other = (spectra(seed, jnp.asarray(wavelength), OFFSETS, ATMOSPHERES) for seed in (1, 2))
    for response, count in COUNTS.items():
        weights = np.asarray(binned_weights(Sun(), Moon(), "xyz" if response == "srgb" else response, MANY)[1])
        chosen, few = best(count, light, weights, response)
        with Path(__file__).with_name(f"few_wavelengths_{response}.csv").open("w", encoding="utf-8") as file:
            file.write(HEADER.format(*(("CIE XYZ", "x,y,z") if response == "srgb" else (response, "red,green,blue"))))
            np.savetxt(file, np.column_stack([wavelength[chosen], few]), delimiter=",", fmt=["%.0f", *3 * ["%.9f"]])
        left = errors(other[:, chosen] @ few, other @ weights, response)
        print(
            f"{response}: {count} wavelengths {wavelength[chosen]}: largest error {left.max():.2%}, "
            f"rms {np.sqrt(np.mean(left**2)):.2%}"
        )

    three = [int(np.argmin(np.abs(wavelength - one))) for one in THREE]
    weights = np.asarray(binned_weights(Sun(), Moon(), "xyz", MANY)[1])
    full = weights.sum(axis=0) @ SRGB_FROM_XYZ.T  # of the uneclipsed Moon
    naive = other[:, three] * full @ np.linalg.inv(SRGB_FROM_XYZ).T
    left = errors(naive, other @ weights, "srgb")
    print(f"3 wavelengths for R, G, B: largest error {left.max():.0%}, rms {np.sqrt(np.mean(left**2)):.0%}")


if __name__ == "__main__":
    main()
