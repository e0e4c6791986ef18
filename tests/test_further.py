"""Which further photograph would help most: as fits of both say, and not what is the same again."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.camera import LOONEY_11
from eclipsejax.ephemeris import geometry
from inverse import further
from inverse.blocked import Blocked, Information
from inverse.evidence import gather, prepare
from inverse.further import blocks_of, further_photographs, in_words, known_information, moments
from inverse.likelihood import LIMB
from inverse.limb_light import shadow_of, shadow_slopes
from inverse.map_estimate import Optimum, quadratic
from inverse.photo import Photo
from inverse.photo_model import signal
from inverse.prior import ATMOSPHERE
from inverse.same_camera import BRIGHTEST, DARKEST, SameCamera
from tests import synthetic

PARTIAL, MINUTE_LATER = ("2022-05-16T05:10:00Z", -2.0), ("2022-05-16T03:46:00Z", 0.0)
# Of standard deviations: what blocks and modes make of the errors. The temperature is seen in fine patterns, the ozone
# in what is nearly black.
WITHIN = {"air.surface_temperature": 0.4, "ozone.column_du": 0.35}
TOLERANCE = np.array([WITHIN.get(parameter.name, 0.12) for parameter in ATMOSPHERE])


def deviations(information: np.ndarray) -> np.ndarray:
    return np.sqrt(np.diag(np.linalg.inv(information))[:LIMB])


class Asked:
    """A synthetic photograph that states its exposure, fitted at the middle of the prior, and its camera."""

    def __init__(self, path):
        synthetic.photograph(path, synthetic.limb(), clock="2022:05:16 03:45:00")
        (item,) = gather([path], time=synthetic.UTC, site=synthetic.SITE, disc=None, progress=lambda *_: None)
        self.item, prepared = replace(item, clock="camera"), prepare([item])
        z = np.zeros(len(prepared.parameters))
        self.likelihood = prepared.carried(z)
        self.optimum = Optimum(z, 0.0, True, 0, quadratic(self.likelihood, z).information, ())
        self.camera = SameCamera(self.item, self.likelihood, self.optimum, 0, blocks_of(1))
        times = [geometry(utc, *synthetic.SITE) for utc, _ in (PARTIAL, MINUTE_LATER)]
        self.shadow = shadow_of([item.where, *times])
        self.light = shadow_slopes(self.shadow, jnp.zeros(LIMB))
        self.known = known_information(self.likelihood, self.optimum, [0], self.camera, self.shadow, self.light)

    def further(self, utc: str, stops: float) -> Blocked:
        """A further photograph."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("inverse.same_camera.STOPS", np.array([stops]))
            where = geometry(utc, *synthetic.SITE)
            ((exposed, one),) = self.camera.photographs(where, self.shadow, *self.light)
        assert exposed == stops
        return one

    def left(self, utc: str, stops: float) -> np.ndarray:
        """What is foreseen to be left of the standard deviations."""
        one = self.further(utc, stops)
        return deviations(self.known.with_further(one, self.camera.columns)) / deviations(self.known.matrix)

    def left_by_fit(self, utc: str, stops: float) -> np.ndarray:
        """What a fit of both leaves of those of the one, where the further one's values are the model's."""
        where, item, camera = geometry(utc, *synthetic.SITE), self.item, self.camera
        gains = camera.model.gain + np.log(2.0) * np.array([0.0, stops])
        model = eqx.tree_at(lambda one: (one.geometry, one.gain), camera.model, (where, jnp.asarray(gains[1])))
        value = np.asarray(signal(model, self.shadow.table(self.light[0]), camera.z))
        cells = replace(
            item.cells, value=value, usable=(value > DARKEST) & (value < BRIGHTEST), limit=np.zeros(value.shape),
            sigma=np.interp(value, *camera.noise),
        )  # fmt: skip
        assert isinstance(item.photo, Photo) and item.photo.exposure_s is not None
        photo = replace(item.photo, exposure_s=item.photo.exposure_s * 2.0**stops)
        both = prepare([item, replace(item, where=where, cells=cells, photo=photo)])
        of_one = zip(both.models, gains, strict=True)
        models = tuple(eqx.tree_at(lambda one: one.gain, one, jnp.asarray(gain)) for one, gain in of_one)
        z = np.zeros(len(both.parameters))
        assert z.size == camera.count
        both = replace(both, models=models, shadow=self.shadow).carried(z)
        # The one by itself has its errors as they are in the fit of both.
        errors = (replace(both.errors[0], shared=0),)
        alone = replace(self.likelihood, shadow=self.shadow, errors=errors, observed=both.observed[:1])
        return deviations(quadratic(both, z).information) / deviations(quadratic(alone, self.optimum.z).information)


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    return Asked(tmp_path_factory.mktemp("further") / "eclipse.jpg")


def test_blocks_tell_what_cells_do(asked):
    ratio = deviations(asked.known.matrix) / deviations(asked.optimum.information)
    np.testing.assert_array_less(np.abs(np.log(ratio)), TOLERANCE)


def test_one_more_is_one_of_two(asked):
    """What is added to the one by itself is what both tell from the beginning."""
    one = asked.further(*PARTIAL)
    columns = [asked.likelihood.columns(0), asked.camera.columns]
    both = Information([*asked.known.photographs, one], columns, asked.camera.count)
    np.testing.assert_allclose(asked.known.with_further(one, columns[1]), both.matrix, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("when", [PARTIAL, MINUTE_LATER])
def test_what_is_left_is_what_a_fit_of_both_leaves(asked, when):
    np.testing.assert_array_less(np.abs(np.log(asked.left(*when) / asked.left_by_fit(*when))), TOLERANCE)


def test_the_same_again_tells_little_since_errors_are_the_same(asked, monkeypatch):
    again = asked.left(*MINUTE_LATER)
    assert np.all(again > 0.88) and np.all(again < 1.0)
    monkeypatch.setattr("inverse.blocked.SHARED", 0.0)
    assert asked.left(*MINUTE_LATER).min() < 0.84


def test_all_of_an_eclipse(asked, monkeypatch):
    """Nothing makes less certain, the full Moon tells the exposure, and the sentence names the best."""
    monkeypatch.setattr(further, "TIMES", 5)
    found = further_photographs([asked.item], asked.likelihood, asked.optimum)
    assert {one.utc for one in found} == {where.utc for where in moments(asked.item)}
    for one in found:
        assert np.all(one.remains < 1.0 + 1e-9) and one.bits > 0.0
    full = [one for one in found if one.utc < "2022-05-16T02"]
    assert full and max(one.stops for one in full) <= -9.0  # the umbra's exposure shows nothing of it
    said = further.advice([asked.item], asked.likelihood, asked.optimum)
    assert said is not None
    best = min(found, key=lambda one: one.remains[0])
    assert best.remains[0] < 0.7
    assert f"would tell most of the dust at {best.utc}" in in_words(said)
    assert f"fall to {best.remains[0]:.0%}" in in_words(said)
    little = {**said["best_for_dust"][0], "remains": {"dust.extinction": 0.95}}
    assert "would tell much more of the dust" in in_words({**said, "best_for_dust": [little]})


@pytest.mark.slow
def test_an_exposure_that_is_known_tells_what_the_full_moon_would(asked):
    """Of the dust, which darkens as a shorter exposure does."""
    photo = replace(asked.item.photo, f_number=8.0)
    likelihood = prepare([replace(asked.item, photo=photo)], 0.25)
    (model,) = likelihood.models
    full_moon = LOONEY_11 * photo.exposure_s * photo.iso * (11.0 / 8.0) ** 2
    assert float(model.gain) == pytest.approx(np.log(full_moon)) and model.gain_width == 0.25
    assert {one.name: one.width for one in likelihood.parameters}["gain"] == 0.25
    z = np.zeros(len(likelihood.parameters))
    left = deviations(quadratic(likelihood.carried(z), z).information) / deviations(asked.optimum.information)
    assert left[0] < 0.75


def test_the_moon_has_to_be_up(asked):
    below = replace(asked.item, site=(52.5, 13.4))  # in Berlin it set before totality
    assert 0 < len(moments(below)) < further.TIMES
    never = replace(asked.item, site=(35.7, 139.7))
    assert further_photographs([never], asked.likelihood, asked.optimum) == []
