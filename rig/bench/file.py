"""Reading a bench file, with the files that it names: curve, error tables, folders."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from calibrations.error_table import ErrorTable, Point, read_error_table
from calibrations.errors import DataError
from calibrations.reading.yaml_file import load_yaml
from drivers.philtec_d63 import Curve
from rig.bench.bench import Bench
from rig.bench.check import check
from rig.bench.faults import told
from rig.bench.parts import SIMULATED, TURNING, Folders, Instrument
from rig.bench.values import check_values
from rig.errors import BenchError

DEFAULT = Path(__file__).with_name("default.yaml")


def read_bench(path: Path | None = None) -> Bench:
    """The bench in the file `path`; without one, the simulated rig.

    Raises BenchError with file, key and nearest key.
    """
    path = path or DEFAULT
    try:
        document = load_yaml(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BenchError(f"{path}: the bench file cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise BenchError(f"{path}: is not a YAML file: {error}") from None
    if not isinstance(document, dict):
        raise BenchError(f"{path}: a bench file is a mapping that begins with `instruments:`")
    return _checked(document, path)


def _checked(document: dict[str, Any], path: Path) -> Bench:
    try:
        bench = Bench.model_validate({**document, **_with_curve(document.get("d63"), path)})
    except ValidationError as error:
        raise BenchError(f"{path}, {told(error, Bench)}") from None
    check(bench, path)
    check_values(bench, path)
    instruments = {role: _with_error_table(role, part, path) for role, part in bench.instruments.items()}
    return bench.model_copy(update={"instruments": instruments, "folders": _beside(bench.folders, path)})


def _with_error_table(role: str, instrument: Instrument, path: Path) -> Instrument:
    return instrument.model_copy(update={"error_table": _error_table(role, instrument.error_table, path)})


def _error_table(role: str, given: tuple[Point, ...] | Path | None, path: Path) -> tuple[Point, ...] | None:
    """The points of a stage's error table, from its file if it is one."""
    key = f"{path}, key instruments.{role}.error_table"
    if given is None:
        return None
    if role not in TURNING:
        raise BenchError(f"{key}: only {' and '.join(TURNING)} have errors of angle; remove it")
    try:
        points = read_error_table(beside(path, given, key)) if isinstance(given, Path) else given
        return ErrorTable(points).points
    except DataError as error:
        raise BenchError(f"{key}: {error}") from None


def _with_curve(given: Any, path: Path) -> dict[str, Any]:
    """The key d63 with the points of the curve that it names. Raises BenchError."""
    if not isinstance(given, dict) or not isinstance(name := given.get("curve"), str) or name == SIMULATED:
        return {}
    file = beside(path, Path(name), f"{path}, key d63.curve")
    try:
        document = load_yaml(file.read_text(encoding="utf-8"))
        if not isinstance(document, dict):
            raise ValueError("must be a mapping")
        curve = Curve.from_mapping(document)
    except (OSError, ValueError) as error:
        raise BenchError(f"{path}, key d63.curve: {file}: {error}") from None
    return {"d63": {**given, "curve": dataclasses.asdict(curve)}}


def beside(path: Path, given: Path, key: str) -> Path:
    """What a bench file, which may be a stranger's, names in its own folder. Raises BenchError for a way out of it.

    A link in that folder may lead out: a person has put it there.
    """
    folder = Path(os.path.abspath(path.parent))  # noqa: PTH100 - resolve() would follow links
    named = Path(os.path.abspath(folder / given))  # noqa: PTH100
    if not named.is_relative_to(folder) or "\0" in str(given):
        raise BenchError(f"{key}: {given} is outside the folder of the bench file; move or link it into {folder}")
    return path.parent / given


def _beside(folders: Folders, path: Path) -> Folders:
    """Folders as the file means them: relative to itself. Raises BenchError where there is none."""
    given = {name: place for name, place in folders if place is not None}
    found = {name: beside(path, place, f"{path}, key folders.{name}").resolve() for name, place in given.items()}
    for name, place in found.items():
        if not place.is_dir():
            raise BenchError(f"{path}, key folders.{name}: there is no folder {place}")
    return Folders(**found)
