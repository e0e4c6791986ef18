"""Fit the smooth ozone profile of `eclipsejax.atmosphere` to the AFGL U.S. Standard table.

Four Gaussians in altitude, weighted so that both the layer and the troposphere count.
Prints the constants and the error; run it as `python eclipsejax/tables/fit_ozone_profile.py`.
"""

from pathlib import Path

import numpy as np
from scipy.optimize import least_squares


def gaussians(parameters: np.ndarray, altitude_km: np.ndarray) -> np.ndarray:
    log_peak, centre, log_width = parameters.reshape(-1, 3).T[..., None]
    return np.sum(np.exp(log_peak - 0.5 * ((altitude_km - centre) / np.exp(log_width)) ** 2), axis=0)


def main() -> None:
    table = np.loadtxt(Path(__file__).with_name("atmosphere_profiles_afgl1986.csv"), delimiter=",")
    altitude_km, density = table[table[:, 0] <= 85][:, [0, 4]].T
    density = density / 1e18
    weight = np.sqrt(np.gradient(altitude_km)) / (0.01 + 0.03 * density)
    start = np.array([1.3, 21, 1.2, 0.5, 30, 1.8, -0.5, 0, 1.8, -1, 12, 0.5])
    fit = least_squares(lambda p: (gaussians(p, altitude_km) - density) * weight, start, loss="soft_l1", max_nfev=20000)
    error = gaussians(fit.x, altitude_km) - density
    for log_peak, centre, log_width in fit.x.reshape(-1, 3):
        print(f"({np.exp(log_peak):.4f}e18, {centre * 1e3:.1f}, {np.exp(log_width) * 1e3:.1f}),")
    print(f"rms error {100 * np.sqrt(np.mean(error**2)) / density.max():.2f} % of the peak")
    column = np.trapezoid(density, altitude_km) * 1e21 / 2.6867e20
    print(f"column of the table {column:.2f} DU")


if __name__ == "__main__":
    main()
