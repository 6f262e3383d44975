"""What a discovery hands to a calibration: a folder with a model for each batch, and the errors of the rigs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from calibrations.errors import ModelError
from calibrations.fleet.corrected import Values
from calibrations.fleet.population import BatchVerdict, Population
from calibrations.model_file import dump_model, read_model
from rig.errors import OutputError
from rig.files import write_whole
from rig.fleet.calibrate import Guide
from rig.fleet.discover import errors_of
from rig.fleet.own import Own, effects_of
from rig.fleet.worker import Question, model_of

RIGS = "rigs.json"
SCHEMA = "rig.fleet-rigs/1"
OTHERWISE = "other.yaml"  # for sensors of no batch


def write_guide(found: Population, start: Question, folder: Path) -> list[Path]:
    """A model file for each batch, and the rigs' errors. Raises OutputError."""
    made_folder(folder)
    texts = {f"{safe(each.batch)}.yaml": _model(start, each) for each in found.batches}
    rigs = {error.rig: errors_of(found.rigs, error.rig) for error in found.rigs}
    texts[RIGS] = json.dumps({"schema": SCHEMA, "rigs": {rig: of for rig, of in rigs.items() if of}}, indent=1) + "\n"
    for name, text in texts.items():
        write_whole(folder / name, text)
    return [folder / name for name in texts]


def read_guide(given: str, batches: set[str], own: Own = ()) -> Guide:
    """The guide in a folder, or one model for all by its name or file. Raises ModelError, UnknownName."""
    folder, effects = Path(given), effects_of(own)
    if not folder.is_dir():
        return Guide({}, dump_model(read_model(given, effects)), {}, own)
    texts = {batch: dump_model(read_model(folder / f"{safe(batch)}.yaml", effects)) for batch in batches}
    return Guide(texts, "", _rigs(folder / RIGS), own)


def made_folder(folder: Path) -> Path:
    """The folder, made where it is not there. Raises OutputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror}; name another folder") from None
    return folder


def safe(name: str) -> str:
    """A name as that of a file."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name).lstrip(".") or Path(OTHERWISE).stem


def _model(start: Question, batch: BatchVerdict) -> str:
    return dump_model(model_of(replace(start, effects=tuple(each.effect for each in batch.effects))))


def _rigs(path: Path) -> Mapping[str, Values]:
    if not path.is_file():
        return {}
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        if said["schema"] != SCHEMA:
            raise ModelError(
                f"{path}: its schema is {said['schema']!r}, not {SCHEMA}; write it by `rig fleet discover`"
            )
        return dict(said["rigs"])
    except (ValueError, KeyError, TypeError) as error:
        raise ModelError(f"{path}: is no list of rigs' errors ({error}); write it by `rig fleet discover`") from None
