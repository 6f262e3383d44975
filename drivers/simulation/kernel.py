"""Kernels: functions over records, compiled once and kept on disk.

A record is a flat piece of memory with named numbers. A frozen dataclass of settings becomes one with
the same names (`record`), so that a kernel reads `config.heat.ambient_c` as the rest of the program does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from platformdirs import user_cache_path

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile `function`; its machine code is cached as long as no file of this package changes.

    The compiler alone would notice a change in the function's own file, but not in those it calls.
    """
    kept, numba.config.CACHE_DIR = numba.config.CACHE_DIR, _cache_folder()
    try:
        return cast(Function, numba.njit(cache=True, error_model="numpy")(function))
    finally:
        numba.config.CACHE_DIR = kept


@cache
def _cache_folder() -> str:
    sources = sorted(Path(__file__).parent.glob("*.py"))
    digest = sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]
    return str(user_cache_path("inertial-rig") / "kernels" / digest)


def record(settings: Any) -> Any:
    """A record with the names and numbers of a (nested) dataclass of floats."""
    return np.array([_values(settings)], dtype=_layout(settings))[0]


def _layout(settings: Any) -> np.dtype[Any]:
    items = [(f.name, getattr(settings, f.name)) for f in fields(settings)]
    return np.dtype([(name, "f8" if isinstance(value, float) else _layout(value)) for name, value in items])


def _values(settings: Any) -> tuple[Any, ...]:
    values = (getattr(settings, f.name) for f in fields(settings))
    return tuple(value if isinstance(value, float) else _values(value) for value in values)
