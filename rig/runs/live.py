"""The loop of `rig discover --live`: measure, diagnose, choose the next experiment, until an explanation is confirmed.

An explanation is confirmed if new data do not change it. If the data cannot separate several explanations, the loop
runs the experiment that separates them (`next_experiment.py`). Otherwise it measures poses between the known ones: they
show effects that the first poses are blind to. All data are analysed together. The loop also ends when time is up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from calibrations.design.experiment import ADDITIONS, MENU, Experiment
from calibrations.discovery.results import Discovery
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit
from calibrations.loop import discover
from calibrations.model import Model
from calibrations.table import Table
from rig.bench import Bench
from rig.planning.next_experiment import TOGETHER, Dispute, choose_experiment, gives_poses, plan_experiment, possible

STANDARD = Experiment("sweep", {}, (), "the sweep with its default settings")
FIRST = Experiment("sweep", {"step_deg": 45.0, "inclinations_deg": [90.0, 30.0, 150.0]}, (), "a short first sweep")
IN_BETWEEN = "poses between the known ones, to confirm the explanation"
SWEEPS_BETWEEN = tuple(
    Experiment("sweep", {"step_deg": step, "inclinations_deg": list(inclinations)}, (), IN_BETWEEN)
    for step, inclinations in (
        (60.0, (60.0, 120.0, 45.0, 135.0)),
        (20.0, (75.0, 105.0, 90.0)),
        (30.0, (30.0, 150.0, 60.0, 120.0)),
        (30.0, (45.0, 135.0, 90.0, 75.0)),
    )
)
FEW = 1 / 3  # of the time of an experiment: shorter sweeps between the known poses come first


@dataclass(frozen=True)
class Measurement:
    """One experiment, the discovery on all data so far, and the following experiment: None at the end."""

    experiment: Experiment
    run: str
    discovery: Discovery[Fit]
    used_s: float  # rig time so far, as planned
    following: Experiment | None = None


@dataclass(frozen=True)
class Live:
    """The loop. `measure` runs an experiment, and returns the name of its run and all data so far as one table."""

    bench: Bench
    bench_file: Path | None
    model: Model
    effects: Mapping[str, Effect]
    time_s: float
    measure: Callable[[Experiment], tuple[str, Table]]

    def measurements(self) -> Iterator[Measurement]:
        """The measurements in order. Raises the errors of `plan` and of `measure`."""
        measurements: list[Measurement] = []
        following: Experiment | None = self.planned(FIRST)
        while following is not None:
            run, table = self.measure(following)
            used_s = (measurements[-1].used_s if measurements else 0.0) + (following.duration_s or 0.0)
            measurements.append(Measurement(following, run, discover(table, self.model, self.effects), used_s))
            separating = self._separating_experiment(measurements)
            following = None if is_confirmed(measurements) else self._next_experiment(separating, measurements)
            discovered = replace(measurements[-1].discovery, next_experiment=separating)
            measurements[-1] = replace(measurements[-1], discovery=discovered, following=following)
            yield measurements[-1]

    def planned(self, experiment: Experiment) -> Experiment:
        """The experiment with its duration on the bench."""
        return plan_experiment(experiment, self.bench, self.bench_file)[0]

    def _separating_experiment(self, measurements: Sequence[Measurement]) -> Experiment | None:
        """The experiment that separates the explanations, with or without time for it; None for one explanation."""
        discovered = measurements[-1].discovery
        if discovered.next_experiment is None:
            return None
        dispute = Dispute.of(discovered.end, discovered.next_experiment.separates, self.effects)
        menu = _new_experiments((*ADDITIONS, *MENU), measurements)
        return choose_experiment(dispute, discovered.next_experiment, self.bench, self.bench_file, menu, (TOGETHER,))

    def _next_experiment(self, separating: Experiment | None, measurements: Sequence[Measurement]) -> Experiment | None:
        """The next experiment: `separating` if its poses fit the other data, else poses in between; None without time.

        A short sweep comes before a much longer experiment: the temperature of the room may show the same as the oven.
        """
        left_s = self.time_s - measurements[-1].used_s
        intermediate = next(
            (self.planned(e) for e in possible(_new_experiments(SWEEPS_BETWEEN, measurements), self.bench, left_s)),
            None,
        )
        if separating is None or separating.duration_s is None or separating.duration_s > left_s:
            return intermediate
        if intermediate is not None and (intermediate.duration_s or 0.0) < FEW * separating.duration_s:
            return intermediate
        return (
            separating
            if _new_experiments([separating], measurements) and gives_poses(separating, self.bench)
            else intermediate
        )


def is_confirmed(measurements: Sequence[Measurement]) -> bool:
    """Whether the last data have confirmed the explanation of the data before, or one of its alternatives."""
    if len(measurements) < 2 or measurements[-1].discovery.undecided:
        return False
    previous, present = measurements[-2].discovery, measurements[-1].discovery
    explanations = {*previous.causes, *(name for names in previous.alternatives.values() for name in names)}
    same_verdict = previous.verdict in (present.verdict, "ambiguous") and _kind(previous) == _kind(present)
    return same_verdict and set(present.causes) <= explanations and len(present.causes) == len(previous.causes)


def _kind(discovered: Discovery[Fit]) -> list[str]:
    """The first words of the remaining pattern, without its place, which more data can change."""
    return (discovered.residual_structure or "").split()[:2]


def _new_experiments(experiments: Sequence[Experiment], measurements: Sequence[Measurement]) -> list[Experiment]:
    """The experiments that were not run yet: a repetition gives no new information."""
    measured_settings = [(m.experiment.procedure, m.experiment.settings) for m in measurements]
    return [e for e in experiments if (e.procedure, e.settings) not in measured_settings]
