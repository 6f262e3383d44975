"""Poses chosen for a model, compared with the standard sweep: `rig plan sweep --optimal`.

The durations of both come from plans on the bench. The chosen poses are fewer with longer dwells, so that the worst
standard error equals that of the sweep.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calibrations.design.optimal_design import (
    Criterion,
    DOptimal,
    IOptimal,
    choose_repeats,
    exchange_design,
    farthest_poses,
)
from calibrations.design.run_order import Tour, order_tour
from calibrations.discovery.check_poses import MARK
from calibrations.model import Model
from calibrations.table import Array
from procedures.catalogue import Procedure
from procedures.pose_list import format_poses
from procedures.session import Pose
from rig.bench import Bench
from rig.errors import PlanError
from rig.planning.planned import from_home_s, moves_s
from rig.planning.sweep_range import JudgedPlan, Range

MOST_POSES = 60
ONE_IN = 10  # share of poses that are repeated, and of check poses that the fit does not use
FEWEST = 4  # repeated poses, and check poses
APART_S = 5.0  # cost of an immediate repeat, which does not show changes between visits
NEARLY = 0.99  # ratio of errors that counts as equal
DESIGN, AGAIN, CHECK = "design", "again", MARK  # paths of poses
CRITERIA: Mapping[str, Callable[[Array], Criterion]] = {"D": lambda _: DOptimal(), "I": IOptimal.over}


@dataclass(frozen=True)
class Optimal:
    """The poses of `criterion` for a model, compared with the standard sweep of a range.

    `short` has the dwell of the standard sweep, `equal` that for equal worst standard errors, `all_equal` that
    at which no parameter is less certain. `drift_loss`: the largest relative increase of the variance of a parameter if
    a drift is fitted as well.
    """

    over: Range
    criterion: str
    short: JudgedPlan
    equal: JudgedPlan
    all_equal: JudgedPlan
    drift_loss: float

    @property
    def standard(self) -> JudgedPlan:
        """The standard sweep."""
        return self.over.standard

    @property
    def times_less(self) -> float:
        """Ratio of the rig times, standard sweep to chosen poses, for equal worst standard error."""
        return self.standard.plan.duration_s / self.equal.plan.duration_s

    @property
    def times_less_for_all(self) -> float:
        """The ratio of the times if no parameter may become less certain."""
        return self.standard.plan.duration_s / self.all_equal.plan.duration_s

    @property
    def height_correlation(self) -> float:
        """Correlation of height (gravity across the table) with time over the poses."""
        heights = np.cos(np.radians([pose.alpha_deg for pose in self.equal.poses]))
        times_s = [dwell.start_s for dwell in self.equal.plan.held]
        return float(np.corrcoef(heights, times_s)[0, 1]) if np.ptp(heights) else 0.0

    def worst(self, judged: JudgedPlan) -> int:
        """Index of the parameter with the largest error at full scale, of those that the standard sweep determines."""
        return int(np.argmax(np.where(self.standard.determined, judged.errors, -1.0)))


def relative(standard: JudgedPlan, judged: JudgedPlan) -> float:
    """Ratio of the worst standard errors to the standard sweep, for the parameters that it determines."""
    determined = standard.determined
    return float(np.max(judged.errors[determined]) / np.max(standard.errors[determined]))


def most_relative(standard: JudgedPlan, judged: JudgedPlan) -> float:
    """The largest ratio of a standard error to that of the same parameter in the standard sweep."""
    determined = standard.determined
    return float(np.max(judged.errors[determined] / standard.errors[determined]))


def optimal(
    bench: Bench,
    sweep: Procedure,
    settings: Mapping[str, Any],
    model: Model,
    poses: int | None = None,
    criterion: str = "I",
) -> Optimal:
    """`poses` poses for `model`, for the range of the sweep with `settings`. The same arguments give the same poses.

    A quarter of the sweep's, at most MOST_POSES, where no number is given: fewer poses have fewer moves between them.
    `criterion` is a name of CRITERIA. Raises PlanError where `poses` are too few or too many; what a plan and a fit
    raise.
    """
    design_range = Range(bench, sweep, settings, model)
    if not design_range.standard.determined.any():
        raise PlanError(f"this sweep determines no parameter of {model.name}; give it more inclinations")
    parameters = len(design_range.fit.theta)
    least = 3 * FEWEST + -(-parameters // len(design_range.axes))
    poses = min(MOST_POSES, max(least, design_range.standard.plan.poses // 4)) if poses is None else poses
    if not least <= poses <= MOST_POSES:
        raise PlanError(f"{poses} poses: give {least} to {MOST_POSES} for the {parameters} parameters of {model.name}")
    design, rows = _choose_poses(design_range, CRITERIA[criterion](design_range.white), poses)
    between_s = moves_s(bench, design) + APART_S * _equal_poses(design)
    tour = Tour(from_home_s(bench, design), between_s, rows, _dwell_s(design_range, design))
    order = order_tour(tour)
    short = design_range.judged(_pose_settings(settings, [design[k] for k in order]))
    equal, all_equal = (_equal_plan(design_range, short, ratio) for ratio in (relative, most_relative))
    return Optimal(design_range, criterion, short, equal, all_equal, tour.drift_loss(order))


def _choose_poses(design_range: Range, criterion: Criterion, poses: int) -> tuple[list[Pose], Array]:
    """Poses with their paths, and their information: 0 for those that no fit sees, (poses, axes, p)."""
    aside = max(FEWEST, round(poses / ONE_IN))
    design = exchange_design(design_range.white, poses - 2 * aside, criterion)
    repeats = choose_repeats(design_range.white, design, aside, criterion)
    fitted = np.concatenate([design, repeats])
    checks = farthest_poses(design_range.places, fitted, poses - len(fitted))
    paths = [DESIGN] * len(design) + [AGAIN] * len(repeats) + [CHECK] * len(checks)
    numbers = np.concatenate([fitted, checks])
    rows = np.concatenate([design_range.white[fitted], 0 * design_range.white[checks]])
    return [replace(design_range.candidates[k], path=path) for k, path in zip(numbers, paths, strict=True)], rows


def _equal_poses(poses: Sequence[Pose]) -> Array:
    """1 where two poses differ in their paths at most, else 0, shape (n, n)."""
    places = [replace(pose, path="") for pose in poses]
    return np.array([[float(a == b) for b in places] for a in places])


def _dwell_s(design_range: Range, design: Sequence[Pose]) -> float:
    """Sum of all dwells at equal worst standard error; the order changes it little. Raises PlanError."""
    unordered = design_range.judged(_pose_settings(design_range.settings, design))
    if undetermined := [
        design_range.name(int(k)) for k in np.flatnonzero(design_range.standard.determined & ~unordered.determined)
    ]:
        raise PlanError(
            f"{len(design)} poses do not determine {', '.join(undetermined)}, but the sweep does; choose more poses"
        )
    return len(design) * _longer(unordered.dwell_s, relative(design_range.standard, unordered))


def _pose_settings(settings: Mapping[str, Any], poses: Sequence[Pose]) -> dict[str, Any]:
    """Settings of a sweep over these poses."""
    return {**settings, "face": "up", "reference_every": 0, "pose_list": format_poses(poses)}


def _equal_plan(design_range: Range, short: JudgedPlan, ratio: Callable[[JudgedPlan, JudgedPlan], float]) -> JudgedPlan:
    """The plan with the dwell at which its `ratio` to the standard sweep is 1.

    With white noise it follows directly. If effects depend on time, the length of the run counts as well: by bisection.
    """
    low, high = (
        short,
        _judged_with_dwell(design_range, short, _longer(short.dwell_s, ratio(design_range.standard, short))),
    )
    while ratio(design_range.standard, high) < NEARLY and high.dwell_s - low.dwell_s > 0.15:
        middle = _judged_with_dwell(design_range, short, round(float(np.sqrt(low.dwell_s * high.dwell_s)), 1))
        low, high = (low, middle) if ratio(design_range.standard, middle) <= 1 else (middle, high)
    return high


def _judged_with_dwell(design_range: Range, judged: JudgedPlan, dwell_s: float) -> JudgedPlan:
    return design_range.judged({**judged.plan.settings, "dwell_s": dwell_s})


def _longer(dwell_s: float, error_ratio: float) -> float:
    """The dwell that reduces the errors of white noise by the ratio, rounded up to a tenth of a second."""
    return float(np.ceil(10 * dwell_s * error_ratio**2 - 1e-6) / 10)
