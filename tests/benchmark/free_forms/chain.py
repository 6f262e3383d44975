"""The signal chain with free forms at its places, its output, and its derivatives (Gauss-Newton).

    stage angles -> specific force -> response of the sensor -> output

The base model is bias and three components of sensitivity per axis (scale factor, misalignment and
non-orthogonality together), an offset of alpha and a tilt of the base. Free forms add to an angle, to the response or
to the output. Derivatives are those of the linear part of the chain: the iteration still ends where the exact residual
is balanced by the priors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmark.free_forms.measurement import Array, Measurement, specific_force

SMALL = 1e-6  # rad, of a numerical derivative


@dataclass(frozen=True, eq=False)
class State:
    """Signals along the chain at given parameters. Arrays (n, ..) or (channels, n)."""

    data: Measurement
    force: Array  # along the sensing axes, g, (n, 3)
    reference: Array  # along the reference axes, g, (n, 3)
    by_alpha: Array  # d output / d alpha, per rad, (channels, n)
    by_beta: Array
    by_tilt: Array  # d output / d tilt about the base's x axis, per rad
    response: Array  # before the output stage, (channels, n)
    predicted: Array  # (channels, n)


Columns = Callable[[State], Array]  # (channels, n, m)
Angle = Callable[[Measurement], Array]  # (n, m)


@dataclass(frozen=True, eq=False)
class Component:
    """One group of columns with one variance: a catalogue form or a curve at a place.

    stage     "alpha", "beta" (an angle's error, `angle`), "response" or "output" (`columns`)
    cause     the catalogue effect that it is a form of; "" for a curve
    family    components of which one at most acts: one form at several values of its shape
    price     of twice the log-likelihood, above that of the search: products and general forms cost more
    """

    name: str
    place: str
    stage: str
    cause: str = ""
    family: str = ""
    price: float = 0.0
    columns: Columns | None = None
    angle: Angle | None = None
    noise: bool = False
    shape: tuple[float, ...] = ()  # values in which the columns are not linear
    step: tuple[float, ...] = ()  # by which they are first changed
    reshaped: Callable[[tuple[float, ...]], Component] | None = None

    def jacobian(self, state: State) -> Array:
        """d output / d coefficients, (channels, n, m)."""
        if self.angle is not None:
            by = state.by_alpha if self.stage == "alpha" else state.by_beta
            return np.asarray(by[:, :, None] * self.angle(state.data)[None])
        assert self.columns is not None
        return self.columns(state)


@dataclass(frozen=True, eq=False)
class Values:
    """Coefficients: of the base (`base`) and of each component by name, those that are zero left out."""

    base: Array
    of: Mapping[str, Array]


def base_size(data: Measurement) -> int:
    """Number of base parameters: bias, three sensitivities per axis, alpha offset, tilt, beta offset if mounted."""
    return 4 * data.channels + 2 + int(mounted(data))


def mounted(data: Measurement) -> bool:
    """Whether the sensor was mounted in several ways, so that an offset of beta is no turn of the sensor about z."""
    return bool(np.ptp(data.flip) > 0 or np.ptp(data.mount) > 0)


def start(data: Measurement) -> Values:
    """The base fitted to the nominal poses by ordinary least squares."""
    a = specific_force(data.alpha, data.beta + data.mount, data.flip, np.array([0.0, 0.0, 1.0]))
    X = np.column_stack([np.ones(data.n), a])
    answer = np.linalg.lstsq(X, data.outputs.T, rcond=1e-9)[0]  # (4, channels)
    return Values(np.concatenate([answer[0], answer[1:].T.ravel(), np.zeros(2 + int(mounted(data)))]), {})


def state_at(data: Measurement, values: Values, components: Sequence[Component]) -> State:
    """All signals at these values; `components` must hold every component that has a coefficient."""
    c = data.channels
    bias, rows = values.base[:c], values.base[c : 4 * c].reshape(c, 3)
    alpha0, tilt = values.base[4 * c : 4 * c + 2]
    beta0 = values.base[4 * c + 2] if mounted(data) else 0.0
    active = [comp for comp in components if comp.name in values.of and not comp.noise]
    alpha, beta = data.alpha + alpha0, data.beta + data.mount + beta0
    for comp in active:
        if comp.angle is not None:
            error = comp.angle(data) @ values.of[comp.name]
            alpha, beta = (alpha + error, beta) if comp.stage == "alpha" else (alpha, beta + error)

    def at(alpha: Array, beta: Array, tilt: float) -> Array:
        return specific_force(alpha, beta, data.flip, np.array([0.0, -np.sin(tilt), np.cos(tilt)]))

    a = at(alpha, beta, tilt)
    linear = rows @ a.T + bias[:, None]
    by_alpha = rows @ (at(alpha + SMALL, beta, tilt) - at(alpha - SMALL, beta, tilt)).T / (2 * SMALL)
    by_beta = rows @ (at(alpha, beta + SMALL, tilt) - at(alpha, beta - SMALL, tilt)).T / (2 * SMALL)
    by_tilt = rows @ (at(alpha, beta, tilt + SMALL) - at(alpha, beta, tilt - SMALL)).T / (2 * SMALL)
    force = a @ _sensing(rows).T
    bare = State(data, force, a, by_alpha, by_beta, by_tilt, linear, linear)
    response = linear.copy()
    for comp in active:
        if comp.stage == "response":
            response += comp.jacobian(bare) @ values.of[comp.name]
    before = State(data, force, a, by_alpha, by_beta, by_tilt, response, response)
    predicted = response.copy()
    for comp in active:
        if comp.stage == "output":
            predicted += comp.jacobian(before) @ values.of[comp.name]
    return State(data, force, a, by_alpha, by_beta, by_tilt, response, predicted)


def base_jacobian(state: State) -> Array:
    """d output / d base parameters, (channels, n, p)."""
    data = state.data
    c, n = data.channels, data.n
    out = np.zeros((c, n, base_size(data)))
    for k in range(c):
        out[k, :, k] = 1.0
        out[k, :, c + 3 * k : c + 3 * k + 3] = state.reference
    out[:, :, 4 * c] = state.by_alpha
    out[:, :, 4 * c + 1] = state.by_tilt
    if mounted(data):
        out[:, :, 4 * c + 2] = state.by_beta
    return out


def _sensing(rows: Array) -> Array:
    """Unit vectors of the three sensing axes in the reference frame, (3, 3); unmeasured ones complete the frame."""
    units = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    if len(units) == 3:
        return np.asarray(units)
    if len(units) == 2:
        z = np.cross(units[0], units[1])
        return np.vstack([units, z / np.linalg.norm(z)])
    y = np.cross(np.array([0.0, 0.0, 1.0]), units[0])
    y = y / np.linalg.norm(y)
    return np.vstack([units[0], y, np.cross(units[0], y)])
