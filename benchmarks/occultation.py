"""Optical depths of grazing rays by sasktran2, a radiative transfer code, as an occultation of the Sun.

Its refracted paths are integrated shell by shell (Thompson et al. 1982), with refractivity and extinction linear
between levels. The refractive index is one for a whole engine: dispersion needs an engine for each wavelength.
It returns no bending angle.
"""

import numpy as np
import sasktran2 as sk

from eclipsejax.atmosphere import extinction, refractivity
from eclipsejax.constants import EARTH_RADIUS
from eclipsejax.limb import impact_parameter


def occultation(atmosphere, tangent_height, wavelength, spacing, refracted_at=None) -> np.ndarray:
    """Optical depths at tangent heights [m] and wavelengths [nm], shape (tangent, wavelength).

    Infinite where a ray touches the ground by the grid's rounding.

    - `spacing`: of the levels [m].
    - `refracted_at`: wavelength of the refractive index [nm]; by default an engine for each wavelength.
    """
    wavelength = np.atleast_1d(wavelength)
    if refracted_at is None:
        columns = [occultation(atmosphere, tangent_height, [one], spacing, refracted_at=one) for one in wavelength]
        return np.concatenate(columns, axis=1)
    levels = np.arange(0.0, float(atmosphere.breaks[-1]) + 1.0, spacing)
    amount = np.asarray(extinction(atmosphere, levels[:, None], wavelength))
    impact = np.asarray(impact_parameter(atmosphere, tangent_height, refracted_at))

    config = sk.Config()
    config.los_refraction = True
    config.occultation_source = sk.OccultationSource.Standard
    config.single_scatter_source = sk.SingleScatterSource.NoSource
    geometry = sk.Geometry1D(1.0, 0.0, EARTH_RADIUS, levels)
    geometry.refractive_index = 1.0 + np.asarray(refractivity(atmosphere, levels, refracted_at))
    view = sk.ViewingGeometry()
    for straight in impact - EARTH_RADIUS:  # it takes the tangent height of the ray as if unrefracted
        view.add_ray(sk.TangentAltitudeSolar(float(straight), 0.0, 3.78e8, 0.0))
    air = sk.Atmosphere(geometry, config, wavelengths_nm=wavelength, calculate_derivatives=False)
    air["all"] = sk.constituent.Manual(amount, np.zeros_like(amount))
    radiance = np.asarray(sk.Engine(config, geometry, view).calculate_radiance(air)["radiance"])
    with np.errstate(divide="ignore"):
        return -np.log(radiance.reshape(wavelength.size, impact.size)).T
