"""Frames of bytes with a checksum, from a stream that may begin anywhere and may be damaged.

Frames are found and checked many at a time. After a damaged one, the search goes on with its second byte.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
BAD, GOOD, UNKNOWN = 0, 1, 2


class Framing(Protocol):
    """The format of a frame. Its first `head` bytes determine its length."""

    starts: re.Pattern[bytes]
    head: int

    def length(self, text: bytes, at: int) -> int | None:
        """Length of the frame that begins at `at`, bytes; 0 without one, None if `text` ends too early to know."""

    def judge(self, frames: Bytes) -> Ints:
        """GOOD, BAD, or UNKNOWN for a kind whose checksum is not known, of each frame, shape (n, length) -> (n,)."""


@dataclass(frozen=True, eq=False)
class FoundFrames:
    """Complete frames in `data`, in their order. `known`: the checksum is checked."""

    data: Bytes
    starts: Ints
    lengths: Ints
    known: NDArray[np.bool_]

    def heads(self, count: int) -> Ints:
        """The first `count` bytes of each frame, shape (n, count); after the data, its last byte again."""
        places = np.minimum(self.starts[:, None] + np.arange(count), len(self.data) - 1)
        return np.asarray(self.data[places], dtype=np.int64)

    def parts(self, frame_numbers: Ints, first: int, count: Ints, size: int) -> Bytes:
        """Bytes `first` to `first + count` of each chosen frame, filled with zeros up to `size`: shape (n, size)."""
        rows = np.zeros((len(frame_numbers), size), dtype=np.uint8)
        for n, group in groups(count):
            used = min(n, size)
            rows[group, :used] = self.data[self.starts[frame_numbers[group], None] + first + np.arange(used)]
        return rows


def groups(values: Ints) -> Iterator[tuple[int, Any]]:
    """Each different value, and the index of the frames that have it."""
    if len(values) and (values == values[0]).all():
        yield int(values[0]), slice(None)
        return
    for value in np.unique(values).tolist():
        yield value, values == value


@dataclass
class Frames:
    """The frames of a stream.

    `damaged`: places after the first good frame where bytes were no good frame. `misfits`: wrong checksums where the
    next frame follows at once. `unread`: bytes after the last good frame.
    """

    framing: Framing
    good: int = 0
    damaged: int = 0
    misfits: int = 0
    unread: int = 0
    remainder: bytes = b""
    _ends_in_frame: bool = False  # the last byte belongs to a good frame

    def take(self, data: bytes) -> FoundFrames:
        """The frames that `data` completes."""
        text = self.remainder + data
        array = np.frombuffer(text, dtype=np.uint8)
        self.unread += len(data)
        frames: list[tuple[Ints, ...]] = []
        start, is_complete = 0, False
        while not is_complete:
            starts, lengths, gaps, end, gap = self._walk(text, array, start)
            verdicts = self._verdicts(array, starts, lengths)
            n = self._accepted_count(gaps, verdicts)
            frames.append((starts[:n], lengths[:n], verdicts[:n]))
            if is_complete := n == len(starts):
                self.remainder = text[end:]
                self._ends_in_frame = self._ends_in_frame and not self._count_missed(gap)
            else:
                follows = not gaps[n + 1] if n + 1 < len(starts) else starts[n] + lengths[n] == len(text)
                self.misfits += int(follows)
                self._ends_in_frame = self._ends_in_frame and not self._count_missed(True)
                start = int(starts[n]) + 1
        starts, lengths, verdicts = (np.concatenate(column) for column in zip(*frames, strict=True))
        if len(good_frames := np.flatnonzero(verdicts == GOOD)):
            self.unread = len(text) - int(starts[good_frames[-1]] + lengths[good_frames[-1]])
        return FoundFrames(array, starts, lengths, verdicts == GOOD)

    def _walk(self, text: bytes, array: Bytes, start: int) -> tuple[Ints, Ints, NDArray[np.bool_], int, bool]:
        """Begin and length of each complete frame from `start` on, and whether bytes were skipped before it.

        And the end of them all, and whether bytes were skipped before it.
        """
        starts, lengths, gaps, gap = [_NONE], [_NONE], [_NONE.astype(bool)], False
        while match := self.framing.starts.search(text, start):
            gap, start = gap or match.start() > start, match.start()
            length = self.framing.length(text, start)
            if length == 0:
                gap, start = True, start + 1
                continue
            if length is None or not (n := _count_alike(array[start:], length, self.framing.head)):
                break
            starts.append(start + length * np.arange(n))
            lengths.append(np.full(n, length))
            gaps.append(np.arange(n) < int(gap))
            gap, start = False, start + n * length
        if not match:
            gap, start = gap or start < len(text), len(text)
        return np.concatenate(starts), np.concatenate(lengths), np.concatenate(gaps), start, gap

    def _verdicts(self, array: Bytes, starts: Ints, lengths: Ints) -> Ints:
        verdicts = np.zeros(len(starts), dtype=np.int64)
        for length, group in groups(lengths):
            verdicts[group] = self.framing.judge(array[starts[group, None] + np.arange(length)])
        return verdicts

    def _accepted_count(self, gaps: NDArray[np.bool_], verdicts: Ints) -> int:
        """The number of frames before a damaged one. A frame of an unknown kind must follow a good one at once."""
        trusted = ~gaps
        trusted[:1] &= self._ends_in_frame
        is_wrong = (verdicts == BAD) | ((verdicts == UNKNOWN) & ~trusted)
        n = int(np.argmax(is_wrong)) if is_wrong.any() else len(verdicts)
        if n:
            self.damaged += int(gaps[1:n].sum()) + int(gaps[0] and self._ends_in_frame)
            self.good += int((verdicts[:n] == GOOD).sum())
            self._ends_in_frame = True
        return n

    def _count_missed(self, gap: bool) -> bool:
        """Count a damaged part once, up to the next good frame."""
        self.damaged += int(gap and self._ends_in_frame)
        return gap


class FrameDecoder:
    """A decoder of samples, see `sensor.Decoder`, whose samples are in frames."""

    def __init__(self, framing: Framing) -> None:
        self.stream = Frames(framing)

    @property
    def good(self) -> int:
        return self.stream.good

    @property
    def damaged(self) -> int:
        return self.stream.damaged

    @property
    def unread(self) -> int:
        return self.stream.unread


_NONE = np.empty(0, dtype=np.int64)


def _count_alike(array: Bytes, length: int, head: int) -> int:
    """Number of successive complete frames with the head of the first one."""
    rows = array[: len(array) // length * length].reshape(-1, length)
    if not len(rows):
        return 0
    is_equal = (rows[:, :head] == rows[0, :head]).all(axis=1)
    return len(rows) if is_equal.all() else int(np.argmin(is_equal))
