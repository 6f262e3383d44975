"""Procedures found by name: the file `sweep.py` holds the function `sweep`. A user's folder comes first.

A file is a procedure when it defines a function of its own name. Nothing is registered, and listing
procedures imports none of them.
"""

from __future__ import annotations

import ast
import importlib.util
import inspect
import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from procedures.errors import ProcedureError, UnknownProcedure, nearest

SHIPPED = Path(__file__).parent
LOG = logging.getLogger(__name__)  # what is not called off is printed to standard error


@dataclass(frozen=True)
class Procedure:
    """A script that runs on a session. `summary` is one line, `doc` what it excites and is blind to.

    `kind` is the table that its poses make (KIND of its file): poses where nothing else is said. An `adaptive` one
    (ADAPTIVE) goes by what it has measured, so that its plan needs measurements too.
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
        """Its settings: the keywords after the session, with their defaults."""
        parameters = list(inspect.signature(self.function).parameters.values())[1:]
        return {p.name: p.default for p in parameters}


def paths(folder: Path | None = None) -> dict[str, Path]:
    """The file of every procedure, by name in alphabetical order."""
    found: dict[str, Path] = {}
    for place in (SHIPPED, folder):
        files = place.glob("*.py") if place is not None else ()
        found |= {name(path): path for path in files if _is_procedure(path)}
    return dict(sorted(found.items()))


def name(path: Path) -> str:
    """`noise_floor.py` is the procedure "noise-floor"."""
    return path.stem.replace("_", "-")


def summary(path: Path) -> str:
    """The first line of the file's docstring, without the name."""
    return _doc(path).partition("\n")[0].removeprefix(f"{name(path)}: ").rstrip(".")


def find(wanted: str, folder: Path | None = None) -> Procedure:
    """The procedure `wanted`.

    Raises UnknownProcedure with the nearest name, ProcedureError for a file that cannot be loaded.
    """
    known = paths(folder)
    path = known.get(wanted.replace("_", "-"))
    if path is None:
        raise UnknownProcedure(f"no procedure {wanted!r}{nearest(wanted, known)}")
    module = _load(path)
    kind, adaptive = getattr(module, "KIND", "poses"), getattr(module, "ADAPTIVE", False)
    return Procedure(name(path), getattr(module, path.stem), summary(path), _doc(path), path, kind, adaptive)


def _is_procedure(path: Path) -> bool:
    try:
        body = ast.parse(path.read_text(encoding="utf-8")).body
    except (SyntaxError, UnicodeDecodeError):
        return False
    return any(isinstance(node, ast.FunctionDef) and node.name == path.stem for node in body)


def _doc(path: Path) -> str:
    return ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""


def _load(path: Path) -> ModuleType:
    if path.parent == SHIPPED:
        return importlib.import_module(f"procedures.{path.stem}")
    spec = importlib.util.spec_from_file_location(f"user_procedures.{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ProcedureError(f"{path}: is not a Python file")
    LOG.warning("%s is run: the bench file names its folder for procedures", path)
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ProcedureError(f"{path}: cannot be loaded: {type(error).__name__}: {error}") from error
    return module
