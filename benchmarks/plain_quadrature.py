"""The quadrature of `limb` as one would first write it: NumPy, Gauss-Legendre in sqrt(z - z_t), no derivatives.

The nodes do not depend on wavelength, so the standard air and ozone of `tests.oracles` are evaluated once a node
and multiplied by the spectra afterwards. The air is clear: U.S. Standard Atmosphere and ozone.
"""

import numpy as np

from tests import oracles


def clear_rays(tangent_height, refractivity, rayleigh, ozone, column_du, order) -> tuple[np.ndarray, np.ndarray]:
    """Bending angle [rad] and optical depth [-] of grazing rays, shape (tangent, wavelength).

    - `tangent_height`: [m].
    - `refractivity`: of air at 15 C and 1 atm, by wavelength [-].
    - `rayleigh`, `ozone`: cross-sections by wavelength [m^2].
    - `column_du`: of ozone [Dobson units].
    - `order`: nodes between two breaks of the profile.
    """
    node, weight = np.polynomial.legendre.leggauss(order)
    node, weight = 0.5 * (node + 1.0), 0.5 * weight
    breaks = oracles.Limb(0.0, 0.0, dust=(0.0, 0.0, oracles.TOP)).breaks()
    tangent = tangent_height[:, None, None]
    ends = np.sqrt(np.maximum(breaks - tangent_height[:, None], 0.0))
    start, width = ends[:, :-1, None], np.diff(ends)[:, :, None]
    t = start + width * node  # (tangent, panel, node)
    measure = (width * weight * 2.0 * t).reshape(tangent_height.size, -1)
    rise = (t**2).reshape(measure.shape)
    # Rounding must not leave the panel: a node that lies in the next layer has the other lapse rate.
    floor, ceiling = breaks[:-1, None], np.nextafter(breaks[1:, None], 0.0)
    altitude = np.clip(tangent + t**2, np.maximum(floor, tangent), np.maximum(ceiling, tangent)).reshape(measure.shape)

    ratio, slope, density = _air(altitude)
    grazed, _, _ = _air(tangent_height[:, None])
    gases = np.stack([density, oracles.ozone_density(altitude, column_du)])
    spectra = np.stack([rayleigh, ozone])

    bending, depth = np.empty((2, tangent_height.size, refractivity.size))
    for i, standard in enumerate(refractivity):  # a wavelength at a time fits into the processor's cache
        impact = (oracles.RADIUS + tangent_height[:, None]) * (1.0 + standard * grazed)
        index = 1.0 + standard * ratio
        excess = rise * index + (oracles.RADIUS + tangent_height[:, None]) * standard * (ratio - grazed)
        inside = excess > 0.0
        common = np.where(inside, measure / np.sqrt(np.where(inside, excess * (excess + 2.0 * impact), 1.0)), 0.0)
        bending[:, i] = -2.0 * impact[:, 0] * np.sum(common * standard * slope / index, axis=1)
        path = common * (oracles.RADIUS + altitude) * index
        depth[:, i] = 2.0 * np.einsum("tn,gtn,g->t", path, gases, spectra[:, i])
    return bending, depth


def _air(altitude):
    """Density relative to 15 C and 1 atm, its slope [1/m] and the number density [m^-3]."""
    temperature, pressure, _, lapse = oracles.standard_air(altitude)
    ratio = pressure / 101325.0 * 288.15 / temperature
    gravity = (oracles.POTENTIAL_RADIUS / (oracles.POTENTIAL_RADIUS + altitude)) ** 2
    slope = -ratio * (oracles.HYDROSTATIC * gravity + lapse) / temperature
    return ratio, slope, pressure / (1.380622e-23 * temperature)
