"""The compensation of a model as source code, and files for other programs: for the commands and the workbench."""

from __future__ import annotations

import hashlib
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from calibrations.compensation import document, sources
from calibrations.compensation.document import (
    Origin,
    coverage_text,
    error_text,
    make_vectors,
    operations_text,
    steps_text,
    uncertainty_text,
)
from calibrations.compensation.forward import LEFT_OUT
from calibrations.compensation.inverse import Compensation
from calibrations.exporting.simulated import ExportedFile
from rig.files import program
from rig.services.provenance import today


def origin_of(model: str, name: str | None, text: str) -> Origin:
    """Where the code comes from. `model`: name or file; `text`: the model as a file has it."""
    path = Path(model)
    digest = hashlib.sha256(path.read_bytes() if path.is_file() else text.encode()).hexdigest()
    return Origin(identifier(name or path.stem), path.name, digest, program(), today())


def source_files(compensation: Compensation, language: str, origin: Origin) -> dict[str, str]:
    """The files by name. `language`: c, python or json."""
    writers = {"c": sources.c_files, "python": sources.python_files, "json": document.files}
    return writers[language](compensation, origin, make_vectors(compensation))


def identifier(name: str) -> str:
    """A valid name in C and Python."""
    word = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lower()
    return word if word[:1].isalpha() else f"sensor_{word}".rstrip("_")


def instruction_for_test(language: str, folder: str, name: str) -> list[str]:
    """The command that compiles and tests the written files; nothing for JSON, which has the reference vectors."""
    if language == "python":
        return [f"To test: python {shlex.quote(str(Path(folder) / name))}.py"]
    if language == "c":
        compiled = f"cc -std=c99 -O2 -D{name.upper()}_MAIN {name}.c {name}_self_test.c -lm -o {name}_self_test"
        return [f"To compile and test: cd {shlex.quote(folder)} && {compiled} && ./{name}_self_test && echo passed"]
    return []


def compensation_lines(compensation: Compensation) -> list[str]:
    """Method, proof and remaining errors, in words."""
    bound, costs, unit = compensation.bound, compensation.costs, compensation.unit
    work = f"{steps_text(compensation)}, {operations_text(compensation)}"
    method = f"{work}; each step reduces the error to {bound.q:.2g} of it or less"
    lines = [f"{compensation.model.name}: {method}, proved for +-{compensation.range.reach:g} {unit}."]
    for fate in compensation.forward.fates:
        if fate.how == LEFT_OUT:
            size = costs.left_out[fate.effect]
            cost = (
                f"error {error_text(size.rms, unit)} rms, {error_text(size.most, unit)} at most"
                if size
                else "error unknown"
            )
            lines.append(f"Not corrected: {fate.effect}: {fate.why}; {cost}.")
    if costs.out_of_gravity is not None:
        lines.append(
            "az is not measured; its value from gravity has an error of "
            f"{error_text(costs.out_of_gravity.most, unit)} at most."
        )
    return [*lines, uncertainty_text(compensation), coverage_text(compensation)]


def export_lines(exported: ExportedFile) -> list[str]:
    """Errors, losses and remarks of a file for another program, in words."""
    lines = [
        f"{sensor}: the file's outputs differ from the model's by {error_text(rms, unit)} rms, "
        f"{error_text(most, unit)} at most."
        for sensor, rms, most, unit in exported.errors
    ]
    return [*lines, *(loss.text for loss in exported.losses), *exported.notes]


def export_document(exported: ExportedFile, form: str, models: Sequence[str], out: Path) -> dict[str, Any]:
    """The JSON document `rig.export-model/1`."""
    return {
        "schema": "rig.export-model/1",
        "for": form,
        "models": list(models),
        "file": str(out),
        "errors": [
            {"sensor": sensor, "rms": rms, "largest": most, "unit": unit} for sensor, rms, most, unit in exported.errors
        ],
        "lost": [
            {"effect": loss.effect, "why": loss.why, "rms": loss.rms, "largest": loss.most, "unit": loss.unit}
            for loss in exported.losses
        ],
        "notes": list(exported.notes),
    }
