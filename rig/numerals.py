"""Lengths of time and sizes of data for people."""

from __future__ import annotations


def duration(seconds: float) -> str:
    """A length of time for people: 0:05, 12:30, 1:02:30."""
    minutes, s = divmod(round(seconds), 60)
    hours, m = divmod(minutes, 60)
    return f"{hours}:{m:02}:{s:02}" if hours else f"{m}:{s:02}"


def size(count: int) -> str:
    """A number of bytes for people."""
    if count >= 1e9:
        return f"{count / 1e9:.1f} GB"
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
