"""Transcripts of commands: `$ rig WORDS`, what it prints, and its exit status where that is not 0.

Lines of standard error begin with `! `. What differs from run to run is replaced: identifiers of runs, dates, folders.
"""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.recorded import command

PROMPT = "$ rig "
RUN = re.compile(r"\b\d{8}-\d{6}-([a-z]+(?:-[a-z]+)*)-[0-9a-f]{3}\b")
DATE = re.compile(r"\b\d{4}-\d\d-\d\d(?:([T ])\d\d:\d\d(:\d\d(?:\.\d+)?)?(Z|\+00:00)?)?")
NUMBER = re.compile(r"(?<![\w.])(\d+)(\.\d+)?(e[-+]?\d+)?")
FILLER = re.compile(r"(?:[\s#─━═]|--+)+")
RELATIVE, LAST_DIGITS = 0.01, 1.5  # by how much a number may differ: of itself, or of its last digit
LOOSE = 0.1  # of a number in a line with one of these words: ill-conditioned, so that processors differ
ILL_CONDITIONED = ("steady-state-latest", "its value from gravity has an error")


def commands(transcript: str) -> list[str]:
    """What follows the prompt in each of its lines."""
    return [line.removeprefix(PROMPT) for line in transcript.splitlines() if line.startswith(PROMPT)]


def made(lines: Sequence[str], runs: Mapping[str, str], folders: Mapping[Path, str]) -> str:
    """Call the commands in order; `runs` maps a placeholder to a run of the record, `folders` a path to its name."""
    parts = []
    for line in lines:
        real = [runs.get(word, word) for word in shlex.split(line)]
        status, out, err = command(*real)
        shown = out.rstrip("\n").split("\n") if out.strip() else []
        shown += [f"! {text}" for text in err.splitlines()]
        shown += [f"exit status {status}"] if status else []
        parts.append("\n".join([PROMPT + line, *(normal(text, folders).rstrip() for text in shown)]))
    return "\n\n".join(parts) + "\n"


def placeholder(run: str) -> str:
    """A run's identifier without its time and its random digits."""
    return RUN.sub(r"20260101-000000-\1-000", run)


def normal(text: str, folders: Mapping[Path, str]) -> str:
    """Text without identifiers of runs, dates and folders."""
    for folder, name in folders.items():
        text = text.replace(str(folder), name)
    return DATE.sub(
        lambda m: "2026-01-01" + (f"{m[1]}00:00" if m[1] else "") + (":00" if m[2] else ""), placeholder(text)
    )


def difference(golden: str, now: str) -> str:
    """A unified diff, or "" where the texts are equal up to the last digit of numbers and the width of columns."""
    if len(golden.splitlines()) == len(now.splitlines()) and all(
        _equal(one, other) for one, other in zip(golden.splitlines(), now.splitlines(), strict=True)
    ):
        return ""
    return "\n".join(difflib.unified_diff(golden.splitlines(), now.splitlines(), "golden", "now", lineterm="", n=1))


def _equal(one: str, other: str) -> bool:
    words = [FILLER.sub(" ", NUMBER.sub("0", line)).strip() for line in (one, other)]
    numbers = [list(NUMBER.finditer(line)) for line in (one, other)]
    relative = LOOSE if any(word in one for word in ILL_CONDITIONED) else RELATIVE
    return words[0] == words[1] and all(_near(a, b, relative) for a, b in zip(*numbers, strict=True))


def _near(one: re.Match[str], other: re.Match[str], relative: float) -> bool:
    a, b = float(one[0]), float(other[0])
    last = 10.0 ** (int((one[3] or "e0")[1:]) - max(len(one[2] or ".") - 1, 0))
    uncertainty = one.string.startswith(")", one.end())  # as in 8.04(16)
    return abs(a - b) <= max(relative * abs(a), LAST_DIGITS * last if one[2] or one[3] or uncertainty else 0.0)
