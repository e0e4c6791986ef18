"""Makes wavelength_mixtures.npz: `python -m eclipsejax.tables.make_wavelength_mixtures`, about a minute.

16, 24 and 48 wavelengths, equally spaced in 1 / wavelength, and the shares of the nearest eight of them in the light
at each of 200: least squares of the relative error, over spectra of the umbra and penumbra out to 46' from the axis
under 60 random atmospheres, those of make_few_wavelengths.py. Offsets are at random too, so that caustics, which pass
an offset at one wavelength after the other, are met everywhere. Prints the largest errors of XYZ and of two cameras
under 60 other atmospheres at other offsets.
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.moon import Moon
from eclipsejax.sun import Sun
from eclipsejax.tables.make_few_wavelengths import spectra
from eclipsejax.wavelengths import MANY, binned_weights

COUNTS, NEAREST, ATMOSPHERES, OFFSETS = (16, 24, 48), 8, 60, 96
FARTHEST = np.radians(46.0 / 60.0)
RIDGE = 1e-12  # of the normal equations, so that shares stay small
RESPONSES = ("xyz", "nikon_5100", "sigma_sdmerill")


def nodes(wavelength: np.ndarray, count: int) -> np.ndarray:
    """Indices of wavelengths equally spaced in 1 / wavelength."""
    inverse = np.linspace(1.0 / wavelength[1], 1.0 / wavelength[-2], count)
    return np.array([np.argmin(np.abs(wavelength - 1.0 / x)) for x in inverse])


def mixture(light: np.ndarray, wavelength: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Shares (wavelength, chosen) of the chosen wavelengths in the light at each."""
    shares = np.zeros((wavelength.size, chosen.size))
    for i, one in enumerate(wavelength):
        near = np.argsort(np.abs(1.0 / wavelength[chosen] - 1.0 / one))[:NEAREST]
        relative = light[:, chosen[near]] / light[:, [i]]
        normal = relative.T @ relative
        shares[i, near] = np.linalg.solve(normal + RIDGE * np.trace(normal) * np.eye(NEAREST), relative.sum(axis=0))
    return shares


def main():
    jax.config.update("jax_enable_x64", True)
    wavelength = np.asarray(binned_weights(Sun(), Moon(), "xyz", MANY)[0])
    random = np.random.default_rng(0)
    light, other = (
        spectra(seed, jnp.asarray(wavelength), np.sort(random.uniform(0.0, FARTHEST, OFFSETS)), ATMOSPHERES)
        for seed in (1, 2)
    )
    table = {}
    for count in COUNTS:
        chosen = nodes(wavelength, count)
        shares = mixture(light, wavelength, chosen)
        table |= {f"wavelength_{count}": wavelength[chosen], f"mixture_{count}": shares}
        for response in RESPONSES:
            weights = np.asarray(binned_weights(Sun(), Moon(), response, MANY)[1])
            error = np.abs(other[:, chosen] @ (shares.T @ weights) / (other @ weights) - 1.0).max(axis=0)
            print(
                f"{count} wavelengths, {response}: largest errors of the channels "
                + " ".join(f"{x:.1e}" for x in error)
            )
    np.savez_compressed(Path(__file__).with_name("wavelength_mixtures.npz"), allow_pickle=False, **table)


if __name__ == "__main__":
    main()
