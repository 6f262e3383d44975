"""Kernels: functions of records, compiled once and kept on disk; processes of first order.

A record is a flat piece of memory with named numbers. `record` makes one with the same names from a frozen dataclass of
settings, so a kernel reads `config.heat.ambient_c` like the rest of the program.
"""

from __future__ import annotations

import math
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


def zeros(*shape: int, dtype: type = float) -> Callable[[], Any]:
    """The default factory of an array of zeros, for the field of a dataclass."""
    return lambda: np.zeros(shape, dtype)


def kernel(function: Function) -> Function:
    """Compile `function`; its machine code is cached as long as no file of this package changes.

    The compiler alone would notice a change in the function's own file, but not in those it calls.
    """
    folder, settings.CACHE_DIR = settings.CACHE_DIR, _cache_folder()  # type: ignore[attr-defined]
    try:
        return cast(Function, numba.njit(cache=True, error_model="numpy")(function))
    finally:
        settings.CACHE_DIR = folder  # type: ignore[attr-defined]


def share_with_kernels(function: Function) -> Function:
    """Make a function usable in kernels, which compile it, and in Python: on settings and on records."""
    return register_jitable(function)


@cache
def _cache_folder() -> str:
    sources = sorted(Path(__file__).parent.glob("*.py"))
    digest = sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]
    chosen = settings.CACHE_DIR  # type: ignore[attr-defined] # NUMBA_CACHE_DIR
    return str((Path(chosen) if chosen else user_cache_path("inertial-rig") / "kernels") / digest)


def record(values: Values) -> Values:
    """A record with the names and values of a (nested) dataclass of numbers and arrays.

    It replaces the dataclass: the same names and types of values, but mutable.
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


# Processes of first order: a value that follows a target with a lag, and a random one with a correlation time.


@kernel
def follow_lag(value: float, target: float, step_s: float, lag_s: float) -> float:
    """`value` after following a constant `target` for `step_s`."""
    return target if lag_s <= 0 else target + (value - target) * math.exp(-step_s / lag_s)


@kernel
def step_wander(value: float, rms: float, time_s: float, step_s: float, normal: float) -> float:
    """An Ornstein-Uhlenbeck process, one exact step on: correlation time `time_s`, stationary `rms`."""
    memory = math.exp(-step_s / time_s)
    return memory * value + rms * math.sqrt(1 - memory * memory) * normal


def mean_variance(rms: float, time_s: float, interval_s: float, n: int) -> float:
    """Variance of the mean of `n` samples of such a process, `interval_s` apart: the exact sum."""
    if rms == 0:
        return 0.0
    rho = math.exp(-interval_s / time_s)
    pairs = n * (1 + rho) / (1 - rho) - 2 * rho * (1 - rho**n) / (1 - rho) ** 2
    return rms**2 * pairs / n**2
