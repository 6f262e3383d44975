"""A fleet calibrated: every sensor fitted by its batch's model, and pooled with its siblings."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibrations.fleet.corrected import Values
from calibrations.fleet.look import NOWHERE, Look
from calibrations.fleet.pooling import Pooled, pooled
from calibrations.model import Estimate, Model
from rig.analysis.provenance import program
from rig.fleet.asked import Fleet
from rig.fleet.discover import stands_out
from rig.fleet.members import Member
from rig.fleet.own import Own
from rig.fleet.worker import Question, model_of
from rig.fleet.written import read_look

Names = tuple[tuple[str, str, str, str], ...]


@dataclass(frozen=True)
class Guide:
    """What sensors are fitted by: the text of a model file for each batch, `otherwise` for the rest; errors by rig.

    `own`: the files of the user's own effects.
    """

    models: Mapping[str, str]
    otherwise: str
    errors: Mapping[str, Values]
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
    looks: tuple[Look, ...]
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
    looks: dict[Member, Look] = {}
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


def _batch(batch: str, names: Names, of: list[Member], looks: Mapping[Member, Look], guide: Guide) -> Calibrated:
    mine = tuple(looks[member] for member in of)
    together = pooled(
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
