"""What the likelihood takes for the shadow and for a photograph."""

from dataclasses import replace
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax.constants import MOON_RADIUS
from eclipsejax.ephemeris import geometry
from eclipsejax.moon import Moon
from eclipsejax.shadow_operator import shadow_operator
from eclipsejax.sun import Sun
from inverse import assumed_camera, prior
from inverse.camera_colours import ASSUMED_MATRIX
from inverse.evidence import gather, prepare
from inverse.likelihood import LIMB, places, response
from inverse.limb_light import shadow_light, shadow_of
from inverse.map_estimate import quadratic
from inverse.noise import Bending
from inverse.observed import LEAST_ERROR
from inverse.photo_model import Disc, developed, log_value, signal
from tests import synthetic


@pytest.mark.parametrize(
    ("utc", "rms", "largest"), [("2022-05-16T04:06:00Z", 0.015, 0.055), ("2022-05-16T03:00:00Z", 0.005, 0.03)]
)
def test_table_of_one_distance_serves_the_depth_of_the_moon(utc, rms, largest):
    # In totality, and with the umbra's edge on the Moon; the nearest point, and the limb.
    where = geometry(utc)
    shadow, limb = shadow_of([where]), jnp.zeros(len(prior.ATMOSPHERE))
    table = eqx.filter_jit(lambda tabulator: tabulator(prior.atmosphere(limb)))(shadow.tabulator)
    operator = eqx.filter_jit(shadow_operator)
    exact = eqx.filter_jit(lambda operator: operator(prior.atmosphere(limb))[0])
    grid, weights = shadow.tabulator.grid, shadow.tabulator.weights
    for depth in (0.0, 0.9):
        distance = jnp.linalg.norm(where.moon) - depth * MOON_RADIUS
        entries = grid.offsets_at(distance)
        offset = jnp.linspace(entries[2], entries[-3], 60)  # on entries of the table, and between
        here = operator(
            Sun(), offset[None], distance[None], jnp.linalg.norm(where.sun), shadow.tabulator.operator.wavelength
        )
        light = np.asarray(exact(here) @ weights)
        error = np.asarray(table(offset, jnp.full(offset.shape, distance))) / light - 1
        assert np.sqrt(np.mean(error**2)) < rms
        assert np.abs(error).max() < largest


def nuisances(**given):
    value = {p.name: p.value(0.0) for p in prior.PHOTOGRAPH + prior.TONE}
    return {name: jnp.asarray(given.get(name.replace(".", "_"), v)) for name, v in value.items()}


def camera(tone_curve, gain=0.0, width=0.0, balance=(0.0, 0.0), tint_width=0.0):
    return SimpleNamespace(
        tone_curve=tone_curve, gain=gain, exposure_width=width, balance=jnp.asarray(balance), tint_width=tint_width,
        primaries=jnp.eye(3), colours=jnp.asarray(ASSUMED_MATRIX),
    )  # fmt: skip


def test_a_white_balance_moves_red_and_blue_against_green():
    light = jnp.asarray([[0.1, 0.2, 0.3]])
    out = developed(
        camera("linear", balance=(-0.3, 0.2), tint_width=0.1), light, nuisances(tint_red=1.0, tint_blue=-2.0)
    )
    np.testing.assert_allclose(out, light * jnp.exp(jnp.asarray([[-0.2, 0.0, 0.0]])), rtol=1e-12)


def test_a_linear_photograph_is_light_times_gain():
    light = jnp.asarray([[0.1, 0.2, 0.3]])
    out = developed(camera("linear", 0.5, 0.2), light, nuisances(gain=np.log(2.0), exposure=-1.5))
    assert np.asarray(out) == pytest.approx(2 * np.exp(0.5 - 0.3) * np.asarray(light))


def test_white_stays_white_and_deep_red_stays_positive():
    neutral = nuisances(tone_exponent=1.0, tone_toe=0.0, tone_shoulder=0.0, tone_saturation=1.0, matrix_red_green=0.1)
    white = np.asarray(developed(camera("srgb"), jnp.full((1, 3), 0.4), neutral))[0]
    assert white == pytest.approx(np.full(3, 0.4), rel=2e-3)
    assert ASSUMED_MATRIX.sum(axis=1) == pytest.approx(1.0, abs=1e-3)
    red = lambda x: developed(camera("srgb"), jnp.asarray([[x, 0.01, 0.001]]), neutral)
    assert np.all(np.asarray(red(0.5)) > 0)
    assert np.all(np.isfinite(np.asarray(jax.jacfwd(red)(0.5))))


def test_light_below_black_is_dark_but_has_a_slope():
    black = nuisances(tone_black=0.01, tone_toe=0.0, tone_shoulder=0.0, tone_saturation=0.0)
    grey = lambda x: developed(camera("srgb"), x * jnp.ones((1, 3)), black)[0, 0]
    assert 0.0 < grey(0.004) < 1e-4
    assert grey(0.2) == pytest.approx(0.19, rel=1e-3)
    assert jax.grad(grey)(0.004) > 0.0


def test_what_a_camera_clips_is_black_even_where_its_black_is_too_bright():
    # Where blue is below nothing by more than a black taken too low adds, the file holds 0.
    low = nuisances(tone_black=-0.005, tone_exponent=1.0, tone_toe=0.0, tone_shoulder=0.0, tone_saturation=1.0)
    for light, mixed in (([0.5, 0.01, 0.001], 0.0256), ([0.02, 0.04, 0.001], -0.0192)):
        assert ASSUMED_MATRIX[2] @ light == pytest.approx(mixed, abs=1e-4)
        blue = developed(camera("srgb"), jnp.asarray([light]), low)[0, 2]
        assert blue == pytest.approx(max(mixed + 0.005, 0.0), abs=2e-4)


def test_a_disc_that_is_larger_shows_what_lies_nearer_to_its_middle():
    where = geometry("2022-05-16T03:00:00Z")
    right, up = jnp.asarray([0.0, 0.505, -0.303]), jnp.asarray([0.0, 0.404, 0.707])
    moon = Moon(albedo_map=np.ones((2, 4)))

    def offset(disc, **given):
        return np.asarray(disc.surface(where, 0.3, False, moon, nuisances(**given)).offset)

    larger = offset(Disc(right, up, 0.0), pointing_radius=0.01)
    np.testing.assert_allclose(larger, offset(Disc(right / 1.01, up / 1.01, 0.0)), rtol=1e-12)
    assert np.abs(larger - offset(Disc(right, up, 0.0)))[1:].min() > 1e-6


def test_what_photographs_share_has_one_place():
    models = [SimpleNamespace(parameters=prior.PHOTOGRAPH), SimpleNamespace(parameters=prior.PHOTOGRAPH)]
    names = [parameter.name for parameter in prior.PHOTOGRAPH]
    alone, together = {}, {"gain": "camera", "clock": "camera"}
    apart = places([alone, alone], models)
    assert not set(apart[0]) & set(apart[1]) and apart[0][0] == LIMB
    first, second = places([together, together], models)
    assert {names[i] for i in range(len(names)) if first[i] == second[i]} == {"gain", "clock"}
    assert sorted({*first, *second}) == list(range(LIMB, LIMB + 2 * len(names) - 2))


def test_scattered_light_fills_the_dark_and_no_more():
    where = geometry("2022-05-16T04:06:00Z")
    shadow = shadow_of([where])
    limb = jnp.zeros(LIMB)
    amplitude = [parameter.name for parameter in prior.ATMOSPHERE].index("scattered.amplitude")
    none = np.exp(shadow_light(shadow, limb.at[amplitude].set(-60.0)).log_light)
    some = np.exp(shadow_light(shadow, limb).log_light) - none
    assert np.all((some > 1e-7) & (some < 6e-7))
    more = np.exp(shadow_light(shadow, limb.at[amplitude].set(1.0)).log_light) - none
    np.testing.assert_allclose(more, np.exp(0.4) * some, rtol=1e-5)


@pytest.fixture(scope="module")
def synthetic_likelihood(tmp_path_factory):
    """One synthetic photograph, no fit."""
    path = synthetic.photograph(tmp_path_factory.mktemp("likelihood") / "eclipse.jpg", synthetic.limb())
    evidence = gather([path], time=synthetic.UTC, site=synthetic.SITE, disc=None, progress=lambda *_: None)
    return prepare(evidence)


def test_errors_are_carried_as_light_is(synthetic_likelihood):
    """A per cent more light in one channel of the shadow, and what the values make of it."""
    one = synthetic_likelihood
    model, names = one.models[0], [parameter.name for parameter in one.models[0].parameters]
    z = 0.5 * np.random.default_rng(3).standard_normal(len(one.parameters))
    z[LIMB + names.index("camera.veil")] = -30.0  # its brightness hangs on all channels together
    table, nuisance = shadow_light(one.shadow, jnp.asarray(z[:LIMB])), jnp.asarray(z[LIMB:])
    nothing = jnp.zeros(len(model.on_disc))
    value, slopes, alike, *bent = response(model, table, nuisance, nothing, nothing)
    np.testing.assert_allclose(alike, slopes.sum(axis=2), rtol=1e-3, atol=1e-4)
    assert all(np.abs(part).max() < 1e-3 for part in bent)
    np.testing.assert_allclose(value, signal(model, table, nuisance), rtol=1e-12)
    for channel, unit in enumerate(5e-4 * np.eye(3)):
        high, low = (
            log_value(model, signal(model, one.shadow.table(table.log_light + sign * unit), nuisance))
            for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(slopes[..., channel], (high - low) / 1e-3, rtol=1e-3, atol=1e-4)


def test_a_cell_that_an_error_made_too_dark_is_not_taken_for_sure(synthetic_likelihood):
    """Errors are those of the light that the model sees; those of what a value tells of are too small near black."""
    z = np.zeros(len(synthetic_likelihood.parameters))
    z[LIMB] = -1.5  # the gain: an exposure that leaves half of the disc near black
    model = synthetic_likelihood.models[0]
    table = shadow_light(synthetic_likelihood.shadow, jnp.asarray(z[:LIMB]))
    sources, small = synthetic_likelihood.sources[0], np.full((1, 3), 1e-4)
    sizes = (jnp.asarray(size) for size in sources.sizes(*small[0]))
    value, slopes, *bent = (np.asarray(part) for part in response(model, table, jnp.asarray(z[LIMB:]), *sizes))
    carried = synthetic_likelihood.carried(z, small)
    assert np.array_equal(carried.carried_at, z)
    assert np.array_equal(carried.errors[0].cells, sources.errors(value, slopes, Bending(*bent), *small[0, :2]).cells)
    floor = float(model.floor)
    near_black = (value < 2.0 * floor) & (value > 0.2 * floor)
    assert near_black.sum() > 50
    too_dark = assumed_camera.response(model, 0.6 * value)
    ratio = np.abs(too_dark).sum(axis=2)[near_black] / np.abs(slopes).sum(axis=2)[near_black]
    assert np.median(ratio) < 0.85


def drawn_changes(model, light, nuisance, draws):
    """How drawn errors of the log of the light (draw, cell, 1 or channel) change the log of the values, in turn."""
    log = lambda light: log_value(model, developed(model, light, nuisance))
    change = jax.jit(lambda draws: jax.lax.map(lambda error: log(light * jnp.exp(error)) - log(light), draws))
    return np.asarray(change(draws))


@pytest.mark.parametrize("uneven", [0.15, 0.5])
def test_large_errors_of_the_light_make_those_of_the_values_that_draws_have(synthetic_likelihood, uneven):
    """Near black a value bends with the light: its errors are no line's, and do not average out."""
    z = np.zeros(len(synthetic_likelihood.parameters))
    z[LIMB] = -1.5
    one, model, sources = synthetic_likelihood, synthetic_likelihood.models[0], synthetic_likelihood.sources[0]
    table, nuisance = shadow_light(one.shadow, jnp.asarray(z[:LIMB])), prior.values(model.parameters, z[LIMB:])
    light = model.light(table, model.seen(jnp.asarray(z[LIMB:])), nuisance)
    draws = uneven * np.random.default_rng(5).standard_normal((3000, sources.broad.shape[1])) @ sources.broad.T
    found = drawn_changes(model, light, nuisance, draws[..., None]).reshape(3000, -1)
    seen = np.repeat(sources.on_disc, 3) & np.asarray(one.observed[0].measured, dtype=bool)
    made = one.carried(z, np.array([[0.0, 0.0, uneven]])).errors[0]
    modes = made.modes * replace(made, smooth=0.0, chromatic=0.0, uneven=uneven).amplitudes
    count, bent = sources.broad.shape[1], sources.bent.shape[1]
    alike = modes[:, made.kinds == 3][:, :count]
    together = modes[:, -2 * bent : -bent]  # before what errors of single channels make, at the end
    predicted = np.sqrt(np.sum(alike**2, axis=1) + np.sum(together**2, axis=1))[seen]
    np.testing.assert_allclose(predicted, found.std(axis=0)[seen], rtol=0.15)
    still = one.carried(z, np.array([[0.0, 0.0, 1e-6]])).errors[0]  # errors of single channels are the same, nearly
    lifted = (np.asarray(made.excess) - np.asarray(still.excess))[seen]
    np.testing.assert_allclose(lifted, found.mean(axis=0)[seen], atol=0.03 + 0.1 * uneven)
    line = (still.modes * replace(still, uneven=uneven).amplitudes)[:, still.kinds == 3][:, :count]
    straight = np.linalg.norm(line, axis=1)[seen]
    if uneven > 0.3:
        assert np.max(np.abs(straight / found.std(axis=0)[seen] - 1.0)) > 0.3


@pytest.mark.parametrize("spread", [0.03, 0.2])
def test_errors_of_colour_bring_back_a_channel_that_the_camera_cut_off(synthetic_likelihood, spread):
    """Where a matrix takes more of the red than there is blue, a value tells of no light, but of errors of much."""
    model = synthetic_likelihood.models[0]
    z = jnp.zeros(len(model.parameters))
    names = [parameter.name for parameter in model.parameters]
    z = z.at[names.index("white_balance.red")].set(2.0).at[names.index("tone.saturation")].set(1.0)
    table = shadow_light(synthetic_likelihood.shadow, jnp.zeros(LIMB))
    nuisance = prior.values(model.parameters, z)
    light = model.light(table, model.seen(z), nuisance)
    draws = spread * np.random.default_rng(6).standard_normal((400, *light.shape))
    found = drawn_changes(model, light, nuisance, draws)
    size = jnp.full(len(light), spread)
    _, slopes, _, _, apart, excess = (
        np.asarray(part) for part in response(model, table, z, jnp.zeros(len(light)), size)
    )
    predicted = np.sqrt(spread**2 * np.sum(slopes**2, axis=2) + apart**2)
    there = np.asarray(synthetic_likelihood.sources[0].on_disc)
    cut_off = (found.std(axis=0) > 0.05) & (np.asarray(signal(model, table, z)) < 2e-3) & there[:, None]
    assert cut_off.sum() > 20
    ratio = predicted[cut_off] / found.std(axis=0)[cut_off]
    assert 0.6 < np.quantile(ratio, 0.1) and np.quantile(ratio, 0.9) < 1.6
    assert np.median(np.abs(excess - found.mean(axis=0))[cut_off]) < 0.3 * np.median(found.std(axis=0)[cut_off])


def test_limits_err_as_the_limb_does(synthetic_likelihood):
    """In a limb that is uneven by four fifths what is black in the file says less of light that should not be."""
    z = np.zeros(len(synthetic_likelihood.parameters))
    blank = np.asarray(synthetic_likelihood.observed[0].measured) == 0
    assert blank.any()
    errors = {}
    for uneven in (0.01, 0.1, 0.8):
        carried = synthetic_likelihood.carried(z)
        made = carried.with_errors([replace(one, uneven=uneven) for one in carried.errors])
        errors[uneven] = np.asarray(made.observed[0].error)[blank]
        assert made.errors[0].uneven == uneven and np.array_equal(made.observed[0].limit, carried.observed[0].limit)
    assert errors[0.01].min() >= LEAST_ERROR
    on_disc = np.repeat(synthetic_likelihood.sources[0].on_disc, 3)[blank]
    assert np.max(errors[0.8][on_disc] / errors[0.1][on_disc]) > 3.0
    assert np.all(errors[0.8][on_disc] >= errors[0.1][on_disc])
    assert np.array_equal(errors[0.8][~on_disc], errors[0.1][~on_disc])  # the sky has no limb


def test_slopes_agree_with_differences(synthetic_likelihood):
    random = np.random.default_rng(7)
    z = 0.3 * random.standard_normal(len(synthetic_likelihood.parameters))
    slopes = synthetic_likelihood.misfits_and_slopes(z)[0][1]
    here = quadratic(synthetic_likelihood, z)
    for direction in random.standard_normal((4, z.size)):
        step = 1e-4 * direction / np.linalg.norm(direction)  # so small that no cell crosses a pixel of the lunar map
        high, low = (synthetic_likelihood.misfits(z + sign * step)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose((high - low) / 2, slopes @ step, atol=2e-3 * np.abs(slopes @ step).max())
        rise = quadratic(synthetic_likelihood, z + step).cost - quadratic(synthetic_likelihood, z - step).cost
        assert rise == pytest.approx(4 * here.gradient @ step, rel=1e-3)


def test_the_same_photograph_twice_is_twice_the_evidence(synthetic_likelihood):
    """Two photographs of one camera: what they share moves both."""
    one = synthetic_likelihood
    everything = {parameter.name: 0 for parameter in one.models[0].parameters}
    models = one.models * 2
    two = replace(one, models=models, observed=one.observed * 2, sources=one.sources * 2, errors=one.errors * 2,
                  places=places([everything, everything], models))  # fmt: skip
    z = 0.1 * np.random.default_rng(8).standard_normal(len(one.parameters))
    single, double = quadratic(one, z), quadratic(two, z)
    assert double.cost - z @ z == pytest.approx(2 * (single.cost - z @ z))
    np.testing.assert_allclose(double.information - np.eye(z.size), 2 * (single.information - np.eye(z.size)))
    assert all(label.startswith("1-2.") for label in two.labels[LIMB:])
