"""Inputs that are nearly right: seeds, changed by a seeded generator. The same seed gives the same inputs."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence

LONGEST = 1 << 17  # bytes of an input
BYTES = (b"\x00", b"\xff", b"\x7f\xff\xff\xff", b"\x80\x00\x00\x00", b"\xff" * 8, b"\n", b"\r\n", b" \n", b"\x00\x01")
TEXTS = r"nan inf -1e999 1e308 '' [] {} null &a *a !!int ( ) ** += 0x .. , ; # é".split()  # noqa: SIM905 - to be read
WORDS = (*BYTES, *(text.encode() for text in TEXTS), b"9" * 40, b"- ", b": ", b"\t", b'"', b"\xef\xbb\xbf")


def mutated(seeds: Sequence[bytes], seed: int, count: int) -> Iterator[bytes]:
    """So many inputs: each a seed after one to eight changes."""
    luck = random.Random(seed)
    for _ in range(count):
        data = bytearray(luck.choice(seeds))
        for _ in range(1 << luck.randrange(4)):
            _change(data, luck, seeds)
        yield bytes(data[:LONGEST])


def _change(data: bytearray, luck: random.Random, seeds: Sequence[bytes]) -> None:
    """One change, in place."""
    at = luck.randrange(len(data) + 1)
    until = min(len(data), at + luck.randrange(1, 9))
    match luck.randrange(7):
        case 0 if data:
            data[at % len(data)] ^= 1 << luck.randrange(8)
        case 1 if data:
            data[at % len(data)] = luck.randrange(256)
        case 2:
            del data[at:until]
        case 3:
            data[at:at] = luck.choice(WORDS)
        case 4:
            data[at:at] = data[at:until] * luck.randrange(1, 4)
        case 5:
            data[at:] = luck.choice(seeds)[at:]
        case _:
            del data[at:]
