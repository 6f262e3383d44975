"""Kernels: functions over records, compiled once and kept on disk.

A record is a flat piece of memory with named numbers. A frozen dataclass of settings becomes one with
the same names (`record`), so that a kernel reads `config.heat.ambient_c` as the rest of the program does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import config as settings
from numba.extending import register_jitable
from numpy.typing import NDArray
from platformdirs import user_cache_path

Function = TypeVar("Function", bound=Callable[..., Any])
Values = TypeVar("Values")
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def kernel(function: Function) -> Function:
    """Compile `function`; its machine code is cached as long as no file of this package changes.

    The compiler alone would notice a change in the function's own file, but not in those it calls.
    """
    kept, settings.CACHE_DIR = settings.CACHE_DIR, _cache_folder()  # type: ignore[attr-defined]
    try:
        return cast(Function, numba.njit(cache=True, error_model="numpy")(function))
    finally:
        settings.CACHE_DIR = kept  # type: ignore[attr-defined]


def shared(function: Function) -> Function:
    """A function that kernels compile as a part of them, and that Python runs as it is: on settings and on records."""
    return register_jitable(function)


@cache
def _cache_folder() -> str:
    sources = sorted(Path(__file__).parent.glob("*.py"))
    digest = sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]
    return str(user_cache_path("inertial-rig") / "kernels" / digest)


def record(values: Values) -> Values:
    """A record with the names and values of a (nested) dataclass of numbers and arrays.

    It stands in for the dataclass: the same names hold the same kinds of values, and can be set.
    """
    return cast(Values, np.array([_contents(values)], dtype=_layout(values))[0])


def _layout(values: Any) -> Any:
    """Record layout of a dataclass; of a number or an array, its type and shape."""
    if not is_dataclass(values):
        array = np.asarray(values)
        return (array.dtype, array.shape)
    return np.dtype((np.record, [(f.name, _layout(getattr(values, f.name))) for f in fields(values)]))


def _contents(values: Any) -> Any:
    return tuple(_contents(getattr(values, f.name)) for f in fields(values)) if is_dataclass(values) else values
