"""Sample blocks as bytes, without loss and small.

A converter has few distinct outputs, so each channel is kept as its distinct values in order and, for every
sample, the number of its value: one byte where 256 values are enough, two up to 65536. zlib's fastest level
then finds the rest. A channel with more distinct values is kept as it is.

Before compression, little-endian: u32 samples n, u32 channels; then for each channel
    u32 distinct values k | k x f64 values | n x u8 or u16 numbers        (k = 0: n x f64 samples)
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

CODEC = "palette-zlib/1"
_HEAD = struct.Struct("<II")
_COUNT = struct.Struct("<I")


def encode(samples: NDArray[np.float64]) -> bytes:
    """The bytes of `samples`, shape (n, channels)."""
    channels = np.ascontiguousarray(samples.T, dtype="<f8")
    return zlib.compress(b"".join([_HEAD.pack(*samples.shape), *map(_encode_channel, channels)]), level=1)


def decode(data: bytes) -> NDArray[np.float64]:
    """The samples that `encode` was given, bit for bit, shape (n, channels). Raises ValueError on damage."""
    try:
        raw = zlib.decompress(data)
    except zlib.error as error:
        raise ValueError(f"damaged sample block: {error}") from None
    n, channels = _HEAD.unpack_from(raw)
    samples = np.empty((channels, n))
    offset = _HEAD.size
    for k in range(channels):
        samples[k], offset = _decode_channel(raw, offset, n)
    return samples.T


def _encode_channel(values: NDArray[np.float64]) -> bytes:
    # Equal bits, not equal numbers: -0.0 stays -0.0.
    distinct, numbers = np.unique(values.view("<i8"), return_inverse=True)
    if len(distinct) > 1 << 16:
        return _COUNT.pack(0) + values.tobytes()
    numbers = numbers.astype(_number(len(distinct)))
    return _COUNT.pack(len(distinct)) + distinct.tobytes() + numbers.tobytes()


def _decode_channel(raw: bytes, offset: int, n: int) -> tuple[NDArray[np.float64], int]:
    (k,) = _COUNT.unpack_from(raw, offset)
    offset += _COUNT.size
    if k == 0:
        return np.frombuffer(raw, "<f8", n, offset), offset + 8 * n
    values = np.frombuffer(raw, "<f8", k, offset)
    numbers = np.frombuffer(raw, _number(k), n, offset + 8 * k)
    return values[numbers], offset + 8 * k + numbers.nbytes


def _number(k: int) -> str:
    """The type of a value's number where there are `k` values."""
    return "<u1" if k <= 1 << 8 else "<u2"
