"""Signals along the chain at given coefficients, and their derivatives (Gauss-Newton).

    stage angles -> specific force -> response of the sensor -> output

The base has bias and three components of sensitivity per axis (scale factor, misalignment and non-orthogonality
together), an offset of alpha, a tilt of the base, and columns of effects that the given model has besides. Components
add to an angle, to the response or to the output. Derivatives are those of the linear part of the chain times the
gain of the output stage: the iteration still ends where the exact residual is balanced by the priors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from calibrations.free_forms.poses import PoseData
from calibrations.geometry.orientation import Pose, specific_force
from calibrations.table import Array

if TYPE_CHECKING:
    from calibrations.free_forms.components import Component

SMALL = 1e-6  # rad, of a numerical derivative
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class State:
    """Signals along the chain. Arrays (n, 3) of forces, else (channels, n)."""

    data: PoseData
    force: Array  # along the sensing axes, g
    reference: Array  # along the reference axes, g
    by_alpha: Array  # d output / d alpha, per rad
    by_beta: Array
    by_tilt: Array  # d output / d tilt about the base's x axis, per rad
    response: Array  # before the output stage
    predicted: Array
    gain: Array  # d predicted / d response: that of a quantiser is far from 1


@dataclass(frozen=True, eq=False)
class ModelEffects:
    """Effects of the given model beyond the base: their contribution, and their columns (channels, n, m)."""

    contribution: Array
    columns: Array

    @staticmethod
    def without_effects(data: PoseData) -> ModelEffects:
        """No effect."""
        shape = data.channels, data.n
        return ModelEffects(np.zeros(shape), np.zeros((*shape, 0)))


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of the base, and of each component by name; those that are zero are left out."""

    base: Array
    of: Mapping[str, Array]


def base_size(data: PoseData, model_effects: ModelEffects) -> int:
    """Number of base columns: bias, three sensitivities per axis, alpha, tilt, beta if remounted, given columns."""
    return own_base_size(data) + int(model_effects.columns.shape[2])


def own_base_size(data: PoseData) -> int:
    """The same without the given model's columns."""
    return 4 * data.channels + 2 + int(data.remounted)


def start(data: PoseData, model_effects: ModelEffects) -> Coefficients:
    """The base fitted to the nominal poses by ordinary least squares; at one orientation a bias alone."""
    zeros = np.zeros(2 + int(data.remounted) + model_effects.columns.shape[2])
    if data.at_rest:
        bias = np.mean(data.outputs - model_effects.contribution, axis=1)
        return Coefficients(np.concatenate([bias, np.zeros(3 * data.channels), zeros]), {})
    a = specific_force(Pose(data.alpha, data.beta, data.mount, data.flip, UP))
    X = np.column_stack([np.ones(data.n), a])
    answer = np.linalg.lstsq(X, (data.outputs - model_effects.contribution).T, rcond=1e-9)[0]  # (4, channels)
    return Coefficients(np.concatenate([answer[0], answer[1:].T.ravel(), zeros]), {})


def state_at(
    data: PoseData, model_effects: ModelEffects, values: Coefficients, components: Sequence[Component]
) -> State:
    """All signals; `components` must hold every component that has a coefficient."""
    c = data.channels
    bias, rows = values.base[:c], values.base[c : 4 * c].reshape(c, 3)
    active = [comp for comp in components if comp.name in values.of and not comp.noise]
    alpha, beta, tilt = _true_angles(data, values, active)

    def at(alpha: Array, beta: Array, tilt: Array) -> Array:
        up = np.stack([0 * tilt, -np.sin(tilt), np.cos(tilt)])
        return specific_force(Pose(alpha, beta, data.mount, data.flip, up))

    a = at(alpha, beta, tilt)
    extra = model_effects.columns @ values.base[own_base_size(data) :]
    linear = rows @ a.T + bias[:, None] + model_effects.contribution + extra
    by_alpha = rows @ (at(alpha + SMALL, beta, tilt) - at(alpha - SMALL, beta, tilt)).T / (2 * SMALL)
    by_beta = rows @ (at(alpha, beta + SMALL, tilt) - at(alpha, beta - SMALL, tilt)).T / (2 * SMALL)
    by_tilt = rows @ (at(alpha, beta, tilt + SMALL) - at(alpha, beta, tilt - SMALL)).T / (2 * SMALL)
    force = a if data.at_rest else a @ _find_sensing_axes(rows).T
    undrifted = State(data, force, a, by_alpha, by_beta, by_tilt, linear, linear, np.ones_like(linear))
    return _with_output(undrifted, _response(undrifted, rows, values, active), values, active)


def _true_angles(data: PoseData, values: Coefficients, active: Sequence[Component]) -> tuple[Array, Array, Array]:
    """Stage angles and tilt of the base with their offsets and errors, rad, shape (n,) each."""
    c = data.channels
    beta0 = values.base[4 * c + 2] if data.remounted else 0.0
    angles = {
        "alpha": data.alpha + values.base[4 * c],
        "beta": data.beta + beta0,
        "tilt": np.full(data.n, values.base[4 * c + 1]),
    }
    for comp in active:
        if comp.angle is not None:
            angles[comp.stage] = angles[comp.stage] + comp.angle @ values.of[comp.name]
    return angles["alpha"], angles["beta"], angles["tilt"]


def _response(undrifted: State, rows: Array, values: Coefficients, active: Sequence[Component]) -> Array:
    """The linear output with the components of the response added, (channels, n).

    A change of the sensitivity multiplies the whole response to the force; a drift also multiplies this change.
    """
    response, of_force = undrifted.response.copy(), np.zeros_like(undrifted.response)
    for comp in active:
        if comp.stage == "response" and not comp.scales:
            part = comp.jacobian(undrifted) @ values.of[comp.name]
            response += part
            of_force += part if comp.of_force else 0.0
    for is_of_force in (True, False):
        changing = [c for c in active if c.stage == "response" and c.scales and c.of_force is is_of_force]
        for k in range(len(response) if changing else 0):
            own_force = undrifted.force.copy()
            own_force[:, k] += of_force[k] / np.linalg.norm(rows[k])
            scaling = replace(undrifted, force=own_force)
            part = sum(comp.jacobian(scaling)[k] @ values.of[comp.name] for comp in changing)
            response[k] += part
            of_force[k] += part if is_of_force else 0.0
    return response


def _with_output(undrifted: State, response: Array, values: Coefficients, active: Sequence[Component]) -> State:
    """The state with the output of a response (channels, n), and the gain of the output stage."""
    converting = [comp for comp in active if comp.stage == "output"]

    def output(response: Array) -> Array:
        unconverted = replace(undrifted, response=response, predicted=response)
        return sum((comp.jacobian(unconverted) @ values.of[comp.name] for comp in converting), response)

    small_step = SMALL * float(np.ptp(response))
    gain = undrifted.gain
    if small_step > 0:
        gain = (output(response + small_step) - output(response - small_step)) / (2 * small_step)
    return replace(undrifted, response=response, predicted=output(response), gain=gain)


def base_jacobian(state: State, model_effects: ModelEffects) -> Array:
    """d output / d base coefficients, (channels, n, p)."""
    data = state.data
    c, n = data.channels, data.n
    jacobian = np.zeros((c, n, base_size(data, model_effects)))
    for k in range(c):
        jacobian[k, :, k] = 1.0
        if not data.at_rest:
            jacobian[k, :, c + 3 * k : c + 3 * k + 3] = state.reference
    jacobian[:, :, 4 * c] = state.by_alpha
    jacobian[:, :, 4 * c + 1] = state.by_tilt
    if data.remounted:
        jacobian[:, :, 4 * c + 2] = state.by_beta
    jacobian *= state.gain[:, :, None]
    jacobian[:, :, own_base_size(data) :] = model_effects.columns
    return jacobian


def _find_sensing_axes(rows: Array) -> Array:
    """Unit vectors of the three sensing axes in the reference frame, (3, 3); unmeasured ones complete the frame."""
    units = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    if len(units) == 3:
        return np.asarray(units)
    if len(units) == 2:
        z = np.cross(units[0], units[1])
        return np.vstack([units, z / np.linalg.norm(z)])
    y = np.cross(UP, units[0])
    y = y / np.linalg.norm(y)
    return np.vstack([units[0], y, np.cross(units[0], y)])
