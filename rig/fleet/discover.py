"""Missing effects of a fleet, found in rounds.

1. Screen every sensor. Find the errors of rigs and the missing effects of batches.
2. Add these to the models of the sensors concerned, and repeat for them.
3. Test each added effect of a batch again without it, and remove an effect that is not needed.
4. Diagnose the sensors that still differ from their batch in full.

The scores of a batch are deleted from memory after its verdict.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc

from calibrations.discovery.verdict import Judgement, decide
from calibrations.fleet.batch import (
    FULL_SEARCH,
    WITH_BATCH,
    BatchEffect,
    Population,
    SensorVerdict,
    batch_verdict,
    find_batch_effects,
)
from calibrations.fleet.look import NO_STAGE, Screening
from calibrations.fleet.rigs import Measured, RigError, StageErrors, find_rig_errors, find_unconnected_rigs
from rig.fleet.members import Member
from rig.fleet.questions import Fleet
from rig.fleet.worker import Question, effects_of, read_look

STANDS_OUT = 0.05  # chance, over the whole search, below which a sensor is diagnosed in full
MOST_ROUNDS = 6
VERDICT_FACTS = ("left", "share_left", "spoilt", "unresponsive", "undetermined")  # facts of a diagnosis for the verdict
FEWEST = 4  # sensors of a batch for an estimate of its noise

Batches = Mapping[str, Sequence[Member]]


@dataclass(frozen=True)
class ScreeningSummary:
    """The part of a screening that stays in memory, see Screening. `on_stages`: whether stages turned the sensor."""

    excess: float
    free: int
    chance: float
    outliers: bool
    on_stages: bool


@dataclass(frozen=True)
class Stand:
    """The state between two rounds; `start` is the first question for every sensor."""

    start: Question
    faults: Mapping[Member, str]
    screening: Mapping[Member, ScreeningSummary] = field(default_factory=dict)
    effects: Mapping[str, tuple[BatchEffect, ...]] = field(default_factory=dict)
    errors: tuple[RigError, ...] = ()

    def question(self, kind: Any, member: Member) -> Question:
        """The present question for a sensor."""
        effects = tuple(effect.effect for effect in self.effects.get(member.batch, ()))
        return replace(self.start, what=kind, effects=effects, errors=errors_of(self.errors, member.rig))

    def with_effects(self, batch: str, effects: tuple[BatchEffect, ...]) -> Stand:
        """This state with other effects of a batch."""
        return replace(self, effects={**self.effects, batch: effects})


def discover_fleet(fleet: Fleet, members: Sequence[Member], start: Question) -> Population:
    """The population; `start` has the text of the model file that is tested first."""
    batches: dict[str, list[Member]] = defaultdict(list)
    for member in members:
        batches[member.batch].append(member)
    stand = _rigs(fleet, Stand(start, {m: m.fault for m in members if m.fault}), batches)
    stand = _remove_unneeded_effects(fleet, _add_missing_effects(fleet, stand, batches), batches)
    return _population(stand, _diagnose_members(fleet, stand, batches), members)


def errors_of(errors: Iterable[RigError], rig: str) -> StageErrors:
    """Errors of the stages of a rig: effect -> parameter -> value."""
    values: dict[str, dict[str, float]] = defaultdict(dict)
    for error in errors:
        if error.rig == rig and error.beyond:
            values[error.effect][error.parameter] = error.value
    return dict(values)


def _rigs(fleet: Fleet, stand: Stand, batches: Batches) -> Stand:
    """The state with the errors of the rigs, if there are several rigs."""
    if len({member.rig for members in batches.values() for member in members}) < 2:
        return stand
    faults = dict(stand.faults)
    screened = _screen_members(fleet, stand, batches, faults, "searching for errors of the rigs")
    stages = {member: look.stage for member, look in screened if look}
    measured = [Measured(m.batch, m.rig, stages[m]) for members in batches.values() for m in members if m in stages]
    return replace(stand, faults=faults, errors=tuple(find_rig_errors(measured)))


def _screen_members(
    fleet: Fleet, stand: Stand, batches: Batches, faults: dict[Member, str], step: str
) -> Iterator[tuple[Member, Screening | None]]:
    """Every sensor with its screening, batch by batch; without one, the reason is added to `faults`.

    `step` is the name of the screening in the progress.
    """
    questions = [(m, stand.question("look", m)) for members in batches.values() for m in members if m not in faults]
    for member, answer in fleet.ask(questions, step):
        if "fault" in answer:
            faults[member] = answer["fault"]
        yield member, None if "fault" in answer else read_look(answer)


def _add_missing_effects(fleet: Fleet, stand: Stand, batches: Batches) -> Stand:
    """The state with the missing effects of every batch, added one after another."""
    open_ = batches
    for rounds_left in reversed(range(MOST_ROUNDS + 1)):
        step = f"searching for missing effects, round {MOST_ROUNDS - rounds_left + 1}"
        stand, missing = _judge_batches(fleet, stand, open_, step)
        open_ = {batch: batches[batch] for batch, effects in missing.items() if effects and rounds_left}
        for batch in open_:
            stand = stand.with_effects(batch, (*stand.effects.get(batch, ()), missing[batch][0]))
    return stand


def _judge_batches(
    fleet: Fleet, stand: Stand, batches: Batches, step: str
) -> tuple[Stand, dict[str, list[BatchEffect]]]:
    """The state with the screened sensors, and the missing effects of each batch, found after its last sensor."""
    stage = {name for name, effect in effects_of(stand.start.own).items() if "pose" in effect.places}
    faults, screened = dict(stand.faults), dict(stand.screening)
    waiting = {batch: sum(m not in faults for m in members) for batch, members in batches.items()}
    screenings: dict[str, dict[Member, Screening]] = defaultdict(dict)
    missing = {}
    for member, look in _screen_members(fleet, stand, batches, faults, step):
        batch = member.batch
        if look is not None:
            screenings[batch][member] = look
            screened[member] = ScreeningSummary(
                look.excess, look.free, look.chance, bool(look.outliers), bool(look.stage.names)
            )
        waiting[batch] -= 1
        if not waiting[batch]:
            batch_screenings = screenings.pop(batch, {})
            missing[batch] = find_batch_effects(
                [batch_screenings[m] for m in batches[batch] if m in batch_screenings], stage
            )
    return replace(stand, faults=faults, screening=screened), missing


def _remove_unneeded_effects(fleet: Fleet, stand: Stand, batches: Batches) -> Stand:
    """The state without the effects of a batch that are not needed with the others."""
    for batch in [batch for batch, effects in stand.effects.items() if len(effects) > 1]:
        stand = _drop_needless_effects(fleet, stand, batch, batches[batch])
    return stand


def _drop_needless_effects(fleet: Fleet, stand: Stand, batch: str, members: Sequence[Member]) -> Stand:
    """The state with the needed effects of a batch; the unneeded effect that was found first is removed first."""
    tested = _test_jointly(fleet, stand, batch, members)
    significant = tuple(effect for effect in tested if effect is not None)
    if len(significant) == len(tested):
        return stand.with_effects(batch, significant)
    k, effects = tested.index(None), stand.effects[batch]
    reduced = stand.with_effects(batch, (*effects[:k], *effects[k + 1 :]))
    fewer, _ = _judge_batches(fleet, reduced, {batch: members}, f"batch {batch}: leaving out {effects[k].effect}")
    return _drop_needless_effects(fleet, fewer, batch, members) if len(effects) > 2 else fewer


def _test_jointly(fleet: Fleet, stand: Stand, batch: str, members: Sequence[Member]) -> list[BatchEffect | None]:
    """Each effect of a batch, tested with all others in the model; None if it is not significant."""
    effects = stand.effects[batch]
    tested = []
    for k, effect in enumerate(effects):
        reduced = stand.with_effects(batch, (*effects[:k], *effects[k + 1 :]))
        step = f"batch {batch}: testing the need of {effect.effect}"
        missed = _judge_batches(fleet, reduced, {batch: members}, step)[1].get(batch, [])
        tested.append(next((candidate for candidate in missed if candidate.effect == effect.effect), None))
    return tested


def _diagnose_members(fleet: Fleet, stand: Stand, batches: Batches) -> dict[Member, Any]:
    """The diagnoses of the sensors that differ from their batch."""
    usual = {
        batch: [stand.screening[m].excess for m in members if m in stand.screening]
        for batch, members in batches.items()
    }
    outliers = [
        m for m, screened in stand.screening.items() if m not in stand.faults and stands_out(screened, usual[m.batch])
    ]
    questions = [(m, stand.question("diagnosis", m)) for m in outliers]
    return dict(fleet.ask(questions, "diagnosing sensors unlike their batch"))


def stands_out(look: Screening | ScreeningSummary, batch: Sequence[float]) -> bool:
    """Whether the residual is more than noise: by a pattern, an outlier, or an excess above that of the batch."""
    usual = max(1.0, float(np.median(batch))) if len(batch) >= FEWEST else 1.0
    noisy = chdtrc(look.free, look.free * (look.excess / usual) ** 2) < STANDS_OUT
    return look.chance < STANDS_OUT or bool(look.outliers) or bool(noisy)


def _population(stand: Stand, diagnosed: Mapping[Member, Any], members: Sequence[Member]) -> Population:
    sensors = tuple(_verdict(member, stand, diagnosed.get(member)) for member in members)
    batches = []
    for batch in dict.fromkeys(member.batch for member in members):
        batch_sensors = tuple(verdict for verdict in sensors if verdict.batch == batch)
        batches.append(batch_verdict(batch, stand.effects.get(batch, ()), batch_sensors))
    unconnected = find_unconnected_rigs(
        [Measured(m.batch, m.rig, NO_STAGE) for m, screened in stand.screening.items() if screened.on_stages]
    )
    return Population(sensors, tuple(batches), stand.errors, tuple(unconnected))


def _verdict(member: Member, stand: Stand, diagnosis: Any | None) -> SensorVerdict:
    identity = (member.sensor, member.batch, member.rig, member.data)
    shared = stand.effects.get(member.batch, ())
    names, rivals = tuple(e.effect for e in shared), {e.effect: e.rivals for e in shared if e.rivals}
    fault = stand.faults.get(member) or (diagnosis or {}).get("fault")
    if fault:
        return SensorVerdict(*identity, "failed", remark=fault)
    facts = diagnosis or {"effects": (), "rivals": {}, "excess": stand.screening[member].excess}
    own_effects = tuple(facts["effects"])
    rivals |= {name: tuple(alternatives) for name, alternatives in facts["rivals"].items()}
    judgement = Judgement(
        model=stand.start.model,
        missing=(*names, *own_effects),
        alternatives=rivals,
        **{name: facts[name] for name in VERDICT_FACTS if name in facts},
    )
    remark = "; ".join(filter(None, (facts.get("left"), facts.get("caution")))) or None
    scope = FULL_SEARCH if diagnosis else WITH_BATCH
    return SensorVerdict(
        *identity, decide(judgement).value, judgement.missing, own_effects, facts["excess"], scope, rivals, remark
    )
