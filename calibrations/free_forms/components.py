"""A component of the search: a group of columns with one variance, either a free form or the form of an effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibrations.free_forms.bases import Preisach
from calibrations.free_forms.chain import State
from calibrations.free_forms.form import Form
from calibrations.table import Array

PLACES_OF_FORCE = (
    "own-response", "cross-response", "z-response", "scale-over-cross", "scale-over-z", "force", "history",
)  # fmt: skip
SCALING = ("scale-over-cross", "scale-over-z", "temperature-scale", "time-scale")
PRODUCT, GENERAL = 2.0, 8.0  # prices: simple before product before general force
Columns = Callable[[State], Array]  # (channels, n, m)
Starts = tuple[tuple[str, str, float], ...]
Basis = Callable[[State, int], Array]  # (n, m) of one channel


@dataclass(frozen=True, eq=False)
class Component:
    """One group of columns with one variance.

    stage     "alpha", "beta", "tilt" (an angle's error, `angle` (n, m)), "response" or "output" (`columns`)
    cause     the catalogue effect that it is a form of; "" for a free form
    family    components of which one at most acts: one form at several values of its shape
    price     of twice the log-likelihood, above that of the search: products and general forms cost more
    general   whether it can follow almost anything: it is tried once no other component gains
    form      the free form that it is, or that takes the place of the effect's own form
    shape     values in which the columns are not linear; `step` by which they are first changed
    constants by which the catalogue effect is the same function, such as the thermometer's lead
    starts    values of the effect's parameters, (parameter, axis or "" for all, value), from the columns' coefficients
    contains  the effect that its cause becomes where the shape vanishes
    error     relative rms error of what drives it, a column without the scatter of its readings
    """

    name: str
    place: str
    stage: str
    cause: str = ""
    family: str = ""
    price: float = 0.0
    columns: Columns | None = None
    angle: Array | None = None
    noise: bool = False
    general: bool = False
    form: Form | None = None
    shape: tuple[float, ...] = ()
    step: tuple[float, ...] = ()
    reshaped: Callable[[tuple[float, ...]], Component] | None = None
    constants: tuple[tuple[str, float], ...] = ()
    starts: Callable[[Array], Starts] | None = None
    contains: str = ""
    error: float = 0.0

    @property
    def has_loops(self) -> bool:
        """Whether it is a hysteresis whose loops differ from place to place."""
        return self.form is not None and isinstance(self.form.bases[0], Preisach)

    @property
    def of_force(self) -> bool:
        """Whether a drift of the sensitivity multiplies it."""
        return self.form.of_force if self.form is not None else self.place in PLACES_OF_FORCE

    @property
    def scales(self) -> bool:
        """Whether it is a change of the sensitivity."""
        return self.form.scales if self.form is not None else self.place in SCALING

    def jacobian(self, state: State) -> Array:
        """d output / d coefficients, (channels, n, m)."""
        if self.angle is not None:
            by_angle = {"alpha": state.by_alpha, "beta": state.by_beta, "tilt": state.by_tilt}[self.stage]
            return np.asarray((by_angle * state.gain)[:, :, None] * self.angle[None])
        assert self.columns is not None  # noqa: S101 every other component has columns
        return self.columns(state) if self.stage == "output" else self.columns(state) * state.gain[:, :, None]


Make = Callable[[tuple[float, ...]], Component]  # a component of a shape


def per_axis(basis: Basis) -> Columns:
    """Columns of each channel's own function: zero in the other channels."""

    def columns(state: State) -> Array:
        blocks = [basis(state, k) for k in range(state.data.channels)]
        matrices = np.zeros((len(blocks), state.data.n, sum(b.shape[1] for b in blocks)))
        start = 0
        for k, block in enumerate(blocks):
            matrices[k, :, start : start + block.shape[1]] = block
            start += block.shape[1]
        return matrices

    return columns


def free(form: Form, data_state: State, cause: str = "", price: float = 0.0, **options: Any) -> Component:
    """The component of a free form."""
    table = data_state.data.table
    name = f"{form.place}/{form.name}"
    if form.angle:
        no_force = np.zeros((table.n, 3))
        angle = form.columns(table, no_force, no_force[:, 0], 0)
        return Component(name, form.place, form.angle, cause, price=price, angle=angle, form=form, **options)

    def basis(state: State, k: int) -> Array:
        return form.columns(table, state.force, state.response[k], k)

    if form.shared:
        columns: Columns = lambda state: np.stack([basis(state, k) for k in range(state.data.channels)])  # noqa: E731
    else:
        columns = per_axis(basis)
    stage = "output" if form.driver == "output" else "response"
    return Component(name, form.place, stage, cause, price=price, columns=columns, form=form, **options)
