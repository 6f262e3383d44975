"""The range of a sweep for a model, and the columns of planned poses: angles, mounting, time, and oven temperature."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrations.design.expected import assume_sensor, predict_data
from calibrations.design.optimal_design import covariance_of, information, scale_rows
from calibrations.discovery.check_poses import MARK
from calibrations.fitting.fit import Fit
from calibrations.geometry.orientation import reported_force
from calibrations.model import Model
from calibrations.table import AXES, Array, Table
from procedures.catalogue import Procedure
from procedures.instruments import output_channel
from procedures.session import Pose
from rig.bench import Bench
from rig.planning.plan import Plan, plan

PAUSE_S = 60.0  # from the end of the data to the beginning of the next run, at least
OVEN_S = 1200.0  # until an oven with its load is near its set point


def columns(planned: Plan, data: Table) -> dict[str, Array]:
    """The columns of a planned run's poses: angles, side, mounting, time after `data`, temperature, length."""
    poses = [dwell.pose for dwell in planned.held]
    names = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
    columns = {name: np.array([getattr(pose, name) for pose in poses], dtype=float) for name in names}
    dwell_s = np.array([_dwell_s(planned.settings, pose.path) for pose in poses])
    since_s = np.array([dwell.start_s for dwell in planned.held]) + dwell_s / 2
    columns["t_s"] = float(data.time_s.max()) + PAUSE_S + since_s
    if "temperature_c" in data and {"oven_c", "temperatures_c"} & {k for k, v in planned.settings.items() if v}:
        last_c = float(data.column("temperature_c")[data.order[-1]])
        columns["temperature_c"] = _temperature_c(planned, last_c, since_s)
    return columns | ({"dwell_s": dwell_s} if "sample_rate_hz" in data.constants else {})


def _dwell_s(settings: Mapping[str, Any], path: str) -> float:
    """Recording time of a pose: all blocks of a hold, or one dwell."""
    return float(settings["block_s" if path.startswith("hold") and "block_s" in settings else "dwell_s"])


def _temperature_c(planned: Plan, last_c: float, since_s: Array) -> Array:
    """The sensor's temperature, which approaches the setting of the oven (first order)."""
    now_c, at_s, course = last_c, 0.0, []
    for dwell, t_s in zip(planned.held, since_s, strict=True):
        now_c += (_oven_c(planned.settings, dwell.pose.path) - now_c) * -np.expm1(-(t_s - at_s) / OVEN_S)
        at_s = t_s
        course.append(now_c)
    return np.array(course)


def _oven_c(settings: Mapping[str, Any], path: str) -> float:
    """The set point at a pose: that of a soak, or of the step of a cycle, which its path names."""
    return float(settings["oven_c"] if "oven_c" in settings else path.split()[1])


# The range of a sweep for a model: the candidates for its poses, and the accuracy of a fit to the poses of a plan.
#
# The range has the inclinations of the sweep and those between them, its turn of beta, both directions and its faces. A
# plan is judged by the standard error of each parameter, as the largest change of the output by this error: volts and
# degrees are then comparable. The largest of them is the worst standard error.

GRID_DEG = 15.0
MOST_ERROR = 0.01  # of the output per g: a plan that leaves more at full scale does not determine the parameter
SIDE = 0.2  # distance of the two directions of one pose, in units of the distances of gravity, g


@dataclass(frozen=True)
class JudgedPlan:
    """A plan and the expected standard uncertainties `errors` (p,), V at full scale, infinite if not determined."""

    plan: Plan
    errors: Array

    @property
    def dwell_s(self) -> float:
        """Recording time of each pose."""
        return float(self.plan.settings["dwell_s"])

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Mask of the parameters that the plan determines, shape (p,)."""
        return np.isfinite(self.errors)

    @property
    def poses(self) -> tuple[Pose, ...]:
        """All, in order."""
        return tuple(dwell.pose for dwell in self.plan.held)


@dataclass(frozen=True)
class Range:
    """The range of the sweep with `settings` on a bench, for `model`."""

    bench: Bench
    sweep: Procedure
    settings: Mapping[str, Any]
    model: Model

    @cached_property
    def standard(self) -> JudgedPlan:
        """The sweep itself."""
        return self.judged(self.settings)

    @cached_property
    def fit(self) -> Fit:
        """The model as if it had been fitted to the sweep."""
        rate_hz = self.bench.instruments["adc"].parse_settings().rate_hz
        constants = self.bench.constants | {"sample_rate_hz": rate_hz}
        return assume_sensor(self.model, _columns(self._plan), constants, self.axes)

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """Measured on the bench; those of any sensor of a batch."""
        names = {name.rpartition(".")[2] for name in self.bench.channels}
        return tuple(axis for axis in AXES if output_channel(axis, names)) or AXES[:2]

    @cached_property
    def candidates(self) -> list[Pose]:
        """Poses to choose from."""
        return list(_candidates([dwell.pose for dwell in self._plan.held]))

    @cached_property
    def white(self) -> Array:
        """Information of the candidates, scaled, shape (candidates, axes, p)."""
        rows = information(self.fit, self._candidate_table)
        return scale_rows(rows.reshape(len(self.axes), len(self.candidates), -1).transpose(1, 0, 2))

    @property
    def places(self) -> Array:
        """Coordinates of the candidates, for distances: gravity in the sensor's frame, and the side of the approach."""
        table = self._candidate_table
        return np.column_stack([reported_force(table), SIDE * table.column("direction")])

    def judged(self, settings: Mapping[str, Any]) -> JudgedPlan:
        """The sweep with other settings; its fit does not use the check poses. Raises what a plan raises."""
        planned = plan(self.bench, self.sweep, settings)
        fitted = replace(planned, held=tuple(dwell for dwell in planned.held if not dwell.pose.path.startswith(MARK)))
        rows = information(self.fit, predict_data(self.fit, _columns(fitted)))
        std = np.sqrt(np.diag(covariance_of(rows)))
        errors = np.multiply(std, self._full_scale, where=np.isfinite(std), out=np.full(len(std), np.inf))
        return JudgedPlan(planned, np.where(errors < MOST_ERROR * self.fit.problem.layout.nominal, errors, np.inf))

    def name(self, k: int) -> str:
        """A parameter: `scale-factor scale x`."""
        slot = self.fit.problem.layout.slots[k]
        return " ".join(filter(None, (self.fit.model.terms[slot.term].name, slot.parameter.name, slot.axis)))

    @cached_property
    def _plan(self) -> Plan:
        return plan(self.bench, self.sweep, self.settings)

    @cached_property
    def _candidate_table(self) -> Table:
        """Table of the candidates, in no order; all at one time where the model needs a time."""
        columns = _pose_columns(self.candidates)
        if any("t_s" in term.effect.needs for term in self.fit.model.terms):
            columns["t_s"] = np.full(len(self.candidates), self._plan.duration_s / 2)
        return predict_data(self.fit, columns)

    @cached_property
    def _full_scale(self) -> Array:
        """The largest derivative of the output by each parameter within the range, V per its unit, shape (p,)."""
        return np.asarray(np.max(np.abs(self.fit.problem.jacobian(self.fit.theta)), axis=(0, 1)))


def _candidates(standard: Sequence[Pose]) -> Iterator[Pose]:
    """The angles of the sweep and angles between them, from both sides, on its faces."""
    alphas, betas = (_fill_gaps(getattr(pose, name) for pose in standard) for name in ("alpha_deg", "beta_deg"))
    for flip in sorted({pose.flip for pose in standard}):
        for alpha in alphas:
            for beta in (beta for beta in betas if beta < betas[0] + 360):
                yield from (Pose(alpha, beta, direction, flip=flip) for direction in (1, -1))


def _fill_gaps(angles_deg: Iterable[float]) -> list[float]:
    """Angles in order, with others between those that are farther apart than GRID_DEG."""
    angles = sorted(set(angles_deg))
    steps = [(a, b, max(1, round((b - a) / GRID_DEG))) for a, b in pairwise(angles)]
    return [a + (b - a) * k / n for a, b, n in steps for k in range(n)] + angles[-1:]


def _columns(planned: Plan) -> dict[str, Array]:
    """Columns of the planned poses, in order, with their times and dwells."""
    dwell_s = float(planned.settings["dwell_s"])
    columns = _pose_columns([dwell.pose for dwell in planned.held])
    columns["t_s"] = np.array([dwell.start_s + dwell_s / 2 for dwell in planned.held])
    return columns | {"dwell_s": np.full(planned.poses, dwell_s)}


def _pose_columns(poses: Sequence[Pose]) -> dict[str, Array]:
    names = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
    return {name: np.array([float(getattr(pose, name)) for pose in poses]) for name in names}
