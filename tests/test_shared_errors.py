"""Errors that photographs of one eclipse share are not averaged out, and are those of each one within it."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array

from eclipsejax.ephemeris import Geometry, geometry
from eclipsejax.scene import axis_offset
from inverse import error_modes, noise
from inverse.cells import CELLS_PER_RADIUS
from inverse.joint_whitener import joint_whitener, shared_parts
from inverse.photo_model import Disc
from inverse.shared_errors import (
    MOON,
    SHARED,
    Places,
    covariance,
    places_of,
    shared_modes,
    uneven_modes,
    unevenness,
)  # fmt: skip


class Registered(eqx.Module):
    """What of a `PhotoModel` places depend on."""

    cells: Disc
    geometry: Geometry
    roll: Array
    on_disc: Array
    mirror: bool = eqx.field(static=True, default=False)


def places(shift=(8e-3, 2e-3), step=0.14):
    """A disc in the shadow, its centre shifted from the axis [rad]."""
    line = np.arange(-1.0, 1.0, step)
    disc = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    on_disc = np.hypot(*disc.T) < 0.97
    return Places(disc, MOON * disc + np.array(shift), on_disc)


def of_disc(one):
    return Places(one.disc[one.on_disc], one.shadow[one.on_disc], one.on_disc[one.on_disc])


def centred(matrix):
    return matrix - matrix.mean(axis=0) - matrix.mean(axis=1)[:, None] + matrix.mean()


def test_within_a_photograph_they_are_its_smooth_errors():
    one = of_disc(places())
    modes, _ = error_modes.smooth_modes(one.disc, np.linalg.norm(one.shadow, axis=1))
    missing = centred(covariance(one, one)) - modes @ modes.T
    assert np.abs(missing - np.diag(np.diag(missing))).max() < 0.1
    assert np.diag(missing).mean() < 0.15


@pytest.mark.parametrize("shift", [(8.1e-3, 2.0e-3), (5e-3, -3e-3)])
def test_modes_make_the_covariance_between_photographs(shift):
    """But for the mean over the disc and fine patterns, a third of the variance, which stay each photograph's own."""
    each = [places(), places(shift)]
    modes = [one[part.on_disc] for one, part in zip(shared_modes(each), each, strict=True)]
    between = centred(covariance(of_disc(each[0]), of_disc(each[1])))
    assert np.abs(modes[0] @ modes[1].T - SHARED * between).max() < 0.12
    whole = SHARED * covariance(each[0], each[0])[0, 0]
    for one in modes:
        assert 0.65 * whole < np.sum(one**2, axis=1).mean() < whole
        np.testing.assert_allclose(one.mean(axis=0), 0.0, atol=1e-12)


def test_an_uneven_limb_is_the_same_at_the_same_place_of_the_shadow():
    each = [places(), places((5e-3, -3e-3))]
    modes = [one[part.on_disc] for one, part in zip(uneven_modes(each), each, strict=True)]
    between = centred(unevenness(of_disc(each[0]), of_disc(each[1])))
    assert np.abs(modes[0] @ modes[1].T - between).max() < 0.02
    alone = error_modes.broad_modes(each[0].disc, each[0].on_disc)[each[0].on_disc]
    assert np.abs(modes[0] @ modes[0].T - alone @ alone.T).max() < 0.03


def test_places_in_the_shadow_are_where_the_axis_leaves_them():
    where = geometry("2022-11-08T10:30:00Z", 35.0, -110.0)
    line = jnp.array([-0.5, 0.0, 0.5])
    found = places_of(Registered(Disc(line, jnp.zeros(3), 1.0 / CELLS_PER_RADIUS), where, jnp.zeros(()), jnp.ones(3)))
    np.testing.assert_allclose(found.disc[:, 0], [0.5, 0.0, -0.5], atol=1e-12)  # east is on the left
    np.testing.assert_allclose(found.shadow[0] - found.shadow[2], [MOON, 0.0], atol=0.03 * MOON)
    centre = float(axis_offset(where, where.moon))
    assert np.linalg.norm(found.shadow[1]) == pytest.approx(
        centre, abs=1e-4
    )  # by the Moon's near side, seen from its side


def three():
    """Errors of three photographs: one mode of its own, and two that are shared, in common and in each channel."""
    random = np.random.default_rng(0)
    found = []
    for count in (24, 30, 27):
        cells = random.uniform(0.5, 2.0, (count // 3, 1, 1)) * np.eye(3)
        found.append(noise.Errors(cells, random.standard_normal((count, 4 * 3 + 2 + 1)), 3, 2, black=1, shared=2))
    return found


def dense(errors):
    """Covariance of all data, written out."""
    low = np.concatenate([shared_of(one) for one in errors])
    found = low @ low.T
    place = 0
    for one in errors:
        smooth = (one.modes * one.amplitudes)[:, [0, 3, 6, 9, 14]]
        own = smooth @ smooth.T
        for cell, block in enumerate(one.cells):
            own[3 * cell : 3 * cell + 3, 3 * cell : 3 * cell + 3] += block
        part = slice(place, place + one.sigma.size)
        found[part, part] += own
        place += one.sigma.size
    return found


def shared_of(one):
    return (one.modes * one.amplitudes)[:, [1, 2, 4, 5, 7, 8, 10, 11, 12, 13]]


def test_whitened_residuals_have_the_products_of_the_whole_covariance():
    errors, random = three(), np.random.default_rng(1)
    joint, inverse = joint_whitener(errors), np.linalg.inv(dense(errors))
    columns = random.standard_normal((len(inverse), 4))
    parts = np.split(columns, np.cumsum([one.sigma.size for one in errors])[:-1])
    np.testing.assert_allclose(np.concatenate(joint.inverse(parts)), inverse @ columns, rtol=1e-8, atol=1e-12)
    white = np.concatenate(joint(parts))
    np.testing.assert_allclose(white.T @ white, columns.T @ inverse @ columns, rtol=1e-9)
    np.testing.assert_allclose(
        joint.products(parts, [np.arange(4)] * 3, 4), columns.T @ inverse @ columns, rtol=1e-9, atol=1e-12
    )
    coordinates = joint.coordinates(parts)
    np.testing.assert_allclose(
        (coordinates.T * joint.signs) @ coordinates, columns.T @ inverse @ columns, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(joint.white(coordinates), white, rtol=1e-9, atol=1e-12)
    own = joint.products(parts, [np.array([0, 1, 2, 3]), np.array([0, 4, 5, 6]), np.array([0, 7, 8, 9])], 10)
    wide = np.zeros((len(inverse), 10))
    place = 0
    for number, part in enumerate(parts):
        wide[place : place + len(part), [0, *range(1 + 3 * number, 4 + 3 * number)]] = part
        place += len(part)
    np.testing.assert_allclose(own, wide.T @ inverse @ wide, rtol=1e-9, atol=1e-12)


def test_what_is_shared_is_the_mean_given_all_misfits():
    errors, random = three(), np.random.default_rng(2)
    whole, low = dense(errors), np.concatenate([shared_of(one) for one in errors])
    misfit = random.standard_normal(len(whole))
    parts = np.split(misfit, np.cumsum([one.sigma.size for one in errors])[:-1])
    expected = low @ low.T @ np.linalg.solve(whole, misfit)
    np.testing.assert_allclose(np.concatenate(shared_parts(errors, parts)), expected, rtol=1e-8, atol=1e-12)


def test_of_one_photograph_nothing_is_shared():
    one = replace(three()[0], shared=0)
    misfit = np.random.default_rng(3).standard_normal(one.sigma.size)
    joint, white = joint_whitener([one]), one.whitener(misfit)
    np.testing.assert_allclose(joint([misfit])[0], white)
    np.testing.assert_allclose(joint.white(joint.coordinates([misfit[:, None]]))[:, 0], white, rtol=1e-9, atol=1e-12)
    assert not np.any(shared_parts([one], [misfit]))


def test_many_photographs_know_no_more_of_what_looks_like_their_common_error():
    """A slope along the strongest mode: its sd falls as 1 / sqrt(number) where errors are drawn anew, and not here."""
    where = places()
    shared = shared_modes([where, where])[0]
    count = len(shared)
    response = np.repeat(np.eye(3)[None], count, axis=0)
    slope = np.repeat(shared[:, -1], 3)[:, None]

    def errors_with(known):
        smooth, left = noise.modes_of(where.disc, np.linalg.norm(where.shadow, axis=1), where.on_disc, known)
        usable = np.ones((count, 3), dtype=bool)
        none = np.zeros((count, 0))
        sources = noise.Sources(
            np.full((count, 3), 0.01), np.full(count, 0.03), smooth, left, none, none, 0.01, 1e-3, usable,
            where.on_disc, 0 if known is None else known.shape[1],
        )  # fmt: skip
        return sources.errors(np.full((count, 3), 0.3), response)

    errors, nothing_shared = errors_with(shared), errors_with(None)

    def sd(count, errors):
        found = joint_whitener([errors] * count).products([slope] * count, [np.array([0])] * count, 1)
        return float(found[0, 0]) ** -0.5

    alone = sd(1, errors)
    assert sd(1, nothing_shared) == pytest.approx(alone, rel=0.02)
    assert sd(16, nothing_shared) < 0.26 * alone
    assert sd(16, errors) > 0.8 * alone
