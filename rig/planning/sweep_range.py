"""The range of a sweep for a model: candidates for its poses, and what a fit to the poses of a plan will know.

The range is that of a sweep: its inclinations and what lies between them, its turn of beta, both directions, the faces
that it has. A plan is judged by the standard error of each parameter as what it does to the output where it does most:
only so can volts be set beside degrees. The greatest of them is the worst standard error.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrations.chain import nominal_pose, specific_force
from calibrations.design.assumed import assumed
from calibrations.design.foreseen import foreseen
from calibrations.design.information import covariance_of, information
from calibrations.design.optimal_design import scaled
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.problem import Problem
from calibrations.search.unseen import MARK
from calibrations.table import AXES, Array, Table
from procedures.catalogue import Procedure
from procedures.session import Pose
from rig.bench import Bench
from rig.planning.plan import Plan, plan

GRID_DEG = 15.0
SIDE = 0.2  # how far the two directions of one pose count as apart, beside distances of gravity in g


@dataclass(frozen=True)
class Judged:
    """A plan, and what a fit to its poses will know: `errors` (p,), V at full scale, infinite where it cannot tell."""

    plan: Plan
    errors: Array

    @property
    def dwell_s(self) -> float:
        """Of each pose."""
        return float(self.plan.settings["dwell_s"])

    @property
    def told(self) -> NDArray[np.bool_]:
        """Mask of the parameters that it tells, shape (p,)."""
        return np.isfinite(self.errors)

    @property
    def poses(self) -> tuple[Pose, ...]:
        """All, in order."""
        return tuple(held.pose for held in self.plan.held)


@dataclass(frozen=True)
class Range:
    """That of the sweep with `settings` on a bench, for `model`."""

    bench: Bench
    sweep: Procedure
    settings: Mapping[str, Any]
    model: Model

    @cached_property
    def standard(self) -> Judged:
        """The sweep itself."""
        return self.judged(self.settings)

    @cached_property
    def fit(self) -> Fit:
        """The model as if it had been fitted to the sweep."""
        rate_hz = self.bench.instruments["adc"].typed_settings().rate_hz
        constants = self.bench.constants | {"sample_rate_hz": rate_hz}
        return assumed(self.model, _columns(self._plan), constants, self.axes)

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """Measured on the bench; those of any sensor of a batch."""
        names = {name.rpartition(".")[2] for name in self.bench.channels}
        return tuple(axis for axis in AXES if f"v{axis}" in names) or AXES[:2]

    @cached_property
    def candidates(self) -> list[Pose]:
        """Poses to choose from."""
        return list(_candidates([held.pose for held in self._plan.held]))

    @cached_property
    def white(self) -> Array:
        """Information of the candidates, scaled, shape (candidates, axes, p)."""
        rows = information(self.fit, self._foreseen)
        return scaled(rows.reshape(len(self.axes), len(self.candidates), -1).transpose(1, 0, 2))

    @property
    def places(self) -> Array:
        """Where the candidates are, for distances: gravity in the sensor's frame, and the side of the approach."""
        table = self._foreseen
        return np.column_stack([specific_force(nominal_pose(table)), SIDE * table.column("direction")])

    def judged(self, settings: Mapping[str, Any]) -> Judged:
        """The sweep with other settings; check poses tell its fit nothing. Raises what a plan raises."""
        planned = plan(self.bench, self.sweep, settings)
        seen = replace(planned, held=tuple(held for held in planned.held if not held.pose.path.startswith(MARK)))
        rows = information(self.fit, foreseen(self.fit, _columns(seen)))
        std = np.sqrt(np.diag(covariance_of(rows)))
        unknown = np.full(len(std), np.inf)
        return Judged(planned, np.multiply(std, self._full_scale, where=np.isfinite(std), out=unknown))

    def name(self, k: int) -> str:
        """A parameter: `scale-factor scale x`."""
        slot = self.fit.problem.layout.slots[k]
        return " ".join(filter(None, (self.fit.model.terms[slot.term].name, slot.parameter.name, slot.axis)))

    @cached_property
    def _plan(self) -> Plan:
        return plan(self.bench, self.sweep, self.settings)

    @cached_property
    def _foreseen(self) -> Table:
        """Of the candidates, in no order; at one time where the model needs a time."""
        columns = _of_poses(self.candidates)
        if any("t_s" in term.effect.needs for term in self.fit.model.terms):
            columns["t_s"] = np.full(len(self.candidates), self._plan.duration_s / 2)
        return foreseen(self.fit, columns)

    @cached_property
    def _full_scale(self) -> Array:
        """The most that a parameter does to the output within the range, V over its unit, shape (p,)."""
        problem = Problem(self.fit.table, self.fit.problem.layout)
        return np.asarray(np.max(np.abs(problem.jacobian(self.fit.theta)), axis=(0, 1)))


def _candidates(standard: Sequence[Pose]) -> Iterator[Pose]:
    """The sweep's own angles and what lies between them, from both sides, on its faces."""
    alphas, betas = (_filled(getattr(pose, name) for pose in standard) for name in ("alpha_deg", "beta_deg"))
    for flip in sorted({pose.flip for pose in standard}):
        for alpha in alphas:
            for beta in (beta for beta in betas if beta < betas[0] + 360):
                yield from (Pose(alpha, beta, direction, flip=flip) for direction in (1, -1))


def _filled(angles_deg: Iterable[float]) -> list[float]:
    """Angles in order, with others between those that are farther apart than GRID_DEG."""
    known = sorted(set(angles_deg))
    steps = [(a, b, max(1, round((b - a) / GRID_DEG))) for a, b in pairwise(known)]
    return [a + (b - a) * k / n for a, b, n in steps for k in range(n)] + known[-1:]


def _columns(planned: Plan) -> dict[str, Array]:
    """Of the poses that a plan holds, in order, with their times and dwells."""
    dwell_s = float(planned.settings["dwell_s"])
    columns = _of_poses([held.pose for held in planned.held])
    columns["t_s"] = np.array([held.start_s + dwell_s / 2 for held in planned.held])
    return columns | {"dwell_s": np.full(planned.poses, dwell_s)}


def _of_poses(poses: Sequence[Pose]) -> dict[str, Array]:
    names = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
    return {name: np.array([float(getattr(pose, name)) for pose in poses]) for name in names}
