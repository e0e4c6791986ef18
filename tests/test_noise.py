"""Whitening is C^(-1/2), and the smooth errors have the covariance they claim."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from inverse import error_modes, noise
from inverse.cells import CELLS_PER_RADIUS
from inverse.whitener import Alone, whitener


def test_whitened_residuals_have_the_mahalanobis_norm():
    random = np.random.default_rng(0)
    roots = np.eye(4) + 0.3 * np.tri(4) * random.uniform(size=(10, 4, 4))
    low_rank, residual = random.standard_normal((40, 6)), random.standard_normal(40)
    covariance = np.asarray(block_diag(*(roots @ np.swapaxes(roots, 1, 2)))) + low_rank @ low_rank.T
    whitened = whitener(Alone(np.linalg.inv(roots)), low_rank)(residual)
    assert whitened @ whitened == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-10)


def test_a_repeated_column_does_no_harm():
    random = np.random.default_rng(1)
    alone, column = Alone(np.ones((20, 1, 1))), random.standard_normal((20, 1))
    twice = np.concatenate([column, column, np.zeros((20, 1))], axis=1)
    residual = random.standard_normal(20)
    covariance = np.eye(20) + twice @ twice.T
    whitened = whitener(alone, twice)(residual)
    assert whitened @ whitened == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-8)


def disc(count=14):
    line = np.linspace(-0.9, 0.9, count)
    position = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    position = position[np.hypot(*position.T) < 0.95]
    return position, np.hypot(position[:, 0] + 1.2, position[:, 1]) * 4.6e-3


def smooth_covariance(position, offset):
    apart, farther = np.linalg.norm(position[:, None] - position, axis=-1), np.abs(offset[:, None] - offset)
    return 0.5 * error_modes.over_disc(apart) + 0.5 * error_modes.over_rings(farther)


@pytest.mark.parametrize("along", [0.0, 0.35, np.pi / 4])
@pytest.mark.parametrize("apart", [0.0, 1.0, 1.5, 3.0, 10.0])
def test_errors_of_cells_are_the_means_of_those_of_their_points(along, apart):
    """However the cells lie to one another, and to the rings that errors are functions of."""
    side, direction = 1.0 / CELLS_PER_RADIUS, np.array([np.cos(along), np.sin(along)])
    one, other = (np.random.default_rng(seed).uniform(-0.5, 0.5, (200_000, 2)) for seed in (0, 1))
    between = side * (apart * direction + one - other)
    over_disc = np.exp(-np.linalg.norm(between, axis=1) / error_modes.LENGTH).mean()
    over_rings = np.exp(-error_modes.MOON * np.abs(between @ direction) / error_modes.RADIAL).mean()
    # Of a change of 0.08 and 0.15 from one cell to the next.
    assert error_modes.over_disc(np.array(side * apart)) == pytest.approx(over_disc, abs=0.003)
    assert error_modes.over_rings(np.array(error_modes.MOON * side * apart)) == pytest.approx(over_rings, abs=0.007)


def about_the_mean(covariance):
    return covariance - covariance.mean(axis=0) - covariance.mean(axis=1)[:, None] + covariance.mean()


def test_smooth_modes_hold_most_of_the_covariance_and_nothing_of_its_mean():
    position, offset = disc(20)
    modes, rest = error_modes.smooth_modes(position, offset)
    assert modes.shape == (len(position), error_modes.MODES)
    assert np.abs(modes.mean(axis=0)).max() < 1e-8
    wanted = about_the_mean(smooth_covariance(position, offset))
    left = wanted - modes @ modes.T
    assert np.trace(left) < 0.06 * np.trace(wanted)
    assert np.linalg.eigvalsh(left).min() > -1e-9
    np.testing.assert_allclose(rest, np.diag(left), atol=1e-12)


def sources(sigma, modes, *, relief=0.0, usable=True):
    """Errors of pixels, and smooth ones of the light; the modes leave nothing."""
    cells = len(modes)
    usable = np.broadcast_to(usable, (cells, 3))
    return noise.Sources(
        np.full((cells, 3), sigma),
        np.full(cells, relief),
        modes,
        np.zeros(cells),
        np.zeros((cells, 0)),
        np.zeros((cells, 0)),
        0.004,
        noise.BLACK,
        usable,
        np.ones(cells, dtype=bool),
    )


def bright(modes):
    """Values of cells so far from black that nothing is wrong with them for being near it."""
    return np.full((len(modes), 3), 1e4)


def test_a_colour_matrix_mixes_the_errors_of_the_light():
    position, offset = disc()
    cells, (modes, _) = len(position), error_modes.smooth_modes(position, offset)
    matrix = np.array([[1.2, -0.3, 0.1], [0.0, 1.5, -0.5], [-1.0, -0.4, 2.4]])
    usable = np.random.default_rng(2).uniform(size=(cells, 3)) > 0.1
    errors = sources(0.02, modes, relief=0.05, usable=usable).errors(
        bright(modes), np.broadcast_to(matrix, (cells, 3, 3))
    )  # fmt: skip
    scaled = (errors.modes * errors.amplitudes)[:, : -errors.black]
    mixed = noise.COMMON**2 * np.outer(matrix.sum(axis=1), matrix.sum(axis=1)) + noise.CHROMATIC**2 * matrix @ matrix.T
    wanted = np.einsum("ij,kl->ikjl", modes @ modes.T, mixed).reshape(3 * cells, 3 * cells)
    used = usable.ravel()
    np.testing.assert_allclose((scaled @ scaled.T)[np.ix_(used, used)], wanted[np.ix_(used, used)], atol=1e-12)
    alike = matrix.sum(axis=1)
    of_cell = 0.02**2 * np.eye(3) + 0.05**2 * np.outer(alike, alike) + noise.TINT**2 * matrix @ matrix.T
    assert np.allclose(errors.cells[usable.all(axis=1)], of_cell, rtol=1e-12)
    assert not scaled[~used].any() and np.allclose(errors.scale[~used], 0.02)


def test_colours_of_the_sky_are_known_less_well_than_the_discs():
    known = replace(sources(0.02, np.zeros((4, 1))), on_disc=np.array([True, True, False, False]))
    errors = known.errors(bright(np.zeros((4, 1))), np.broadcast_to(np.eye(3), (4, 3, 3)))
    for tint, of_cells in zip((noise.TINT, noise.SKY_TINT), (errors.cells[:2], errors.cells[2:]), strict=True):
        np.testing.assert_allclose(of_cells, np.broadcast_to((0.02**2 + tint**2) * np.eye(3), (2, 3, 3)), rtol=1e-12)
        assert tint in (0.012, 0.1)


def test_errors_have_the_stated_size_on_the_disc_and_beside_it():
    position, offset = disc()
    on_disc = np.concatenate([np.full(len(position), True), np.full(20, False)])
    around = 1.3 * np.stack([np.cos(np.arange(20)), np.sin(np.arange(20))], axis=1)
    position, offset = np.concatenate([position, around]), np.concatenate([offset, np.zeros(20)])
    modes, left = noise.modes_of(position, offset, on_disc)
    assert not left[~on_disc].any()
    errors = sources(0.05, modes).errors(bright(modes), np.broadcast_to(np.eye(3), (on_disc.size, 3, 3)))
    whole = (errors.modes * errors.amplitudes).reshape(on_disc.size, 3, -1)
    smooth = whole[..., : -errors.black]
    together = smooth[~on_disc, 0] @ smooth[~on_disc, 1].T
    assert np.sqrt(np.diag(together).min()) >= noise.SKY and together.mean() == pytest.approx(noise.SKY**2, rel=0.1)
    assert not (smooth[on_disc, 0] @ smooth[~on_disc, 0].T).any()
    red, both = np.sum(smooth[:, 0] ** 2, axis=1), np.sum(smooth[:, 0] * smooth[:, 1], axis=1)
    variance = np.sum(modes**2, axis=1)
    np.testing.assert_allclose(both, noise.COMMON**2 * variance)
    np.testing.assert_allclose(red, (noise.COMMON**2 + noise.CHROMATIC**2) * variance)
    residual = np.random.default_rng(1).standard_normal(3 * on_disc.size)
    flat = whole.reshape(residual.size, -1)
    covariance = np.asarray(block_diag(*errors.cells)) + flat @ flat.T
    expected = residual @ np.linalg.solve(covariance, residual)
    assert np.sum(errors.whitener(residual) ** 2) == pytest.approx(expected, rel=1e-9)
    columns = np.column_stack([residual, residual**2])
    white = errors.whitener(columns)
    np.testing.assert_allclose(errors.whitener.products(columns), white.T @ white, rtol=1e-9)
    alone = errors.without_smooth()
    np.testing.assert_allclose(alone.scale**2, np.diag(covariance))
    np.testing.assert_allclose(alone.whitener(residual), residual / alone.scale, rtol=1e-6)


def test_what_the_modes_leave_is_independent():
    """Of every cell on the disc the smooth errors have their whole variance about the mean over it, as drawn ones have,
    and none of those of the sky."""
    position, offset = disc(30)
    cells, usable = len(position), np.full((len(position), 3), True)
    on_disc = np.arange(cells) < cells - 10
    modes, left = noise.modes_of(position, offset, on_disc)
    modes, none = modes * on_disc[:, None], np.zeros((cells, 0))  # the sky's own errors left out
    errors = noise.Sources(
        np.full((cells, 3), 0.01), np.zeros(cells), modes, left, none, none, 0.004, noise.BLACK, usable, on_disc
    )
    every = errors.errors(bright(modes), np.broadcast_to(np.eye(3), (cells, 3, 3)))
    both = np.diagonal(every.cells, axis1=1, axis2=2) + np.sum(
        (every.modes * every.amplitudes).reshape(cells, 3, -1) ** 2, axis=2
    )
    covariance, alone = smooth_covariance(position[on_disc], offset[on_disc]), noise.TINT**2 + 0.01**2
    smooth = (noise.COMMON**2 + noise.CHROMATIC**2) * np.diag(about_the_mean(covariance))
    np.testing.assert_allclose(both[on_disc], np.broadcast_to((smooth + alone)[:, None], (cells - 10, 3)), rtol=1e-6)
    np.testing.assert_allclose(both[~on_disc], noise.SKY_TINT**2 + 0.01**2, rtol=1e-6)
    normal = np.random.default_rng(4).standard_normal((cells - 10, 4000))
    drawn = np.linalg.cholesky(covariance + 1e-9 * np.eye(cells - 10)) @ normal
    variance = (drawn - drawn.mean(axis=0)).var(axis=1)
    wanted = (noise.COMMON**2 + noise.CHROMATIC**2) * variance + alone
    np.testing.assert_allclose(both[on_disc].mean(axis=1), wanted, rtol=0.1)
    assert np.mean(both[on_disc]) == pytest.approx(wanted.mean(), rel=0.01)


@pytest.mark.parametrize(
    ("nearest", "amplitudes"), [(1e-4, (0.2, 0.05, 0.3)), (2.5e-3, (0.1, 0.04, 0.1)), (4e-3, (0.2, 0.05, 0.3))]
)
def test_estimates_stray_no_farther_than_they_say(nearest, amplitudes):
    """Of brightness and colours that follow the offset from the shadow's axis, as those of a limb do.

    What estimates make of errors by whole kernels, against what they think of modes: 100 modes made intervals a
    seventh too narrow. Weights go to patterns that modes leave out, since these pass for small.
    """
    position, _ = disc(38)
    offset = np.hypot(position[:, 0] * 4.5e-3 + nearest + 4.3e-3, position[:, 1] * 4.5e-3)
    smooth, chromatic, uneven = amplitudes
    cells, on_disc = len(position), np.full(len(position), True)
    modes, left = noise.modes_of(position, offset, on_disc)
    broad = error_modes.broad_modes(position, on_disc)
    response = np.broadcast_to(np.eye(3), (cells, 3, 3))
    errors = noise.Sources(
        np.full((cells, 3), 0.01), np.full(cells, noise.RELIEF), modes, left, broad, np.zeros((cells, 0)), 0.004,
        1e-9, np.full((cells, 3), True), on_disc,
    ).errors(bright(modes), response, smooth=smooth, chromatic=chromatic)  # fmt: skip
    errors = replace(errors, smooth=smooth, chromatic=chromatic, uneven=uneven)
    curves = np.polynomial.chebyshev.chebvander(2.0 * (offset - offset.min()) / np.ptp(offset) - 1.0, 5)
    slopes = np.concatenate([curves[:, None] * np.eye(3)[colour][:, None] for colour in range(3)], axis=2)
    white = errors.whitener(slopes.reshape(3 * cells, -1))
    covariance = np.linalg.inv(white.T @ white)
    weights = (errors.whitener(np.eye(3 * cells)).T @ white @ covariance).reshape(cells, 3, -1)
    apart = np.linalg.norm(position[:, None] - position, axis=-1)
    kernels = smooth_covariance(position, offset), np.exp(-0.5 * (apart / error_modes.BROAD) ** 2)
    kernels = [about_the_mean(kernel) for kernel in kernels]
    together, alone = (np.einsum("ik,ij,jk->k", weights.sum(axis=1), kernel, weights.sum(axis=1)) for kernel in kernels)
    each, coloured = (np.einsum("ick,ij,jck->k", weights, kernel, weights) for kernel in kernels)
    of_cells = (noise.TINT**2 + 0.01**2) * (weights**2).sum(axis=(0, 1)) + noise.RELIEF**2 * (
        weights.sum(axis=1) ** 2
    ).sum(axis=0)
    whole = smooth**2 * together + chromatic**2 * each + uneven**2 * (alone + noise.COLOURED**2 * coloured) + of_cells
    ratio = np.sqrt(whole / np.diag(covariance))
    assert ratio.max() < 1.04 and ratio.min() > 0.96


def test_the_whole_error_is_that_of_the_modes_and_of_a_limit_too():
    """By draws of the light's errors, through a matrix; a value that is no measurement errs as much as one that is."""
    position, offset = disc()
    cells, random = len(position), np.random.default_rng(8)
    on_disc, usable = np.arange(cells) < cells - 20, random.uniform(size=(cells, 3)) > 0.3
    response = np.broadcast_to([[1.5, -0.4, 0.0], [0.0, 0.8, 0.1], [-2.0, 0.3, 2.5]], (cells, 3, 3))
    none = np.zeros((cells, 0))
    made = noise.Sources(
        np.full((cells, 3), 0.02), np.full(cells, 0.05), *error_modes.smooth_modes(position, offset),
        none, none, 0.004, noise.BLACK, usable, on_disc,
    ).errors(np.full((cells, 3), 0.5), response)  # fmt: skip
    found = replace(made, independent=2.0, smooth=0.2, chromatic=0.1, uneven=0.3).whole.reshape(cells, 3)
    alike, each = random.standard_normal((2, 1, 200_000)), random.standard_normal((3, 3, 200_000))
    own, of_sky = (2.0 * (0.05 * alike[0] + tint * each[0]) for tint in (noise.TINT, noise.SKY_TINT))
    limb = 0.2 * random.standard_normal(200_000) + 0.1 * each[1] + 0.3 * (alike[1] + noise.COLOURED * each[2])
    for light, where in ((own + limb, on_disc), (of_sky, ~on_disc)):
        wanted = (response[0] @ light).std(axis=1)
        np.testing.assert_allclose(found[where], np.broadcast_to(wanted, found[where].shape), rtol=0.02)


def test_errors_near_black_are_those_of_a_curve_for_each_channel():
    value = np.random.default_rng(5).uniform(0.0, 0.4, (200, 3))
    value[:50] *= 0.01
    usable = np.random.default_rng(6).uniform(size=value.shape) > 0.1
    modes = error_modes.black_modes(value, 0.004, usable, noise.BLACK).reshape(*value.shape, -1)
    variance = np.sum(modes**2, axis=-1)
    assert not variance[~usable].any() and not np.any(np.sum(modes[:, 0] * modes[:, 1], axis=1))
    wanted = noise.BLACK / (value + 0.004)
    share = variance[usable] / wanted[usable] ** 2
    assert share.min() > 0.5 and share.max() < 1.05  # a few modes hold most of it
    dark, light = wanted > 0.1, wanted < 0.004
    assert np.sqrt(variance[dark & usable].max()) > 0.1 and np.sqrt(variance[light & usable].max()) < 0.005


def test_a_linear_file_knows_its_black_by_its_brightest_value():
    value = np.array([[0.5, 0.2, 0.1], [0.9, 0.3, 0.1]])
    usable = np.array([[True, True, True], [False, True, True]])
    assert noise.black_error(value, usable, "srgb") == noise.black_error(1e-5 * value, usable, "srgb") == noise.BLACK
    linear = noise.black_error(value, usable, "linear")
    assert linear == 0.5 * noise.BLACK_LINEAR  # what is overexposed says nothing
    assert noise.black_error(1e-5 * value, usable, "linear") == pytest.approx(1e-5 * linear)


def test_an_uneven_limb_makes_broad_errors_of_the_light_alike_in_all_channels():
    position, offset = disc()
    on_disc = np.hypot(*position.T) < 0.9
    broad = error_modes.broad_modes(position, on_disc)
    apart = np.linalg.norm(position[on_disc][:, None] - position[on_disc], axis=-1)
    wanted = about_the_mean(np.exp(-0.5 * (apart / error_modes.BROAD) ** 2))
    assert np.abs(broad[on_disc] @ broad[on_disc].T - wanted).max() < 0.01
    assert not broad[~on_disc].any()
    cells = len(position)
    made = noise.Sources(
        np.full((cells, 3), 0.02), np.zeros(cells), np.zeros((cells, 1)), np.zeros(cells), broad, np.zeros((cells, 0)),
        0.004, noise.BLACK, np.full((cells, 3), True), np.zeros(cells),
    ).errors(bright(broad), np.broadcast_to(np.eye(3), (cells, 3, 3)))  # fmt: skip
    whole = (made.modes * made.amplitudes)[:, made.kinds == 3].reshape(cells, 3, -1)
    variance = noise.UNEVEN**2 * np.sum(broad**2, axis=1)
    np.testing.assert_allclose(np.sum(whole[:, 0] * whole[:, 2], axis=1), variance, atol=1e-15)
    np.testing.assert_allclose(np.sum(whole[:, 1] ** 2, axis=1), (1.0 + noise.COLOURED**2) * variance, atol=1e-15)


def test_an_excess_is_known_to_no_better_than_itself_and_alike_all_over_a_channel():
    position, offset = disc()
    cells, (modes, _) = len(position), error_modes.smooth_modes(position, offset)
    excess = np.random.default_rng(3).uniform(0.0, 0.5, (cells, 3))
    none, response = np.zeros((cells, 3)), np.broadcast_to(np.eye(3), (cells, 3, 3))
    made = [
        sources(0.02, modes).errors(bright(modes), response, noise.Bending(np.ones((cells, 3)), none, none, lifted))
        for lifted in (excess, none)
    ]
    with_it, without = ((one.modes * one.amplitudes) @ (one.modes * one.amplitudes).T for one in made)
    added = (with_it - without).reshape(cells, 3, cells, 3)
    wanted = np.einsum("ic,jd,cd->icjd", excess, excess, np.eye(3))
    np.testing.assert_allclose(added, wanted, atol=1e-12)
    np.testing.assert_allclose(made[0].excess, excess.ravel())
