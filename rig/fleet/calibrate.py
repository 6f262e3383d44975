"""Calibration of a fleet: fit each sensor with the model of its batch, then pool it with the batch."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from calibrations.errors import ModelError
from calibrations.fleet.batch import BatchVerdict, Population
from calibrations.fleet.look import NO_STAGE, Screening
from calibrations.fleet.rigs import StageErrors
from calibrations.fleet.siblings import PooledParameters, pool_siblings
from calibrations.model import Estimate, Model
from calibrations.model.file import dump_model, read_model
from calibrations.table import Array
from rig.files import make_folder, program, write_whole
from rig.fleet.discover import errors_of, stands_out
from rig.fleet.members import Member
from rig.fleet.questions import Fleet
from rig.fleet.worker import OwnEffects, Question, effects_of, model_of, read_look

Names = tuple[tuple[str, str, str, str], ...]


@dataclass(frozen=True)
class Guide:
    """Input of a calibration: text of a model file by batch, and `otherwise` for other batches; stage errors by rig.

    `own` has the files of the user's effects.
    """

    models: Mapping[str, str]
    otherwise: str
    errors: Mapping[str, StageErrors]
    own: OwnEffects = ()

    def question(self, member: Member) -> Question:
        """The question for a sensor."""
        model, errors = self.models.get(member.batch, self.otherwise), self.errors.get(member.rig, {})
        return Question("look", model, (), errors, self.own)


@dataclass(frozen=True)
class CalibratedBatch:
    """Sensors of a batch with the same parameters. `members`, `looks` and `pooled` have the same order."""

    batch: str
    names: Names
    members: tuple[Member, ...]
    looks: tuple[Screening, ...]
    pooled: PooledParameters
    question: Question

    @cached_property
    def unlike(self) -> tuple[bool, ...]:
        """For each sensor, whether its residual is more than noise, so that the model does not describe it."""
        usual = [look.excess for look in self.looks]
        return tuple(stands_out(look, usual) for look in self.looks)

    @property
    def gains(self) -> Array:
        """For each parameter, the median ratio of its standard uncertainty to that of a sensor fitted alone."""
        return np.asarray(np.median(self.pooled.stds / self.pooled.alone, axis=0))

    def marked(self, marks: Iterable[bool]) -> list[str]:
        """The names of the sensors with a mark; one mark for each sensor."""
        return [member.sensor for member, mark in zip(self.members, marks, strict=True) if mark]


@dataclass(frozen=True)
class FleetCalibration:
    """All batches, and the faults of the sensors that are in no batch."""

    batches: tuple[CalibratedBatch, ...]
    faults: Mapping[Member, str]


def calibrate_fleet(fleet: Fleet, members: Sequence[Member], guide: Guide) -> FleetCalibration:
    """Fit all sensors, and pool those of a batch that have the same parameters."""
    faults = {member: member.fault for member in members if member.fault}
    screenings: dict[Member, Screening] = {}
    questions = [(m, guide.question(m)) for m in members if m not in faults]
    for member, answer in fleet.ask(questions, "fitting the sensors"):
        if "fault" in answer:
            faults[member] = answer["fault"]
        else:
            screenings[member] = replace(read_look(answer), scores=(), stage=NO_STAGE)  # pooling needs no scores
    groups: dict[tuple[str, Names], list[Member]] = defaultdict(list)
    for member in members:
        if member in screenings:
            groups[member.batch, screenings[member].names].append(member)
    batches = (
        _batch(batch, names, batch_members, screenings, guide) for (batch, names), batch_members in groups.items()
    )
    return FleetCalibration(tuple(batches), faults)


def _batch(
    batch: str, names: Names, members: list[Member], screenings: Mapping[Member, Screening], guide: Guide
) -> CalibratedBatch:
    batch_screenings = tuple(screenings[member] for member in members)
    pooled = pool_siblings(
        np.array([look.theta for look in batch_screenings]),
        np.array([look.information for look in batch_screenings]),
        np.median([look.typical for look in batch_screenings], axis=0),
    )
    return CalibratedBatch(batch, names, tuple(members), batch_screenings, pooled, guide.question(members[0]))


def models(calibrated: CalibratedBatch) -> dict[str, Model]:
    """The models by sensor, with pooled values and standard uncertainties."""
    base = replace(model_of(calibrated.question), unit=calibrated.looks[0].unit)
    values, stds = calibrated.pooled.values, calibrated.pooled.stds
    return {m.sensor: _model(base, calibrated, m, values[k], stds[k]) for k, m in enumerate(calibrated.members)}


def _model(base: Model, calibrated: CalibratedBatch, member: Member, values: Array, stds: Array) -> Model:
    estimates: dict[str, list[Estimate]] = defaultdict(list)
    for (effect, name, axis, unit), value, std in zip(calibrated.names, values, stds, strict=True):
        estimates[effect].append(Estimate(name, axis, float(value), float(std), unit))
    terms = tuple(replace(term, estimates=tuple(estimates[term.name])) for term in base.terms if estimates[term.name])
    provenance: dict[str, str | float] = {
        "data": member.data,
        "sensor": member.sensor,
        "batch": member.batch,
        "pooled": len(calibrated.members),
        "program": program(),
    }
    return replace(base, terms=terms, provenance=provenance)


# The output of a discovery for a calibration: a folder with a model for each batch, and the errors of the rigs.

RIGS = "rigs.json"
SCHEMA = "rig.fleet-rigs/1"
OTHER_MODEL = "other.yaml"  # for sensors without a batch


def write_guide(population: Population, start: Question, folder: Path) -> list[Path]:
    """Write a model file for each batch, and the errors of the rigs; return the paths. Raises OutputError."""
    make_folder(folder)
    texts = {f"{safe(batch.batch)}.yaml": _guide_model(start, batch) for batch in population.batches}
    rigs = {error.rig: errors_of(population.rigs, error.rig) for error in population.rigs}
    texts[RIGS] = (
        json.dumps({"schema": SCHEMA, "rigs": {rig: errors for rig, errors in rigs.items() if errors}}, indent=1) + "\n"
    )
    for name, text in texts.items():
        write_whole(folder / name, text)
    return [folder / name for name in texts]


def write_models(result: FleetCalibration, folder: Path) -> list[Path]:
    """Write a model file for each sensor; return the paths. Raises OutputError."""
    make_folder(folder)
    texts = {safe(sensor): dump_model(model) for batch in result.batches for sensor, model in models(batch).items()}
    for sensor, text in texts.items():
        write_whole(folder / f"{sensor}.yaml", text)
    return [folder / f"{sensor}.yaml" for sensor in texts]


def read_guide(source: str, batches: set[str], effect_files: OwnEffects = ()) -> Guide:
    """The guide from a folder, or from the name or file of one model. Raises ModelError, UnknownName."""
    folder, effects = Path(source), effects_of(effect_files)
    if not folder.is_dir():
        return Guide({}, dump_model(read_model(source, effects)), {}, effect_files)
    texts = {batch: dump_model(read_model(folder / f"{safe(batch)}.yaml", effects)) for batch in batches}
    return Guide(texts, "", _rigs(folder / RIGS), effect_files)


def safe(name: str) -> str:
    """A name with the characters of a file name only."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name).lstrip(".") or Path(OTHER_MODEL).stem


def _guide_model(start: Question, batch: BatchVerdict) -> str:
    return dump_model(model_of(replace(start, effects=tuple(effect.effect for effect in batch.effects))))


def _rigs(path: Path) -> Mapping[str, StageErrors]:
    if not path.is_file():
        return {}
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["schema"] != SCHEMA:
            raise ModelError(
                f"{path}: its schema is {document['schema']!r}, not {SCHEMA}; write it by `rig fleet discover`"
            )
        return dict(document["rigs"])
    except (ValueError, KeyError, TypeError) as error:
        raise ModelError(f"{path}: is not a list of rig errors ({error}); write it by `rig fleet discover`") from None
