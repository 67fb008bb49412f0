"""How kernels are compiled, packed, called at an address and kept: the machinery that every flight stands on.

Verifies: a packed tuple reads like the tuple, in Python and compiled; what is refused; constants; calls by address;
lean compiling and plain numba give the same; damaged or foreign kept pieces are made anew; progress is told.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.kernels import kept as keeping
from rtsim.kernels import progress, store
from rtsim.kernels.compiled import inner_kernel, interpreted, kernel, part
from rtsim.kernels.kept import kept
from rtsim.kernels.packed import Address, Packed, Size, packed
from rtsim.kernels.parts import address_of, call_at, entry_point
from rtsim.places import Places

PLACE = Places("first", ("block", 3), "last")


class Inner(NamedTuple):
    matrix: np.ndarray
    scale: float


class Outer(NamedTuple):
    values: np.ndarray
    counts: np.ndarray
    inner: Inner
    pair: tuple[float, float]
    number: int
    rows: int
    parts: np.ndarray


THREE = Size(3)


def outer(rows=THREE):
    inner = Inner(np.arange(6.0).reshape(2, 3), 0.5)
    return Outer(np.arange(5.0), np.array([7, 8]), inner, (1.5, 2.5), 4, rows, np.zeros(2, dtype=np.int64))


@inner_kernel
def below(t, which):
    return t.values[which] * t.inner.scale


@part
def total(t):
    sum_ = below(t, PLACE.last) + below(t, 0) + t.inner.matrix[1, 2] + t.pair[1] + t.counts[1] + t.number
    for k in range(t.rows):
        sum_ += t.inner.matrix[0, k]
    return sum_ + PLACE.size


@part
def through(t, n):
    sum_ = 0.0
    for _ in range(n):
        sum_ += call_at(t.parts[0], t)
    return sum_


def test_a_packed_tuple_reads_as_the_tuple_in_python_and_compiled():
    plain = outer()
    made = packed(plain)
    assert isinstance(made, Packed)
    assert made.inner.scale == plain.inner.scale
    np.testing.assert_array_equal(made.inner.matrix, plain.inner.matrix)
    assert list(made)[4] == 4
    assert len(made) == len(plain)
    expected = interpreted(total)(plain)
    assert total(made) == expected == 0.5 * 4.0 + 0.0 + 5.0 + 2.5 + 8 + 4 + 3.0 + 5


def test_contents_of_arrays_change_the_words_never():
    made = packed(outer())
    before = total(made)
    made.values[4] = 10.0
    assert total(made) == before + 3.0
    with pytest.raises(ValueError, match="read-only"):
        made._words[0] = 0


def test_another_size_is_another_type_another_length_is_not():
    assert packed(outer())._kind != packed(outer(Size(2)))._kind
    longer = outer()._replace(values=np.arange(50.0))
    assert packed(outer())._kind == packed(longer)._kind
    assert total(packed(outer(Size(2)))) == total(packed(outer())) - 2.0


@pytest.mark.parametrize("array", [np.arange(3, dtype=np.float32), np.array([True]), np.array(["x"])])
def test_an_array_of_another_type_is_refused_when_packed(array):
    with pytest.raises(TypeError, match=r"Outer\.values is of type"):
        packed(outer()._replace(values=array))


def test_arrays_that_do_not_lie_in_order_are_copied():
    made = packed(outer()._replace(values=np.arange(10.0)[::2]))
    assert made.values.flags.c_contiguous
    assert total(made) == pytest.approx(0.5 * 8.0 + 0.0 + 5.0 + 2.5 + 8 + 4 + 3.0 + 5)


def test_a_packed_tuple_survives_pickling_with_arrays_of_its_own():
    made = packed(outer())
    copy = pickle.loads(pickle.dumps(made))
    made.values[4] = 99.0
    assert total(copy) == total(packed(outer()))


def test_replacing_gives_another_block():
    made = packed(outer())
    changed = made._replace(inner=made.inner._replace(scale=1.0))
    assert changed.address != made.address
    assert total(changed) == total(made) + 2.0


def test_a_part_is_called_at_its_address():
    made = packed(outer())
    made.parts[0] = address_of(total, made)
    assert entry_point(through, made, 1)(made, 3) == 3.0 * total(made)
    assert address_of(total, made) == made.parts[0]


def test_an_address_only_points():
    class Holder(NamedTuple):
        what: Address

    target = packed(outer())
    assert packed(Holder(Address(target)))._words[0] == target.address


def test_a_literal_makes_no_specialisation_of_its_own():
    @inner_kernel
    def pick(values, which):
        return values[which]

    @kernel
    def both(values):
        return pick(values, 0) + pick(values, 1) + pick(values, 2)

    assert both(np.arange(3.0)) == 3.0
    assert len(pick.dispatcher.overloads) == 1


@given(st.lists(st.floats(allow_nan=False, width=64), min_size=1, max_size=20), st.floats(allow_nan=False))
def test_numbers_arrive_bit_for_bit(values, scale):
    made = packed(Inner(np.array([values]), scale))
    assert read_back(made, len(values) - 1) == (values[-1], scale)


@kernel
def read_back(t, column):
    return t.matrix[0, column], t.scale


def test_places_are_told_by_name_and_refuse_what_is_not_there():
    assert (PLACE.first, PLACE.block, PLACE.last, PLACE.size) == (0, 1, 4, 5)
    assert PLACE.asdict() == {"first": 0, "block": 1, "last": 4}
    with pytest.raises(AttributeError, match="there is no place 'middle'; there are first, block, last"):
        _ = PLACE.middle
    with pytest.raises(AssertionError, match="twice is a place already"):
        Places("twice", "twice")


def test_plain_numba_compiles_to_the_same_bits(tmp_path):
    """Where a name inside numba is missing, kernels compile by numba as it is."""
    code = (
        "import numpy as np\n"
        "from rtsim.kernels import compiled\n"
        "from rtsim.kernels.ramp_filter_kernels import critically_damped_ramp\n"
        "@compiled.kernel\n"
        "def run(n):\n"
        "    x, v = 0.1, 0.3\n"
        "    for k in range(n):\n"
        "        x, v, _ = critically_damped_ramp(1.5, 0.01 * k, 0.7, x, v, 0.004)\n"
        "    return x + v\n"
        "print(compiled.LEAN, run(500).hex())\n"
    )
    said = {}
    for plain in ("", "1"):
        file = tmp_path / f"run{plain}.py"
        file.write_text(code)
        environment = {**os.environ, "RTSIM_PLAIN_NUMBA": plain, "NUMBA_CACHE_DIR": str(tmp_path / f"cache{plain}")}
        done = subprocess.run(
            [sys.executable, str(file)], env=environment, capture_output=True, text=True, check=True, timeout=300
        )
        lean, said[plain] = done.stdout.split()
        assert lean == str(plain == "")
    assert said[""] == said["1"]


def test_a_kept_piece_is_made_once_and_again_when_damaged(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "main_folder", lambda: tmp_path)
    made = []

    def make():
        made.append(1)
        return {"a": np.arange(3)}

    assert kept("piece", b"key", make)["a"][2] == 2
    assert kept("piece", b"key", make)["a"][2] == 2
    assert len(made) == 1
    kept("piece", b"other key", make)
    assert len(made) == 2
    for damage in (lambda content: content[: len(content) // 2], lambda _: b"", lambda content: content[:-1] + b"\0"):
        for file in tmp_path.glob("*.kept"):
            file.write_bytes(damage(file.read_bytes()))
        before = len(made)
        kept("piece", b"key", make)
        assert len(made) == before + 1


def test_only_the_pieces_used_last_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "main_folder", lambda: tmp_path)
    for number in range(6):
        kept("piece", bytes([number]), lambda: 1)
        kept("another", b"", lambda: 1)
    assert len(list(tmp_path.glob("piece-*.kept"))) == keeping.KEPT
    assert len(list(tmp_path.glob("another-*.kept"))) == 1


def test_compiling_is_told_and_nothing_else():
    @inner_kernel
    def small(a):
        return a + 1.0

    @kernel
    def large(a):
        return small(a)

    told = []
    with progress.told(told.append):
        large(1.0)
        first = len(told)
        large(2.0)
    assert "small" in [one.what for one in told]
    assert len(told) == first
