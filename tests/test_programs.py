"""Programs that are kept on disk: they give what they were made from, and are never taken for another."""

import hashlib
import pickle

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from eclipsejax import programs
from eclipsejax.programs import program

TRACED = []


class Pair(eqx.Module):
    first: jax.Array
    second: jax.Array | None
    name: str = eqx.field(static=True)


def scaled(pair: Pair, factor: float):
    TRACED.append(pair.name)
    return Pair(factor * pair.first, None, pair.name), jnp.sum(pair.first)


def solved(matrix):
    return jnp.linalg.solve(matrix, jnp.ones(matrix.shape[0]))


PAIR = Pair(jnp.arange(4.0), jnp.ones(2), "pair")


@pytest.fixture(autouse=True)
def fresh(compiled_anew):
    TRACED.clear()


def made(folder, pair=PAIR, factor=3.0):
    """The function's value, by a program; what is to be kept is on the disk when it returns."""
    one = program(scaled, pair, factor, folder=folder)
    value = one(pair, factor)
    settle()
    return one, value


def settle():
    programs._compilers().shutdown()
    programs._compilers.cache_clear()


def kept(folder):
    return sorted(folder.glob(f"*{programs.SUFFIX}"))


def check(value, factor=3.0):
    pair, total = value
    np.testing.assert_array_equal(pair.first, factor * np.arange(4.0))
    assert pair.second is None and pair.name == "pair" and total == 6.0


def test_a_program_from_the_disk_is_not_traced_and_gives_the_same(tmp_path):
    first, value = made(tmp_path)
    check(value)
    assert TRACED == ["pair"] and len(kept(tmp_path)) == 1
    again, value = made(tmp_path)
    check(value)
    assert TRACED == ["pair"] and len(kept(tmp_path)) == 1
    assert jax.tree.map(lambda x: x.shape, again.shape) == jax.tree.map(lambda x: x.shape, first.shape)


def test_a_program_can_be_made_from_shapes_alone(tmp_path):
    outline = jax.eval_shape(lambda pair: pair, PAIR)
    one = program(scaled, outline, 3.0, folder=tmp_path)
    check(one(PAIR, 3.0))
    settle()
    made(tmp_path)
    assert TRACED == ["pair"]


def test_other_shapes_numbers_names_and_surroundings_are_other_programs(tmp_path, monkeypatch):
    made(tmp_path)
    made(tmp_path, Pair(jnp.arange(5.0), jnp.ones(2), "pair"))
    check(made(tmp_path, factor=2.0)[1], 2.0)
    made(tmp_path, Pair(jnp.arange(4.0), jnp.ones(2), "other"))
    made(tmp_path, Pair(jnp.arange(4.0), None, "pair"))
    monkeypatch.setattr(programs, "_surroundings", lambda: "another version")
    made(tmp_path)
    assert len(TRACED) == len(kept(tmp_path)) == 6


@pytest.mark.parametrize(
    "spoilt", ["cut short", "a byte wrong", "empty", "no program"], ids=lambda name: name.replace(" ", "-")
)
def test_a_spoilt_file_is_passed_over_and_written_anew(tmp_path, spoilt):
    made(tmp_path)
    (place,) = kept(tmp_path)
    content = place.read_bytes()
    shape, *_ = programs._read(place) or (None,)
    whole = pickle.dumps((shape, b"no program", None, None))
    place.write_bytes(
        {
            "cut short": content[: len(content) // 2],
            "a byte wrong": content[:-1] + bytes([content[-1] ^ 1]),
            "empty": b"",
            "no program": hashlib.sha256(whole).digest() + whole,
        }[spoilt]
    )
    check(made(tmp_path)[1])
    assert len(TRACED) == 2
    check(made(tmp_path)[1])
    assert len(TRACED) == 2


def test_what_calls_code_outside_itself_is_not_kept(tmp_path):
    """Untraced, it would call LAPACK before that is loaded, and crash."""
    matrix = 2.0 * jnp.eye(3)
    np.testing.assert_allclose(program(solved, matrix, folder=tmp_path)(matrix), 0.5)
    settle()
    assert not kept(tmp_path)


def test_nothing_is_kept_while_the_cache_of_jax_is_on(tmp_path):
    """What comes from there and is written again crashes when it is run."""
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_enable_compilation_cache", True)
    jax.config.update("jax_compilation_cache_dir", str(tmp_path / "jax"))
    try:
        check(made(tmp_path)[1])
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
    assert not kept(tmp_path)


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path):
    check(made(tmp_path / "absent")[1])


def test_the_oldest_programs_go(tmp_path, monkeypatch):
    monkeypatch.setattr(programs, "KEPT", 2)
    for factor in (1.0, 2.0, 3.0, 4.0):
        made(tmp_path, factor=factor)
    assert len(kept(tmp_path)) == 2
    made(tmp_path, factor=4.0)
    assert len(TRACED) == 4
