"""The table of the shadow by the paper's stepping, beside ours, at an equal error of 1e-3.

    python -m benchmarks.shadow_peers      # a minute; prints a table and writes benchmarks/results/shadow_peers.json

Yapo & Cutler (2009) step each ray through the air. How they spread their rays we do not know; here they are added up
in equal cells of tangent height, each with its solid angle and its part of the Sun, as CosmoScout VR does it. Two
settings decide the error, the step and the number of cells. Each is varied by itself, with the other exact, at three
wavelengths; power laws through these errors say with which settings either leaves half of the error wanted. A whole
table with these takes hours, so its time is the number of its rays times the time of a ray, measured at that step. The
arcs, the Sun and the geometry are ours in both, and the time that stepping would spend on them is not counted. One
wavelength, the reddest and easiest, is computed in full.

A second line gives the stepping what it did not have, our Chebyshev nodes of tangent height, and so separates what is
gained along the ray from what is gained between rays.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.measure import Measurement, report, timed
from eclipsejax.arc import arc_moments
from eclipsejax.atmosphere import Atmosphere
from eclipsejax.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS, MOON_MEAN_DISTANCE
from eclipsejax.limb import bending_angle, impact_parameter, optical_depth
from eclipsejax.march import march_ray
from eclipsejax.shadow import QUADRATURES, shadow_irradiance
from eclipsejax.sun import Sun
from eclipsejax.sunlight import light_above, sky_angle, solid_angle, whole_sun

OFFSETS = np.linspace(0.0, 21e-3, 64)  # from the axis to the edge of the penumbra
WAVELENGTHS = np.linspace(390.0, 770.0, 24)
TOP = 80e3  # m, of the cells, as in CosmoScout; above it light goes straight
ERROR = 1e-3
SOME = np.array([0, 10, 23])  # wavelengths with which settings are found: 390, 555 and 770 nm
BLOCK = 400  # cells at a time: each other shape would be compiled anew
CELLS, STEPS = (400, 1600, 6400, 12800), (1000.0, 250.0, 62.5)  # m


@eqx.filter_jit
def exact_rays(atmosphere, tangent_height, wavelength):
    """(bending angle, optical depth), shape (wavelength, tangent)."""
    wavelength = wavelength[:, None]
    return bending_angle(atmosphere, tangent_height, wavelength), optical_depth(atmosphere, tangent_height, wavelength)


def marched_rays(atmosphere, tangent_height, wavelength, *, step):
    """The same by steps [m]."""
    return march_ray(atmosphere, tangent_height, wavelength[:, None], step)


@eqx.filter_jit
def cell_light(atmosphere, rays, edges, wavelength):
    """Light through cells of tangent height between these edges, one ray in each, (offset, wavelength)."""
    sun = Sun()
    radius = jnp.arcsin(sun.radius / ASTRONOMICAL_UNIT)
    middles = 0.5 * (edges[1:] + edges[:-1])

    def one(wavelength, bending, depth):
        ends, impact = (impact_parameter(atmosphere, z, wavelength) for z in (edges, middles))
        psi = jnp.abs(sky_angle(impact, MOON_MEAN_DISTANCE, ASTRONOMICAL_UNIT) - bending)
        measure = solid_angle(impact, MOON_MEAN_DISTANCE) * jnp.diff(ends)
        light = measure * jnp.exp(-depth) * jax.vmap(atmosphere.limb_transmission)(middles)
        darkening = sun.limb_darkening_coefficients(wavelength)
        return jax.lax.map(lambda offset: light @ (arc_moments(offset, psi, radius, 8) @ darkening), OFFSETS)

    return jax.vmap(one, out_axes=1)(wavelength, *rays)


@eqx.filter_jit
def straight_light(wavelength):
    """(Light that passes above the cells, light of the whole Sun), (offset, wavelength)."""
    sun, sky = Sun(), (jnp.asarray(MOON_MEAN_DISTANCE), jnp.asarray(ASTRONOMICAL_UNIT))
    radius = jnp.arcsin(sun.radius / ASTRONOMICAL_UNIT)

    def one(offset, wavelength):
        darkening = sun.limb_darkening_coefficients(wavelength)
        arcs = lambda circle: arc_moments(offset, circle, radius, 10)
        above = light_above(EARTH_RADIUS + TOP, offset, *sky, radius, darkening, order=28, arcs=arcs)
        return above, whole_sun(*sky, radius, darkening, 28, offset)

    return jax.vmap(lambda offset: jax.vmap(lambda w: one(offset, w))(wavelength))(jnp.asarray(OFFSETS))


def added_up(atmosphere, trace, count, wavelength):
    """Fraction of sunlight, (offset, wavelength), from `count` cells with rays of `trace`."""
    wavelength = jnp.asarray(wavelength)
    edges = np.linspace(0.0, TOP, count + 1)
    light, whole = straight_light(wavelength)
    for first in range(0, count, BLOCK):
        block = jnp.asarray(edges[first : first + BLOCK + 1])
        rays = trace(atmosphere, 0.5 * (block[1:] + block[:-1]), wavelength)
        light = light + cell_light(atmosphere, rays, block, wavelength)
    return light / whole


def worst(found, reference) -> np.ndarray:
    """Largest relative error at each wavelength."""
    return np.max(np.abs(np.asarray(found) / np.asarray(reference) - 1.0), axis=0)


def setting_for(error, settings, errors) -> float:
    """The setting that leaves an error, by the power law through the first and the last of the measured."""
    power = np.log(errors[-1] / errors[0]) / np.log(settings[-1] / settings[0])
    return float(settings[-1] * (error / errors[-1]) ** (1.0 / power))


def main():
    jax.config.update("jax_enable_x64", True)
    atmosphere = Atmosphere()
    table = partial(shadow_irradiance, atmosphere, OFFSETS, WAVELENGTHS)
    reference = table(tolerance=1e-6)
    light, cold, warm = timed(partial(table, tolerance=ERROR), 5)
    reached = float(np.max(worst(light, reference)))
    found = [Measurement("eclipsejax shadow_irradiance", f"tolerance {ERROR:g}", cold, warm, reached)]

    some = WAVELENGTHS[SOME]
    by_cells = [worst(added_up(atmosphere, exact_rays, count, some), reference[:, SOME]) for count in CELLS]
    exact = added_up(atmosphere, exact_rays, BLOCK, some)
    by_step = [worst(added_up(atmosphere, partial(marched_rays, step=step), BLOCK, some), exact) for step in STEPS]
    count = setting_for(0.5 * ERROR, CELLS, np.max(by_cells, axis=1))
    step = setting_for(0.5 * ERROR, STEPS, np.max(by_step, axis=1))

    tangent = np.linspace(0.0, TOP, 121)[:-1]
    ray = timed(partial(march_ray, atmosphere, tangent, 550.0, step), 1)[2] / tangent.size
    rays = count * WAVELENGTHS.size
    note = f"extrapolated: {rays:.3g} rays of {1e3 * ray:.3g} ms; {rays * ray / warm:.2g} times ours"
    found.append(
        Measurement(
            "stepping and equal cells (paper)", f"{step:.1f} m, {count:.0f} cells", None, rays * ray, ERROR, note
        )
    )
    nodes = QUADRATURES[ERROR].table * (atmosphere.breaks.size - 1) * WAVELENGTHS.size
    note = f"extrapolated: {nodes} rays; {nodes * ray / warm:.2g} times ours"
    found.append(Measurement("stepping at our tangent heights", f"{step:.1f} m", None, nodes * ray, ERROR, note))
    red = partial(added_up, atmosphere, partial(marched_rays, step=STEPS[-1]), wavelength=WAVELENGTHS[-1:])
    red(BLOCK)  # compiles
    light, taken, _ = timed(partial(red, CELLS[-2]), 0)
    reached = float(np.max(worst(light, reference[:, -1:])))
    setting = f"{STEPS[-1]:.1f} m, {CELLS[-2]} cells"
    note = f"not extrapolated: 1 of 24 wavelengths, {WAVELENGTHS[-1]:.0f} nm; {taken / warm:.2g} times all of ours"
    found.append(Measurement("stepping and equal cells, one colour", setting, None, taken, reached, note))
    facts: dict = {"cells": CELLS, "steps [m]": STEPS}
    for i, wavelength in enumerate(WAVELENGTHS[SOME]):
        for what, errors in (("cells", by_cells), ("steps", by_step)):
            facts[f"error of the {what} at {wavelength:.0f} nm"] = [float(f"{e[i]:.2g}") for e in errors]
    case = (
        "Shadow: 64 offsets to the edge of the penumbra, 24 wavelengths, 390-770 nm, clear air; error relative, largest"
    )
    report("shadow_peers", case, found, facts)


if __name__ == "__main__":
    main()
