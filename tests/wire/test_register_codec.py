"""Values to words and back: literal words first, then for every value."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.transport.modbus import CODES, Kind, Register


@pytest.mark.parametrize(
    ("kind", "scale", "words", "value"),
    [
        ("int32", 1.0, [0x0000, 0x2134], 8500),
        ("int32", 1.0, [0xFFFF, 0xEE6C], -4500),
        ("uint32", 1.0, [0x0011, 0x2233], 0x00112233),
        ("float32", 1.0, [0x40E0, 0x0000], 7.0),
        ("float32", 1.0, [0x447A, 0x0000], 1000.0),
        ("int16", 0.1, [0x00FD], 25.3),
        ("int16", 0.1, [0xFF9C], -10.0),
        ("uint16", 1.0, [0xC350], 50000),
    ],
)
def test_known_values_have_known_words(kind: Kind, scale: float, words: list[int], value: float) -> None:
    register = Register(0, kind, "", scale=scale)
    assert register.decode(words) == pytest.approx(value, rel=1e-12)
    assert register.encode(value) == words


@settings(derandomize=True, deadline=None)
@given(st.sampled_from(list(CODES)), st.data())
def test_every_word_survives_decoding_and_encoding(kind: Kind, data: st.DataObject) -> None:
    register = Register(0, kind, "")
    words = data.draw(st.lists(st.integers(0, 0xFFFF), min_size=register.count, max_size=register.count))
    value = register.decode(words)
    if value == value and abs(value) != float("inf"):
        assert register.encode(value) == words


@settings(derandomize=True, deadline=None)
@given(st.integers(-32768, 32767))
def test_a_scaled_count_survives_decoding_and_encoding(count: int) -> None:
    register = Register(0, "int16", "", scale=0.1)
    assert register.encode(register.decode(struct.unpack(">H", struct.pack(">h", count)))) == [count & 0xFFFF]


@pytest.mark.parametrize(("kind", "value"), [("int16", 40000), ("uint32", -1), ("float32", 1e39)])
def test_a_value_that_does_not_fit_is_named(kind: Kind, value: float) -> None:
    with pytest.raises(ValueError, match=r"does not fit into register 0x1001 \(set point\)"):
        Register(0x1001, kind, "set point").encode(value)
