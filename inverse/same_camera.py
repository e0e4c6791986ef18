"""The camera of a photograph of a fit, taking further ones of the same eclipse."""

from collections.abc import Iterator
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from eclipsejax.ephemeris import Geometry
from eclipsejax.traced import real
from inverse import noise, prior
from inverse.blocked import Blocked, Blocks, Placed, blocked
from inverse.evidence import Evidence
from inverse.exposures import FREE_TINT, STATED
from inverse.likelihood import LIMB, Likelihood
from inverse.limb_light import Shadow
from inverse.map_estimate import Optimum
from inverse.photo_model import TINT, PhotoModel, developed

STOPS = np.arange(-15.0, 16.0, 3.0)  # exposures tried, in powers of two of that of the photograph there is
BRIGHTEST, DARKEST = 0.97, 3e-4  # full scale, of what files hold: below the last codes of 8 bits, above the first
LEAST_SHOWN = 0.1  # of the values on the disc that an exposure must show
NOISE_STEPS = 12  # of brightness, in which the noise of pixels is looked up
OF_BOTH = prior.OF_CAMERA | {"clock"}  # nuisances that the two photographs share
ALIKE = OF_BOTH | {"camera.glare", "camera.veil"}  # and that are as large in both


class SameCamera:
    """The camera of a photograph of a fit, taking further ones.

    - `columns`: of the limb and a further photograph's nuisances among all parameters, `count` of them: the fit's, and
      then those of its own.
    """

    def __init__(self, item: Evidence, likelihood: Likelihood, optimum: Optimum, number: int, along_radius: int):
        model, place = likelihood.models[number], likelihood.places[number]
        once = model.tone_curve == "linear" or getattr(item.photo, "balanced_once", None)
        widths = lambda model: (model.exposure_width, model.tint_width)
        self.model = eqx.tree_at(widths, model, (real(STATED), real(TINT if once else FREE_TINT)))
        self.sources, self.errors = likelihood.sources[number], likelihood.errors[number]
        self.blocks = Blocks(model, along_radius)
        names = [parameter.name for parameter in model.parameters]
        self.z = jnp.asarray(np.where([name in ALIKE for name in names], optimum.z[place], 0.0))
        own = np.array([name not in OF_BOTH for name in names])
        self.columns = np.append(np.arange(LIMB), np.where(own, optimum.z.size + np.cumsum(own) - 1, place))
        self.count = optimum.z.size + int(own.sum())
        assert item.cells is not None
        self.noise = _noise(item.cells.value[item.cells.usable], item.cells.sigma[item.cells.usable])

    def photographs(self, where: Geometry, shadow: Shadow, light, slopes) -> Iterator[tuple[float, Blocked]]:
        """Exposures that show something, and their photographs by blocks, at another time.

        - `light`, `slopes`: of the shadow's table, as `limb_light.shadow_slopes` gives them.
        """
        model = eqx.tree_at(lambda model: model.geometry, self.model, where)
        placed = Placed.of(self.blocks, model)
        values = np.asarray(_developed(model, shadow.table(light), self.z, jnp.asarray(STOPS)))
        for stops, value in zip(STOPS.tolist(), values, strict=True):
            usable = (value > DARKEST) & (value < BRIGHTEST)
            if usable[self.sources.on_disc].mean() < LEAST_SHOWN:
                continue
            sources = replace(
                self.sources, usable=usable, black=noise.black_error(value, usable, model.tone_curve),
                noise=np.interp(value, *self.noise) / (value + self.sources.floor),
            )  # fmt: skip
            longer = eqx.tree_at(lambda model: model.gain, model, model.gain + stops * np.log(2.0))
            yield stops, blocked(longer, sources, self.errors, self.z, placed, shadow, light, slopes)


def _noise(value: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values, rising, and the standard deviations from pixel noise that cells as bright have, in the median."""
    parts = np.array_split(np.argsort(value), NOISE_STEPS)
    return tuple(np.array([[np.median(one[part]) for part in parts if part.size] for one in (value, sigma)]))


@eqx.filter_jit
def _developed(model: PhotoModel, table, z, stops):
    """Values (exposure, cell, 3) [full scale] of exposures so many powers of two longer."""
    nuisance = prior.values(model.parameters, z)
    light = model.light(table, model.seen(z), nuisance)
    return jax.vmap(lambda stop: developed(model, light * 2.0**stop, nuisance))(stops)
