"""What a compensation does not know costs, over a simulated sweep: effects left out, an axis that is not measured,
and the uncertainties of its parameters.

The sweep holds the sensor in gravity alone, with every effect of the model but those of the rig, at angles approached
from both sides, while temperature, supply and what a user added go up and down over their stated ranges.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibrations.chain import Step, nominal_pose, respond, sensed, specific_force
from calibrations.compensation.forward import FORCES, INVERTED, Forward, steps_of
from calibrations.compensation.memory import memory_at
from calibrations.compensation.program import Program
from calibrations.compensation.uncertainty import Span, Uncertainty, uncertainty
from calibrations.errors import CalibrationError
from calibrations.model import Model
from calibrations.table import Array, Table

INCLINATIONS_DEG = (90, 30, 150, 60, 120, 10, 170)
STEP_DEG = 15.0
PASSES = 3  # by which the axis that is not measured is found in gravity


@dataclass(frozen=True)
class Size:
    """An error's root mean square and greatest magnitude over the sweep, worst axis."""

    rms: float
    most: float


@dataclass(frozen=True)
class Cost:
    """`left_out` by effect, None where a sweep does not show it; `out_of_gravity` of an axis found from the others;
    `parameters` the standard uncertainty of what is sensed by those of the parameters.
    """

    left_out: Mapping[str, Size | None]
    out_of_gravity: Size | None
    parameters: Uncertainty | None


def costs(model: Model, forward: Forward, program: Program, reach: float, unit: str, spans: Mapping[str, Span]) -> Cost:
    """All costs of a compensation, in `unit`; `spans` has the stated ranges of what is given beside the outputs."""
    table = _sweep(model, spans)
    a = specific_force(nominal_pose(table)) * (1.0 if unit != "deg/s" else reach)
    fates = {fate.effect: fate.how for fate in forward.fates}
    followed = [step for step in steps_of(model) if fates[step[0].name] == INVERTED]
    trial = _Trial(forward, program, table, a, memory_at(table, sensed(a, table, followed), forward))
    names = {effect.name for effect, _ in followed}
    kept = replace(model, terms=tuple(term for term in model.terms if term.name in names))
    hidden = unit == "g" and len(forward.axes) == 2 and "az" in program.inputs
    return Cost(
        {name: _of_left_out(name, model, followed, trial) for name in forward.left_out},
        _of_gravity(followed, trial) if hidden else None,
        uncertainty(kept, forward, table, a, {name: spans[name] for name in program.inputs if name in spans}, reach),
    )


@dataclass(frozen=True)
class _Trial:
    """A sweep on which the program is tried: its specific force `a` (n, 3), and what is remembered at each row."""

    forward: Forward
    program: Program
    table: Table
    a: Array
    memory: Mapping[str, Array]

    def inputs(self, steps: Sequence[Step]) -> dict[str, Array]:
        """Of the program, for a sensor of these steps."""
        v = respond(sensed(self.a, self.table, steps), self.table, steps)
        known = {f"v{axis}": v[:, k] for k, axis in enumerate("xyz")}
        known |= {name: self.a[:, k] for k, name in enumerate(FORCES)}
        columns = {name: known[name] if name in known else self.table.column(name) for name in self.program.inputs}
        return columns | dict(self.memory)

    def size(self, found: Mapping[str, Array]) -> Size:
        """By how much what was found is wrong."""
        return _size(np.column_stack([found[f"a{x}"] - self.a[:, "xyz".index(x)] for x in self.forward.axes]))


def in_gravity(program: Program, inputs: Mapping[str, Array], side: Array) -> dict[str, Array]:
    """What the program finds where only gravity acts and z is not measured: |a| = 1, z on the `side` +1 or -1.

    Source  Ang (5)-(7), with the model in place of the linear estimate. Fixed passes, as the written sources do.
    """
    found = program.run({**inputs, "az": np.zeros(np.shape(side))})
    for _ in range(PASSES):
        az = side * np.sqrt(np.maximum(0.0, 1 - found["ax"] ** 2 - found["ay"] ** 2))
        found = program.run({**inputs, "az": az})
    return found


def _sweep(model: Model, spans: Mapping[str, Span]) -> Table:
    """A table of poses: a turn each way at each inclination, 7 s a pose, all else but the time over its range."""
    up = np.arange(0.0, 360.0 + STEP_DEG / 2, STEP_DEG)
    alpha = np.repeat(np.array(INCLINATIONS_DEG, float), 2 * len(up))
    beta = np.tile(np.concatenate([up, up[::-1]]), len(INCLINATIONS_DEG))
    n = len(alpha)
    wave = np.sin(np.linspace(0, 4 * np.pi, n))
    at = {name: value for term in model.terms for name, value in term.constants.items()}
    columns = {
        "alpha_deg": alpha,
        "beta_deg": beta,
        "direction": np.tile(np.repeat([1.0, -1.0], len(up)), len(INCLINATIONS_DEG)),
        "t_s": at.get("middle_s", 0.0) + 7.0 * (np.arange(n) - n / 2) + 3.5 * n * ("middle_s" not in at),
        "vx_v": np.zeros(n),
    }
    columns |= {
        name: (low + high) / 2 + (high - low) / 2 * wave for name, (low, high) in spans.items() if name not in columns
    }
    return Table.from_columns("poses", columns, source="a simulated sweep")


def _size(errors: Array) -> Size:
    return Size(float(np.sqrt(np.mean(errors**2, axis=0)).max()), float(np.abs(errors).max()))


def _of_left_out(name: str, model: Model, followed: Sequence[Step], trial: _Trial) -> Size | None:
    """By the whole model with this effect, compensated without it."""
    steps = [s for s in steps_of(model) if s[0].name == name or any(s[0] is other[0] for other in followed)]
    try:
        inputs = trial.inputs(steps)
    except CalibrationError:  # it needs what no sweep has, such as a motion
        return None
    return trial.size(trial.program.run(inputs))


def _of_gravity(followed: Sequence[Step], trial: _Trial) -> Size:
    side = np.where(trial.a[:, 2] < 0, -1.0, 1.0)
    return trial.size(in_gravity(trial.program, trial.inputs(followed), side))
