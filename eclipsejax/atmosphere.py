"""The air along the limb: what bends, scatters and absorbs the light, against altitude.

An atmosphere is a sum of constituents, each the product of a spectrum and a profile:

    refractivity(z, wavelength) = dispersion(wavelength) * density_ratio(z)
    extinction(z, wavelength)   = sum over constituents of coefficient(wavelength) * profile(z)

`limb` and `shadow` use that product where they find it (`profiles`, `dispersion`, `coefficients`); any other
object with `refractivity`, `extinction`, `limb_transmission` and `breaks` serves as an atmosphere as well.
Clouds are in neither: they act on a whole ray, through its tangent height.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from eclipsejax.air import Air
from eclipsejax.constants import ATMOSPHERE_TOP, DOBSON_UNIT
from eclipsejax.errors import InputError
from eclipsejax.sounding import Sounding
from eclipsejax.spectra import ozone_cross_section
from eclipsejax.traced import ascending, real

# Peak [m^-3], altitude [m] and width [m] of four Gaussians: the AFGL 1986 U.S. Standard ozone profile (Anderson
# et al. 1986, AFGL-TR-86-0110) to 0.6 % of its peak; tables/fit_ozone_profile.py makes them. A sum of
# Gaussians because each knot of a piecewise-linear profile would be a cusp in the optical depth.
_OZONE_GAUSSIANS = (
    (2.3486e18, 21047.8, 4459.7),
    (2.6537e18, 24131.7, 9325.2),
    (0.5817e18, 104.6, 3653.5),
    (0.5606e18, 11973.4, 1353.0),
)
# Their vertical column above the ground [m^-2].
_OZONE_COLUMN = sum(
    peak * width * math.sqrt(math.pi / 2.0) * math.erfc(-centre / (width * math.sqrt(2.0)))
    for peak, centre, width in _OZONE_GAUSSIANS
)


class Ozone(eqx.Module):
    """Ozone of the AFGL U.S. Standard profile, scaled to a vertical column.

    - `column_du`: vertical column [Dobson units]; the tabulated profile itself has 345.75 DU.
    """

    column_du: Float[Array, ""] = eqx.field(converter=real, default=300.0)

    def coefficient(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Absorption cross-section [m^2]."""
        return ozone_cross_section(wavelength)

    def profile(self, altitude: Float[Array, ""]) -> Float[Array, ""]:
        """Number density [m^-3]."""
        # Term by term: of one sum, XLA would write the terms at all points of all rays to memory before it adds them.
        shape = sum(peak * jnp.exp(-0.5 / width**2 * (altitude - at) ** 2) for peak, at, width in _OZONE_GAUSSIANS)
        return self.column_du * (DOBSON_UNIT / _OZONE_COLUMN) * shape


class Dust(eqx.Module):
    """Grey stratospheric dust, uniform between two altitudes: the alpha of Yapo & Cutler (2009).

    - `extinction`: alpha [1/m]; the vertical optical depth is alpha times the thickness.
    - `base`, `top`: edges of the layer [m].
    """

    extinction: Float[Array, ""] = eqx.field(converter=real, default=0.0)
    base: Float[Array, ""] = eqx.field(converter=real, default=15e3)
    top: Float[Array, ""] = eqx.field(converter=real, default=25e3)

    @property
    def optical_depth(self) -> Float[Array, ""]:
        """Vertical optical depth [-]."""
        return self.extinction * (self.top - self.base)

    def coefficient(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Grey: 1 at every wavelength."""
        return jnp.ones_like(wavelength)

    def profile(self, altitude: Float[Array, ""]) -> Float[Array, ""]:
        """Extinction [1/m]. The edges are breaks of the atmosphere, so derivatives with respect to them
        arrive through the limits of integration although this step has none."""
        return jnp.where((altitude > self.base) & (altitude < self.top), self.extinction, 0.0)


class Haze(eqx.Module):
    """Tropospheric aerosol, exponential in altitude, Angstrom's law in wavelength.

    - `optical_depth`: vertical, at 550 nm [-].
    - `scale_height`: [m].
    - `angstrom`: exponent [-]; Angstrom (1929).
    """

    optical_depth: Float[Array, ""] = eqx.field(converter=real, default=0.0)
    scale_height: Float[Array, ""] = eqx.field(converter=real, default=1.5e3)
    angstrom: Float[Array, ""] = eqx.field(converter=real, default=1.3)

    def coefficient(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Extinction relative to 550 nm [-]."""
        return (wavelength / 550.0) ** -self.angstrom

    def profile(self, altitude: Float[Array, ""]) -> Float[Array, ""]:
        """Extinction at 550 nm [1/m]."""
        return self.optical_depth / self.scale_height * jnp.exp(-altitude / self.scale_height)


class Clouds(eqx.Module):
    """What opaque clouds and terrain leave of a ray, by the ray's tangent height.

    A grazing ray runs some 400 km within a kilometre of its lowest point, so what matters is the chance that
    all of that is clear: 1 aloft, 1 - `cover` well below `top`.

    - `top`: altitude where half of `cover` blocks [m].
    - `cover`: fraction blocked far below [-].
    - `width`: the blocked fraction falls from 88 % to 12 % of `cover` over this height [m].
    """

    top: Float[Array, ""] = eqx.field(converter=real, default=0.0)
    cover: Float[Array, ""] = eqx.field(converter=real, default=0.0)
    width: Float[Array, ""] = eqx.field(converter=real, default=1e3)

    def limb_transmission(self, tangent_height: Float[Array, ""]) -> Float[Array, ""]:
        """Fraction of rays that stay clear [-]."""
        return 1.0 - self.cover * jax.nn.sigmoid(4.0 * (self.top - tangent_height) / self.width)


class Atmosphere(eqx.Module):
    """Everything along the limb. `None` for a part means absent: nothing of it is computed.

    `Atmosphere()` is clear standard air with ozone; `Atmosphere.typical()` the climatological limb.
    """

    air: Air | Sounding = eqx.field(default_factory=Air)
    ozone: Ozone | None = eqx.field(default_factory=Ozone)
    dust: Dust | None = eqx.field(default_factory=Dust)
    haze: Haze | None = eqx.field(default_factory=Haze)
    clouds: Clouds | None = eqx.field(default_factory=Clouds)

    @classmethod
    def typical(cls) -> "Atmosphere":
        """The limb as eclipses find it: clouds to 11.5 km on 85 % of it, thin haze, background dust, ozone.

        With it the magnitudes of five eclipses from 1990 to 2022 come out within 0.6 mag, neither too bright nor too
        dark on the whole, and the colours of 2019 within 0.7 stop (`notebooks/brightness_of_eclipses.ipynb`); a clear
        limb is 0.7-2.1 mag too bright for all. Clouds fill a sixth of the troposphere (CloudSat and CALIPSO, Remote
        Sens. 2023, 15, 3978), and a ray that runs 400 km within a kilometre of its lowest point seldom passes below
        their highest tops. Dust has the vertical optical depth 0.01, that of the stratosphere between larger eruptions:
        0.008 in the mean of 2006-2015 (Friberg et al. 2018). Haze is that of clear days, 0.05: more stands under the
        clouds. Ozone, 325 DU, is between the 300 DU of the globe and the 346 DU of the U.S. standard of middle
        latitudes, since the limb has more of high latitudes than the globe has.
        """
        return cls(
            ozone=Ozone(column_du=325.0),
            dust=Dust(extinction=1e-6),
            haze=Haze(optical_depth=0.05),
            # Not 11 km: a break 19 m below the tropopause of the standard air leaves the cusp under that within its
            # panel, and the shadow on the axis 2.5e-6 off where 1e-6 is promised.
            clouds=Clouds(top=11.5e3, cover=0.85, width=9e3),
        )

    @property
    def constituents(self) -> tuple:
        """The parts that scatter or absorb, each with `coefficient` and `profile`."""
        parts = (self.air, self.ozone, self.dust, self.haze)
        return tuple(part for part in parts if part is not None)

    @property
    def ray_breaks(self) -> Float[Array, " breaks"]:
        """Altitudes where a profile is not smooth: all of `breaks` but the clouds' [m]."""
        self._one_place()
        edges = [jnp.asarray([0.0, ATMOSPHERE_TOP]), self.air.breaks]
        if self.dust is not None:
            edges.append(jnp.stack([self.dust.base, self.dust.top]))
        return ascending(_inside(jnp.concatenate(edges)))

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        """Altitudes where a profile is not smooth, or the clouds' transmission changes fast, ascending [m]."""
        breaks = self.ray_breaks
        if self.clouds is None:
            return breaks
        around = self.clouds.top + self.clouds.width * jnp.asarray([-1.0, 0.0, 1.0])
        return ascending(jnp.concatenate([breaks, _inside(around)]))

    def dispersion(self, wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Refractivity of air at 15 C and 1013.25 hPa [-]."""
        self._one_place()
        return self.air.dispersion(wavelength)

    def coefficients(self, wavelength: Float[Array, ""]) -> Float[Array, " constituent"]:
        """Spectrum of each constituent; times its profile, extinction [1/m]."""
        self._one_place()
        return jnp.stack([part.coefficient(wavelength) for part in self.constituents])

    def profiles(self, altitude: Float[Array, ""]) -> tuple[Float[Array, ""], Float[Array, " constituent"]]:
        """(density ratio, profile of each constituent) at an altitude [m]."""
        air, *others = self.constituents
        density_ratio = self.air.density_ratio(altitude)
        densities = [air.number_density(density_ratio), *(part.profile(altitude) for part in others)]
        return density_ratio, jnp.stack(densities)

    def refractivity(self, altitude: Float[Array, ""], wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Refractive index minus one [-]."""
        return self.dispersion(wavelength) * self.air.density_ratio(altitude)

    def extinction(self, altitude: Float[Array, ""], wavelength: Float[Array, ""]) -> Float[Array, ""]:
        """Extinction by all constituents but clouds [1/m]."""
        return self.coefficients(wavelength) @ self.profiles(altitude)[1]

    def limb_transmission(self, tangent_height: Float[Array, ""]) -> Float[Array, ""]:
        """What clouds and terrain leave of a ray [-]."""
        if self.clouds is None:
            return jnp.ones_like(tangent_height)
        return self.clouds.limb_transmission(tangent_height)

    def _one_place(self) -> None:
        if any(jax.tree.leaves(varying(self))):
            raise InputError("This wants air that is the same all around: give one of the atmospheres along the limb.")


def varying(atmosphere: Atmosphere):
    """Tree of whether each leaf has an axis along the limb (`limb_sectors.along_limb`)."""
    air = atmosphere.air
    profiles = (air.levels, air.temperatures, air.pressures) if isinstance(air, Sounding) else ()
    own = {id(leaf) for leaf in profiles}
    return jax.tree.map(lambda leaf: jnp.ndim(leaf) > (id(leaf) in own), atmosphere)


def _inside(altitudes):
    """Altitudes moved to the nearest end of the atmosphere where they lie outside it."""
    return jnp.clip(altitudes, 0.0, ATMOSPHERE_TOP)


def refractivity(atmosphere, altitude, wavelength) -> Float[Array, "..."]:
    """Refractive index of the air minus one [-]; altitude [m] and wavelength [nm] broadcast."""
    return _broadcast(atmosphere.refractivity, jnp.asarray(altitude, float), jnp.asarray(wavelength, float))


def extinction(atmosphere, altitude, wavelength) -> Float[Array, "..."]:
    """Extinction by all constituents [1/m]; altitude [m] and wavelength [nm] broadcast. Clouds are not in it."""
    return _broadcast(atmosphere.extinction, jnp.asarray(altitude, float), jnp.asarray(wavelength, float))


@eqx.filter_jit
def _broadcast(quantity, altitude, wavelength):
    return jnp.vectorize(quantity)(altitude, wavelength)
