"""The digest of a block of samples: the same for the same samples, however the record keeps them."""

from __future__ import annotations

import hashlib

import numpy as np

from procedures.session import Samples


def digest_of(samples: Samples) -> str:
    """SHA-256 of the channels' names, joined by commas, and of the samples as little-endian float64, in rows."""
    h = hashlib.sha256(",".join(samples.channels).encode())
    h.update(np.ascontiguousarray(samples.volts, "<f8").tobytes())
    return h.hexdigest()
