"""Messages that no transcript shows, as `[FILE TEST]` and the text; `messages/AREA.txt` has those of a folder of tests.

A test gives a text to `golden.same`, or an error to `golden.refused`; `pytest TESTS --update-golden` writes the files.
"""

from __future__ import annotations

import fcntl
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.golden.transcript import normal

FOLDER = Path(__file__).parent / "messages"
TESTS = Path(__file__).parents[1]
HEAD = re.compile(r"^\[(\S+\.py test_.+)\]\n", re.MULTILINE)
REMEDY = "if this is meant: pytest TESTS --update-golden, and read the difference that git shows"


def messages(text: str) -> dict[str, str]:
    """What follows each head of a file."""
    _, *parts = HEAD.split(text)
    return {head: part.rstrip("\n") for head, part in zip(parts[::2], parts[1::2], strict=True)}


class Golden:
    """The messages of one test, in order; `folder` is its own, and has another name in every run."""

    def __init__(self, test: pytest.Item, folder: Path, update: bool) -> None:
        area, *_, file = test.path.relative_to(TESTS).parts
        self._path = FOLDER / f"{area}.txt"
        self._head = f"{file} {test.name}"
        self._folders = {folder: "FOLDER"}
        self._update = update
        self._count = 0

    @contextmanager
    def refused(self, error: type[BaseException]) -> Iterator[None]:
        """The lines inside raise this error, with this message."""
        with pytest.raises(error) as raised:
            yield
        self.same(raised.value)

    def same(self, text: object) -> None:
        """Compare with the file, number for number."""
        self._count += 1
        head = f"{self._head} {self._count}" if self._count > 1 else self._head
        now = "\n".join(line.rstrip() for line in normal(str(text), self._folders).rstrip().split("\n"))
        if self._update:
            _write(self._path, {head: now})
        assert messages(self._path.read_text(encoding="utf-8")).get(head) == now, REMEDY


def _write(path: Path, new: Mapping[str, str]) -> None:
    """Exchange these messages alone; another worker may do the same at the same time."""
    with path.open("a+", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        all_of_them = messages(file.read()) | new
        file.truncate(0)
        file.write("\n\n".join(f"[{head}]\n{text}" for head, text in sorted(all_of_them.items())) + "\n")
