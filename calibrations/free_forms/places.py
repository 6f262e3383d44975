"""The components that can act at each place of the signal chain: free forms and forms of catalogue effects.

Every component is normalised to unit rms at the start of a search, so that a variance is the mean square of what it
adds to the output. Constant and linear parts over the forces are in the base (`chain`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calibrations.effects.kernels import play
from calibrations.effects.thermometer import leading_temperature
from calibrations.free_forms.bases import Clips, Harmonics, Line, Play, Preisach, Products, Ramp, Settling, Waves, spline
from calibrations.free_forms.chain import State
from calibrations.free_forms.components import Basis, Columns, Component, Starts, free, per_axis
from calibrations.free_forms.form import CROSS, Factor, Form
from calibrations.free_forms.place_names import acts_at_rest
from calibrations.free_forms.poses import LOGGED_DEG, SIDES, PoseData
from calibrations.geometry.orientation import out_of_plane
from calibrations.geometry.stage_path import AS_STATED
from calibrations.table import Array

PRODUCT, GENERAL = 2.0, 8.0  # prices: simple before product before general force
WIDTHS_G = tuple(np.geomspace(0.01, 1.8, 14).tolist())  # of slip elements
LOOPS_G = (0.02, 0.06, 0.15, 0.35, 0.8)  # half widths of the loops of a Preisach hysteresis
LOOP_INTERVALS = 8
DEAD_G = (0.003, 0.012, 0.05)
THRESHOLDS_G = tuple(np.geomspace(0.002, 0.2, 8).tolist())  # of dead zones that are not all of one width
ENDS = (0.75, 0.9, 0.97, 0.99)  # of an axis's range, where saturation begins
WARMING = (0.04, 0.15, 0.6)  # of the record: time constants
AGES = 8  # intervals of the logarithm of the time since the record's beginning
SHORTEST_PART = 1e-3  # the same: shorter ones are over before the second pose
LEADS_S = (0.0, -90.0, 90.0)  # by which the sensor is ahead of the thermometer
LONG_LEADS_S = (-300.0, 300.0)  # the same at rest, where an oven warms a whole fixture
WAVES, WALK_WAVES = 24, 160  # of slow noise, and of a random walk, whose roughness is never small
DEGREE = 4  # of a general function of the force's direction
PLAYS = (0.05, 0.15, 0.35)  # of the range of temperatures
BRANCHES = (0.02, 0.035, 0.06, 0.1, 0.17, 0.28, 0.45)  # the same: plays that together are a hysteresis of any shape
FEWEST_TIMED, FEWEST_NOISE = 12, 20  # rows that can show a function of time, and slow noise
FEWEST_ANGLES, FINE_ANGLES = 8, 33  # different angles beta that can show harmonics, and fine ones
FEWEST_INCLINATIONS = 4

Make = Callable[[tuple[float, ...]], Component]


def components(data: PoseData, first: State) -> list[Component]:
    """Every component that this table can show, but those at places that the search leaves out.

    At one orientation nothing over the force can be known, nor a scale factor over anything else.
    """
    every = [
        *_slow_noise(data),
        *_stages(data, first),
        *_own(data, first),
        *_other_axes(data, first),
        *_history(data, first),
        *_temperature(data, first),
        *_time(data, first),
        *_output(data, first),
        *_columns(data, first),
        *_general(first),
    ]
    if data.at_rest:
        every = [c for c in every if c.noise or (acts_at_rest(c.place) and not c.scales)]
    return [c for c in every if c.place not in data.table.left_out]


def _slow_noise(data: PoseData) -> list[Component]:
    """Flicker noise of each channel: never a cause, always in the model."""
    if not data.timed or data.n < FEWEST_NOISE:
        return []
    basis = Waves(0.0, 1.0, min(WAVES, data.n // 6), 1.0)(data.since)
    out = []
    for k in range(data.channels):
        columns = np.zeros((data.channels, *basis.shape))
        columns[k] = basis
        out.append(Component(f"noise/{data.axes[k]}", "noise", "response", columns=_fixed(columns), noise=True))
    return out


def _fixed(columns: Array) -> Columns:
    return lambda _: columns


def _timed(basis: Array) -> Columns:
    """A function of the row alone, for each axis one."""
    return per_axis(lambda *_: basis)


def _times_force(basis: Array) -> Columns:
    return per_axis(lambda state, k: state.force[:, k, None] * basis)


def _stages(data: PoseData, first: State) -> list[Component]:
    found: list[Component] = []
    place = "stage-angle-beta"
    angles = len(np.unique(np.round(np.mod(data.beta, 2 * np.pi), 3)))
    if angles > FEWEST_ANGLES:
        eccentricity = Harmonics(1, 1)(data.beta)
        found.append(Component(f"{place}/stage-eccentricity", place, "beta", "stage-eccentricity", angle=eccentricity))
        found.append(free(Form(place, "curve", "beta", (Harmonics(2, 9),), shared=True), first))
        if angles > FINE_ANGLES:
            fine = Form(place, "fine", "beta", (Harmonics(4, 16, power=0.0),), shared=True)
            found.append(free(fine, first, price=PRODUCT))
    for approach, turn in data.sides.items():
        if np.ptp(turn) > 0:
            found.append(
                Component(
                    f"{place}/stage-backlash@{SIDES[approach]}", place, "beta", "stage-backlash",
                    angle=turn[:, None], constants=(("approach_deg", approach),),
                )
            )  # fmt: skip
            form = Form(
                place, f"side-{SIDES[approach]}", "beta", (Harmonics(1, 4),), "side", shared=True, approach_deg=approach
            )
            found.append(free(form, first, price=PRODUCT))
    if len(np.unique(np.round(data.alpha, 4))) >= FEWEST_INCLINATIONS:
        form = Form("stage-angle-alpha", "curve", "alpha", (spline(data.alpha, 10, order=1),), shared=True)
        found.append(free(form, first, price=PRODUCT))
    return found


def _over(forces: Array, count: int, intervals: int) -> tuple[Any, ...]:
    """A spline over each axis's own range of forces (n, 3)."""
    return tuple(spline(forces[:, k], intervals) for k in range(count))


def _own(data: PoseData, first: State) -> list[Component]:
    place = "own-response"

    def form(cause: str, basis: Basis) -> Component:
        return Component(f"{place}/{cause}", place, "response", cause, columns=per_axis(basis))

    found = [
        form("quadratic-nonlinearity", lambda s, k: s.force[:, k, None] ** 2),
        form("cubic-nonlinearity", lambda s, k: s.force[:, k, None] ** 3),
        form("odd-quadratic-nonlinearity", lambda s, k: (s.force[:, k] * np.abs(s.force[:, k]))[:, None]),
        form("scale-factor-asymmetry", lambda s, k: np.abs(s.force[:, k, None])),
        free(Form(place, "curve", "own", _over(first.force, data.channels, 22)), first),
    ]
    price = 2 * np.log(len(DEAD_G))

    def dead(name: str) -> Make:
        return lambda shape: Component(
            name, place, "response", "dead-zone", f"{place}/dead-zone", price, per_axis(_dead(shape)),
            shape=shape, step=tuple(0.3 * w for w in shape), reshaped=dead(name),
            starts=lambda _: tuple(("width", axis, abs(w)) for axis, w in zip(data.axes, shape, strict=True)),
        )  # fmt: skip

    found += [dead(f"{place}/dead-zone@{width:.4f}")((width,) * data.channels) for width in DEAD_G]
    found.append(free(Form(place, "thresholds", "own", (Clips(THRESHOLDS_G),)), first, "dead-zone", PRODUCT))
    return found + _saturations(data, first)


def _dead(widths: tuple[float, ...]) -> Basis:
    """Specific force clipped at a width of each channel's own, g."""
    return lambda s, k: np.clip(s.force[:, k, None], -abs(widths[k]), abs(widths[k]))


def _saturations(data: PoseData, first: State) -> list[Component]:
    place = "own-response"
    ranges = [(float(f.min() + f.max()) / 2, float(np.ptp(f)) / 2) for f in first.force.T]
    price = 2 * np.log(3 * len(ENDS))

    def saturated(name: str, side: int) -> Make:
        return lambda shape: Component(
            name, place, "response", "saturation", f"{place}/saturation", price, _saturated(shape, side),
            shape=shape, step=(0.02,) * len(shape), reshaped=saturated(name, side),
            starts=lambda loss: (*_levels(first, shape, side), ("loss", "", float(np.clip(-loss[0], 0.01, 1.0)))),
        )  # fmt: skip

    found = []
    for side, name in ((1, "high"), (-1, "low"), (0, "both")):
        for end in ENDS:
            levels = [(m + end * h, m - end * h) for m, h in ranges[: data.channels]]
            shape = tuple(
                level
                for high, low in levels
                for level in ((high, low) if side == 0 else (high,) if side > 0 else (low,))
            )
            found.append(saturated(f"{place}/saturation@{name}{end}", side)(shape))
    return found


def _levels(first: State, shape: tuple[float, ...], side: int) -> tuple[tuple[str, str, float], ...]:
    """The outputs at which saturation begins, from its specific forces, g; the end of the outputs on the other side."""
    found: list[tuple[str, str, float]] = []
    for k, axis in enumerate(first.data.axes):
        slope, offset = np.polyfit(first.force[:, k], first.response[k], 1)
        outputs = first.data.outputs[k]
        ends = {"high": outputs.max(), "low": outputs.min()}
        levels = shape[2 * k : 2 * k + 2] if side == 0 else shape[k : k + 1]
        found += [(name, axis, float(ends[name])) for name in ends if side and name != ("high" if side > 0 else "low")]
        names = ("high", "low") if side == 0 else ("high",) if side > 0 else ("low",)
        found += [(name, axis, float(slope * a + offset)) for name, a in zip(names, levels, strict=True)]
    return tuple(found)


def _saturated(levels: tuple[float, ...], side: int) -> Columns:
    """What is lost above the high level and below the low one of each channel, g; one share for all of it.

    One pose at the end of an axis's range may be all that shows a level: the share lost is common to all ends.
    """

    def columns(s: State) -> Array:
        out = np.zeros((s.data.channels, s.data.n, 1))
        for k in range(s.data.channels):
            a = s.force[:, k]
            gain = float(np.polyfit(a, s.response[k], 1)[0]) if np.ptp(a) > 0 else 1.0
            if side == 0:
                lost = np.maximum(a - levels[2 * k], 0.0) + np.minimum(a - levels[2 * k + 1], 0.0)
            else:
                lost = np.maximum(a - levels[k], 0.0) if side > 0 else np.minimum(a - levels[k], 0.0)
            out[k, :, 0] = gain * lost
        return out

    return columns


def _other_axes(data: PoseData, first: State) -> list[Component]:
    c = data.channels
    cross, z = first.force[:, list(CROSS)], out_of_plane(first.force)
    inclinations = len(np.unique(np.round(first.force[:, 2], 3)))

    def named(place: str, cause: str, basis: Basis, price: float = 0.0) -> Component:
        return Component(f"{place}/{cause}", place, "response", cause, price=price, columns=per_axis(basis))

    def curve(place: str, driver: str, forces: Array, most: int, factor: Factor = "", price: float = 0.0) -> Component:
        return free(Form(place, "curve", driver, _over(forces, c, most), factor), first, price=price)

    found = [
        named("cross-response", "cross-axis-bias", lambda s, k: s.force[:, CROSS[k], None] ** 2),
        curve("cross-response", "cross", cross, 14),
        named(
            "scale-over-cross", "cross-axis-scale",
            lambda s, k: (s.force[:, k] * s.force[:, CROSS[k]])[:, None], PRODUCT,
        ),
        curve("scale-over-cross", "cross", cross, 14, "force", PRODUCT),
    ]  # fmt: skip
    if inclinations < FEWEST_INCLINATIONS - 1:
        return found

    def square(s: State, k: int) -> Array:
        return out_of_plane(s.force)[:, k, None] ** 2

    def product(s: State, k: int) -> Array:
        over = out_of_plane(s.force)[:, k]
        return np.column_stack([s.force[:, k] * over, s.force[:, k] * over**2])

    found += [named("z-response", "z-axis-bias", square), named("scale-over-z", "z-axis-scale", product, PRODUCT)]
    if inclinations >= FEWEST_INCLINATIONS:
        found += [
            curve("z-response", "out-of-plane", z, 10),
            curve("scale-over-z", "out-of-plane", z, 10, "force", PRODUCT),
        ]
    return found


def _history(data: PoseData, first: State) -> list[Component]:
    """Slip elements with free weights, the same pressed by the other axis, and branches."""
    if not data.sides:
        return []
    stated = "approach_deg" in data.table.constants
    begin = (AS_STATED if stated else LOGGED_DEG,)
    found = [_slipping(first, "slip", "", stated)(begin), _slipping(first, "pressed-slip", "pressed", stated)(begin)]
    found.append(_loops(first, stated)(begin))
    cross, own = first.force[:, list(CROSS)], first.force
    for approach, turn in data.sides.items():
        if np.ptp(turn) == 0:
            continue
        for name, driver, forces in (("branch-over-cross", "cross", cross), ("branch-over-own", "own", own)):
            splines = _over(forces, data.channels, 10)
            form = Form("history", f"{name}-{SIDES[approach]}", driver, splines, "side", approach_deg=approach)
            found.append(free(form, first, "hysteresis", PRODUCT))
        friction = Form("history", f"friction-{SIDES[approach]}", "cross", (Ramp(),), "side", approach_deg=approach)
        found.append(free(friction, first, "hysteresis", constants=(("approach_deg", approach),)))
    return found


def _slipping(first: State, name: str, factor: Factor, stated: bool) -> Make:
    """Slip elements by how many degrees before a pose its approach begins."""

    def at(shape: tuple[float, ...]) -> Component:
        widths = Play(WIDTHS_G, memory=not factor and first.data.timed)
        approach = AS_STATED if stated else abs(shape[0])
        form = Form("history", name, "way", (widths,), factor, approach_deg=approach)
        return free(form, first, "hysteresis", PRODUCT if factor else 0.0, shape=shape, step=(2.0,),
                    reshaped=None if stated else _slipping(first, name, factor, stated),
                    constants=(("approach_deg", approach),))  # fmt: skip

    return at


def _loops(first: State, stated: bool) -> Make:
    """Hysteresis whose loops differ from place to place, by how many degrees before a pose its approach begins."""

    def at(shape: tuple[float, ...]) -> Component:
        approach = AS_STATED if stated else abs(shape[0])
        reach = 1.05 * float(np.abs(first.force).max())
        basis = Preisach(LOOPS_G, -reach, reach, LOOP_INTERVALS)
        form = Form("history", "loops", "way", (basis,), approach_deg=approach)
        return free(form, first, "hysteresis", GENERAL, constants=(("approach_deg", approach),))

    return at


def _temperature(data: PoseData, first: State) -> list[Component]:
    if "temperature_c" not in data.table or np.ptp(data.table.column("temperature_c")) == 0:
        return []
    found: list[Component] = []
    leads = LEADS_S if data.timed else (0.0,)
    if data.timed and data.at_rest:
        leads = (*leads, *LONG_LEADS_S)
    chosen = 2 * np.log(len(leads))
    factors: tuple[tuple[str, Factor, float], ...] = (
        ("temperature-bias", "", 0.0),
        ("temperature-scale", "force", PRODUCT),
    )
    for place, factor, price in factors:
        for lead in leads:
            more = price + chosen if lead else price
            found.append(_warmer(data, first, f"{place}/{place}@{lead:g}", place, factor, more)((lead,)))
        found.append(_over_temperature(data, first, place, factor, price)((0.0,)))
    if data.timed:
        temperature = leading_temperature(data.table, 0.0)
        for part in PLAYS:
            name = f"temperature-bias/temperature-hysteresis@{part}"
            found.append(_behind_play(name, temperature)((part * float(np.ptp(temperature)),)))
        widths = tuple(part * float(np.ptp(temperature)) for part in BRANCHES)
        form = Form("temperature-bias", "branches", "temperature", (Play(widths),))
        more = {"general": True, "contains": "temperature-bias", "starts": _middle_play(widths)}
        found.append(
            free(form, first, "temperature-hysteresis", GENERAL, **more)
        )  # after transients: it settles as they do
    return found


def _middle_play(widths: tuple[float, ...]) -> Callable[[Array], Starts]:
    """Where the fit of one play begins: the mean of the plays, by their weights."""

    def starts(found: Array) -> Starts:
        weights = np.abs(found.reshape(-1, len(widths))).sum(axis=0)
        return (("play", "", float(weights @ widths / max(float(weights.sum()), np.finfo(float).tiny))),)

    return starts


def _behind_play(name: str, temperature: Array) -> Make:
    """A line over the temperature behind a play, K."""

    def at(shape: tuple[float, ...]) -> Component:
        width = abs(shape[0])
        return Component(
            name, "temperature-bias", "response", "temperature-hysteresis", "temperature-bias/play", GENERAL,
            _timed(play(temperature, width)[:, None]), contains="temperature-bias",
            shape=shape, step=(0.05 * float(np.ptp(temperature)),), reshaped=_behind_play(name, temperature),
            starts=lambda _: (("play", "", width),),
        )  # fmt: skip

    return at


def _warmer(data: PoseData, first: State, name: str, place: str, factor: Factor, price: float) -> Make:
    """A line over the temperature that the thermometer will show so many seconds later."""

    def at(shape: tuple[float, ...]) -> Component:
        T = leading_temperature(data.table, shape[0])
        basis = (T - T.mean())[:, None]
        return Component(
            name, place, "response", place, f"{place}/line", price, _times_force(basis) if factor else _timed(basis),
            shape=shape, step=(30.0,), constants=(("lead_s", shape[0]),),
            reshaped=_warmer(data, first, name, place, factor, price) if data.timed else None,
        )  # fmt: skip

    return at


def _over_temperature(data: PoseData, first: State, place: str, factor: Factor, price: float) -> Make:
    """A curve over the same."""

    def at(shape: tuple[float, ...]) -> Component:
        smooth = spline(leading_temperature(data.table, shape[0]), 8)
        form = Form(place, "curve", "temperature", (smooth,), factor, lead_s=shape[0])
        made = free(form, first, price=price, family=f"{place}/curve", shape=shape, step=(30.0,))
        return replace(made, reshaped=_over_temperature(data, first, place, factor, price)) if data.timed else made

    return at


def _time(data: PoseData, first: State) -> list[Component]:
    if not data.timed or data.n < FEWEST_TIMED:
        return []
    t, u = data.table.time_s, data.since
    begin, span = float(t.min()), float(np.ptp(t)) or 1.0
    found: list[Component] = []
    places: tuple[tuple[str, Factor, str, str, float], ...] = (
        ("time-bias", "", "warm-up-bias", "bias-drift", 0.0),
        ("time-scale", "force", "warm-up-scale", "", PRODUCT),
    )
    for place, factor, cause, drift, price in places:
        for tau in WARMING:
            name = f"{place}/{cause}@{tau:.3f}"
            more = price + 2 * np.log(len(WARMING))
            found.append(_warming(data.axes, u, span, name, place, cause, more, factor)((tau,)))
        line = Form(place, "line", "time", (Line(begin, begin + span),), factor)
        found.append(free(line, first, drift, price))
        found.append(free(Form(place, "curve", "time", (spline(t, 12),), factor), first, price=price))
        settling = Settling(begin, span, span / data.n, AGES)
        found.append(free(Form(place, "settling", "time", (settling,), factor), first, price=price))
        if drift:
            walk = Waves(begin, span, min(WALK_WAVES, data.n // 3), 2.0)
            for k, axis in enumerate(data.axes):
                kept = tuple(walk.count if j == k else 0 for j in range(data.channels))
                found.append(
                    free(
                        Form(place, f"walk-{axis}", "time", (walk,), factor, kept=kept),
                        first,
                        drift,
                        price,
                        general=True,
                    )
                )
    return found


def _warming(
    axes: Sequence[str], u: Array, span_s: float, name: str, place: str, cause: str, price: float, factor: Factor
) -> Make:
    """An exponential approach by its time constant, as a share of the record."""

    def at(shape: tuple[float, ...]) -> Component:
        part = max(shape[0], SHORTEST_PART)
        left = np.exp(-u / part)[:, None]
        return Component(
            name, place, "response", cause, f"{place}/{cause}", price, _times_force(left) if factor else _timed(left),
            shape=shape, step=(0.2 * shape[0],), reshaped=_warming(axes, u, span_s, name, place, cause, price, factor),
            starts=lambda amplitudes: (
                *(("amplitude", axis, float(a)) for axis, a in zip(axes, amplitudes, strict=True)),
                ("time_constant", "", part * span_s),
            ),
        )  # fmt: skip

    return at


def _output(data: PoseData, first: State) -> list[Component]:
    if data.channels < 2:
        return []
    low, high = float(data.outputs.min()), float(data.outputs.max())
    middle, half = (low + high) / 2, (high - low) / 2 or 1.0

    def powers(s: State) -> Array:
        u = (s.response - middle) / half
        return np.stack([u**2, u**3], axis=2)

    return [
        Component("output/adc-nonlinearity", "output", "output", "adc-nonlinearity", columns=powers),
        free(Form("output", "curve", "output", (spline(data.outputs.ravel(), 22),), shared=True), first),
    ]


def saw(frequency: float, harmonics: int, price: float, step: float) -> Component:
    """Quantisation: harmonics of a saw over the output, codes per unit of output; `step` of the frequency to try."""
    name = f"output/quantisation@{frequency:.6g}"

    def at(shape: tuple[float, ...]) -> Component:
        def columns(s: State) -> Array:
            turned = 2 * np.pi * shape[0] * s.response[:, :, None] * np.arange(1, harmonics + 1)
            scale = 1.0 / np.arange(1, harmonics + 1)
            return np.concatenate([np.sin(turned) * scale, np.cos(turned) * scale], axis=2)

        return Component(
            name, "output", "output", "quantisation", "output/quantisation", price, columns,
            shape=shape, step=(step,), reshaped=at, starts=lambda found: _steps(shape[0], found[0], found[harmonics]),
        )  # fmt: skip

    return at((frequency,))


def _steps(frequency: float, sine: float, cosine: float) -> Starts:
    """Step, offset and noise of the quantiser whose saw has this first harmonic.

    The saw of rounding is -(q / pi) exp(-2 (pi s / q)^2) sin(2 pi (V - o) / q) and harmonics (Widrow and Kollar, 2008).
    """
    step = 1 / frequency
    fraction = np.clip(np.pi * np.hypot(sine, cosine) / step, 1e-6, 1.0)
    noise = step / np.pi * np.sqrt(-np.log(fraction) / 2)
    offset = step / (2 * np.pi) * np.arctan2(cosine, -sine)
    return ("step", "", step), ("offset", "", float(offset)), ("noise", "", float(noise))


def _columns(data: PoseData, first: State) -> list[Component]:
    found: list[Component] = []
    table = data.table
    if "supply_v" in table and np.ptp(table.column("supply_v")) > 0:
        supply = table.column("supply_v")
        more = (supply / supply.mean() - 1)[:, None]
        place = "column:supply_v"
        cause = "supply-sensitivity"
        columns = per_axis(lambda s, k: s.response[k, :, None] * more)
        found.append(Component(f"{place}/{cause}", place, "output", cause, columns=columns))
        found += _over_column(place, supply, first)
    if data.spread is not None and np.all(np.ptp(data.spread, axis=1) > 0):
        squares = data.spread**2
        place, cause = "column:std", "vibration-rectification"
        columns = per_axis(lambda _, k: (squares[k] - squares[k].mean())[:, None])
        found.append(Component(f"{place}/{cause}", place, "response", cause, columns=columns))
        found.append(free(Form(place, "curve", "variance", tuple(spline(q, 6) for q in squares)), first))
    for name, x in data.logged.items():
        found += _over_column(f"column:{name}", x, first)
    return found


def _over_column(place: str, x: Array, first: State) -> list[Component]:
    """Bias and scale factor over a logged column, as a line and as a curve."""
    line, curve = (Line(float(x.min()), float(x.max())),), (spline(x, 8),)
    return [
        free(Form(place, "line", place, line), first),
        free(Form(place, "curve", place, curve), first),
        free(Form(place, "scale-line", place, line, "force"), first, price=PRODUCT),
        free(Form(place, "scale-curve", place, curve, "force"), first, price=PRODUCT),
    ]


def _general(first: State) -> list[Component]:
    """Polynomials on the sphere that no sum of functions of single axes is."""
    return [free(Form("force", "curve", "force", (Products(DEGREE),)), first, price=GENERAL)]
