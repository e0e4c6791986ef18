"""The physics of the package once more, in plain NumPy and SciPy, for the tests to compare with.

Nothing is shared with the package but published numbers. Where the package has one fast rule, this file has a
slow and general one: double-exponential quadrature, which does not care about singular ends, splines through
thousands of rays, and, as a check on the formula itself, vectors in three dimensions.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

RADIUS = 6.371e6  # m
TOP = 120e3  # m
SOLAR_RADIUS = 6.957e8  # m
AU = 1.495978707e11  # m
HYDROSTATIC = 9.80665 * 28.9644e-3 / 8.31432  # K/m
POTENTIAL_RADIUS = 6356.766e3  # m


def standard_air(altitude, surface_temperature=288.15, surface_pressure=101325.0):
    """Temperature [K], pressure [Pa], density [kg/m^3] and dT/dz [K/m], layer by layer as in the standard's text."""
    altitude = np.asarray(altitude, dtype=float)
    height = POTENTIAL_RADIUS * altitude / (POTENTIAL_RADIUS + altitude)
    bases = [0.0, (surface_temperature - 216.65) / 6.5e-3, 20e3, 32e3, 47e3, 51e3, 71e3, 84852.05, 1e6]
    rates = [-6.5e-3, 0.0, 1e-3, 2.8e-3, 0.0, -2.8e-3, -2e-3, 0.0]
    temperature, pressure, lapse = np.empty((3, *height.shape))
    warm, pressed = surface_temperature, surface_pressure
    for base, top, rate in zip(bases[:-1], bases[1:], rates, strict=True):
        inside = height >= base
        h = np.where(inside, height - base, 0.0)
        layer_temperature = warm + rate * h
        power = np.exp(-HYDROSTATIC * h / warm)
        if rate != 0.0:
            power = (warm / np.maximum(layer_temperature, 1.0)) ** (HYDROSTATIC / rate)
        temperature = np.where(inside, layer_temperature, temperature)
        pressure = np.where(inside, pressed * power, pressure)
        lapse = np.where(inside, rate * (POTENTIAL_RADIUS / (POTENTIAL_RADIUS + altitude)) ** 2, lapse)
        thickness = top - base
        end = warm + rate * thickness
        pressed *= np.exp(-HYDROSTATIC * thickness / warm) if rate == 0.0 else (warm / end) ** (HYDROSTATIC / rate)
        warm = end
    return temperature, pressure, pressure * 28.9644e-3 / (8.31432 * temperature), lapse


OZONE_GAUSSIANS = (
    (2.3486, 21047.8, 4459.7),
    (2.6537, 24131.7, 9325.2),
    (0.5817, 104.6, 3653.5),
    (0.5606, 11973.4, 1353.0),
)


def ozone_density(altitude, column_du):
    """Number density [m^-3], normalised by adaptive quadrature from the ground up."""

    def shape(z):
        return sum(peak * np.exp(-(((z - centre) / width) ** 2) / 2) for peak, centre, width in OZONE_GAUSSIANS)

    column = quad(shape, 0.0, TOP, points=[8e3, 12e3, 16e3, 21e3, 30e3, 50e3], limit=200, epsrel=1e-12)[0]
    return column_du * 2.6867e20 * shape(altitude) / column


@dataclass(frozen=True)
class Limb:
    """The limb at one wavelength; amounts as in `eclipsejax.Atmosphere`."""

    refractivity: float  # of air at 15 C and 1 atm
    rayleigh: float  # m^2
    ozone: float = 0.0  # m^2
    surface_temperature: float = 288.15
    surface_pressure: float = 101325.0
    column_du: float = 0.0
    dust: tuple[float, float, float] = (0.0, 15e3, 25e3)  # extinction, base, top
    haze: tuple[float, float] = (0.0, 1.5e3)  # vertical optical depth at this wavelength, scale height
    clouds: tuple[float, float, float] = (0.0, 0.0, 1e3)  # top, cover, width

    def air(self, z):
        """Refractivity and its slope [1/m]."""
        temperature, pressure, _, lapse = standard_air(z, self.surface_temperature, self.surface_pressure)
        refractivity = self.refractivity * pressure / 101325.0 * 288.15 / temperature
        gravity = (POTENTIAL_RADIUS / (POTENTIAL_RADIUS + z)) ** 2
        return refractivity, -refractivity * (HYDROSTATIC * gravity + lapse) / temperature

    def extinction(self, z):
        """[1/m]"""
        temperature, pressure, _, _ = standard_air(z, self.surface_temperature, self.surface_pressure)
        alpha, base, top = self.dust
        depth, scale_height = self.haze
        ozone = self.ozone * ozone_density(z, self.column_du) if self.column_du else 0.0
        return (
            self.rayleigh * pressure / (1.380622e-23 * temperature)
            + ozone
            + alpha * ((z > base) & (z < top))
            + depth / scale_height * np.exp(-z / scale_height)
        )

    def transmission(self, tangent):
        """What clouds leave of a ray."""
        top, cover, width = self.clouds
        return 1.0 - cover / (1.0 + np.exp(np.minimum(4.0 * (tangent - top) / width, 700.0)))

    def breaks(self):
        """Altitudes where something is not smooth, or changes fast."""
        tropopause = (self.surface_temperature - 216.65) / 6.5e-3
        heights = np.array([tropopause, 20e3, 32e3, 47e3, 51e3, 71e3, 84852.05])
        top, _, width = self.clouds
        clouds = top + width * np.array([-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0])
        inside = [POTENTIAL_RADIUS * heights / (POTENTIAL_RADIUS - heights), self.dust[1:], clouds[clouds > 0.0]]
        return np.unique(np.concatenate([[0.0, TOP], *inside]))


def double_exponential(step):
    """Distances of the nodes from both ends of [0, 1], and weights (Takahasi & Mori 1974)."""
    count = int(3.1 / step)
    t = step * np.arange(-count, count + 1)
    y = 0.5 * np.pi * np.sinh(t)
    start, end = 1.0 / (1.0 + np.exp(-2.0 * y)), 1.0 / (1.0 + np.exp(2.0 * y))
    return start, end, step * 0.25 * np.pi * np.cosh(t) / np.cosh(y) ** 2


def grazing_ray(limb, tangent, step=0.07):
    """Bending angle and optical depth, tangent heights of shape (n,); t = sqrt(z - tangent), panels between breaks."""
    tangent = np.asarray(tangent, dtype=float)[:, None]
    node, _, weight = double_exponential(step)
    grazed, grazed_slope = limb.air(tangent)
    impact = (RADIUS + tangent) * (1.0 + grazed)
    bending, depth = np.zeros(tangent.shape[0]), np.zeros(tangent.shape[0])
    breaks = limb.breaks()
    for lower, upper in zip(breaks[:-1], breaks[1:], strict=True):
        if not np.any(upper > tangent):
            continue
        start, stop = np.sqrt(np.maximum(lower - tangent, 0.0)), np.sqrt(np.maximum(upper - tangent, 0.0))
        t = start + (stop - start) * node
        rise = t**2
        z = np.clip(tangent + rise, lower, np.nextafter(upper, 0.0))  # rounding must not leave the layer
        z = np.where(upper > tangent, z, tangent)
        refractivity, slope = limb.air(z)
        # n r - a from heights. Within a centimetre of the tangent point the difference of refractivities is all
        # rounding, and one term of its series is right to 1e-6 (of a part of 1e-3 of the whole).
        difference = np.where((rise < 1e-2) & (start == 0.0), grazed_slope * rise, refractivity - grazed)
        excess = rise * (1.0 + refractivity) + (RADIUS + tangent) * difference
        bouguer = np.sqrt(np.where(excess > 0.0, excess * (excess + 2.0 * impact), 1.0))
        measure = np.where(excess > 0.0, (stop - start) * weight * 2.0 * t / bouguer, 0.0)
        bending -= 2.0 * impact[:, 0] * np.sum(measure * slope / (1.0 + refractivity), axis=1)
        path = measure * (RADIUS + z) * (1.0 + refractivity)
        depth += 2.0 * np.sum(path * limb.extinction(z), axis=1)
    return bending, depth


def arc_moments(offset, circle, sun, step=0.07):
    """Integrals of mu^k, k = 0 ... 5, over the azimuth of circles about the origin; shape (..., 6)."""
    circle = np.asarray(circle, dtype=float)[..., None]
    _, end, weight = double_exponential(step)  # `end` counts from the far end of the arc, where mu may vanish
    # Flat Sun in the tangent plane at its centre would be wrong by 5e-4: spherical law of cosines, in haversines.
    near, far = np.sin(0.5 * (offset - circle)) ** 2, np.sin(0.5 * (offset + circle)) ** 2
    edge = np.sin(0.5 * sun) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        half = np.where(edge > near, 2.0 * np.arcsin(np.sqrt(np.minimum((edge - near) / (far - near), 1.0))), 0.0)
    half = np.where((edge > near) & (edge >= far), np.pi, half)
    phi = half * (1.0 - end)
    # Distance from the Sun's edge: edge - far + (far - near) cos^2(phi/2), and zero at the end of a part of a circle.
    within = np.where(
        edge >= far,
        edge - far + (far - near) * np.sin(0.5 * half * end + 0.5 * (np.pi - half)) ** 2,
        (far - near) * np.sin(0.5 * (half - phi)) * np.sin(0.5 * (half + phi)),
    )
    sine_squared = 1.0 - within * (1.0 - 2.0 * edge + within) / (edge * (1.0 - edge))
    mu = np.sqrt(np.maximum(1.0 - sine_squared, 0.0))
    return np.stack([2.0 * np.sum(half * weight * mu**k, axis=-1) for k in range(6)], axis=-1)


def irradiance(limb, offset, darkening, *, distance=3.844e8, sun_distance=AU, rays=300, step=0.07):
    """Fraction of sunlight at each offset [rad]: rays on splines, pieces between all their tangencies.

    - `darkening`: A_0 ... A_5 of the Sun at this wavelength.
    """
    offset = np.atleast_1d(offset)
    sun = np.arcsin(SOLAR_RADIUS / sun_distance)
    start, end, weight = double_exponential(step)
    breaks = limb.breaks()
    total = np.zeros(offset.shape)

    def solid_angle(impact):
        return impact / (distance * np.sqrt(distance**2 - impact**2))

    for lower, upper in zip(breaks[:-1], breaks[1:], strict=True):
        # The rays of a panel have cusps at its upper end: smooth in u = sqrt(upper - z).
        u = np.linspace(0.0, np.sqrt(upper - lower), rays)
        tangent = np.maximum(upper - u**2, lower)
        bending, depth = grazing_ray(limb, tangent, step)
        impact = (RADIUS + tangent) * (1.0 + limb.air(tangent)[0])
        psi = np.arcsin(impact / distance) + np.arcsin(impact / sun_distance) - bending
        sky, lift, thick = CubicSpline(u, psi), CubicSpline(u, impact - RADIUS), CubicSpline(u, depth)
        for i, here in enumerate(offset):
            edges = [here + sun, abs(here - sun), -abs(here - sun), -here - sun]
            cuts = np.unique(np.concatenate([[0.0, u[-1]], *(sky.solve(edge, extrapolate=False) for edge in edges)]))
            for low, high in zip(cuts[:-1], cuts[1:], strict=True):
                if abs(abs(sky(0.5 * (low + high))) - here) >= sun:
                    continue
                # From the nearer end, lest the end's singularity drown in rounding.
                x = np.where(start < 0.5, low + (high - low) * start, high - (high - low) * end)
                slope = np.abs(lift(x, 1))
                light = np.exp(-thick(x)) * limb.transmission(upper - x**2)
                arcs = arc_moments(here, np.abs(sky(x)), sun, step) @ darkening
                measure = solid_angle(RADIUS + lift(x)) / distance * slope * (high - low) * weight
                total[i] += np.sum(measure * light * arcs)

    # Straight rays above the air, over psi.
    def straight(psi):
        impact = psi / (1.0 / distance + 1.0 / sun_distance)
        for _ in range(4):
            rate = 1.0 / np.sqrt(distance**2 - impact**2) + 1.0 / np.sqrt(sun_distance**2 - impact**2)
            impact = impact - (np.arcsin(impact / distance) + np.arcsin(impact / sun_distance) - psi) / rate
        rate = 1.0 / np.sqrt(distance**2 - impact**2) + 1.0 / np.sqrt(sun_distance**2 - impact**2)
        return solid_angle(impact) / distance / rate

    top = np.arcsin((RADIUS + TOP) / distance) + np.arcsin((RADIUS + TOP) / sun_distance)

    def direct(here, floor):
        value = 0.0
        inner, outer = max(abs(here - sun), floor), max(here + sun, floor)
        for low, high in ((floor, inner), (inner, outer)):
            if high > low and abs(0.5 * (low + high) - here) < sun:
                x = np.where(start < 0.5, low + (high - low) * start, high - (high - low) * end)
                value += np.sum((high - low) * weight * straight(x) * (arc_moments(here, x, sun, step) @ darkening))
        return value

    unobstructed = np.array([direct(here, 0.0) for here in offset])
    return (total + np.array([direct(here, top) for here in offset])) / unobstructed


def derivative(function, x, step):
    """Central difference with two Richardson extrapolations: the error falls as the sixth power of `step`."""
    a, b, c = ((function(x + h) - function(x - h)) / (2.0 * h) for h in (step, step / 2.0, step / 4.0))
    ab, bc = (4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0
    return (16.0 * bc - ab) / 15.0


def whole_sun(distance, darkening):
    """Light of the Sun's sphere, seen from a distance to its centre, with the brightness of its centre as unit [sr]."""
    node, weight = np.polynomial.legendre.leggauss(40)
    mu = 0.5 * (node + 1.0)
    sine_squared = (1.0 - mu**2) * (SOLAR_RADIUS / distance) ** 2
    brightness = np.polynomial.polynomial.polyval(mu, darkening)
    # sin(theta) d(theta) = (R / d)^2 mu d(mu) / cos(theta)
    return (
        2.0
        * np.pi
        * np.sum(0.5 * weight * brightness * mu / np.sqrt(1.0 - sine_squared))
        * (SOLAR_RADIUS / distance) ** 2
    )


def eclipsed_by_a_ball(offset, darkening, *, distance=3.844e8, sun_distance=AU):
    """Fraction of sunlight past an Earth without air: circles about the Sun's centre, as seen from the point."""
    apart = np.sqrt(distance**2 + sun_distance**2 + 2.0 * distance * sun_distance * np.cos(offset))
    separation = np.arcsin(sun_distance * np.sin(offset) / apart)  # of Sun and Earth in the point's sky
    earth, sun = np.arcsin(RADIUS / distance), np.arcsin(SOLAR_RADIUS / apart)

    def ring(theta):
        mu = np.sqrt(max(1.0 - (np.sin(theta) / np.sin(sun)) ** 2, 0.0))
        cosine = (np.cos(earth) - np.cos(theta) * np.cos(separation)) / max(np.sin(theta) * np.sin(separation), 1e-300)
        covered = np.arccos(np.clip(cosine, -1.0, 1.0))
        return 2.0 * (np.pi - covered) * np.polynomial.polynomial.polyval(mu, darkening) * np.sin(theta)

    edges = [x for x in (abs(earth - separation), earth + separation) if 0.0 < x < sun]
    cuts = [0.0, *sorted(edges), sun]
    light = sum(
        quad(ring, a, b, epsabs=0.0, epsrel=1e-10, limit=200)[0] for a, b in zip(cuts[:-1], cuts[1:], strict=True)
    )
    return light / whole_sun(apart, darkening)


def traced_irradiance(limb, offset, darkening, *, distance=3.844e8, sun_distance=AU, azimuths=900, panels=8):
    """`irradiance` by vectors in space, one offset: rays from the point, bent in their planes, hit the Sun or miss it.

    No angle psi, no arcs, no formula for mu: the distance at which the ray passes the centre of the Sun's sphere.
    Good to 2e-4 with the defaults, for every ray that just misses counts nothing.
    """
    towards = np.array([np.cos(offset), np.sin(offset), 0.0])  # from the point at the Earth's centre
    point, sun = -distance * towards, np.array([sun_distance, 0.0, 0.0])
    side, up = np.array([-np.sin(offset), np.cos(offset), 0.0]), np.array([0.0, 0.0, 1.0])
    phi = np.pi * (np.arange(azimuths) + 0.5) / azimuths  # above the plane of the axis; below it the same
    across = np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * up
    node, weight = np.polynomial.legendre.leggauss(24)

    def light(impact, bending, transmission, measure):
        """Sum over rays of these impact parameters and all azimuths."""
        sine = impact / distance
        angle = np.arcsin(sine) - bending
        ahead = np.cos(angle)[:, None, None] * towards + np.sin(angle)[:, None, None] * across
        foot = np.cos(angle)[:, None, None] * across - np.sin(angle)[:, None, None] * towards
        to_line = impact[:, None, None] * foot - sun
        passing = np.linalg.norm(np.cross(to_line, ahead), axis=-1) / SOLAR_RADIUS
        mu = np.sqrt(np.maximum(1.0 - passing**2, 0.0))
        brightness = np.where(passing < 1.0, np.polynomial.polynomial.polyval(mu, darkening), 0.0)
        rings = 2.0 * np.pi * np.mean(brightness, axis=1)
        return np.sum(rings * transmission * sine / (distance * np.sqrt(1.0 - sine**2)) * measure)

    total, breaks = 0.0, limb.breaks()
    for lower, upper in zip(breaks[:-1], breaks[1:], strict=True):
        edges = np.linspace(0.0, np.sqrt(upper - lower), panels + 1)
        u = (edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (node + 1.0)).ravel()
        du = (np.diff(edges)[:, None] * 0.5 * weight).ravel()
        tangent = upper - u**2
        bending, depth = grazing_ray(limb, tangent)
        refractivity, slope = limb.air(tangent)
        impact = (RADIUS + tangent) * (1.0 + refractivity)
        stretch = np.abs(1.0 + refractivity + (RADIUS + tangent) * slope) * 2.0 * u
        total += light(impact, bending, np.exp(-depth) * limb.transmission(tangent), stretch * du)
    edges = np.linspace(RADIUS + TOP, max((offset + 5e-3) * distance, RADIUS + 2.0 * TOP), 40)
    impact = (edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (node + 1.0)).ravel()
    total += light(impact, 0.0 * impact, 1.0, (np.diff(edges)[:, None] * 0.5 * weight).ravel())
    return total / whole_sun(np.linalg.norm(sun - point), darkening)
