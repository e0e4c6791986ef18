"""Cells are means of linear light where they should be, and always the same ones."""

from types import SimpleNamespace

import numpy as np
import pytest

from inverse.cells import CELLS_PER_RADIUS, SKY_CELLS, bin_photo


def picture(shape, centre, radius, function):
    row, column = np.mgrid[: shape[0], : shape[1]]
    right, up = (column - centre[1]) / radius, (centre[0] - row) / radius
    pixels = np.repeat(function(right, up)[..., None], 3, axis=-1).astype(np.float32)
    photo = SimpleNamespace(
        pixels=pixels, variance=np.full_like(pixels, 1e-6), usable=(pixels > 0.01) & (pixels < 0.9),
        saturated=pixels >= 0.9, black=pixels <= 0.01,
    )  # fmt: skip
    return photo, SimpleNamespace(row=centre[0], column=centre[1], radius=radius)


@pytest.mark.parametrize("radius", [60.0, 251.3])
def test_a_plane_of_light_comes_back_at_the_cells_positions(radius):
    photo, registration = picture((900, 1000), (430.2, 512.7), radius, lambda x, y: 0.5 + 0.1 * x - 0.05 * y)
    cells = bin_photo(photo, registration)
    expected = 0.5 + 0.1 * cells.right - 0.05 * cells.up
    seen = cells.usable.all(axis=1)
    # To the last digit of the pixels, wherever in a cell these lie: else a disc is off by up to half a pixel.
    np.testing.assert_allclose(cells.value[seen, 0], expected[seen], rtol=1e-6)


def test_every_photograph_gives_the_same_cells():
    wide, narrow = (
        bin_photo(*picture(shape, (200.0, 210.0), 150.0, lambda x, y: 0.3 + 0 * x))
        for shape in ((900, 900), (401, 390))
    )
    assert wide.value.shape == narrow.value.shape
    assert wide.on_disc.sum() == narrow.on_disc.sum() > 0.8 * np.pi * CELLS_PER_RADIUS**2 * 0.96**2
    assert (~wide.on_disc).sum() == SKY_CELLS
    assert np.all(np.hypot(wide.right, wide.up)[wide.on_disc] < 0.96)


def test_masked_pixels_do_not_count():
    photo, registration = picture((400, 400), (200.0, 200.0), 150.0, lambda x, y: 0.3 + 0 * x)
    photo.pixels[:, :200] = 1.0
    photo.usable[:, :200] = False
    cells = bin_photo(photo, registration)
    assert np.all(cells.value[cells.usable] == pytest.approx(0.3))
    assert not cells.usable[cells.right < -0.05].any()


def test_noise_of_a_mean_falls_with_the_pixels_in_it():
    random = np.random.default_rng(3)
    photo, registration = picture((700, 700), (350.0, 350.0), 300.0, lambda x, y: 0.4 + 0 * x)
    photo.pixels += random.normal(0, 0.02, photo.pixels.shape)
    cells = bin_photo(photo, registration)
    pixels = (300.0 / CELLS_PER_RADIUS) ** 2
    # Four pixels count as one, for JPEG's sake.
    assert np.median(cells.sigma[cells.usable]) == pytest.approx(0.02 * np.sqrt(4 / pixels), rel=0.1)


def test_what_is_overexposed_or_black_is_a_limit():
    """Of a cell that is so in part, its mean with the rest at the end of the scale."""
    light = lambda right, up: np.where(right > 0, 0.92 + 0.05 * right, np.where(up > 0, 0.5, 0.002 - 0.001 * up))
    photo, registration = picture((500, 500), (250.0, 250.0), 200.0, light)
    photo.black[450:, :200] = False  # known for nothing
    cells = bin_photo(photo, registration)
    left, over = cells.right < -0.06, cells.right > 0.06
    middle, under = left & (cells.up > 0.06), left & (cells.up < -0.3) & (cells.up > -0.9)
    assert (cells.limit[over] == 1).all() and not cells.usable[over].any()
    np.testing.assert_allclose(cells.value[over], 0.92, rtol=1e-3)  # the least of what is overexposed
    assert (cells.limit[middle] == 0).all() and cells.usable[middle].all()
    assert (cells.limit[under] == -1).all()
    np.testing.assert_allclose(cells.value[under], photo.pixels[photo.black].max(), rtol=1e-6)
    unknown = (cells.right < -0.3) & (cells.up < -1.06)
    assert unknown.any() and (cells.limit[unknown] == 0).all() and not cells.usable[unknown].any()


def test_a_cell_that_is_overexposed_in_part_is_at_least_its_mean():
    photo, registration = picture((400, 400), (200.0, 200.0), 160.0, lambda right, up: 0.4 + 0 * up)
    photo.pixels[::2], photo.usable[::2], photo.saturated[::2] = 0.95, False, True
    cells = bin_photo(photo, registration)
    assert (cells.limit == 1).all()
    np.testing.assert_allclose(cells.value, 0.5 * (0.4 + 0.95), rtol=0.05)  # eight or nine rows in each
