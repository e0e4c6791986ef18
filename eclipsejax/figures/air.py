"""The air of the limb: what it is at each height, and what it does there to light of each wavelength."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.air import Air
from eclipsejax.atmosphere import Atmosphere, Dust, Haze, Ozone, extinction, refractivity
from eclipsejax.figures.page import BLUE, GOLD, GREEN, INK, RED, VIOLET, Plate, styled
from eclipsejax.spectra import ciddor_refractivity, ozone_cross_section, rayleigh_cross_section

ALPHA = 4.7e-6  # 1/m, dust of the paper


@styled
def air_plate() -> Plate:
    """Temperature, density and refractivity against height for four surfaces; spectra; extinctions."""
    plate = Plate("The air: U.S. Standard Atmosphere 1976", 11.0, 7.9)
    grid = plate.add_gridspec(2, 3, left=0.06, right=0.985, top=0.875, bottom=0.075, wspace=0.26, hspace=0.34)
    height = np.linspace(0.0, 86e3, 431)
    temperature, density, change = (plate.add_subplot(grid[0, column]) for column in range(3))
    standard = jax.vmap(Air().density)(jnp.asarray(height))
    for name, air, colour, dashes in (
        ("standard: 288.15 K, 1013.25 hPa", Air(), INK, "-"),
        ("ground 20 K colder", Air(surface_temperature=268.15), BLUE, "-"),
        ("ground 20 K warmer", Air(surface_temperature=308.15), RED, "-"),
        ("pressure 5 % lower", Air(surface_pressure=0.95 * 101325.0), GOLD, (0, (4, 2))),
    ):
        line = {"color": colour, "linestyle": dashes, "label": name}
        here = jax.vmap(air.density)(jnp.asarray(height))
        temperature.plot(jax.vmap(air.temperature)(jnp.asarray(height)), height / 1e3, **line)
        density.semilogx(here, height / 1e3, **line)
        change.plot(here / standard, height / 1e3, **line)
    temperature.set(title="temperature", xlabel="[K]", ylabel="height  [km]", ylim=(0, 86))
    density.set(title="density  (below),  n − 1 at 550 nm  (above)", xlabel="[kg m$^{-3}$]", ylim=(0, 86))
    factor = float(refractivity(Atmosphere(), 0.0, 550.0) / standard[0])  # refractivity follows density
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
    dark = Air(scattering=0.0)
    for name, atmosphere, at, colour, dashes in (
        ("Rayleigh 450 nm", Atmosphere(ozone=None), 450.0, BLUE, "-"),
        ("Rayleigh 650 nm", Atmosphere(ozone=None), 650.0, RED, "-"),
        ("ozone 600 nm, 300 DU", Atmosphere(air=dark, ozone=Ozone()), 600.0, VIOLET, "-"),
        (f"dust, α = {ALPHA:.1e} m$^{{-1}}$", Atmosphere(dark, None, Dust(extinction=ALPHA)), 550.0, GOLD, "-"),
        ("haze 550 nm, depth 0.1", Atmosphere(dark, None, None, Haze(optical_depth=0.1)), 550.0, GREEN, (0, (4, 2))),
    ):
        value = np.asarray(extinction(atmosphere, height, at))
        value = np.where(value > 1e-12, value, np.nan)
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
