"""Choice of the next experiment: each candidate is planned on the bench, and its data are predicted.

The choice is the shortest experiment that separates the explanations with 95 % probability. If none does, it is the one
with most information per minute. An experiment without a table of poses cannot be predicted; it is proposed for its
physics, without an expected result.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from calibrations.criteria import CERTAIN_PROBABILITY
from calibrations.design.expected import ExpectedResult, distance_alone, expected_gain, pairs_separated, predict_data
from calibrations.design.experiment import MENU, Experiment
from calibrations.discovery.additions import without_forms
from calibrations.discovery.results import Diagnosis, Discovery
from calibrations.effects import Effect
from calibrations.errors import CalibrationError
from calibrations.fitting.fit import Fit, refit
from calibrations.tables import KINDS
from drivers.errors import LimitError
from procedures.catalogue import find
from procedures.errors import ProcedureError
from procedures.settings import parse
from rig.bench import Bench
from rig.errors import BenchError
from rig.planning.plan import Plan, plan
from rig.planning.sweep_range import columns

ALONE, TOGETHER = "probability_alone", "probability"  # of Expected
LEAST = 1.0  # smallest lambda that counts as information
Question = tuple[Experiment, Mapping[str, Effect], Bench, Path | None]
_CHOSEN: WeakKeyDictionary[Fit, list[tuple[Question, Experiment]]] = WeakKeyDictionary()  # by the final fit of a search
_ONE_AT_A_TIME = Lock()
Answer = TypeVar("Answer", Diagnosis[Any], Discovery[Any])


@dataclass(frozen=True)
class Dispute:
    """Explanations that the data cannot separate: `best`, and the others by the effect that differs."""

    best: Fit
    rivals: Mapping[tuple[str, str], Fit]  # by (effect of the best, effect of the rival)
    nothing: Fit  # the model without any of them
    of_temperature: bool  # whether one of these effects depends on it

    @classmethod
    def of(cls, best: Fit, pairs: Iterable[tuple[str, str]], effects: Mapping[str, Effect]) -> Dispute:
        """The best explanation, and the same with each rival effect. Raises the errors of `refit`."""
        rivals = {(a, b): refit(best, best.model.without(a).with_effect(effects[b])) for a, b in pairs}
        without_rivals = refit(best, best.model.without(next(iter(rivals))[0]))
        return cls(
            best,
            rivals,
            without_rivals,
            any("temperature_c" in effects[name].needs for pair in rivals for name in pair),
        )


def with_next_experiment(
    result: Answer, effects: Mapping[str, Effect], bench: Bench, bench_file: Path | None
) -> Answer:
    """The result with the next experiment for the bench; unchanged without a dispute."""
    e = result.next_experiment
    if e is None:
        return result
    findings = result.findings
    frees = {a for a, _ in e.separates} & set(findings.origin.model.effects)  # a value for each axis, and adds nothing
    if not findings.data.foreseeable or frees or not e.separates:
        return replace(result, next_experiment=as_proposed(e, bench, bench_file))
    with _ONE_AT_A_TIME:  # a page and its report ask for the same one: the second waits for the first
        rivals = {name: effects[name] for pair in e.separates for name in pair}
        known, question = _CHOSEN.setdefault(findings.end, []), (e, rivals, bench, bench_file)
        chosen = next((choice for asked, choice in known if asked == question), None)
        if chosen is None:
            dispute = Dispute.of(without_forms(findings.end), e.separates, effects)
            chosen = choose_experiment(dispute, e, bench, bench_file)
            known.append((question, chosen))
    return replace(result, next_experiment=chosen)


def possible(experiments: Iterable[Experiment], bench: Bench, within_s: float) -> Iterator[Experiment]:
    """The experiments that the bench can do within a time."""
    for e in experiments:
        with suppress(LimitError, ProcedureError, BenchError):
            if (plan_experiment(e, bench, None)[0].duration_s or 0.0) <= within_s:
                yield e


def plan_experiment(experiment: Experiment, bench: Bench, bench_file: Path | None) -> tuple[Experiment, Plan]:
    """The experiment with command line and duration. Raises the errors of `plan` if the bench cannot do it."""
    procedure = find(experiment.procedure, bench.folders.procedures)
    planned = plan(bench, procedure, parse(procedure, experiment.settings))
    command = command_line(experiment, bench_file)
    return replace(experiment, command=command, duration_s=round(planned.duration_s, 1)), planned


def gives_poses(e: Experiment, bench: Bench) -> bool:
    """Whether its data are poses, which are analysed together with those of a sweep. Raises the errors of `plan`."""
    poses = plan_experiment(e, bench, None)[1].poses
    return bool(poses) and KINDS[find(e.procedure, bench.folders.procedures).kind].stage_angles


def command_line(experiment: Experiment, bench_file: Path | None) -> str:
    """The command line that runs the experiment."""
    words = ["rig", "run", experiment.procedure]
    for name, value in experiment.settings.items():
        words += [f"--{name.replace('_', '-')}", _text(value)]
    return shlex.join([*words, *(["--bench", str(bench_file)] if bench_file else [])])


def _text(value: object) -> str:
    if isinstance(value, (list, tuple)):
        return ",".join(map(_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def choose_experiment(
    dispute: Dispute,
    by_physics: Experiment,
    bench: Bench,
    bench_file: Path | None = None,
    menu: Sequence[Experiment] = MENU,
    criteria: Sequence[str] = (ALONE, TOGETHER),
) -> Experiment:
    """The next experiment for a dispute; one that the bench cannot do only if there is no other.

    `by_physics` is the experiment if no candidate of the menu helps; its text then says what the bench lacks.
    `criteria`: whether the new data are analysed alone or with the present data, in order of preference.
    """
    predicted = []
    for e, planned in sorted(_plans(menu, bench, bench_file), key=lambda pair: pair[0].duration_s or 0.0):
        if (prediction := _predict(dispute, e, planned)) is not None:
            predicted.append(prediction)
            if _will_separate(prediction, criteria[0]) and len(prediction.separates) == len(dispute.rivals):
                break  # no longer experiment can be better
    return choose_best(predicted, criteria) or as_proposed(by_physics, bench, bench_file)


def _plans(menu: Sequence[Experiment], bench: Bench, bench_file: Path | None) -> Iterator[tuple[Experiment, Plan]]:
    """The experiments that the bench can do, each with its plan."""
    for e in menu:
        with suppress(LimitError, ProcedureError, BenchError):
            yield plan_experiment(e, bench, bench_file)


def choose_best(experiments: Sequence[Experiment], criteria: Sequence[str]) -> Experiment | None:
    """The shortest experiment that certainly separates most pairs; else that with most information per minute."""
    for probability in criteria:
        enough = [e for e in experiments if _will_separate(e, probability)]
        if enough:
            return min(enough, key=lambda e: (-len(e.separates), e.duration_s or 0.0))
    separating = [e for e in experiments if _per_minute(e) > 0]
    return max(separating, key=_per_minute, default=None)


def _will_separate(e: Experiment, probability: str) -> bool:
    """Whether it separates the explanations; `probability` is the name of an attribute of `ExpectedResult`."""
    return bool(getattr(e.expected, probability) >= CERTAIN_PROBABILITY)


def _per_minute(e: Experiment) -> float:
    """Lambda per minute on the rig; 0 below LEAST."""
    information = e.expected.together if e.expected else 0.0
    return 60 * information / max(e.duration_s or 0.0, 1.0) if information > LEAST else 0.0


def _predict(dispute: Dispute, e: Experiment, planned: Plan) -> Experiment | None:
    """The experiment with its expected result; None if its data cannot be predicted.

    The temperature of a room is not known in advance: effects that depend on it are only predicted in an oven.
    """
    try:
        planned_columns = columns(planned, dispute.best.table)
        if dispute.of_temperature and "temperature_c" not in planned_columns:
            return None
        table = predict_data(dispute.best, planned_columns)
        gains = {pair: expected_gain(dispute.best, rival, table) for pair, rival in dispute.rivals.items()}
    except (LimitError, ProcedureError, BenchError, CalibrationError):
        return None
    separated = {
        pair: gains[pair] for pair in gains if pairs_separated(gains[pair].together) >= CERTAIN_PROBABILITY
    } or gains
    distances = [
        distance_alone(explanation, dispute.nothing, table) for explanation in (dispute.best, *dispute.rivals.values())
    ]
    worst = ExpectedResult(
        min(x.alone for x in separated.values()), min(x.together for x in separated.values()), min(distances)
    )
    return replace(e, separates=tuple(separated), expected=worst)


def as_proposed(e: Experiment, bench: Bench, bench_file: Path | None) -> Experiment:
    """The experiment for its physics; with a remark if the bench cannot do it."""
    try:
        return plan_experiment(e, bench, bench_file)[0]
    except (LimitError, ProcedureError, BenchError) as error:
        return replace(e, command=command_line(e, bench_file), why=f"{e.why}; but not on this bench: {error}")
