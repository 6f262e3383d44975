"""The list of procedures: the file `sweep.py` holds the function `sweep`. A user's folder takes precedence.

A file is a procedure when it defines a function with the name of the file. There is no registration. Listing the
procedures does not import them.
"""

from __future__ import annotations

import ast
import importlib.util
import inspect
import logging
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, wraps
from pathlib import Path
from types import ModuleType
from typing import Any

from drivers.errors import DriverError, did_you_mean
from procedures.errors import ProcedureError, UnknownProcedure

SHIPPED = Path(__file__).parent
PACKAGES = ("calibrations", "drivers", "procedures", "rig")
LOG = logging.getLogger(__name__)  # without a handler, Python prints warnings to standard error


@dataclass(frozen=True)
class Procedure:
    """A script that runs on a session. `summary` is one line. `doc` names what it excites and does not excite.

    `kind` is the kind of table that its poses make: KIND of its file, `poses` by default. An `adaptive` procedure
    (ADAPTIVE of its file) chooses poses by its measurements, so its plan needs simulated measurements.
    """

    name: str
    function: Callable[..., Any]
    summary: str
    doc: str
    path: Path
    kind: str = "poses"
    adaptive: bool = False

    @property
    def defaults(self) -> dict[str, Any]:
        """The settings with their defaults: the keywords after the session."""
        parameters = list(inspect.signature(self.function).parameters.values())[1:]
        return {p.name: p.default for p in parameters}


def paths(folder: Path | None = None) -> dict[str, Path]:
    """The file of every procedure, by name in alphabetical order."""
    files = [file for place in (SHIPPED, folder) if place is not None for file in place.glob("*.py")]
    return dict(sorted({name(file): file for file in files if _is_procedure(file)}.items()))


def name(path: Path) -> str:
    """`noise_floor.py` is the procedure "noise-floor"."""
    return path.stem.replace("_", "-")


def summary(path: Path) -> str:
    """The first line of the file's docstring, without the name."""
    return _doc(path).partition("\n")[0].removeprefix(f"{name(path)}: ").rstrip(".")


def find(procedure_name: str, folder: Path | None = None) -> Procedure:
    """The procedure with the name `procedure_name`.

    Raises UnknownProcedure with a suggestion, ProcedureError for a file that cannot be loaded.
    """
    paths_by_name = paths(folder)
    path = paths_by_name.get(procedure_name.replace("_", "-"))
    if path is None:
        raise UnknownProcedure(f"no procedure {procedure_name!r}.{did_you_mean(procedure_name, paths_by_name)}")
    module = _load(path)
    kind, adaptive = getattr(module, "KIND", "poses"), getattr(module, "ADAPTIVE", False)
    function = getattr(module, path.stem)
    function = function if path.parent == SHIPPED else _guard(function, path)
    return Procedure(name(path), function, summary(path), _doc(path), path, kind, adaptive)


def _is_procedure(path: Path) -> bool:
    try:
        return path.stem in _outline(path.read_text(encoding="utf-8"))[0]
    except (SyntaxError, ValueError, RecursionError, MemoryError):  # bytes that are no text, a zero, deep brackets
        return False


def _doc(path: Path) -> str:
    return _outline(path.read_text(encoding="utf-8"))[1]


@lru_cache(maxsize=256)
def _outline(text: str) -> tuple[frozenset[str], str]:
    """The names of the functions of a module, and its docstring. Raises SyntaxError."""
    module = ast.parse(text)
    return frozenset(node.name for node in module.body if isinstance(node, ast.FunctionDef)), (
        ast.get_docstring(module) or ""
    )


def _load(path: Path) -> ModuleType:
    if path.parent == SHIPPED:
        return importlib.import_module(f"procedures.{path.stem}")
    spec = importlib.util.spec_from_file_location(f"user_procedures.{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ProcedureError(f"{path}: this is not a Python file; rename it to NAME.py")
    LOG.warning("the program runs %s, because the bench file names its folder in folders.procedures", path)
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ProcedureError(f"{path}: cannot load it: {type(error).__name__}: {error}; correct the file") from error
    return module


def _guard(function: Callable[..., Any], path: Path) -> Callable[..., Any]:
    """A user's procedure. A fault in its file raises ProcedureError with the line; other errors pass unchanged."""

    @wraps(function)
    def call(*arguments: Any, **settings: Any) -> Any:
        try:
            return function(*arguments, **settings)
        except (DriverError, ProcedureError, OSError):  # they say what happened
            raise
        except Exception as error:
            line = _faulty_line(error, path)
            if line is None:
                raise
            fault = f"{type(error).__name__}: {error}".rstrip(": ")
            raise ProcedureError(f"{path}, line {line}: {fault}; correct the procedure") from error

    return call


def _faulty_line(error: Exception, path: Path) -> int | None:
    """The line of the file in which an error arose; None if it arose in a function of this program that it called."""
    own_folders = [SHIPPED.parent / package for package in PACKAGES]
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        file = Path(frame.f_code.co_filename)
        if file == path:
            return line
        if any(folder in file.parents for folder in own_folders):
            return None
    return None
