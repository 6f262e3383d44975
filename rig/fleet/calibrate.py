"""A fleet calibrated: every sensor fitted by its batch's model, and pooled with its siblings."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from calibrations.errors import ModelError
from calibrations.fleet.batch import BatchVerdict, Population
from calibrations.fleet.look import NOWHERE, Screening
from calibrations.fleet.rigs import StageErrors
from calibrations.fleet.siblings import Pooled, pool_siblings
from calibrations.model import Estimate, Model
from calibrations.model.file import dump_model, read_model
from rig.errors import OutputError
from rig.files import program, write_whole
from rig.fleet.discover import errors_of, stands_out
from rig.fleet.members import Member
from rig.fleet.questions import Fleet
from rig.fleet.worker import Own, Question, effects_of, model_of, read_look

Names = tuple[tuple[str, str, str, str], ...]


@dataclass(frozen=True)
class Guide:
    """What sensors are fitted by: the text of a model file for each batch, `otherwise` for the rest; errors by rig.

    `own`: the files of the user's own effects.
    """

    models: Mapping[str, str]
    otherwise: str
    errors: Mapping[str, StageErrors]
    own: Own = ()

    def question(self, member: Member) -> Question:
        """What is asked of a sensor."""
        model, errors = self.models.get(member.batch, self.otherwise), self.errors.get(member.rig, {})
        return Question("look", model, (), errors, self.own)


@dataclass(frozen=True)
class Calibrated:
    """The sensors of a batch that have the same parameters; `members`, `looks` and `pooled` in one order."""

    batch: str
    names: Names
    members: tuple[Member, ...]
    looks: tuple[Screening, ...]
    pooled: Pooled
    question: Question

    @cached_property
    def unlike(self) -> tuple[bool, ...]:
        """Of each sensor, whether the model leaves more than noise, and so does not describe it."""
        usual = [look.excess for look in self.looks]
        return tuple(stands_out(look, usual) for look in self.looks)


@dataclass(frozen=True)
class Calibration:
    """All batches, and why sensors are in none."""

    batches: tuple[Calibrated, ...]
    faults: Mapping[Member, str]


def calibrate_fleet(fleet: Fleet, members: Sequence[Member], guide: Guide) -> Calibration:
    """Fit and pool."""
    faults = {member: member.fault for member in members if member.fault}
    looks: dict[Member, Screening] = {}
    for member, said in fleet.ask([(m, guide.question(m)) for m in members if m not in faults]):
        if "fault" in said:
            faults[member] = said["fault"]
        else:
            looks[member] = replace(read_look(said), scores=(), stage=NOWHERE)  # what is pooled, and no more
    groups: dict[tuple[str, Names], list[Member]] = defaultdict(list)
    for member in members:
        if member in looks:
            groups[member.batch, looks[member].names].append(member)
    batches = (_batch(batch, names, of, looks, guide) for (batch, names), of in groups.items())
    return Calibration(tuple(batches), faults)


def _batch(batch: str, names: Names, of: list[Member], looks: Mapping[Member, Screening], guide: Guide) -> Calibrated:
    mine = tuple(looks[member] for member in of)
    together = pool_siblings(
        np.array([look.theta for look in mine]),
        np.array([look.information for look in mine]),
        np.median([look.typical for look in mine], axis=0),
    )
    return Calibrated(batch, names, tuple(of), mine, together, guide.question(of[0]))


def models(found: Calibrated) -> dict[str, Model]:
    """Each sensor's model, by its name, with its pooled values and standard uncertainties."""
    base = _base(found)
    values, stds = found.pooled.values, found.pooled.stds
    return {m.sensor: _model(base, found, m, values[k], stds[k]) for k, m in enumerate(found.members)}


def _base(found: Calibrated) -> Model:
    return replace(model_of(found.question), unit=found.looks[0].unit)


def _model(base: Model, found: Calibrated, member: Member, values: object, stds: object) -> Model:
    said: dict[str, str | float] = {
        "data": member.data,
        "sensor": member.sensor,
        "batch": member.batch,
        "pooled": len(found.members),
    }
    return _with(base, found.names, np.asarray(values), np.asarray(stds), said)


def _with(base: Model, names: Names, values: object, stds: object, said: Mapping[str, str | float]) -> Model:
    numbers = zip(names, np.asarray(values), np.asarray(stds), strict=True)
    estimates: dict[str, list[Estimate]] = defaultdict(list)
    for (effect, name, axis, unit), value, std in numbers:
        estimates[effect].append(Estimate(name, axis, float(value), float(std), unit))
    terms = tuple(replace(term, estimates=tuple(estimates[term.name])) for term in base.terms if estimates[term.name])
    return replace(base, terms=terms, provenance={**said, "program": program()})


# What a discovery hands to a calibration: a folder with a model for each batch, and the errors of the rigs.

RIGS = "rigs.json"
SCHEMA = "rig.fleet-rigs/1"
OTHERWISE = "other.yaml"  # for sensors of no batch


def write_guide(found: Population, start: Question, folder: Path) -> list[Path]:
    """A model file for each batch, and the rigs' errors. Raises OutputError."""
    made_folder(folder)
    texts = {f"{safe(each.batch)}.yaml": _guide_model(start, each) for each in found.batches}
    rigs = {error.rig: errors_of(found.rigs, error.rig) for error in found.rigs}
    texts[RIGS] = json.dumps({"schema": SCHEMA, "rigs": {rig: of for rig, of in rigs.items() if of}}, indent=1) + "\n"
    for name, text in texts.items():
        write_whole(folder / name, text)
    return [folder / name for name in texts]


def write_models(result: Calibration, folder: Path) -> list[Path]:
    """A model file for each sensor. Raises OutputError."""
    made_folder(folder)
    texts = {safe(sensor): dump_model(model) for batch in result.batches for sensor, model in models(batch).items()}
    for sensor, text in texts.items():
        write_whole(folder / f"{sensor}.yaml", text)
    return [folder / f"{sensor}.yaml" for sensor in texts]


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


def _guide_model(start: Question, batch: BatchVerdict) -> str:
    return dump_model(model_of(replace(start, effects=tuple(each.effect for each in batch.effects))))


def _rigs(path: Path) -> Mapping[str, StageErrors]:
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
        raise ModelError(f"{path}: is not a list of rig errors ({error}); write it by `rig fleet discover`") from None
