"""Reads a bench file, with the files that it names: curve, error tables, folders."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from calibrations.errors import DataError
from calibrations.files import read_mapping
from calibrations.geometry.error_table import ErrorTable, Point, read_error_table
from drivers.philtec_d63 import CalibrationCurve
from rig.bench.bench import Bench
from rig.bench.check import check, check_values, describe_error
from rig.bench.parts import SIMULATED, TURNING, Folders, Instrument
from rig.errors import BenchError

CURVE = "its keys are serial, date, near and far"
DEFAULT = Path(__file__).with_name("default.yaml")
HAND = DEFAULT.with_name("hand.yaml")  # a sensor in a hand
DEMO = DEFAULT.with_name("demo.yaml")  # of `rig demo`


def read_bench(path: Path | None = None) -> Bench:
    """The bench in the file `path`; by default the simulated rig.

    Raises BenchError with file, key and suggestion.
    """
    path = path or DEFAULT
    return _check_document(read_mapping(path, "bench file", BenchError, "`rig check --example` prints one"), path)


def _check_document(document: dict[str, Any], path: Path) -> Bench:
    if str(document.get("schema", "")).startswith("rig.model/"):
        raise BenchError(f"{path}: is a model file, not a bench file; give it with --model")
    try:
        bench = Bench.model_validate({**document, **_with_curve(document.get("d63"), path)})
    except ValidationError as error:
        raise BenchError(f"{path}, {describe_error(error, Bench)}") from None
    check(bench, path)
    check_values(bench, path)
    instruments = {role: _with_error_table(role, part, path) for role, part in bench.instruments.items()}
    return bench.model_copy(update={"instruments": instruments, "folders": _resolve(bench.folders, path)})


def _with_error_table(role: str, instrument: Instrument, path: Path) -> Instrument:
    return instrument.model_copy(update={"error_table": _error_table(role, instrument.error_table, path)})


def _error_table(role: str, entry: tuple[Point, ...] | Path | None, path: Path) -> tuple[Point, ...] | None:
    """The points of the error table of a stage, read from its file if it is one."""
    key = f"{path}, key instruments.{role}.error_table"
    if entry is None:
        return None
    if role not in TURNING:
        raise BenchError(f"{key}: only {' and '.join(TURNING)} have an error table; remove this key")
    try:
        points = read_error_table(own_file(path, entry, key)) if isinstance(entry, Path) else entry
        return ErrorTable(points).points
    except DataError as error:
        raise BenchError(f"{key}: {error}") from None


def _with_curve(entry: Any, path: Path) -> dict[str, Any]:
    """The key d63 with the points of its curve. Raises BenchError."""
    if not isinstance(entry, dict) or not isinstance(name := entry.get("curve"), str) or name == SIMULATED:
        return {}
    file = own_file(path, Path(name), f"{path}, key d63.curve")
    document = read_mapping(file, "curve", lambda text: BenchError(f"{path}, key d63.curve: {text}"), CURVE)
    try:
        curve = CalibrationCurve.from_mapping(document)
    except ValueError as error:
        raise BenchError(f"{path}, key d63.curve: {file}: {error}") from None
    return {"d63": {**entry, "curve": dataclasses.asdict(curve)}}


def own_file(path: Path, relative: Path, key: str) -> Path:
    """A file in the folder of the bench file, which may come from a stranger. Raises BenchError for another folder.

    A link in this folder may point elsewhere, because a person has made it.
    """
    folder = Path(os.path.abspath(path.parent))  # noqa: PTH100 - resolve() would follow links
    target = Path(os.path.abspath(folder / relative))  # noqa: PTH100
    if not target.is_relative_to(folder) or "\0" in str(relative):
        raise BenchError(f"{key}: {relative} is outside the folder of the bench file; move or link it into {folder}")
    return path.parent / relative


def _resolve(folders: Folders, path: Path) -> Folders:
    """Absolute paths of the folders, which are relative to the bench file. Raises BenchError for a missing folder."""
    given_folders = {name: place for name, place in folders if place is not None}
    resolved = {
        name: own_file(path, place, f"{path}, key folders.{name}").resolve() for name, place in given_folders.items()
    }
    for name, place in resolved.items():
        if not place.is_dir():
            raise BenchError(f"{path}, key folders.{name}: there is no folder {place}; make it, or correct the key")
    return Folders(**resolved)
