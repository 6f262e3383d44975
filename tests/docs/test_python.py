"""docs/python.md: every example runs as it is written."""

from __future__ import annotations

import doctest

import pytest

import calibrations as cal
import rig
from tests.docs.markdown import ROOT

PAGE = ROOT / "docs" / "python.md"
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.mark.slow
def test_every_example_runs_as_written() -> None:
    ended = doctest.testfile(str(PAGE), module_relative=False, optionflags=FLAGS)
    assert ended.attempted > 15
    assert not ended.failed


def test_every_public_function_is_on_the_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert not [name for name in cal.__all__ if f"cal.{name}" not in text]
    assert not [name for name in rig.__all__ if f"rig.{name}" not in text]
