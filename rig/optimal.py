"""Poses chosen for a model, beside the sweep that they take the place of: `rig plan sweep --optimal`.

The range is that of the sweep: its inclinations and what lies between them, its turn of beta, both directions, the
faces that it has. Both plans are counted by the procedure itself on the bench, and judged by what a fit will know: the
standard error of each parameter, as what it does to the output where it does most. Only so can volts be set beside
degrees. The greatest of them is the worst standard error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from calibrations.assumed import assumed
from calibrations.chain import nominal_pose, specific_force
from calibrations.fit import Fit
from calibrations.foreseen import foreseen
from calibrations.information import covariance_of, information
from calibrations.model import Model
from calibrations.optimal_design import Criterion, DOptimal, IOptimal, again, exchanged, farthest, scaled
from calibrations.problem import Problem
from calibrations.run_order import Tour, ordered
from calibrations.table import AXES, Array
from procedures.catalogue import Procedure
from procedures.pose_list import written
from procedures.session import Pose
from rig.bench import Bench
from rig.errors import PlanError
from rig.plan import Plan, plan
from rig.travel import from_home_s, moves_s

MOST_POSES = 60
ONE_IN = 10  # poses is measured again, and as many are kept out of the fit
FEWEST = 4  # of either
GRID_DEG = 15.0
SIDE = 0.2  # how far the two directions of one pose count as apart, beside distances of gravity in g
CRITERIA: Mapping[str, Callable[[Array], Criterion]] = {"D": lambda _: DOptimal(), "I": IOptimal.over}
DESIGN, AGAIN, CHECK = "design", "again", "check"  # paths of poses; what begins with CHECK is kept out of the fit


@dataclass(frozen=True)
class Judged:
    """A plan, and what a fit of its poses will know: `errors` (p,), V at full scale, infinite where it cannot tell."""

    plan: Plan
    errors: Array

    @property
    def dwell_s(self) -> float:
        """Of each pose."""
        return float(self.plan.settings["dwell_s"])

    @property
    def poses(self) -> tuple[Pose, ...]:
        """All, in order."""
        return tuple(held.pose for held in self.plan.held)


@dataclass(frozen=True)
class Optimal:
    """The poses of `criterion` for the model of `fit`, beside the standard sweep.

    `short` has the standard sweep's dwell, `equal` the dwell at which the worst standard errors are equal, `all_equal`
    that at which no parameter is less certain than after the sweep. `drift_loss`: by how much the variance of the
    parameter that suffers most grows where a drift is fitted beside all.
    """

    fit: Fit
    criterion: str
    standard: Judged
    short: Judged
    equal: Judged
    all_equal: Judged
    drift_loss: float

    @cached_property
    def times_less(self) -> float:
        """Rig time of the standard sweep over that at equal worst standard error."""
        return self.standard.plan.duration_s / self.equal.plan.duration_s

    @property
    def times_less_for_all(self) -> float:
        """The same with no parameter less certain than after the standard sweep."""
        return self.standard.plan.duration_s / self.all_equal.plan.duration_s

    @property
    def determined(self) -> Any:
        """Mask of the parameters that the standard sweep tells, shape (p,)."""
        return np.isfinite(self.standard.errors)

    def worst(self, judged: Judged) -> int:
        """Number of the parameter with the greatest error at full scale, of those that the standard sweep tells."""
        return int(np.argmax(np.where(self.determined, judged.errors, -1.0)))

    def relative(self, judged: Judged) -> float:
        """Worst standard error over that of the standard sweep."""
        worst = judged.errors[self.worst(judged)]
        return float(worst / self.standard.errors[self.worst(self.standard)])

    def most_relative(self, judged: Judged) -> float:
        """The greatest ratio of any parameter's standard error to its own in the standard sweep."""
        known = self.determined
        return float(np.max(judged.errors[known] / self.standard.errors[known]))

    @property
    def height_correlation(self) -> float:
        """Of height (the part of gravity across the table) with time, over the poses in order."""
        heights = np.cos(np.radians([pose.alpha_deg for pose in self.equal.poses]))
        times_s = [held.start_s for held in self.equal.plan.held]
        return float(np.corrcoef(heights, times_s)[0, 1]) if np.ptp(heights) else 0.0


def optimal(
    bench: Bench,
    sweep: Procedure,
    settings: Mapping[str, Any],
    model: Model,
    poses: int = MOST_POSES,
    criterion: str = "I",
) -> Optimal:
    """`poses` poses for `model`, for the range of the sweep with `settings`. The same arguments give the same poses.

    `criterion`: a name of CRITERIA.

    Raises PlanError for too few or too many poses; what a plan and a fit raise.
    """
    planner = _Planner(bench, sweep, settings, model)
    _check_count(poses, planner)
    return planner.made(CRITERIA[criterion](planner.white), poses)


def _check_count(poses: int, planner: _Planner) -> None:
    least = 3 * FEWEST + -(-len(planner.fit.theta) // len(planner.axes))
    if not least <= poses <= MOST_POSES:
        raise PlanError(f"{poses} poses: give {least} to {MOST_POSES} for the {len(planner.fit.theta)} parameters")


@dataclass(frozen=True)
class _Planner:
    """What both designs have in common: the standard sweep, its model, and the candidates."""

    bench: Bench
    sweep: Procedure
    settings: Mapping[str, Any]
    model: Model

    @cached_property
    def standard_plan(self) -> Plan:
        return plan(self.bench, self.sweep, self.settings)

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """Measured on the bench; those of any sensor of a batch."""
        names = {name.rpartition(".")[2] for name in self.bench.channels}
        return tuple(axis for axis in AXES if f"v{axis}" in names) or AXES[:2]

    @cached_property
    def fit(self) -> Fit:
        rate_hz = self.bench.instruments["adc"].typed_settings().rate_hz
        constants = self.bench.constants | {"sample_rate_hz": rate_hz}
        return assumed(self.model, _columns(self.standard_plan), constants, self.axes)

    @cached_property
    def candidates(self) -> list[Pose]:
        return list(_candidates([held.pose for held in self.standard_plan.held]))

    @cached_property
    def white(self) -> Array:
        """Information of the candidates, scaled, shape (candidates, axes, p)."""
        rows = information(self.fit, foreseen(self.fit, self._timeless(self.candidates)))
        return scaled(rows.reshape(len(self.axes), len(self.candidates), -1).transpose(1, 0, 2))

    @cached_property
    def full_scale(self) -> Array:
        """The most that a parameter does to the output within the range, V over its unit, shape (p,)."""
        problem = Problem(self.fit.table, self.fit.problem.layout)
        return np.asarray(np.max(np.abs(problem.jacobian(self.fit.theta)), axis=(0, 1)))

    def _timeless(self, poses: Sequence[Pose]) -> dict[str, Array]:
        """Their columns, in no order; at one time where the model needs a time."""
        columns = _of_poses(poses)
        if any("t_s" in term.effect.needs for term in self.fit.model.terms):
            columns["t_s"] = np.full(len(poses), self.standard_plan.duration_s / 2)
        return columns

    def judged(self, settings: Mapping[str, Any]) -> Judged:
        """The sweep with these settings; CHECK poses tell its fit nothing."""
        planned = plan(self.bench, self.sweep, settings)
        seen = replace(planned, held=tuple(held for held in planned.held if not held.pose.path.startswith(CHECK)))
        rows = information(self.fit, foreseen(self.fit, _columns(seen)))
        return Judged(planned, np.sqrt(np.diag(covariance_of(rows))) * self.full_scale)

    def made(self, criterion: Criterion, poses: int) -> Optimal:
        """The design, its order, and how it compares."""
        chosen, order, drift_loss = self._visited(criterion, poses)
        settings = {**self.settings, "face": "up", "reference_every": 0, "pose_list": written(chosen[k] for k in order)}
        short = self.judged(settings)
        draft = Optimal(self.fit, criterion.name, self.judged(self.settings), short, short, short, drift_loss)
        needed = (draft.relative(short), draft.most_relative(short))
        equal, all_equal = (self.judged({**settings, "dwell_s": _longer(short.dwell_s, ratio)}) for ratio in needed)
        return replace(draft, equal=equal, all_equal=all_equal)

    def _visited(self, criterion: Criterion, poses: int) -> tuple[list[Pose], Sequence[int], float]:
        """Poses with their paths, their order, and what a drift takes away."""
        aside = max(FEWEST, round(poses / ONE_IN))
        chosen = exchanged(self.white, poses - 2 * aside, criterion)
        more = again(self.white, chosen, aside, criterion)
        checks = farthest(self._places, np.concatenate([chosen, more]), poses - len(chosen) - len(more))
        numbers = np.concatenate([chosen, more, checks])
        paths = [DESIGN] * len(chosen) + [AGAIN] * len(more) + [CHECK] * len(checks)
        visited = [replace(self.candidates[k], path=path) for k, path in zip(numbers, paths, strict=True)]
        rows = np.where(np.arange(len(numbers))[:, None, None] < len(chosen) + len(more), self.white[numbers], 0.0)
        dwell_s = len(visited) * float(self.settings["dwell_s"])
        tour = Tour(from_home_s(self.bench, visited), moves_s(self.bench, visited), rows, dwell_s)
        order = ordered(tour)
        return visited, [int(k) for k in order], tour.drift_loss(order)

    @property
    def _places(self) -> Array:
        """Where the candidates are, for distances: gravity in the sensor's frame, and the side of the approach."""
        table = foreseen(self.fit, self._timeless(self.candidates))
        return np.column_stack([specific_force(nominal_pose(table)), SIDE * table.column("direction")])


def _longer(dwell_s: float, error_ratio: float) -> float:
    """The dwell that takes a white noise's errors down by the ratio, up to a tenth of a second."""
    return float(np.ceil(10 * dwell_s * error_ratio**2 - 1e-6) / 10)


def _candidates(standard: Sequence[Pose]) -> Iterator[Pose]:
    """A grid over the range of the standard poses, with all their inclinations."""
    alphas, betas = ([getattr(pose, name) for pose in standard] for name in ("alpha_deg", "beta_deg"))
    finer = np.arange(min(alphas), max(alphas) + 1e-9, GRID_DEG)
    whole = [beta for beta in np.arange(min(betas), max(betas) + 1e-9, GRID_DEG) if beta < min(betas) + 360]
    for flip in sorted({pose.flip for pose in standard}):
        for alpha in np.unique([*alphas, *finer]):
            for beta in whole:
                yield from (Pose(float(alpha), float(beta), direction, flip=flip) for direction in (1, -1))


def _columns(planned: Plan) -> dict[str, Array]:
    """Of the poses that a plan holds, in order, with their times and dwells."""
    dwell_s = float(planned.settings["dwell_s"])
    columns = _of_poses([held.pose for held in planned.held])
    columns["t_s"] = np.array([held.start_s + dwell_s / 2 for held in planned.held])
    return columns | {"dwell_s": np.full(planned.poses, dwell_s)}


def _of_poses(poses: Sequence[Pose]) -> dict[str, Array]:
    names = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
    return {name: np.array([float(getattr(pose, name)) for pose in poses]) for name in names}
