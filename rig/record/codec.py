"""Lossless compression of sample blocks.

A converter has few distinct outputs. So each channel is stored as its sorted distinct values and, for every sample, the
number of its value: one byte for up to 256 values, two for up to 65536. The numbers are noise, so zlib searches only
for runs, which is faster and gives the same size. A channel with more distinct values is stored as it is.

Before compression, little-endian: u32 samples n, u32 channels; then for each channel
    u32 distinct values k | k x f64 values | n x u8 or u16 numbers        (k = 0: n x f64 samples)
"""

from __future__ import annotations

import hashlib
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from drivers.recorder import Samples

CODEC = "palette-zlib/1"
MOST_BYTES = 1 << 30  # of a block before compression: a hundred times the longest recorded block
_HEAD = struct.Struct("<II")
_COUNT = struct.Struct("<I")
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)  # 2^64 / golden ratio: spreads neighbours over the table


def encode(samples: NDArray[np.float64]) -> bytes:
    """The bytes of `samples`, shape (n, channels)."""
    channels = np.ascontiguousarray(samples.T, dtype="<f8")
    packer = zlib.compressobj(level=1, memLevel=9, strategy=zlib.Z_RLE)
    pieces = [_HEAD.pack(*samples.shape), *map(_encode_channel, channels)]
    return b"".join([*map(packer.compress, pieces), packer.flush()])


def decode(data: bytes) -> NDArray[np.float64]:
    """The samples, bit for bit, shape (n, channels). Raises ValueError for damaged data; uses at most MOST_BYTES."""
    try:
        return _decode(_inflate(data))
    except (zlib.error, struct.error, IndexError, ValueError) as error:
        raise ValueError(f"damaged sample block: {error}") from None


def _inflate(data: bytes) -> bytes:
    inflater = zlib.decompressobj()
    raw = inflater.decompress(data, MOST_BYTES)
    if not inflater.eof:
        raise ValueError(f"the end is missing, or the block is longer than {MOST_BYTES} bytes")
    return raw


def _decode(raw: bytes) -> NDArray[np.float64]:
    n, channels = _HEAD.unpack_from(raw)
    if n * channels > len(raw):
        raise ValueError(f"{len(raw)} bytes cannot hold {n} samples of {channels} channels")
    samples = np.empty((channels, n))
    offset = _HEAD.size
    for k in range(channels):
        samples[k], offset = _decode_channel(raw, offset, n)
    return samples.T


def _encode_channel(values: NDArray[np.float64]) -> bytes:
    # Equal bits, not equal numbers: -0.0 stays -0.0.
    distinct, numbers = _distinct(values.view("<i8"))
    if len(distinct) > 1 << 16:
        return _COUNT.pack(0) + values.tobytes()
    numbers = numbers.astype(_number(len(distinct)), copy=False)
    return _COUNT.pack(len(distinct)) + distinct.tobytes() + numbers.tobytes()


def _distinct(values: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.integer]]:
    """The distinct values in order, and the number of each sample's value.

    Multiplicative hashing (Knuth, volume 3, 6.4) puts few values mostly at different places of a table, in a tenth of
    the time of sorting. If two values share a place, the values are sorted.
    """
    places = ((values.view("<u8") * _GOLDEN) >> np.uint64(48)).astype(np.intp)
    table, used = np.empty(1 << 16, np.int64), np.zeros(1 << 16, bool)
    table[places], used[places] = values, True
    if not np.array_equal(table[places], values):
        return np.unique(values, return_inverse=True)
    distinct = np.sort(table[used])
    number = np.empty(1 << 16, _number(len(distinct)))
    number[used] = np.searchsorted(distinct, table[used])
    return distinct, number[places]


def _decode_channel(raw: bytes, offset: int, n: int) -> tuple[NDArray[np.float64], int]:
    (k,) = _COUNT.unpack_from(raw, offset)
    offset += _COUNT.size
    if k == 0:
        return np.frombuffer(raw, "<f8", n, offset), offset + 8 * n
    values = np.frombuffer(raw, "<f8", k, offset)
    numbers = np.frombuffer(raw, _number(k), n, offset + 8 * k)
    return values[numbers], offset + 8 * k + numbers.nbytes


def _number(k: int) -> str:
    """The type of the numbers for `k` values."""
    return "<u1" if k <= 1 << 8 else "<u2"


def digest_of(samples: Samples) -> str:
    """SHA-256 of the channel names, joined by commas, and of the samples as little-endian float64, in rows.

    It does not depend on the compression.
    """
    h = hashlib.sha256(",".join(samples.channels).encode())
    h.update(np.ascontiguousarray(samples.volts, "<f8").tobytes())
    return h.hexdigest()
