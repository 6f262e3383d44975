"""Cases of a battery: some run with every `make test`, others with `make test-all`, the longest before a release."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def slow(values: Iterable[Any]) -> list[Any]:
    """Cases that only `make test-all` runs; a case of several values is a tuple."""
    return [pytest.param(*(v if isinstance(v, tuple) else (v,)), marks=pytest.mark.slow) for v in values]


def before_release(values: Iterable[Any]) -> list[Any]:
    """Cases that take minutes, which only `make test-release` runs; a case of several values is a tuple."""
    return [pytest.param(*(v if isinstance(v, tuple) else (v,)), marks=pytest.mark.release) for v in values]


def first_fast(values: Iterable[Any], fast: int = 1) -> list[Any]:
    """The first cases as they are, the others slow."""
    cases = list(values)
    return [*cases[:fast], *slow(cases[fast:])]
