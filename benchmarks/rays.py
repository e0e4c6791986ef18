"""Grazing rays: time against error of ways to bend and dim them, all in one run on one machine.

    python -m benchmarks.rays      # two minutes; prints a table and writes benchmarks/results/rays.json

Bending angle and optical depth of 120 rays from the ground to 80 km at 81 wavelengths from 380 to 780 nm, each bent
by its own refractivity, in the U.S. Standard Atmosphere with 300 DU of ozone. The error is the largest relative one of
either quantity over all rays. Where a method would take minutes it does 36 of the rays, or 4 of the wavelengths, and
its time is multiplied; the note says so.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.measure import Measurement, report, timed
from benchmarks.occultation import occultation
from benchmarks.plain_quadrature import clear_rays
from benchmarks.solved_ray import solved_ray
from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Dust, Haze, Ozone
from eclipsejax.limb import bending_angle, optical_depth
from eclipsejax.limb_table import grazing_rays
from eclipsejax.march import march_ray
from eclipsejax.spectra import ciddor_refractivity, ozone_cross_section, rayleigh_cross_section
from eclipsejax.traced import slopes
from tests import oracles

Part = slice | np.ndarray
COLUMN_DU = 300.0
TANGENTS = np.linspace(0.0, 80e3, 120)
WAVELENGTHS = np.linspace(380.0, 780.0, 81)
FEW_RAYS, FEW_WAVELENGTHS = np.linspace(0, 119, 12).astype(int), np.array([0, 40, 80])
FOUR = np.array([0, 27, 54, 80])


@eqx.filter_jit
def direct_rays(atmosphere, tangent_height, wavelength, order):
    """Both quantities, every ray by itself."""
    tangent_height = tangent_height[:, None]
    return (
        bending_angle(atmosphere, tangent_height, wavelength, order=order),
        optical_depth(atmosphere, tangent_height, wavelength, order=order),
    )


@eqx.filter_jit
def shared_rays(atmosphere, tangent_height, wavelength, order, dispersion):
    """Both quantities, all wavelengths from rays at a few refractivities."""
    return grazing_rays(atmosphere, tangent_height, wavelength, order=order, dispersion=dispersion)


SETTINGS: list[tuple[int, int | None]] = [(6, None), (12, None), (5, 2), (6, 3), (8, 3), (12, 4)]


def our_rays(setting, atmosphere, tangent_height=TANGENTS, wavelength=WAVELENGTHS):
    """(bending angle, optical depth) of this package with (order, dispersion)."""
    order, dispersion = setting
    if dispersion is None:
        return direct_rays(atmosphere, jnp.asarray(tangent_height), jnp.asarray(wavelength), order)
    return shared_rays(atmosphere, jnp.asarray(tangent_height), jnp.asarray(wavelength), order, dispersion)


def method(setting) -> str:
    return "eclipsejax" + (" limb" if setting[1] is None else " grazing_rays")


def words(setting) -> str:
    return f"order {setting[0]}" + ("" if setting[1] is None else f", {setting[1]} refractivities")


def worst(found, reference, rows: Part = slice(None), columns: Part = slice(None)) -> float:
    """Largest relative error of the quantities that were found; rays of infinite depth are left out."""
    largest = []
    for values, exact in zip(found, reference, strict=True):
        if values is not None:
            errors = np.abs(np.asarray(values, dtype=float) / np.asarray(exact)[rows][:, columns] - 1.0)
            largest.append(np.max(errors[~np.isinf(errors)]))
    return float(np.max(largest))


def with_amounts(values) -> Atmosphere:
    """Standard air with six numbers that can be differentiated by."""
    temperature, pressure, scattering, column, dust, haze = values
    air = Air(surface_temperature=temperature, surface_pressure=pressure, scattering=scattering)
    return Atmosphere(air=air, ozone=Ozone(column), dust=Dust(dust), haze=Haze(haze))


AMOUNTS = np.array([288.15, 101325.0, 1.0, COLUMN_DU, 0.0, 0.0])


@eqx.filter_jit
def derivatives(values, setting):
    """Both quantities, and their derivatives by six numbers of the atmosphere, each by itself."""
    return slopes(lambda numbers: jnp.stack(our_rays(setting, with_amounts(numbers))), list(values))


def ours(reference) -> list[Measurement]:
    """This package: double and single precision, and derivatives."""
    found = []
    for setting in SETTINGS:
        for precision in ("", " float32"):
            with jax.enable_x64(not precision):
                atmosphere = Atmosphere(ozone=Ozone(COLUMN_DU))
                rays, cold, warm = timed(partial(our_rays, setting, atmosphere), 5)
            found.append(Measurement(method(setting) + precision, words(setting), cold, warm, worst(rays, reference)))
    setting = SETTINGS[-2]
    plain = timed(partial(our_rays, setting, with_amounts(AMOUNTS)), 5)[2]
    (rays, _), cold, warm = timed(partial(derivatives, jnp.asarray(AMOUNTS), setting), 5)
    note = f"{warm / plain:.1f} times the value alone"
    name = method(setting) + ", 6 derivatives"
    return [*found, Measurement(name, words(setting), cold, warm, worst(rays, reference), note)]


def stepped(reference) -> list[Measurement]:
    """The paper's stepping through the refracting air."""
    atmosphere, found = Atmosphere(ozone=Ozone(COLUMN_DU)), []
    tangent, wavelength = TANGENTS[FEW_RAYS, None], WAVELENGTHS[FEW_WAVELENGTHS]
    for step in (10e3, 1e3, 100.0, 10.0):
        rays, cold, warm = timed(partial(march_ray, atmosphere, tangent, wavelength, step), 1 if step < 50 else 3)
        compiled = cold if step == 10e3 else None
        error = worst(rays, reference, FEW_RAYS, FEW_WAVELENGTHS)
        found.append(Measurement("stepping (paper, JAX)", f"step {step:.0f} m", compiled, warm, error))
    return [m.scaled(270.0, "36 of 9720 rays, times 270") for m in found]


def solved(reference) -> list[Measurement]:
    """Adaptive steps, Dormand-Prince 8."""
    atmosphere, found = Atmosphere(ozone=Ozone(COLUMN_DU)), []
    tangent, wavelength = TANGENTS[FEW_RAYS, None], WAVELENGTHS[FEW_WAVELENGTHS]
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        rays, cold, warm = timed(lambda t=tolerance: solved_ray(atmosphere, tangent, wavelength, jnp.asarray(t))[:2])
        compiled = cold if tolerance == 1e-4 else None
        error = worst(rays, reference, FEW_RAYS, FEW_WAVELENGTHS)
        found.append(Measurement("diffrax Dopri8", f"tolerance {tolerance:.0e}", compiled, warm, error))
    return [m.scaled(270.0, "36 of 9720 rays, times 270") for m in found]


def numpy_rays(reference) -> list[Measurement]:
    """The same integral without JAX."""
    spectra = [
        np.asarray(jax.vmap(f)(jnp.asarray(WAVELENGTHS)))
        for f in (ciddor_refractivity, rayleigh_cross_section, ozone_cross_section)
    ]
    found = []
    for order in (4, 6, 8, 12, 20):
        rays, _, warm = timed(partial(clear_rays, TANGENTS, *spectra, COLUMN_DU, order), 5)
        note = "no derivatives; nodes shared by all wavelengths"
        found.append(Measurement("NumPy Gauss-Legendre", f"order {order}", None, warm, worst(rays, reference), note))
    limbs = [oracles.Limb(*(float(s[i]) for s in spectra), column_du=COLUMN_DU) for i in FOUR]
    for step in (0.3, 0.15, 0.07):
        pairs, _, warm = timed(lambda s=step: [oracles.grazing_ray(limb, TANGENTS, s) for limb in limbs], 1)
        rays = [np.stack([pair[i] for pair in pairs], axis=1) for i in range(2)]
        error = worst(rays, reference, columns=FOUR)
        measured = Measurement("NumPy double exponential", f"step {step}", None, warm, error)
        found.append(measured.scaled(81 / FOUR.size, "4 of 81 wavelengths, scaled; no derivatives"))
    return found


def transferred(reference) -> list[Measurement]:
    """sasktran2, with one engine a wavelength, and with one engine that refracts all alike."""
    atmosphere, found = Atmosphere(ozone=Ozone(COLUMN_DU)), []
    for spacing in (500.0, 250.0):
        depth, _, warm = timed(partial(occultation, atmosphere, TANGENTS, WAVELENGTHS[FOUR], spacing), 1)
        error = worst((None, depth), reference, columns=FOUR)
        measured = Measurement("sasktran2", f"{spacing:.0f} m", None, warm, error)
        note = "depth only, no ray at the ground; 4 of 81 wavelengths, scaled"
        found.append(measured.scaled(81 / FOUR.size, note))
    depth, _, warm = timed(lambda: occultation(atmosphere, TANGENTS, WAVELENGTHS, 250.0, refracted_at=550.0), 1)
    error = worst((None, depth), reference)
    note = "depth only, no ray at the ground; refractivity of 550 nm for all"
    return [*found, Measurement("sasktran2 without dispersion", "250 m", None, warm, error, note)]


def main():
    jax.config.update("jax_enable_x64", True)
    reference = our_rays((30, None), Atmosphere(ozone=Ozone(COLUMN_DU)))
    checked = numpy_rays(reference)
    agreement = min(m.max_error for m in checked if m.max_error is not None)
    found = [*stepped(reference), *solved(reference), *transferred(reference), *checked, *ours(reference)]
    report(
        "rays",
        "Bending and optical depth: 120 rays, 0-80 km, 81 wavelengths with dispersion; error relative, largest",
        found,
        {"reference": f"eclipsejax limb, order 30; NumPy quadratures agree with it to {agreement:.1e}"},
    )


if __name__ == "__main__":
    main()
