"""How much dust explains how dark the Moon was, when nobody knows the clouds along the limb.

A report is one number, the dimming of the disc, or only says that the Moon was fainter than something. Under each of
many limbs, drawn from `uncertain_limbs`, it is compared with what a photometer shows for a range of dust; the
likelihoods are averaged over the limbs. Dust, clouds and haze dim alike, so one magnitude cannot tell little dust from
none; under thick dust only light scattered by the limb is left, and more dust dims no more: limits are open there.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from eclipsejax.atmosphere import Atmosphere, Clouds, Dust, Haze, Ozone
from eclipsejax.photometry import Photometer
from eclipsejax.traced import real

# Uniform ranges of what is not known along a limb. Those of the clouds are about as wide as what is known of clouds
# along a limb; the five measured eclipses of `notebooks/brightness_of_eclipses.ipynb` scatter by more, so that a
# report's error should have another 0.4 mag added.
PRIOR = {
    "cloud top": (6e3, 12e3),  # m
    "cloud cover": (0.8, 1.0),
    "cloud width": (4e3, 8e3),  # m
    "haze": (0.05, 0.2),
    "ozone": (250.0, 400.0),  # DU
}

# Dust that is tried [1/m]: vertical optical depths from 0.001 to 0.6 of a layer of 10 km. Dimming is nearly linear
# in it, up to where scattered light takes over.
EXTINCTIONS = 1e-6 * np.array([0.1, 1.5, 4.0, 7.0, 10.0, 13.0, 16.0, 19.0, 22.5, 27.0, 34.0, 60.0])
_FINE = 661  # entries of the posterior: steps of 1 %

LOWER_95 = math.exp(-0.5 * 1.645**2)  # of the greatest likelihood: a one-sided limit of 95 %


def uncertain_limbs(count: int) -> Atmosphere:
    """Limbs without dust, as an atmosphere whose numbers have a leading axis; they fill the ranges of `PRIOR` evenly.

    Successive multiples of irrational numbers (Roberts's R sequence), so that a dozen do what many random draws
    would, and always the same.
    """
    ratio = 1.5
    for _ in range(50):  # of x^6 = x + 1
        ratio = (1.0 + ratio) ** (1.0 / (1 + len(PRIOR)))
    unit = np.modf(0.5 + np.outer(np.arange(1, count + 1), ratio ** -np.arange(1.0, 1 + len(PRIOR))))[0]
    low, high = np.array(list(PRIOR.values())).T
    top, cover, width, haze, ozone = (low + (high - low) * unit).T
    return jax.vmap(
        lambda top, cover, width, haze, ozone: Atmosphere(
            ozone=Ozone(ozone), dust=Dust(), haze=Haze(haze), clouds=Clouds(top, cover, width)
        )
    )(*map(jnp.asarray, (top, cover, width, haze, ozone)))


def dusty(limb: Atmosphere, extinction) -> Atmosphere:
    """The limb with another extinction of its dust [1/m]."""
    return eqx.tree_at(lambda air: air.dust.extinction, limb, real(extinction))


@eqx.filter_jit
def dimmings(photometer: Photometer, limbs: Atmosphere, extinction=EXTINCTIONS) -> Float[Array, "limb extinction"]:
    """By how many magnitudes the disc is fainter than full Moon, under each limb with each dust.

    The photometer's scene should have `Scatterers`: without them a dusty Moon comes out too faint, by 1 mag at an
    optical depth of 0.2 and by far more above.
    """
    each = jnp.asarray(extinction)
    return jax.lax.map(lambda limb: jax.vmap(lambda x: photometer(dusty(limb, x)).dimming)(each), limbs)


class DustPosterior(eqx.Module):
    """What a report says about dust, on a fine grid."""

    extinction: Float[Array, " grid"]
    """Of the dust, evenly spaced in its logarithm [1/m]."""
    likelihood: Float[Array, " grid"]
    """Of the report, mean over the limbs; the greatest is 1."""

    @property
    def density(self) -> Float[Array, " grid"]:
        """Per unit of ln(extinction), under a prior that is flat in it over the grid."""
        step = jnp.log(self.extinction[1] / self.extinction[0])
        return self.likelihood / (jnp.sum(self.likelihood) * step)

    @property
    def bounded(self) -> tuple[bool, bool]:
        """Whether the report excludes, at 95 %, the least and the most dust of the grid.

        Where it does not, quantiles depend on where the grid ends, and only a limit should be reported.
        """
        return bool(self.likelihood[0] < LOWER_95), bool(self.likelihood[-1] < LOWER_95)

    def quantile(self, probability) -> Float[Array, "..."]:
        """Extinction below which the dust is with a probability [1/m]."""
        below = jnp.cumsum(self.likelihood) / jnp.sum(self.likelihood)
        return jnp.exp(jnp.interp(jnp.asarray(probability), below, jnp.log(self.extinction)))

    def limits(self) -> tuple[float, float]:
        """Least and greatest extinction that the report allows at 95 %, each one-sided; 0 and inf where open [1/m].

        From the ratio of likelihoods alone: no prior of the dust is in it.
        """
        allowed = np.asarray(self.extinction)[np.asarray(self.likelihood) >= LOWER_95]
        least, most = self.bounded
        return float(allowed[0]) if least else 0.0, float(allowed[-1]) if most else math.inf


def dust_of_dimming(
    modelled: Float[Array, "limb extinction"],
    dimming: float,
    error: float,
    *,
    fainter: bool = False,
    extinction=EXTINCTIONS,
) -> DustPosterior:
    """Dust for which a report is plausible, whatever the clouds.

    - `modelled`: from `dimmings` [mag].
    - `dimming`: reported [mag].
    - `error`: standard deviation of the report, with all that the limbs leave out, such as the zero point [mag].
    - `fainter`: the report says that the Moon was at least as faint as this, not how faint.
    - `extinction`: of the columns [1/m].
    """
    coarse = np.asarray(extinction)
    fine = jnp.asarray(np.geomspace(coarse[0], coarse[-1], _FINE))
    # Linear in the extinction, as dimming nearly is; in its logarithm it bends by 0.5 mag between two columns.
    model = jax.vmap(lambda column: jnp.interp(fine, jnp.asarray(coarse), column))(modelled)
    off = (model - dimming) / error
    plausible = jax.scipy.special.ndtr(off) if fainter else jnp.exp(-0.5 * off**2)
    mean = jnp.mean(plausible, axis=0)
    return DustPosterior(extinction=fine, likelihood=mean / jnp.max(mean))
