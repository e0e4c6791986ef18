"""The air of the limb: what it is at each height, and what it does there to light of each wavelength."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Dust, Haze
from eclipsejax.figures.page import BLUE, GOLD, GREEN, INK, RED, VIOLET, Plate, styled
from eclipsejax.spectra import ciddor_refractivity, ozone_cross_section, rayleigh_cross_section

ALPHA = 4.7e-6  # 1/m, dust of the paper


@eqx.filter_jit
def _state(air, height):
    return jax.vmap(air.temperature)(height), jax.vmap(air.density)(height)


@eqx.filter_jit
def _extinctions(atmosphere, height, wavelength):
    """Of each constituent, (height, wavelength, constituent) [1/m]."""
    profiles = jax.vmap(lambda z: atmosphere.profiles(z)[1])(height)
    return profiles[:, None] * jax.vmap(atmosphere.coefficients)(wavelength)


@styled
def air_plate() -> Plate:
    """Temperature, density and refractivity against height for four surfaces; spectra; extinctions."""
    plate = Plate("The air: U.S. Standard Atmosphere 1976", 11.0, 7.9)
    grid = plate.add_gridspec(2, 3, left=0.06, right=0.985, top=0.875, bottom=0.075, wspace=0.26, hspace=0.34)
    height = np.linspace(0.0, 86e3, 431)
    temperature, density, change = (plate.add_subplot(grid[0, column]) for column in range(3))
    _, standard = _state(Air(), jnp.asarray(height))
    for name, air, colour, dashes in (
        ("standard: 288.15 K, 1013.25 hPa", Air(), INK, "-"),
        ("ground 20 K colder", Air(surface_temperature=268.15), BLUE, "-"),
        ("ground 20 K warmer", Air(surface_temperature=308.15), RED, "-"),
        ("pressure 5 % lower", Air(surface_pressure=0.95 * 101325.0), GOLD, (0, (4, 2))),
    ):
        line = {"color": colour, "linestyle": dashes, "label": name}
        warmth, here = _state(air, jnp.asarray(height))
        temperature.plot(warmth, height / 1e3, **line)
        density.semilogx(here, height / 1e3, **line)
        change.plot(here / standard, height / 1e3, **line)
    temperature.set(title="temperature", xlabel="[K]", ylabel="height  [km]", ylim=(0, 86))
    density.set(title="density  (below),  n − 1 at 550 nm  (above)", xlabel="[kg m$^{-3}$]", ylim=(0, 86))
    factor = float(ciddor_refractivity(jnp.asarray(550.0)) / standard[0])  # refractivity follows density
    density.secondary_xaxis(
        "top", functions=(partial(np.multiply, factor), partial(np.multiply, 1.0 / factor))
    ).tick_params(pad=0)
    density.set_title(density.get_title(), pad=20)
    change.set(title="density and n − 1, of the standard's", ylim=(0, 45), ylabel="height  [km]")
    change.set_xlim(0.85, 1.2)
    plate.legend(*change.get_legend_handles_labels(), loc="upper center", ncol=4, fontsize=9.5)

    wavelength = np.linspace(380.0, 780.0, 401)
    index, section, dim = (plate.add_subplot(grid[1, column]) for column in range(3))
    index.plot(wavelength, 1e4 * ciddor_refractivity(jnp.asarray(wavelength)), color=INK)
    index.set(title="dispersion, 15 °C and 1013.25 hPa", xlabel="wavelength  [nm]", ylabel="$10^4$ (n − 1)")
    section.semilogy(wavelength, rayleigh_cross_section(jnp.asarray(wavelength)), color=BLUE)
    section.semilogy(wavelength, ozone_cross_section(jnp.asarray(wavelength)), color=VIOLET)
    section.text(640, 4.2e-31, "Rayleigh, a molecule of air", color=BLUE, fontsize=8.5, ha="center", rotation=-15)
    section.text(600, 1.1e-24, "ozone, a molecule", color=VIOLET, fontsize=8.5, ha="center")
    section.set(title="cross-sections", xlabel="wavelength  [nm]", ylabel="[m$^2$]", ylim=(5e-32, 5e-24))

    height = np.linspace(0.0, 62e3, 1241)
    everything = Atmosphere(dust=Dust(extinction=ALPHA), haze=Haze(optical_depth=0.1))
    rayleigh, ozone, dust, haze = range(4)  # as in `Atmosphere.constituents`
    values = np.asarray(_extinctions(everything, jnp.asarray(height), jnp.asarray([450.0, 550.0, 600.0, 650.0])))
    for name, part, at, colour, dashes in (
        ("Rayleigh 450 nm", rayleigh, 0, BLUE, "-"),
        ("Rayleigh 650 nm", rayleigh, 3, RED, "-"),
        ("ozone 600 nm, 300 DU", ozone, 2, VIOLET, "-"),
        (f"dust, α = {ALPHA:.1e} m$^{{-1}}$", dust, 1, GOLD, "-"),
        ("haze 550 nm, depth 0.1", haze, 1, GREEN, (0, (4, 2))),
    ):
        value = np.where(values[:, at, part] > 1e-12, values[:, at, part], np.nan)
        dim.semilogx(value, height / 1e3, color=colour, linestyle=dashes, label=name)
    dim.set(title="extinction", xlabel="[m$^{-1}$]", ylabel="height  [km]", xlim=(1e-8, 2e-4), ylim=(0, 62))
    dim.legend(loc="upper right")
    plate.caption = (
        "Above, the standard atmosphere and what another temperature or pressure at the ground makes of it: the "
        "tropopause moves until the cooling air meets 216.65 K, the temperatures above 20 km stay, and warm air below "
        "lifts all the air above it. Below, what one molecule does (refractivity after Ciddor 1996, Rayleigh "
        "scattering after Bodhaine et al. 1999, ozone after Malicet et al. 1995 and Brion et al. 1998), and the "
        "extinction of each constituent against height."
    )
    return plate
