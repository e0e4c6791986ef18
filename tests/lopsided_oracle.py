"""Light behind a flattened Earth whose air changes along the limb: rays in space over an ellipsoid, for the tests.

No sectors, circles of curvature or arcs: every ray from the point is bent in the plane of the local vertical, over
ground that is curved like the normal section along it, and hits the Sun's sphere or misses it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from tests import oracles


@dataclass(frozen=True)
class Ellipsoid:
    """With x towards the Sun, y north and z east."""

    declination: float = 0.0
    equatorial: float = oracles.RADIUS
    polar: float = oracles.RADIUS

    @property
    def squared(self):
        pole = np.array([np.sin(self.declination), np.cos(self.declination), 0.0])
        return self.equatorial**2 * np.eye(3) + (self.polar**2 - self.equatorial**2) * np.outer(pole, pole)

    def point(self, normal):
        """Where the surface has this normal (..., 3)."""
        carried = normal @ self.squared
        return carried / np.sqrt(np.sum(normal * carried, axis=-1, keepdims=True))

    def curvature_radius(self, normal, along):
        """Of the normal section along a direction in the surface; from the gradient of x Q x = 1."""
        form = np.linalg.inv(self.squared)
        gradient = np.linalg.norm(self.point(normal) @ form, axis=-1, keepdims=True)
        return gradient / np.sum(along * (along @ form), axis=-1, keepdims=True)


def traced_irradiance(
    limbs, earth, offset, position_angle, darkening, *, distance=3.844e8, azimuths=720, panels=4, nodes=12
):
    """Fraction of sunlight at one point.

    - `limbs`: equally spaced along the limb, from north through east; between two the light is mixed in proportion.
    """
    point = distance * np.array(
        [-np.cos(offset), np.sin(offset) * np.cos(position_angle), np.sin(offset) * np.sin(position_angle)]
    )
    sun = np.array([oracles.AU, 0.0, 0.0])
    azimuth = 2.0 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    count, node, weight = len(limbs), *np.polynomial.legendre.leggauss(nodes)

    def ray(nu, height, refractivity, bending):
        """(direction at the point, normal at the lowest place, vector from the Sun at the passage), (ray, azimuth, 3).

        `refractivity` and `bending` are functions of the radius of curvature.
        """
        outward = np.stack([0.0 * nu, np.cos(nu), np.sin(nu)], axis=-1)
        normal, along = outward, np.array([1.0, 0.0, 0.0]) + 0.0 * outward

        def bent(normal, along):
            """The ray over the ground that this guess of the lowest place's axes gives."""
            radius = earth.curvature_radius(normal, along)
            centre = earth.point(normal) - radius * normal
            turn, impact = 0.5 * bending(radius), (radius + height) * (1.0 + refractivity)
            apart = np.linalg.norm(centre - point, axis=-1, keepdims=True)
            towards = (centre - point) / apart
            across = outward - np.sum(outward * towards, axis=-1, keepdims=True) * towards
            across = across / np.linalg.norm(across, axis=-1, keepdims=True)
            sine = impact / apart
            cosine = np.sqrt(1.0 - sine**2)
            first, foot = cosine * towards + sine * across, cosine * across - sine * towards
            normal = np.cos(turn) * foot + np.sin(turn) * first
            return normal, np.cos(turn) * first - np.sin(turn) * foot, first, centre, impact, turn

        normal, along, *_ = bent(*bent(normal, along)[:2])
        normal, along, first, centre, impact, turn = bent(normal, along)
        onward, foot = np.cos(turn) * along - np.sin(turn) * normal, np.cos(turn) * normal + np.sin(turn) * along
        return first, normal, np.cross(centre + impact * foot - sun, onward)

    def light(u, du, upper, rays, transmission):
        """Sum over the nodes u, height = upper - u^2, and all azimuths."""
        step, shape = 1e-4, (-1, 1, 1)

        def at(nu, u):
            refractivity, bend = rays(u)
            bending = lambda radius: np.sqrt(radius / oracles.RADIUS) * bend.reshape(shape)
            return ray(nu, (upper - u**2).reshape(shape), refractivity.reshape(shape), bending)

        span = step * max(u[-1], 1.0)
        by_azimuth = (at(azimuth + step, u)[0] - at(azimuth - step, u)[0]) / (2.0 * step)
        by_u = (at(azimuth, u + span)[0] - at(azimuth, u - span)[0]) / (2.0 * span)
        solid = np.linalg.norm(np.cross(by_azimuth, by_u), axis=-1)
        _, normal, passing = at(azimuth, u)
        passing = np.linalg.norm(passing, axis=-1) / oracles.SOLAR_RADIUS
        mu = np.sqrt(np.maximum(1.0 - passing**2, 0.0))
        brightness = np.where(passing < 1.0, np.polynomial.polynomial.polyval(mu, darkening), 0.0)
        place = np.arctan2(normal[..., 2], normal[..., 1]) / (2.0 * np.pi) * count
        return np.sum(brightness * solid * transmission(place) * du[:, None]) * 2.0 * np.pi / azimuths

    def share(place, one):
        return np.maximum(1.0 - np.abs((place - one + 0.5 * count) % count - 0.5 * count), 0.0)

    def line(low, high, panels):
        edges = np.linspace(low, high, panels + 1)
        u = (edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (node + 1.0)).ravel()
        return u, (np.diff(edges)[:, None] * 0.5 * weight).ravel()

    total = 0.0
    for limb in set(limbs):
        here = [i for i, other in enumerate(limbs) if other == limb]
        breaks = limb.breaks()
        for lower, upper in zip(breaks[:-1], breaks[1:], strict=True):
            whole = np.linspace(0.0, np.sqrt(upper - lower), 120)
            height = np.maximum(upper - whole**2, lower)
            bending, depth = oracles.grazing_ray(limb, height, 0.13)
            bend, thick = CubicSpline(whole, bending), CubicSpline(whole, depth)
            u, du = line(0.0, np.sqrt(upper - lower), panels)
            rays = lambda u, limb=limb, upper=upper, bend=bend: (limb.air(upper - u**2)[0], bend(u))
            passed = np.exp(-thick(u)) * limb.transmission(upper - u**2)
            mixed = lambda place, passed=passed, here=here: passed[:, None] * sum(share(place, i) for i in here)
            total += light(u, du, upper, rays, mixed)
    # Straight rays above the air, up to beyond the Sun; heights grow with -u^2 from the top.
    beyond = max((offset + 5.2e-3) * distance - oracles.RADIUS, 3.0 * oracles.TOP)
    for low, high in ((oracles.TOP, 1e6), (1e6, max(beyond, 1.1e6))):
        u, du = line(0.0, np.sqrt(high - low), 8)
        none = lambda u: (0.0 * u, 0.0 * u)
        total += light(u, du, high, none, lambda place: np.ones(place.shape))
    return total / oracles.whole_sun(np.linalg.norm(sun - point), darkening)
