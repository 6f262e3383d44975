"""Inputs of a calibration that no fit can know, and what their errors do to the residual: GUM type B.

Constants of a table give their standard uncertainties; the bench file gives these constants to every run, a
data file has them in its header. A missing constant is unknown, not zero.

    alpha_std_deg, beta_std_deg   true angle of a stage, from its error table or its dial: alike at one angle
    repeat_std_deg                true angle of either stage, from pose to pose: each on its own
    tilt_std_deg                  the base against the vertical, about its x and y (the level; alpha's zero too)
    mount_std_deg                 the sensor's edges against the table, about x, y and z (beta's zero too)
    gravity_std_m_s2              gravity at the place
    gain_std, offset_std_v        the converter: relative, and in V
    temperature_std_c             the thermometer's offset
    rate_std                      speed of the stage of a gyroscope: relative

Gravity counts for values per m/s^2: per local g a scale factor would not depend on it.
Source  JCGM 100 (GUM) 4.3; JCGM 102 for several outputs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from calibrations.effects import Effect, Values
from calibrations.fitting.problem import Problem
from calibrations.geometry.orientation import Pose, rotation
from calibrations.table import Array, Table

Derivative = Callable[[Problem, Array], Array]  # (problem, theta) -> d residual / d input, (channels, n)
Sharing = Callable[[Table], NDArray[np.intp]]  # number of the error that each row has, shape (n,)


@dataclass(frozen=True)
class Contribution:
    """An input with its standard uncertainty `std` in `unit`, None where it is not given.

    Rows of one number by `shared` have one error; those of different numbers are independent. `freedom` as in GUM G.4.
    """

    source: str
    unit: str
    std: float | None
    derivative: Derivative
    shared: Sharing
    freedom: float = np.inf


def one_error(table: Table) -> NDArray[np.intp]:
    """Indices of the errors: one error is common to the whole table."""
    return np.zeros(table.n, dtype=np.intp)


def error_per_row(table: Table) -> NDArray[np.intp]:
    """Every row has its own."""
    return np.arange(table.n)


def error_per_angle(name: str) -> Sharing:
    """Indices of the errors: rows at the same angle share one error."""

    def number(table: Table) -> NDArray[np.intp]:
        angle_deg = np.round(np.mod(table.column(name), 360), 6)
        return np.asarray(np.unique(angle_deg, return_inverse=True)[1].ravel())

    return number


def column_derivative(name: str, step: float) -> Derivative:
    """Derivative with respect to a column of the table, by central differences."""

    def derivative(problem: Problem, theta: Array) -> Array:
        forward, backward = (_shift_input(problem, name, change).residual(theta) for change in (step, -step))
        return (forward - backward) / (2 * step)

    return derivative


def step_derivative(effect: Effect, step: float) -> Derivative:
    """Derivative with respect to the parameter "by" of `effect`, at zero."""

    def derivative(problem: Problem, theta: Array) -> Array:
        steps = problem.layout.steps(theta)
        forward, backward = (
            problem.residual_by([*steps, (effect, Values(by=np.asarray(change)))]) for change in (step, -step)
        )
        return (forward - backward) / (2 * step)

    return derivative


def input_contributions(table: Table) -> tuple[Contribution, ...]:
    """Every input that this kind of table has. Raises DataError for a constant that is not a number."""
    of_kind = {"poses": _of_poses, "rates": _of_rates}.get(table.kind, list)
    contributions = [*_of_any(table), *of_kind()]
    return tuple(replace(c, std=_stated_std(table, constant)) for constant, c in contributions)


def _of_poses() -> list[tuple[str, Contribution]]:
    stages = [(name, column_derivative(f"{name}_deg", 1e-3)) for name in ("alpha", "beta")]
    return [
        *(
            (
                f"{name}_std_deg",
                Contribution(f"true angle of {name}", "deg", None, change, error_per_angle(f"{name}_deg")),
            )
            for name, change in stages
        ),
        *(
            ("repeat_std_deg", Contribution(f"{name} from pose to pose", "deg", None, d, error_per_row))
            for name, d in stages
        ),
        *(("tilt_std_deg", _common(f"level of the base about {axis}", "deg", _tilt(k))) for k, axis in enumerate("xy")),
        *_of_the_mount(),
        (
            "offset_std_v",
            _common("offset of the converter", "V", step_derivative(_Input("output", _add_to_output), 1e-4)),
        ),
    ]


def _of_rates() -> list[tuple[str, Contribution]]:
    return [("rate_std", _common("speed of the stage", "1", _rate_derivative)), *_of_the_mount()]


def _of_the_mount() -> list[tuple[str, Contribution]]:
    return [("mount_std_deg", _common(f"mount about {axis}", "deg", _turn(k))) for k, axis in enumerate("xyz")]


def _rate_derivative(problem: Problem, theta: Array) -> Array:
    """Derivative with respect to the relative error of the stage's reported rate."""
    share = 1e-4
    change = share * problem.table.column("rate_deg_s")
    forward, backward = (_shift_input(problem, "rate_deg_s", by).residual(theta) for by in (change, -change))
    return (forward - backward) / (2 * share)


def _of_any(table: Table) -> list[tuple[str, Contribution]]:
    sources = [("gain_std", _common("gain of the converter", "1", step_derivative(_Input("output", _times), 1e-4)))]
    if table.input_unit == "g":
        stronger = step_derivative(_Input("force", _stronger(table.gravity_m_s2)), 1e-3)
        sources.insert(0, ("gravity_std_m_s2", _common("gravity at the place", "m/s^2", stronger)))
    if "temperature_c" in table:
        sources.append(("temperature_std_c", _common("thermometer", "K", column_derivative("temperature_c", 1e-2))))
    return sources


def _stated_std(table: Table, constant: str) -> float | None:
    return table.number(constant, 0.0) if constant in table.constants else None


def _common(source: str, unit: str, derivative: Derivative) -> Contribution:
    return Contribution(source, unit, None, derivative, one_error)


def _shift_input(problem: Problem, name: str, change: float | Array) -> Problem:
    columns = {**problem.table.columns, name: problem.table.column(name) + change}
    return replace(problem, table=replace(problem.table, columns=MappingProxyType(columns)))


def _tilt(component: int) -> Derivative:
    def lean(pose: Pose, table: Table, p: Values) -> Pose:  # noqa: ARG001 as every effect
        return replace(pose, up=rotation(np.radians(np.eye(3)[component] * p.by)) @ pose.up)

    return step_derivative(_Input("pose", lean), 1e-3)


def _turn(component: int) -> Derivative:
    def turn(a: Array, table: Table, p: Values) -> Array:  # noqa: ARG001
        return a @ rotation(np.radians(np.eye(3)[component] * p.by))

    return step_derivative(_Input("force", turn), 1e-3)


def _stronger(gravity_m_s2: float) -> Callable[..., Array]:
    return lambda a, table, p: a * (1 + p.by / gravity_m_s2)  # noqa: ARG005


def _times(v: Array, table: Table, p: Values) -> Array:  # noqa: ARG001
    return v * (1 + p.by)


def _add_to_output(v: Array, table: Table, p: Values) -> Array:  # noqa: ARG001
    return v + p.by


class _Input(Effect):
    """input: the error of an input acts at one place of the signal chain, as an effect does."""

    def __init__(self, place: str, change: Callable[..., object]) -> None:
        self.places = frozenset({place})
        setattr(self, place, change)
