"""A user's own effect, called so that a fault in it is told as theirs: file, line, and what went wrong."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

from calibrations.errors import ModelError


def fault(path: Path, error: BaseException) -> ModelError:
    """`error`, raised in the file `path`, with the line of that file where it arose."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename).absolute() == path.absolute()]
    line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
    what = error.msg if isinstance(error, SyntaxError) else str(error)
    where = f"{path}, line {line}" if line else str(path)
    return ModelError(f"{where}: {type(error).__name__}: {what}")


def guarded(hook: Callable[..., Any], path: Path) -> Callable[..., Any]:
    """The function `hook` of an effect's file. Where it fails, or gives no array of the shape of its first argument
    with finite numbers, it raises ModelError. A pose in place of an array is not looked into.
    """

    @wraps(hook)
    def call(given: Any, *more: Any) -> Any:
        try:
            result = hook(given, *more)
        except Exception as error:
            raise fault(path, error) from error
        if isinstance(given, np.ndarray):
            _check(result, given, f"{path}: {hook.__name__}()")
        return result

    return call


def _check(result: Any, given: np.ndarray, where: str) -> None:
    if np.shape(result) != given.shape:
        raise ModelError(f"{where} must give an array of shape {given.shape}, and gave {_described(result)}")
    if not np.isfinite(result).all():
        raise ModelError(f"{where} gave numbers that are not finite; see what it divides by or takes a root of")


def _described(result: Any) -> str:
    return f"shape {np.shape(result)}" if isinstance(result, np.ndarray) else f"a {type(result).__name__}"
