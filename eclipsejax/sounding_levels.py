"""Levels of a table of air, before they become a `Sounding`: refused, thinned, continued. Plain NumPy.

All columns are altitude [m], temperature [K] and pressure [Pa], from the lowest level up.
"""

import numpy as np

from eclipsejax import constants
from eclipsejax.air import HYDROSTATIC, geometric, geopotential, layer_column
from eclipsejax.errors import InputError

_LAPSE_RATE = -6.5e-3  # K/m, between a table's lowest level and the sea
# U.S. Standard Atmosphere 1976: geopotential height [m] and temperature [K] of the layer bases above 32 km.
_STANDARD = ((47e3, 270.65), (51e3, 270.65), (71e3, 214.65), (84852.05, 186.946))
_REACH = 5e3  # m, from a table's last level to the first of the standard's
_HIGHEST_GROUND, _LOWEST_TOP = 6e3, 10e3  # m: where a table must begin and end
_FEWEST = 5  # levels of a table
_COLDEST, _WARMEST = 100.0, 400.0  # K, up to 120 km
_THIN = 0.01  # of the density at the lowest level; where air is thinner its errors count less
_HYDROSTATIC_ERROR = 0.3  # of w: moisture makes 0.02, the lighter air at 110 km 0.1, wrong units more
_REFRACTIVITY = 2.8393e-4  # of air at 15 C and 1013.25 hPa at 380 nm, where it refracts most; Ciddor (1996)


def table_levels(altitude, temperature, pressure, *, tolerance: float, count: int):
    """The columns that `Sounding.from_table` makes of a table."""
    z, t, p = checked(altitude, temperature, pressure)
    if z[0] > _HIGHEST_GROUND or z[-1] < _LOWEST_TOP:
        raise InputError(
            f"The table runs from {z[0]:g} to {z[-1]:g} m: it must begin below {_HIGHEST_GROUND:g} m and reach "
            f"{_LOWEST_TOP:g} m (is it in metres?)."
        )
    inside = z <= constants.ATMOSPHERE_TOP
    if np.sum(inside) < _FEWEST:
        raise InputError(f"The table has {np.sum(inside)} levels below 120 km: it needs {_FEWEST} or more.")
    height, t, log_pressure = geopotential(z[inside]), t[inside], np.log(p[inside])
    _refuse_unbalanced(height, t, log_pressure)
    kept = _kept(height, t, log_pressure, tolerance, count)
    height, t, log_pressure = _continued(height[kept], t[kept], log_pressure[kept])
    return geometric(height), t, np.exp(log_pressure)


def _continued(height, t, log_pressure):
    """With levels added down to the sea and up to the U.S. Standard Atmosphere's, by the weight of the air."""
    if height[0] > 0.0:
        ground = t[0] - _LAPSE_RATE * height[0]
        column = layer_column(height[0], ground, _LAPSE_RATE, np)
        height, t = np.insert(height, 0, 0.0), np.insert(t, 0, ground)
        log_pressure = np.insert(log_pressure, 0, log_pressure[0] + HYDROSTATIC * column)
    for base, warmth in _STANDARD:
        if base >= height[-1] + _REACH:
            lapse = (warmth - t[-1]) / (base - height[-1])
            column = layer_column(base - height[-1], t[-1], lapse, np)
            height, t = np.append(height, base), np.append(t, warmth)
            log_pressure = np.append(log_pressure, log_pressure[-1] - HYDROSTATIC * column)
    return height, t, log_pressure


def checked(altitude, temperature, pressure):
    """The columns; `InputError` for those that are no sounding."""
    if (
        not altitude.ndim == temperature.ndim == pressure.ndim == 1
        or not altitude.size == temperature.size == pressure.size
    ):
        raise InputError(
            "A sounding needs altitude, temperature and pressure of every level: give columns of one length."
        )
    if altitude.size < 2:
        raise InputError(f"A sounding of {altitude.size} levels is no profile: give more levels.")
    bad = np.flatnonzero(~np.isfinite(altitude + temperature + pressure))
    if bad.size:
        raise InputError(f"Level {bad[0] + 1} of the sounding lacks a number: leave that level out.")
    bad = np.flatnonzero(np.diff(altitude) <= 0.0)
    if bad.size:
        raise InputError(
            f"Level {bad[0] + 2} of the sounding, at {altitude[bad[0] + 1]:g} m, is not above the one before: sort "
            "the levels by altitude, each once."
        )
    low = altitude <= constants.ATMOSPHERE_TOP
    bad = np.flatnonzero((temperature < _COLDEST) | ((temperature > _WARMEST) & low))
    if bad.size:
        raise InputError(
            f"The temperature {temperature[bad[0]]:g} K of level {bad[0] + 1} is not one of the air below 120 km: "
            "give kelvin."
        )
    if np.any(pressure <= 0.0) or np.any(np.diff(pressure) >= 0.0):
        bad = np.flatnonzero((pressure <= 0.0) | (np.diff(pressure, prepend=np.inf) >= 0.0))[0]
        raise InputError(
            f"The pressure {pressure[bad]:g} Pa of level {bad + 1} is not positive and below that of the level under "
            "it: correct it, or leave that level out."
        )
    return altitude, temperature, pressure


def _kept(height, temperature, log_pressure, tolerance, count):
    """Indices of the levels that `Sounding.from_table` keeps."""
    density = np.exp(log_pressure) / temperature

    def error(kept):
        layer = np.clip(np.searchsorted(kept, np.arange(height.size), side="right") - 1, 0, kept.size - 2)
        base, top = kept[layer], kept[layer + 1]
        lapse = (temperature[top] - temperature[base]) / (height[top] - height[base])
        above = layer_column(height - height[base], temperature[base], lapse, np)
        whole = layer_column(height[top] - height[base], temperature[base], lapse, np)
        pressure = np.exp(log_pressure[base] + (log_pressure[top] - log_pressure[base]) * above / whole)
        found = pressure / (temperature[base] + lapse * (height - height[base]))
        return np.abs(found - density) / (density + _THIN * density[0])

    kept = np.array([0, height.size - 1])
    while kept.size < min(4 * count, height.size) and np.max(error(kept)) > tolerance:
        kept = np.sort(np.append(kept, np.argmax(error(kept))))
    while kept.size > 2:
        errors = [np.max(error(np.delete(kept, i))) for i in range(1, kept.size - 1)]
        if min(errors) > tolerance and kept.size <= count:
            break
        kept = np.delete(kept, 1 + int(np.argmin(errors)))
    return kept


def _refuse_unbalanced(height, temperature, log_pressure):
    """`InputError` where pressure falls as it cannot in air of these temperatures, over 2 km: less may be rounding."""
    column = np.cumsum(layer_column(np.diff(height), temperature[:-1], np.diff(temperature) / np.diff(height), np))
    column = np.insert(column, 0, 0.0)
    marks = np.flatnonzero(np.diff(np.floor(height / 2e3), prepend=-np.inf))
    weight = -np.diff(log_pressure[marks]) / np.diff(column[marks])
    bad = np.flatnonzero((np.abs(weight / HYDROSTATIC - 1.0) > _HYDROSTATIC_ERROR) & (np.diff(height[marks]) > 1e3))
    if bad.size:
        base, top = geometric(height[marks[bad[0]]]), geometric(height[marks[bad[0] + 1]])
        raise InputError(
            f"Between {base:.0f} and {top:.0f} m pressure falls {weight[bad[0]] / HYDROSTATIC:.2f} times as fast as "
            "the weight of the air lets it: check the units of the table."
        )


def refuse_ducts(altitude, temperature, pressure, refraction):
    """`InputError` where n r falls with altitude: no ray is lowest there, and light from below never leaves."""
    height, radius = geopotential(altitude), constants.EARTH_RADIUS + altitude
    lapse = np.diff(temperature) / np.diff(height)
    weight = -np.diff(np.log(pressure)) / layer_column(np.diff(height), temperature[:-1], lapse, np)
    density_ratio = pressure / constants.STANDARD_PRESSURE * constants.STANDARD_TEMPERATURE / temperature
    refractivity = refraction * _REFRACTIVITY * density_ratio
    gravity = (constants.GEOPOTENTIAL_RADIUS / (constants.GEOPOTENTIAL_RADIUS + altitude)) ** 2
    slowing = radius * refractivity * gravity / temperature  # times (w + lapse) this is -r dn/dr, greatest at an end
    left = (
        1.0 + np.minimum(refractivity[:-1], refractivity[1:]) - np.maximum(slowing[:-1], slowing[1:]) * (weight + lapse)
    )
    if np.any(left <= 0.0):
        layer = np.flatnonzero(left <= 0.0)[0]
        raise InputError(
            f"Between {altitude[layer]:.0f} and {altitude[layer + 1]:.0f} m the air warms so fast, by "
            f"{temperature[layer + 1] - temperature[layer]:.1f} K, that it is a duct for light: leave out levels there."
        )
