"""Components that temperature and time drive: slow noise, thermometer and sensor, warm-up, drift."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from calibrations.effects.kernels import play
from calibrations.effects.logged import leading_temperature, reading_error
from calibrations.free_forms.bases import Play, Settling, StraightLine, Waves, spline
from calibrations.free_forms.chain import State
from calibrations.free_forms.components import GENERAL, PRODUCT, Columns, Component, Make, Starts, free, per_axis
from calibrations.free_forms.form import TURNING_AXES, Factor, Form
from calibrations.free_forms.poses import PoseData
from calibrations.table import Array

WARMING = (0.04, 0.15, 0.6)  # of the record: time constants
AGES = 8  # intervals of the logarithm of the time since the record's beginning
SHORTEST_PART = 1e-3  # the same: shorter ones are over before the second pose
LONGEST_PART = 1.0  # the same: what a longer one would describe is a drift
LEADS_S = (0.0, -90.0, 90.0)  # by which the sensor is ahead of the thermometer
LONG_LEADS_S = (-300.0, 300.0)  # the same at rest, where an oven warms a whole fixture
WAVES, WALK_WAVES = 24, 160  # of slow noise, and of a random walk, whose roughness is never small
PLAYS = (0.05, 0.15, 0.35)  # of the range of temperatures
BRANCHES = (0.02, 0.035, 0.06, 0.1, 0.17, 0.28, 0.45)  # the same: plays that together are a hysteresis of any shape
DRIFT_LINE = "time-bias/line"  # the component of a straight drift
LEAST_CHANGE_G = 0.1  # of the force out of the plane, which is else a bias
OF_LEVEL = (("level", 1.0),)  # constant of an effect that the temperature drives without the scatter of its readings
FEWEST_TIMED, FEWEST_NOISE = 12, 20  # rows that can show a function of time, and slow noise


def slow_noise(data: PoseData, all_frequencies: bool = False) -> list[Component]:
    """Flicker noise of each channel: never a cause, always in the model; `all_frequencies`: of all frequencies."""
    if not data.timed or data.n < FEWEST_NOISE:
        return []
    count = min(WALK_WAVES, data.n // 2) if all_frequencies else min(WAVES, data.n // 6)
    basis = Waves(0.0, 1.0, count, 1.0)(data.elapsed_share)
    components = []
    for k in range(data.channels):
        columns = np.zeros((data.channels, *basis.shape))
        columns[k] = basis
        components.append(
            Component(f"noise/{data.axes[k]}", "noise", "response", columns=_fixed_columns(columns), noise=True)
        )
    return components


def _fixed_columns(columns: Array) -> Columns:
    return lambda _: columns


def _columns_over_rows(basis: Array) -> Columns:
    """A function of the row alone, one for each axis."""
    return per_axis(lambda *_: basis)


def _times_force(basis: Array) -> Columns:
    return per_axis(lambda state, k: state.force[:, k, None] * basis)


def over_temperature(data: PoseData, first: State) -> list[Component]:
    if "temperature_c" not in data.table or np.ptp(data.table.column("temperature_c")) == 0:
        return []
    components: list[Component] = []
    leads = LEADS_S if data.timed else (0.0,)
    if data.timed and data.at_rest:
        leads = (*leads, *LONG_LEADS_S)
    lead_price = 2 * np.log(len(leads))
    factors: tuple[tuple[str, Factor, float], ...] = (
        ("temperature-bias", "", 0.0),
        ("temperature-scale", "force", PRODUCT),
    )
    for place, factor, price in factors:
        for lead in leads:
            form_price = price + lead_price if lead else price
            components.append(_warmer(data, first, f"{place}/{place}@{lead:g}", place, factor, form_price)((lead,)))
        components.append(_curve_over_temperature(data, first, place, factor, price)((0.0,)))
    components += _axes_over_temperature(data, first)
    if data.timed:
        temperature = leading_temperature(data.table, 0.0)
        for part in PLAYS:
            name = f"temperature-bias/temperature-hysteresis@{part}"
            components.append(_make_play(name, temperature)((part * float(np.ptp(temperature)),)))
        widths = tuple(part * float(np.ptp(temperature)) for part in BRANCHES)
        form = Form("temperature-bias", "branches", "temperature", (Play(widths),))
        form_price = {
            "general": True,
            "contains": "temperature-bias",
            "starts": _middle_play(widths),
            "constants": OF_LEVEL,
        }
        components.append(
            free(form, first, "temperature-hysteresis", GENERAL, **form_price)
        )  # after transients: it settles as they do
    return components


def _axes_over_temperature(data: PoseData, first: State) -> list[Component]:
    """Sensing axes that turn in the case with the temperature, each by two angles: a part of the other forces."""
    if data.at_rest:
        return []
    smooth = (spline(leading_temperature(data.table, 0.0), 8, order=1),)  # an adhesive expands in a straight line
    has_inclinations = np.ptp(first.force[:, 2]) > LEAST_CHANGE_G
    factors: tuple[Factor, ...] = ("cross", "out-of-plane") if has_inclinations else ("cross",)
    return [
        free(Form(TURNING_AXES, factor, "temperature", smooth, factor), first, price=GENERAL, general=True)
        for factor in factors
    ]


def _middle_play(widths: tuple[float, ...]) -> Callable[[Array], Starts]:
    """Start value for the fit of one play: the mean of the plays, by their weights."""

    def starts(coefficients: Array) -> Starts:
        weights = np.abs(coefficients.reshape(-1, len(widths))).sum(axis=0)
        return (("play", "", float(weights @ widths / max(float(weights.sum()), np.finfo(float).tiny))),)

    return starts


def _make_play(name: str, temperature: Array) -> Make:
    """A line over the temperature behind a play, K."""

    def at(shape: tuple[float, ...]) -> Component:
        width = abs(shape[0])
        return Component(
            name, "temperature-bias", "response", "temperature-hysteresis", "temperature-bias/play", GENERAL,
            _columns_over_rows(play(temperature, width)[:, None]), contains="temperature-bias",
            shape=shape, step=(0.05 * float(np.ptp(temperature)),), reshaped=_make_play(name, temperature),
            starts=lambda _: (("play", "", width),), constants=OF_LEVEL,
        )  # fmt: skip

    return at


def _warmer(data: PoseData, first: State, name: str, place: str, factor: Factor, price: float) -> Make:
    """A line over the temperature that the thermometer shows some seconds later."""

    def at(shape: tuple[float, ...]) -> Component:
        T = leading_temperature(data.table, shape[0])
        basis = (T - T.mean())[:, None]
        return Component(
            name, place, "response", place, f"{place}/line", price,
            _times_force(basis) if factor else _columns_over_rows(basis),
            shape=shape, step=(30.0,), constants=(("lead_s", shape[0]), *(OF_LEVEL if data.timed else ())),
            reshaped=_warmer(data, first, name, place, factor, price) if data.timed else None,
            error=reading_error(data.table, "temperature_c", lead_s=shape[0]) if data.timed else 0.0,
        )  # fmt: skip

    return at


def _curve_over_temperature(data: PoseData, first: State, place: str, factor: Factor, price: float) -> Make:
    """A curve over the temperature that the thermometer shows some seconds later.

    It has as many columns at any lead: a coarse thermometer shows few values, and its level has many.
    """
    intervals = spline(leading_temperature(data.table, 0.0), 8).intervals

    def at(shape: tuple[float, ...]) -> Component:
        error = reading_error(data.table, "temperature_c", lead_s=shape[0]) if data.timed else 0.0
        smooth = replace(spline(leading_temperature(data.table, shape[0])), intervals=intervals)
        form = Form(place, "curve", "temperature", (smooth,), factor, lead_s=shape[0])
        component = free(form, first, price=price, family=f"{place}/curve", shape=shape, step=(30.0,), error=error)
        return (
            replace(component, reshaped=_curve_over_temperature(data, first, place, factor, price))
            if data.timed
            else component
        )

    return at


def over_time(data: PoseData, first: State) -> list[Component]:
    if not data.timed or data.n < FEWEST_TIMED:
        return []
    t, u = data.table.time_s, data.elapsed_share
    begin, span = float(t.min()), float(np.ptp(t)) or 1.0
    components: list[Component] = []
    places: tuple[tuple[str, Factor, str, str, float], ...] = (
        ("time-bias", "", "warm-up-bias", "bias-drift", 0.0),
        ("time-scale", "force", "warm-up-scale", "", PRODUCT),
    )
    for place, factor, cause, drift, price in places:
        for tau in WARMING:
            name = f"{place}/{cause}@{tau:.3f}"
            price_with_choice = price + 2 * np.log(len(WARMING))
            components.append(_make_warm_up(data.axes, u, span, name, place, cause, price_with_choice, factor)((tau,)))
        line = Form(place, "line", "time", (StraightLine(begin, begin + span),), factor)
        components.append(free(line, first, drift, price))
        components.append(free(Form(place, "curve", "time", (spline(t, 12),), factor), first, price=price))
        settling = Settling(begin, span, span / data.n, AGES)
        components.append(free(Form(place, "settling", "time", (settling,), factor), first, price=price))
        if drift:
            walk = Waves(begin, span, min(WALK_WAVES, data.n // 3), 2.0)
            for k, axis in enumerate(data.axes):
                counts = tuple(walk.count if j == k else 0 for j in range(data.channels))
                components.append(
                    free(
                        Form(place, f"walk-{axis}", "time", (walk,), factor, kept=counts),
                        first,
                        drift,
                        price,
                        general=True,
                    )
                )
    return components


def _make_warm_up(
    axes: Sequence[str], u: Array, span_s: float, name: str, place: str, cause: str, price: float, factor: Factor
) -> Make:
    """An exponential approach by its time constant, as a share of the record."""

    def at(shape: tuple[float, ...]) -> Component:
        part = min(max(shape[0], SHORTEST_PART), LONGEST_PART)
        decay = np.exp(-u / part)[:, None]
        return Component(
            name, place, "response", cause, f"{place}/{cause}", price,
            _times_force(decay) if factor else _columns_over_rows(decay),
            shape=shape, step=(0.2 * shape[0],),
            reshaped=_make_warm_up(axes, u, span_s, name, place, cause, price, factor),
            starts=lambda amplitudes: (
                *(("amplitude", axis, float(a)) for axis, a in zip(axes, amplitudes, strict=True)),
                ("time_constant", "", part * span_s),
            ),
        )  # fmt: skip

    return at
