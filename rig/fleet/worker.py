"""What a worker does with a handful of sensors: read, look or diagnose, answer.

A sensor that cannot be read is answered with the reason. Answers are plain values, as they go through the network and
into the record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from calibrations.diagnose import Diagnosis, diagnose
from calibrations.errors import CalibrationError, DataError, ModelError
from calibrations.fleet.columns import Shared
from calibrations.fleet.corrected import Values, corrected
from calibrations.fleet.look import look
from calibrations.model import Model
from calibrations.model_file import parse_model
from calibrations.reading.read_csv import parse_csv
from calibrations.reports.words import joined
from calibrations.table import Table
from rig.analysis.asked import DEFAULTS, check_unit
from rig.analysis.asked_still import LONGEST_BEGINNING, channels_alone
from rig.analysis.data import averaged
from rig.analysis.sensors import CALIBRATING
from rig.errors import RigError
from rig.fleet.own import Own, effects_of
from rig.fleet.written import write_look

Answer = dict[str, Any]


@dataclass(frozen=True)
class Question:
    """What is asked of every sensor of a batch on a rig. `model` is the text of a model file."""

    what: Literal["look", "diagnosis"]
    model: str
    effects: tuple[str, ...] = ()  # of its batch, beside the model
    errors: Values = field(default_factory=dict)  # of its rig
    own: Own = ()  # the user's effects


@dataclass(frozen=True)
class Task:
    """One sensor and its question.

    `text` is that of a file; else `data` is a run of the record in `home`, or of the lab's where there is none.
    """

    key: str
    data: str
    question: Question
    text: str | None = None
    home: str | None = None


def answer(tasks: Sequence[Task]) -> list[tuple[str, Answer]]:
    """Every task's key and answer; where there is none, its `fault`."""
    return [(task.key, _answered(task)) for task in tasks]


def _answered(task: Task) -> Answer:
    asked = task.question
    try:
        model, columns = _beside(asked.model, asked.effects, asked.own)
        table = corrected(_checked(_read(task), model), asked.errors, columns.effects)
        if asked.what == "look":
            return write_look(look(table, model, columns))
        return _told(diagnose(table, model, columns.effects))
    except (CalibrationError, RigError) as error:
        return {"fault": str(error)}
    except Exception as error:  # one sensor never stops a fleet
        return {"fault": f"a fault of this program: {type(error).__name__}: {error}"}


@lru_cache(maxsize=8)
def _beside(model: str, effects: tuple[str, ...], own: Own) -> tuple[Model, Shared]:
    """The model, and the columns that the sensors of this worker share beside it."""
    return model_of(Question("look", model, effects, own=own)), Shared(effects_of(own))


def model_of(asked: Question) -> Model:
    """The model with the effects of the batch, in which nothing is known yet."""
    effects = effects_of(asked.own)
    model = parse_model(asked.model, "the model", effects)
    for name in asked.effects:
        model = model.with_effect(effects[name])
    return model


def _checked(table: Table, model: Model) -> Table:
    """The table, where a fleet may hold it against the model. Raises DataError, ModelError."""
    if table.kind not in CALIBRATING:
        raise DataError(_instead(table.source, table.kind))
    if not model.for_table(table).terms:
        raise ModelError(
            f"{table.source}: {model.name} is no model of {table.content}; make these sensors a fleet of their own, "
            f"with --model {DEFAULTS[table.content]}"
        )
    check_unit(model, table.unit, table.source)
    return table


def _instead(source: str, kind: str) -> str:
    command = "noise" if kind == "still" else "discover"
    return (
        f"{source}: is a table of {kind}, and fleets have {joined(list(CALIBRATING))}; leave it out, and ask for it "
        f"alone: rig {command} {source}"
    )


def _read(task: Task) -> Table:
    """Raises DataError, RecordError."""
    if task.text is not None:
        if channels_alone(task.text[:LONGEST_BEGINNING]):
            raise DataError(_instead(task.data, "still"))
        return averaged(parse_csv(task.text, task.data), _nobody)
    from rig.record.measured import table_of
    from rig.record.store import Record

    with Record(Path(task.home)) if task.home else Record.to_read() as record:
        return averaged(table_of(record, task.data), _nobody)


def _nobody(_: str) -> None:
    """What would be said to a person of one sensor is not said of thousands."""


def _told(found: Diagnosis) -> Answer:
    steps = found.path.steps if found.verdict in ("effect-missing", "ambiguous") else ()
    rivals: Mapping[str, tuple[str, ...]] = (
        {found.candidates[0].name: found.candidates[0].indistinguishable_from} if steps else {}
    )
    return {
        "verdict": found.verdict,
        "effects": [step.taken.name for step in steps],
        "rivals": {name: list(others) for name, others in rivals.items() if others},
        "excess": found.path.end.pooled_excess,
        "left": found.residual_structure,
        "caution": found.caution,
    }
