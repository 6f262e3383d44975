"""The work of a worker on a few sensors: read the table, screen or diagnose it, answer.

The answer for a sensor that cannot be read is the reason. Answers are plain values, for the network and the record.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from pathlib import Path
from sys import intern
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from calibrations.discovery.results import Diagnosis
from calibrations.effects import Effect
from calibrations.effects.catalogue import LOG, catalogue
from calibrations.errors import CalibrationError, DataError, ModelError
from calibrations.fitting.fit import Fit
from calibrations.fleet.look import Score, Screening, SharedDesigns, StageScore, screen_sensor
from calibrations.fleet.rigs import StageErrors, correct_stage_errors
from calibrations.importing.foreign import parse_csv
from calibrations.loop import diagnose
from calibrations.model import Model
from calibrations.model.file import parse_model
from calibrations.table import Table
from calibrations.tables import FITTED_KINDS, MEANS
from calibrations.text import join_words
from rig.errors import RigError
from rig.services.load import LONGEST_BEGINNING, channels_alone, check_unit
from rig.services.request import effects_of as checked
from rig.services.tables import average_log

# A screening as a document of plain values, and back.


def write_look(look: Screening) -> dict[str, Any]:
    """The screening as plain values, without rounding."""
    return {
        **_document(look),
        "scores": [_document(score) for score in look.scores],
        "stage": _document(look.stage),
    }


def read_look(document: dict[str, Any]) -> Screening:
    """The screening from the document of `write_look`."""
    values = dict(document)
    stage = values.pop("stage")
    scores = tuple(Score(**_arrays(score) | {"effect": intern(score["effect"])}) for score in values.pop("scores"))
    names = _shared_names(tuple(tuple(name) for name in values.pop("names")))
    k = len(stage["names"])
    return Screening(
        **_arrays(values) | {"outliers": tuple(values["outliers"])},
        names=names,
        scores=scores,
        stage=StageScore(
            _shared_names(tuple(tuple(name) for name in stage["names"])),
            np.array(stage["score"], dtype=float),
            np.array(stage["information"], dtype=float).reshape(k, k),
        ),
    )


@lru_cache(maxsize=1000)
def _shared_names(names: tuple[Any, ...]) -> tuple[Any, ...]:
    """The same object for the same names, which all sensors of a batch have."""
    return names


def _document(value: Any) -> dict[str, Any]:
    values = {field.name: getattr(value, field.name) for field in fields(value)}
    return {name: item.tolist() if isinstance(item, np.ndarray) else item for name, item in values.items()}


def _arrays(document: dict[str, Any]) -> dict[str, Any]:
    return {name: np.array(item, dtype=float) if isinstance(item, list) else item for name, item in document.items()}


Answer = dict[str, Any]


@dataclass(frozen=True)
class Question:
    """The question for every sensor of a batch on a rig. `model` is the text of a model file."""

    what: Literal["look", "diagnosis"]
    model: str
    effects: tuple[str, ...] = ()  # of the batch, in addition to the model
    errors: StageErrors = field(default_factory=dict)  # of the rig
    own: OwnEffects = ()  # the user's effects


@dataclass(frozen=True)
class Task:
    """One sensor and its question.

    `text` is the content of a file. Without it, `data` is a run of the record in the folder `home`; without `home`, of
    the lab's record.
    """

    key: str
    data: str
    question: Question
    text: str | None = None
    home: str | None = None


def answer(tasks: Sequence[Task]) -> list[tuple[str, Answer]]:
    """Key and answer of each task; an answer can be a `fault`."""
    return [(task.key, _answer(task)) for task in tasks]


def _answer(task: Task) -> Answer:
    question = task.question
    try:
        model, columns = _model_and_designs(question.model, question.effects, question.own)
        table = correct_stage_errors(_check_table(_read_table(task), model), question.errors, columns.effects)
        if question.what == "look":
            return write_look(screen_sensor(table, model, columns))
        return _diagnosis_answer(diagnose(table, model, columns.effects))
    except (CalibrationError, RigError) as error:
        return {"fault": str(error)}
    except Exception as error:  # one sensor must not stop a fleet
        return {"fault": f"a fault of this program: {type(error).__name__}: {error}"}


@lru_cache(maxsize=8)
def _model_and_designs(model: str, effects: tuple[str, ...], effect_files: OwnEffects) -> tuple[Model, SharedDesigns]:
    """The model, and the designs that the sensors of this worker share."""
    return model_of(Question("look", model, effects, own=effect_files)), SharedDesigns(effects_of(effect_files))


def model_of(question: Question) -> Model:
    """The model with the effects of the batch, without estimates of these."""
    effects = effects_of(question.own)
    model = parse_model(question.model, "the model", effects)
    for name in question.effects:
        model = model.with_effect(effects[name])
    return model


def _check_table(table: Table, model: Model) -> Table:
    """The table, if a fleet can test it with the model. Raises DataError, ModelError."""
    if not table.type.means:
        raise DataError(_unsuitable_kind(table.source, table.kind))
    if not model.for_table(table).terms:
        raise ModelError(
            f"{table.source}: {model.name} is not a model of {table.content}; put these sensors into a separate "
            f"fleet with --model {table.type.default_model}"
        )
    check_unit(model, table.unit, table.source)
    return table


def _unsuitable_kind(source: str, kind: str) -> str:
    command = "discover" if kind in FITTED_KINDS else "noise"
    return (
        f"{source}: is a table of {kind}, and a fleet can have {join_words(list(MEANS))}; leave it out, and analyse "
        f"it alone: rig {command} {source}"
    )


def _read_table(task: Task) -> Table:
    """Raises DataError, RecordError."""
    if task.text is not None:
        if channels_alone(task.text[:LONGEST_BEGINNING]):
            raise DataError(_unsuitable_kind(task.data, "still"))
        return average_log(parse_csv(task.text, task.data), _suppress_remark)
    from rig.record.measured import table_of
    from rig.record.store import Record

    with Record(Path(task.home)) if task.home else Record.to_read() as record:
        return average_log(table_of(record, task.data), _suppress_remark)


def _suppress_remark(_: str) -> None:
    """Suppress a remark on a single sensor."""


def _diagnosis_answer(diagnosis: Diagnosis[Fit]) -> Answer:
    """The facts of the sensor's own judgement; the fleet adds the effects of the batch before it decides."""
    facts = diagnosis.judgement
    return {
        "effects": list(facts.missing),
        "rivals": {name: list(alternatives) for name, alternatives in facts.alternatives.items()},
        "excess": diagnosis.findings.end.pooled_excess,
        "left": facts.left,
        "share_left": facts.share_left,
        "spoilt": facts.spoilt,
        "unresponsive": facts.unresponsive,
        "undetermined": facts.undetermined,
        "caution": diagnosis.caution,
    }


# The user's effects as texts, because workers may have no access to the folder that the bench file names.


OwnEffects = tuple[tuple[str, str], ...]  # names and texts of Python files


def own_files(bench_file: Path | None) -> OwnEffects:
    """The files of the effects folder of a bench file. Raises ModelError for a file that is not an effect."""
    if bench_file is None:
        return ()
    from rig.bench import read_bench

    checked(bench_file)
    folder = read_bench(bench_file).folders.effects
    files = sorted(folder.glob("*.py")) if folder is not None else []
    return tuple((path.name, path.read_text(encoding="utf-8")) for path in files)


@lru_cache(maxsize=8)
def effects_of(effect_files: OwnEffects) -> Mapping[str, Effect]:
    """The shipped effects and those of the user's files. Raises ModelError."""
    if not effect_files:
        return catalogue()
    with TemporaryDirectory(prefix="effects-") as folder:
        for name, text in effect_files:
            Path(folder, name).write_text(text, encoding="utf-8")
        LOG.addFilter(_silent)
        try:
            return catalogue(Path(folder))
        finally:
            LOG.removeFilter(_silent)


def _silent(_: logging.LogRecord) -> bool:
    """Suppress the warning about the user's files; the command has given it once."""
    return False
