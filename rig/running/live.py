"""Measure a little, diagnose, choose what to measure next: until one explanation stands, or the time is used up.

An explanation stands when data that were measured after it was found leave it as it is. Where several cannot be told
apart, the experiment is run that will tell (`next_experiment.py`); else poses in between those that there are,
which would show what the first ones are blind to. All data are judged together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from calibrations.discover import Discovery, discover
from calibrations.effect import Effect
from calibrations.experiment import BESIDE, MENU, Experiment
from calibrations.model import Model
from calibrations.table import Table
from rig.bench import Bench
from rig.planning.next_experiment import TOGETHER, Dispute, chosen, gives_poses, planned_experiment, possible

STANDARD = Experiment("sweep", {}, (), "the sweep as it is without settings")
FIRST = Experiment("sweep", {"step_deg": 45.0, "inclinations_deg": [90.0, 30.0, 150.0]}, (), "a little, to begin with")
IN_BETWEEN = "at angles in between: an explanation that stands holds there as well"
BETWEEN = tuple(
    Experiment("sweep", {"step_deg": step, "inclinations_deg": list(inclinations)}, (), IN_BETWEEN)
    for step, inclinations in (
        (60.0, (60.0, 120.0, 45.0, 135.0)),
        (20.0, (75.0, 105.0, 90.0)),
        (30.0, (30.0, 150.0, 60.0, 120.0)),
        (30.0, (45.0, 135.0, 90.0, 75.0)),
    )
)
FEW = 1 / 3  # of the time of an experiment: poses in between that take less come first


@dataclass(frozen=True)
class Measurement:
    """One experiment that was run, what all data so far say, and what is run next: None at the end."""

    experiment: Experiment
    run: str
    found: Discovery
    used_s: float  # rig time so far, as planned
    following: Experiment | None = None


@dataclass(frozen=True)
class Live:
    """The loop's givens. `measure` runs an experiment, and returns its run's name and all data so far as one table."""

    bench: Bench
    bench_file: Path | None
    model: Model
    effects: Mapping[str, Effect]
    time_s: float
    measure: Callable[[Experiment], tuple[str, Table]]

    def measurements(self) -> Iterator[Measurement]:
        """One after another. Raises what `plan` raises where the bench cannot even begin, and what `measure` raises."""
        done: list[Measurement] = []
        following: Experiment | None = self.planned(FIRST)
        while following is not None:
            run, table = self.measure(following)
            used_s = (done[-1].used_s if done else 0.0) + (following.duration_s or 0.0)
            done.append(Measurement(following, run, discover(table, self.model, self.effects), used_s))
            telling = self._telling(done)
            following = None if stands(done) else self._following(telling, done)
            found = replace(done[-1].found, next_experiment=telling)
            done[-1] = replace(done[-1], found=found, following=following)
            yield done[-1]

    def planned(self, experiment: Experiment) -> Experiment:
        """The experiment with its duration on the bench."""
        return planned_experiment(experiment, self.bench, self.bench_file)[0]

    def _telling(self, done: Sequence[Measurement]) -> Experiment | None:
        """What would tell the explanations apart, whether there is time for it or not; None where there is one."""
        found = done[-1].found
        if found.next_experiment is None:
            return None
        dispute = Dispute.of(found.end, found.next_experiment.separates, self.effects)
        menu = _new((*BESIDE, *MENU), done)
        return chosen(dispute, found.next_experiment, self.bench, self.bench_file, menu, (TOGETHER,))

    def _following(self, telling: Experiment | None, done: Sequence[Measurement]) -> Experiment | None:
        """`telling`, where its poses can be judged with the others, else poses in between; None when time is up.

        A few minutes of poses come before what takes much longer: the room may tell what the oven would.
        """
        left_s = self.time_s - done[-1].used_s
        between = next((self.planned(e) for e in possible(_new(BETWEEN, done), self.bench, left_s)), None)
        if telling is None or telling.duration_s is None or telling.duration_s > left_s:
            return between
        if between is not None and (between.duration_s or 0.0) < FEW * telling.duration_s:
            return between
        return telling if _new([telling], done) and gives_poses(telling, self.bench) else between


def stands(done: Sequence[Measurement]) -> bool:
    """Whether the last explanation was there before, perhaps among others, and the last data left it alone."""
    if len(done) < 2 or done[-1].found.undecided:
        return False
    before, now = done[-2].found, done[-1].found
    known = {*before.causes, *(name for names in before.alternatives.values() for name in names)}
    same = before.verdict in (now.verdict, "ambiguous") and _kind(before) == _kind(now)
    return same and set(now.causes) <= known and len(now.causes) == len(before.causes)


def _kind(found: Discovery) -> list[str]:
    """The first words of the pattern that is left: when and where it is are known better as data are added."""
    return (found.residual_structure or "").split()[:2]


def _new(experiments: Sequence[Experiment], done: Sequence[Measurement]) -> list[Experiment]:
    """What was not run yet: what did not tell does not tell when it is run again."""
    known = [(m.experiment.procedure, m.experiment.settings) for m in done]
    return [e for e in experiments if (e.procedure, e.settings) not in known]
