"""Errors of rigs by the sensors that they measured, and tables with the true angles by these errors.

A sensor at rest senses only the direction of gravity. So each error of the pose, also the tilt of the base, is a change
of alpha and beta.

The data of one sensor cannot separate its misalignment from its stage's zero offset. An error common to all sensors of
one rig is the rig's. Over a fleet, parameter j of an effect on the pose, by sensor i of batch b on rig r, is

    y_i = beta_b + rho_r + e_i        var e_i = tau^2 + v_i

tau^2 is the variance between sensors of one batch on one rig (Paule and Mandel). The assignment of sensors to rigs
is assumed to be random. rho is tested by F (Knapp and Hartung, 2003). The values of the rigs for the strongest effect
are subtracted, and the search continues.

The data cannot separate an error common to all rigs from one of the sensors' design, nor an error of a rig from one of
a batch if each batch was on one rig. Errors are therefore relative to the median of the rigs that batches connect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtr

from calibrations.criteria import FAR_SENSOR, FEWEST_SENSORS_PER_RIG, SIGNIFICANT
from calibrations.effects import Effect, Values
from calibrations.estimators.least_squares import between_variance, shortest_solution
from calibrations.fleet.look import StageScore
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.means.noise import robust_std
from calibrations.table import Array, Table

StageErrors = Mapping[str, Mapping[str, float]]  # effect -> parameter -> value


def correct_stage_errors(table: Table, errors: StageErrors, effects: Mapping[str, Effect]) -> Table:
    """`table` at the poses that its stages truly took, given the parameters of effects on the pose; any other as is."""
    if not errors or not table.type.stage_angles:
        return table
    table = table.in_order()
    pose = nominal_pose(table)
    for name, values in errors.items():
        effect = effects[name]
        parameters = Values.of({p.name: values.get(p.name, 0.0) for p in effect.parameters})
        pose = effect.pose(pose, table, parameters)
    gravity = specific_force(replace(pose, mount=np.zeros(table.n), flip=np.zeros(table.n)))
    columns = dict(table.columns)
    columns["alpha_deg"] = np.degrees(np.arctan2(np.hypot(gravity[:, 0], gravity[:, 1]), gravity[:, 2]))
    columns["beta_deg"] = np.degrees(np.arctan2(gravity[:, 1], gravity[:, 0]))
    return replace(table, columns=MappingProxyType(columns))


LEAST_INFORMATION = 1e-8  # share of an information matrix: less is not known


@dataclass(frozen=True)
class Measured:
    """A sensor's contribution: its rig, its batch, and its information on the stage."""

    batch: str
    rig: str
    stage: StageScore


@dataclass(frozen=True)
class RigError:
    """One parameter of one rig's error: value and standard uncertainty against the median of the rigs, in `unit`.

    `p_value` is that of the effect, over all rigs and the whole search; `sensors` measured there.
    """

    rig: str
    effect: str
    parameter: str
    unit: str
    value: float
    std: float
    p_value: float
    sensors: int
    beyond: bool  # whether this rig's own value is more than chance


@dataclass(frozen=True)
class _Found:
    """The values of one effect on every rig, and the reduction of the sums of squares of all sensors."""

    errors: tuple[RigError, ...] = ()
    fall: float = 0.0

    @property
    def p_value(self) -> float:
        return self.errors[0].p_value if self.errors else 1.0


def find_rig_errors(fleet: Sequence[Measured]) -> list[RigError]:
    """The errors of rigs that the fleet shows, effect by effect in the order found; none where no two are connected."""
    names = next((measured.stage.names for measured in fleet if measured.stage.names), ())
    fleet = [measured for measured in fleet if measured.stage.names == names]
    effects = list(dict.fromkeys(effect for effect, *_ in names))
    corrections = {rig: np.zeros(len(names)) for rig in {measured.rig for measured in fleet}}
    errors: list[RigError] = []
    while effects and fleet:
        results = {effect: _effect(fleet, names, effect, corrections) for effect in effects}
        significant = [
            e for e, result in results.items() if result.p_value * len(effects) < SIGNIFICANT and result.fall > 0
        ]
        if not significant:
            break
        best = max(significant, key=lambda effect: results[effect].fall)
        errors += results[best].errors
        for error in results[best].errors:
            if error.beyond:
                corrections[error.rig][_place(names, error.effect, error.parameter)] = error.value
        effects.remove(best)
    return errors


def find_unconnected_rigs(fleet: Sequence[Measured]) -> list[tuple[str, ...]]:
    """Groups of rigs between which no batch connects; one group where all can be compared."""
    groups: list[set[str]] = []
    for batch in dict.fromkeys(measured.batch for measured in fleet):
        rigs = {measured.rig for measured in fleet if measured.batch == batch}
        connected = [group for group in groups if group & rigs]
        groups = [group for group in groups if not group & rigs] + [rigs.union(*connected)]
    return [tuple(sorted(group)) for group in groups]


def _place(names: Sequence[tuple[str, str, str]], effect: str, parameter: str) -> int:
    return next(k for k, (e, p, _) in enumerate(names) if (e, p) == (effect, parameter))


def _effect(
    fleet: Sequence[Measured], names: Sequence[tuple[str, str, str]], effect: str, corrections: Mapping[str, Array]
) -> _Found:
    """The errors of one effect, of every rig, after the corrections made already."""
    own_rows = [k for k, name in enumerate(names) if name[0] == effect]
    own = [e for measured in fleet if (e := _own_estimate(measured, own_rows, corrections[measured.rig])) is not None]
    if not own:
        return _Found()
    sensors = [e.measured for e in own]
    # the residual falls as the prediction grows
    y, v = np.array([-e.inverse @ e.score for e in own]), np.array([np.diag(e.inverse) for e in own])
    errors_of_parameters = [_parameter(sensors, y[:, j], v[:, j], names[k]) for j, k in enumerate(own_rows)]
    p_values = [error.p_value for rig_errors in errors_of_parameters for error in rig_errors]
    least = min(len(own_rows) * min(p_values, default=1.0), 1.0)
    errors = tuple(replace(error, p_value=least) for rig_errors in errors_of_parameters for error in rig_errors)
    off = {rig: np.zeros(len(own_rows)) for rig in corrections}
    for error in errors:
        if error.beyond:
            off[error.rig][[names[k][1] for k in own_rows].index(error.parameter)] = error.value
    return _Found(errors, sum(e.fall(off[e.measured.rig]) for e in own))


@dataclass(frozen=True)
class _OwnEstimate:
    """The score and the information of one sensor on the parameters of one effect, shapes (p,) and (p, p)."""

    measured: Measured
    score: Array
    information: Array
    inverse: Array

    def fall(self, off: Array) -> float:
        """The fall of the sum of squares when the parameters are corrected by `off`."""
        return float(-2 * self.score @ off - off @ self.information @ off)


def _own_estimate(measured: Measured, own_rows: list[int], corrections: Array) -> _OwnEstimate | None:
    """The estimate after the corrections of its rig; None if the sensor does not determine the parameters."""
    A = measured.stage.information
    information = A[own_rows][:, own_rows]
    size = np.diag(information)
    if not np.all(size > 0) or np.linalg.cond(information / np.sqrt(np.outer(size, size))) > 1 / LEAST_INFORMATION:
        return None
    score = measured.stage.score[own_rows] + A[own_rows] @ corrections
    return _OwnEstimate(measured, score, information, np.linalg.inv(information).astype(float))


def _parameter(sensors: Sequence[Measured], y: Array, v: Array, name: tuple[str, str, str]) -> list[RigError]:
    """One parameter of every rig; nothing where the rigs cannot be compared."""
    is_consistent = ~_are_far(sensors, y, v)
    sensors = [measured for measured, is_alike in zip(sensors, is_consistent, strict=True) if is_alike]
    y, v = y[is_consistent], v[is_consistent]
    batches, rigs = sorted({measured.batch for measured in sensors}), sorted({measured.rig for measured in sensors})
    of_batch = np.array([[measured.batch == batch for batch in batches] for measured in sensors], dtype=float)
    design = np.hstack(
        [of_batch, np.array([[measured.rig == rig for rig in rigs] for measured in sensors], dtype=float)]
    )
    rig_rank = int(np.linalg.matrix_rank(design)) - len(batches)
    free = len(y) - len(batches) - rig_rank
    if rig_rank <= 0 or free < FEWEST_SENSORS_PER_RIG:
        return []
    total = v + between_variance(design, y, v, free)
    solution = shortest_solution(design, y, total)
    theta, scale = solution.values, max(1.0, solution.square / free)
    f = (shortest_solution(of_batch, y, total).square - solution.square) / rig_rank / scale
    p_value = float(fdtrc(rig_rank, free, max(f, 0.0)))
    errors = []
    for group in find_unconnected_rigs(sensors):
        places = [len(batches) + rigs.index(rig) for rig in group]
        middle = _middle(theta[places])
        for k, rig in enumerate(group if len(group) > 1 else ()):
            contrast = np.zeros(len(theta))
            contrast[places] = np.eye(len(group))[k] - middle
            value, std = float(contrast @ theta), float(np.sqrt(scale * contrast @ solution.covariance @ contrast))
            significant = std > 0 and 2 * float(stdtr(free, -abs(value) / std)) * len(rigs) < SIGNIFICANT
            count = sum(measured.rig == rig for measured in sensors)
            errors.append(RigError(rig, name[0], name[1], name[2], value, std, p_value, count, significant))
    return errors


def _middle(values: Array) -> Array:
    """Weights (n,) that make the median of `values`."""
    order, n = np.argsort(values), len(values)
    weights = np.zeros(n)
    weights[order[(n - 1) // 2]] += 0.5
    weights[order[n // 2]] += 0.5
    return weights


def _are_far(sensors: Sequence[Measured], y: Array, v: Array) -> NDArray[np.bool_]:
    """Sensors far off the others of their batch on their rig, (n,)."""
    far = np.zeros(len(y), dtype=bool)
    places: dict[tuple[str, str], list[int]] = {}
    for k, sensor in enumerate(sensors):
        places.setdefault((sensor.batch, sensor.rig), []).append(k)
    for members in map(np.array, places.values()):
        off = np.abs(y[members] - np.median(y[members]))
        far[members] = off > FAR_SENSOR * np.sqrt(robust_std(off) ** 2 + v[members])
    return far
