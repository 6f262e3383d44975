"""Sample blocks come back bit for bit, whatever they hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from rig.record.codec import decode, encode


@given(arrays(np.float64, array_shapes(min_dims=2, max_dims=2, max_side=40), elements=st.floats(width=64)))
def test_any_block_is_decoded_bit_for_bit(samples: np.ndarray) -> None:
    assert decode(encode(samples)).tobytes() == np.ascontiguousarray(samples).tobytes()


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 256, 257, 1 << 16]))
def test_codes_of_a_converter_are_decoded_again(seed: int, codes: int) -> None:
    rng = np.random.default_rng(seed)
    samples = 315.9e-6 * rng.integers(0, codes, (300, 3)) - 10
    assert np.array_equal(decode(encode(samples)), samples)


def test_a_block_with_more_values_than_a_converter_has_is_decoded() -> None:
    samples = np.random.default_rng(1).standard_normal((70_000, 1))
    assert np.array_equal(decode(encode(samples)), samples)


def test_values_with_equal_hashes_are_decoded() -> None:
    """Of a few thousand values some do, for certain."""
    samples = 315.9e-6 * np.random.default_rng(1).integers(0, 5000, (20_000, 1))
    assert np.array_equal(decode(encode(samples)), samples)


def test_a_block_of_an_earlier_version_is_read() -> None:
    kept = bytes.fromhex("780163666060600462262086800ff6109ae50023230300130201fc")
    assert decode(kept).tolist() == [[-2.5], [-2.5], [1.0]]


def test_a_negative_zero_stays_negative() -> None:
    assert np.signbit(decode(encode(np.array([[-0.0], [0.0]])))).ravel().tolist() == [True, False]


def test_an_empty_array_survives_the_codec() -> None:
    assert decode(encode(np.empty((0, 3)))).shape == (0, 3)


def test_a_dwell_takes_less_than_a_byte_a_sample() -> None:
    codes = np.random.default_rng(1).normal(33518, 2.5, (5000, 3)).round()
    assert len(encode(315.872e-6 * codes)) < codes.size


def test_damaged_data_is_an_error() -> None:
    with pytest.raises(ValueError, match="damaged sample block"):
        decode(b"\0" + encode(np.ones((3, 1))))
