"""Light scattered once into the shadow, in plain NumPy: lines of sight and sunlight marched through the air.

Nothing is shared with the package but published numbers. Rays are solved in polar coordinates, step by step, without
Bouguer's invariant; at every step of a line of sight the whole limb-darkened disc of the Sun is summed, in the
refracted sky of that point; directions of Earth, Sun and Moon are added on the sphere; scattering goes by its angle.
"""

import numpy as np

from tests.oracles import AU, RADIUS, SOLAR_RADIUS, TOP, Limb

STEP = 3e3  # m


def march(limb: Limb, altitude, depression, reach=TOP):
    """Rays from altitudes [m] with depressions below the horizontal [rad], of one shape, until they leave the air.

    Returns lists along the rays (altitude, depth, angle at the Earth's centre, elevation), and the lowest altitude.
    """
    fine = np.arange(0.0, reach + 2 * STEP, 25.0)  # the ground's air goes on below it
    refractivity, slope = limb.air(fine)
    extinction = limb.extinction(fine)

    def rate(z, elevation):
        turn = np.interp(z, fine, slope) / (1.0 + np.interp(z, fine, refractivity))
        return np.sin(elevation), np.cos(elevation) * (1.0 / (RADIUS + z) + turn), np.cos(elevation) / (RADIUS + z)

    z, elevation = np.array(altitude, dtype=float), -np.array(depression, dtype=float)
    depth, angle, lowest = np.zeros(z.shape), np.zeros(z.shape), z.copy()
    line = [(z, depth, angle, elevation)]
    while np.any((z < reach) & (lowest > -100.0)):
        goes = (z < reach) & (lowest > -100.0)
        step = np.where(goes, STEP, 0.0)
        climb, tilt, _ = rate(z, elevation)
        middle, tilted = z + 0.5 * step * climb, elevation + 0.5 * step * tilt
        climb, tilt, advance = rate(middle, tilted)
        ends = z + step * climb
        thick = [np.interp(height, fine, extinction) for height in (z, middle, ends)]
        depth = depth + step * (thick[0] + 4.0 * thick[1] + thick[2]) / 6.0
        z, elevation, angle = ends, elevation + step * tilt, angle + step * advance
        lowest = np.minimum(lowest, z)
        line.append((z, depth, angle, elevation))
    return line, lowest


def strip(darkening, count=801):
    """The Sun's light against height on the disc [radii], summed to 1."""
    y = np.linspace(-1.0, 1.0, count)
    x = np.linspace(0.0, 1.0, 400)
    across = np.sqrt(1.0 - y**2)[:, None] * x
    mu = np.sqrt(np.maximum(1.0 - y[:, None] ** 2 - across**2, 0.0))
    light = np.trapezoid(np.polynomial.polynomial.polyval(mu, darkening), across, axis=1)
    return y, light / np.trapezoid(light, y)


def sunlight(limb: Limb, darkening, altitudes, zenith):
    """Fraction of sunlight at altitudes and angles of the Sun from the zenith [rad], shape (altitude, angle)."""
    depression = np.radians(np.linspace(-9.5, 9.5, 191))
    z, start = np.broadcast_arrays(altitudes[:, None], depression)
    line, lowest = march(limb, z, start)
    _, depth, angle, elevation = line[-1]
    # At the Earth's centre, from the point: where the ray comes from, the Sun's parallax included.
    source = 0.5 * np.pi + angle - elevation - RADIUS / AU
    clear = np.where(lowest > 0.0, np.exp(-depth) * np.sqrt(limb.transmission(lowest)), 0.0)
    y, light = strip(darkening)
    disc = SOLAR_RADIUS / AU
    found = np.zeros((altitudes.size, zenith.size))
    for i in range(altitudes.size):
        for k, angle_of_sun in enumerate(zenith):
            weight = np.interp((source[i] - angle_of_sun) / disc, y, light, left=0.0, right=0.0) / disc
            found[i, k] = np.trapezoid(weight * clear[i] * np.cos(start[i]), start[i])
    return found


def irradiance(limb: Limb, darkening, offset, scattering, *, distance=3.844e8, azimuths=8):
    """Fraction of sunlight that the limb scatters to a point at `offset` [rad] from the shadow's axis.

    - `scattering`: function of altitudes [m] and the scattering angle [rad], [1/(m sr)].
    """
    # Sunlight at any altitude and zenith angle: splines would do, but linear steps of 1 km and 0.2 degrees suffice.
    altitudes = np.concatenate([np.arange(50.0, 36e3, 1e3), np.arange(36e3, 78e3, 3e3)])
    zenith = np.radians(np.arange(83.0, 97.0, 0.2))
    lit = np.log(np.maximum(sunlight(limb, darkening, altitudes, zenith), 1e-60))

    tangent = np.concatenate([np.arange(0.0, 36e3, 600.0), np.arange(36e3, 75e3, 3e3)])
    line, _ = march(limb, tangent, np.zeros(tangent.size))
    z, depth, angle, elevation = (np.array(part) for part in zip(*line, strict=True))  # (step, ray)
    bend = angle[-1] - elevation[-1]  # of half of the ray
    impact = (RADIUS + tangent) * (1.0 + limb.air(tangent)[0])
    beta = np.arcsin(impact / distance)
    phi = np.pi * (np.arange(azimuths) + 0.5) / azimuths
    steps = np.diff(angle, axis=0, prepend=0.0) * (RADIUS + z) / np.maximum(np.cos(elevation), 0.5)
    weight = 0.5 * (steps + np.append(steps[1:], np.zeros((1, tangent.size)), axis=0))

    total = 0.0
    for side in (-1.0, 1.0):  # towards the Moon, and beyond the tangent point
        gone = np.exp(-(depth[-1] + side * depth)) * np.sqrt(limb.transmission(np.where(side > 0.0, tangent, z)))
        gamma = 0.5 * np.pi - beta + bend + side * angle  # at the Earth's centre, from the Moon
        for azimuth in phi:
            cosine = -np.cos(gamma) * np.cos(offset) + np.sin(gamma) * np.sin(offset) * np.cos(azimuth)
            sun = np.arccos(cosine)
            row = np.interp(z, altitudes, np.arange(altitudes.size))
            column = np.interp(sun, zenith, np.arange(zenith.size))
            i = np.minimum(row.astype(int), altitudes.size - 2)
            k = np.minimum(column.astype(int), zenith.size - 2)
            x, y = row - i, column - k
            light = np.exp(
                (1 - x) * ((1 - y) * lit[i, k] + y * lit[i, k + 1])
                + x * ((1 - y) * lit[i + 1, k] + y * lit[i + 1, k + 1])
            )
            # From the Sun's direction to the Moon's, without refraction: 57' less, or more, than the offset.
            turn = np.hypot(beta - offset * np.cos(azimuth), offset * np.sin(azimuth))
            radiance = np.sum(weight * gone * light * scattering(z, turn), axis=0)
            total += np.trapezoid(radiance * impact / (distance**2 * np.cos(beta)), impact)
    return 2.0 * np.pi / azimuths * total * ((AU + distance) / AU) ** 2


def henyey_greenstein(asymmetry, angle):
    """[1/sr]"""
    return (1 - asymmetry**2) / (1 + asymmetry**2 - 2 * asymmetry * np.cos(angle)) ** 1.5 / (4 * np.pi)


def rayleigh(depolarisation, angle):
    """[1/sr]; Chandrasekhar (1960), section 18."""
    gamma = depolarisation / (2 - depolarisation)
    return 3 / (4 * (1 + 2 * gamma)) * (1 + 3 * gamma + (1 - gamma) * np.cos(angle) ** 2) / (4 * np.pi)
