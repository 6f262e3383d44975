"""The names that results can have: NAMES of each procedure's file, in which `{axis}` stands for any axis."""

from __future__ import annotations

import importlib
from pathlib import Path

AXES = "xyz"


def names() -> list[str]:
    """Those of all shipped procedures, in alphabetical order."""
    files = (path.stem for path in Path(__file__).parent.glob("[a-z]*.py"))
    patterns = [each for file in files for each in getattr(importlib.import_module(f"rig.results.{file}"), "NAMES", ())]
    return sorted({pattern.format(axis=axis) for pattern in patterns for axis in AXES})
