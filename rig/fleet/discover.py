"""What a fleet's sensors miss, in rounds: every sensor is looked at, rigs and batches are judged, and what they explain
is taken into the model of those sensors, which are looked at again. Who then still stands out is diagnosed in full.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc

from calibrations.effect import catalogue
from calibrations.fleet.batch import BatchEffect, batch_effects
from calibrations.fleet.corrected import Values
from calibrations.fleet.look import Look
from calibrations.fleet.population import BESIDE, IN_FULL, Population, SensorVerdict, batch_verdict
from calibrations.fleet.rigs import Measured, RigError, rig_errors, unconnected
from rig.fleet.asked import Fleet
from rig.fleet.members import Member
from rig.fleet.worker import Question
from rig.fleet.written import read_look

STANDS_OUT = 0.05  # chance, over the whole search, below which a sensor is diagnosed in full
MOST_ROUNDS = 6
FEWEST = 4  # sensors that tell how noisy their batch is


@dataclass(frozen=True)
class Stand:
    """What is known between two rounds."""

    looks: Mapping[Member, Look] = field(default_factory=dict)
    faults: Mapping[Member, str] = field(default_factory=dict)
    effects: Mapping[str, tuple[BatchEffect, ...]] = field(default_factory=dict)
    errors: tuple[RigError, ...] = ()
    asked: Mapping[Member, Question] = field(default_factory=dict)


def discover_fleet(fleet: Fleet, members: Sequence[Member], model: str) -> Population:
    """The population; `model` is the text of the model file that every sensor is held against at first."""
    faulty = {member: member.fault for member in members if member.fault}
    stand = _looked(fleet, Stand(faults=faulty), [m for m in members if m not in faulty], model)
    stand = replace(stand, errors=tuple(rig_errors([_measured(m, look) for m, look in stand.looks.items()])))
    stand = _looked(fleet, stand, list(stand.looks), model)
    for _ in range(MOST_ROUNDS):
        more = _batches(stand)
        if not more:
            break
        effects = {batch: (*stand.effects.get(batch, ()), effect) for batch, effect in more.items()}
        stand = _looked(fleet, replace(stand, effects={**stand.effects, **effects}), list(stand.looks), model)
    diagnosed = _diagnosed(fleet, stand, model)
    return _population(stand, diagnosed, members)


def _question(what: Any, member: Member, stand: Stand, model: str) -> Question:
    effects = tuple(each.effect for each in stand.effects.get(member.batch, ()))
    return Question(what, model, effects, errors_of(stand.errors, member.rig))


def errors_of(errors: Iterable[RigError], rig: str) -> Values:
    """What a rig's stages are off by: effect -> parameter -> value."""
    values: dict[str, dict[str, float]] = defaultdict(dict)
    for error in errors:
        if error.rig == rig and error.beyond:
            values[error.effect][error.parameter] = error.value
    return dict(values)


def _looked(fleet: Fleet, stand: Stand, members: Sequence[Member], model: str) -> Stand:
    """Look again at the members of which something else is asked than before."""
    questions = {member: _question("look", member, stand, model) for member in members}
    new = [(m, question) for m, question in questions.items() if stand.asked.get(m) != question]
    looks, faults = dict(stand.looks), dict(stand.faults)
    for member, said in fleet.ask(new):
        if "fault" in said:
            faults[member] = said["fault"]
            looks.pop(member, None)
        else:
            looks[member] = read_look(said)
    ordered = {member: looks[member] for member in members if member in looks}
    return replace(stand, looks=ordered, faults=faults, asked={**stand.asked, **questions})


def _measured(member: Member, look: Look) -> Measured:
    return Measured(member.batch, member.rig, look.stage)


def _batches(stand: Stand) -> dict[str, BatchEffect]:
    """The next effect of each batch that misses one."""
    stage = {name for name, effect in catalogue().items() if effect.pose is not None}
    looks: dict[str, list[Look]] = defaultdict(list)
    for member, look in stand.looks.items():
        looks[member.batch].append(look)
    found = {batch: batch_effects(of, stage) for batch, of in looks.items()}
    return {batch: effects[0] for batch, effects in found.items() if effects}


def _diagnosed(fleet: Fleet, stand: Stand, model: str) -> dict[Member, Any]:
    """The diagnoses of those that stand out from their batch."""
    usual: dict[str, list[float]] = defaultdict(list)
    for member, look in stand.looks.items():
        usual[member.batch].append(look.excess)
    out = [m for m, look in stand.looks.items() if stands_out(look, usual[m.batch])]
    return dict(fleet.ask([(m, _question("diagnosis", m, stand, model)) for m in out]))


def stands_out(look: Look, batch: Sequence[float]) -> bool:
    """Whether noise alone would hardly leave so much: a pattern, a pose, or more than its batch leaves (`excess`)."""
    usual = max(1.0, float(np.median(batch))) if len(batch) >= FEWEST else 1.0
    noisy = chdtrc(look.free, look.free * (look.excess / usual) ** 2) < STANDS_OUT
    return look.chance < STANDS_OUT or bool(look.outliers) or bool(noisy)


def _population(stand: Stand, diagnosed: Mapping[Member, Any], members: Sequence[Member]) -> Population:
    sensors = tuple(_verdict(member, stand, diagnosed.get(member)) for member in members)
    batches = []
    for batch in dict.fromkeys(member.batch for member in members):
        mine = tuple(each for each in sensors if each.batch == batch)
        batches.append(batch_verdict(batch, stand.effects.get(batch, ()), mine))
    apart = unconnected([_measured(m, look) for m, look in stand.looks.items()])
    return Population(sensors, tuple(batches), stand.errors, tuple(apart))


def _verdict(member: Member, stand: Stand, diagnosis: Any | None) -> SensorVerdict:
    of = (member.sensor, member.batch, member.rig, member.data)
    shared = stand.effects.get(member.batch, ())
    names, rivals = tuple(e.effect for e in shared), {e.effect: e.rivals for e in shared if e.rivals}
    fault = stand.faults.get(member) or (diagnosis or {}).get("fault")
    if fault:
        return SensorVerdict(*of, "failed", remark=fault)
    if diagnosis is None:
        verdict = "adequate" if not names else "ambiguous" if rivals else "effect-missing"
        return SensorVerdict(*of, verdict, names, (), stand.looks[member].excess, BESIDE, rivals)
    own = tuple(diagnosis["effects"])
    rivals |= {name: tuple(others) for name, others in diagnosis["rivals"].items()}
    verdict = diagnosis["verdict"]
    if verdict == "adequate" and names:
        verdict = "ambiguous" if rivals else "effect-missing"
    remark = "; ".join(filter(None, (diagnosis["left"], diagnosis["caution"]))) or None
    return SensorVerdict(*of, verdict, (*names, *own), own, diagnosis["excess"], IN_FULL, rivals, remark)
