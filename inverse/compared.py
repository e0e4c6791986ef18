"""Photographs beside what the fitted model makes of them, cell for cell and as pictures."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from inverse import prior
from inverse.evidence import Evidence
from inverse.joint_whitener import shared_parts
from inverse.likelihood import LIMB, Likelihood
from inverse.limb_light import shadow_light
from inverse.photo import Photo
from inverse.photo_model import Disc, PhotoModel, seen, signal, wings_at
from inverse.profile import Profile
from inverse.result import PhotoFit
from inverse.shared_errors import places_of

PICTURE = 240  # pixels along a side of the pictures in a report


def photo_fits(
    evidence: Sequence[Evidence], likelihood: Likelihood, z: np.ndarray, draws: np.ndarray
) -> list[PhotoFit]:
    """The photographs beside their models, at the optimum `z` and for `draws` of all parameters (draw, parameter)."""
    shared = shared_parts(likelihood.errors, likelihood.misfits(z))
    return [
        _photo_fit(item, likelihood, number, z, draws, part.reshape(-1, 3))
        for number, (item, part) in enumerate(zip(evidence, shared, strict=True))
    ]


def _photo_fit(item: Evidence, likelihood: Likelihood, number: int, z, draws, shared) -> PhotoFit:
    model = likelihood.models[number]

    place = likelihood.places[number]

    def at(model, z):
        table = shadow_light(likelihood.shadow, jnp.asarray(z[:LIMB]))
        return np.asarray(signal(model, table, jnp.asarray(z[place])))

    predicted = at(model, z)
    drawn = np.stack([at(model, one) for one in draws])
    black = likelihood.sources[number].black
    if not isinstance(model, PhotoModel):
        profile = item.photo
        assert isinstance(profile, Profile)
        everywhere = np.ones(len(profile.value), dtype=bool)
        return PhotoFit(
            item.name, item.where.utc, None, np.asarray(profile.offset), everywhere, np.isfinite(profile.value),
            np.asarray(profile.value), predicted, np.hypot(profile.sigma, black), np.asarray(profile.surface), drawn,
            floor=float(model.floor),
        )  # fmt: skip

    surface, _ = seen(model, jnp.asarray(z[place]))
    cells, reach = item.cells, 1.3
    assert cells is not None and isinstance(item.photo, Photo)
    line = np.linspace(-reach, reach, PICTURE)
    right, up = np.meshgrid(line, -line)
    right, up = right.ravel(), up.ravel()
    dense = eqx.tree_at(
        lambda model: (model.cells, model.wings, model.on_disc),
        model,
        (
            Disc(jnp.asarray(right), jnp.asarray(up), 0.0),
            jnp.asarray(wings_at(right, up, np.asarray(model.glare_points.right), np.asarray(model.glare_points.up))),
            jnp.asarray(np.hypot(right, up) < 1.0, dtype=float),
        ),
    )
    picture = at(dense, z).reshape(PICTURE, PICTURE, 3)
    return PhotoFit(
        name=item.name,
        utc=_later(model, jnp.asarray(z[place])).utc,
        registration=item.registration,
        offset=np.asarray(surface.offset),
        on_disc=cells.on_disc,
        usable=cells.usable,
        observed=cells.value,
        predicted=predicted,
        noise=np.hypot(cells.sigma, black),
        albedo=np.asarray(surface.brightness),
        drawn=drawn,
        image=_photograph(item.photo, item.registration, right, up).reshape(PICTURE, PICTURE, 3),
        model_image=picture,
        reach=reach,
        floor=float(model.floor),
        shadow=places_of(model).shadow,
        shared=shared,
    )


@eqx.filter_jit
def _later(model: PhotoModel, z):
    """The geometry, moved by what the clock is found to be wrong by."""
    return model.geometry.after(prior.values(model.parameters, z)["clock"])


def _photograph(photo, registration, right, up):
    """Mean pixels around points given in radii from the disc's centre; NaN outside the frame."""
    row = registration.row - up * registration.radius
    column = registration.column + right * registration.radius
    spread = max(1, round(2.6 * registration.radius / PICTURE))
    steps = np.arange(spread) - (spread - 1) / 2
    rows, columns = photo.pixels.shape[:2]
    total = np.zeros((row.size, 3))
    inside = (row >= 0) & (row < rows - 1) & (column >= 0) & (column < columns - 1)
    for down in steps:
        for across in steps:
            r = np.clip(np.rint(row + down).astype(int), 0, rows - 1)
            c = np.clip(np.rint(column + across).astype(int), 0, columns - 1)
            total += photo.pixels[r, c]
    return np.where(inside[:, None], total / spread**2, np.nan)
