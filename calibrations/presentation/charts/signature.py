"""An effect's signature: the residual of the linear model by the effect, over the column that shows it best.

Made by the effect's own functions, without noise, on a sensor of 1 V/g: a sweep of full turns each way at five
inclinations while the room warms and cools, or, for an effect that only motion shows, oscillations beside a rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from calibrations.effects import Effect, Parameter, Values
from calibrations.effects.catalogue import catalogue
from calibrations.geometry.orientation import other_in_plane
from calibrations.geometry.rate_table import rate_deg_s
from calibrations.model.chain import Step, force, forward, respond, sensed
from calibrations.noise.comparison import deviation
from calibrations.noise.likelihood import ChannelFit, effect_lines
from calibrations.noise.likelihood import Values as NoiseValues
from calibrations.noise.lines import SpectralLine
from calibrations.noise.record import Channel
from calibrations.presentation.chart import BLUE, GREEN, INK, QUIET, VERMILION, Axis, Chart, Dash, Line, Panel, Rule
from calibrations.presentation.charts.noise import root
from calibrations.spectrum import Sampling, Welch, slow_bands
from calibrations.table import AXES, Array, Table

INCLINATIONS_DEG = (90.0, 30.0, 150.0, 60.0, 120.0)
STEP_DEG = 9.0
SMOOTH = 1.0  # von Neumann's ratio of a residual that is a function of a force; 2 where it is none
EQUAL_VALUES = 0.02  # of its range
DIGITS = 4  # decimals of mV: further digits depend on the machine
INCLINATIONS = ("#440154", "#3b528b", "#21918c", "#5ec962", "#c9d614")  # colours of 30 to 150 deg
SMALL = 7.2  # inches: the width of a page of the catalogue
CLOSE_S = (3.0, 4.0)  # of a motion, so that its waves are visible
LABELS = {"t_s": "time (min)", "temperature_c": "temperature (°C)", "supply_v": "supply voltage (V)"}


def signature_chart(effect: Effect) -> Chart:
    """A panel for each axis that the effect changes; lines are coloured by inclination, and dashed on the way back."""
    parts = signature(effect)
    has_several = len(parts[0].curves) > 1
    panels = [_part_panel(part, legend=has_several and k == 0) for k, part in enumerate(parts)]
    return Chart((tuple(panels),), 1.95, SMALL, share_y=True)


def _part_panel(part: Part, *, legend: bool) -> Panel:
    lines = []
    for label, curves in groupby(part.curves, lambda curve: curve.label):
        for k, curve in enumerate(curves):
            name = label if legend and k == 0 else ""
            dash: Dash = "dash" if curve.style == "--" else "solid"
            lines.append(Line(part.abscissa[curve.rows], part.residual[curve.rows], name, curve.colour, 1.6, dash))
    if legend and any(curve.style == "--" for curve in part.curves):
        lines.append(Line(part.abscissa[:0], part.residual[:0], "turning back", INK, 1.6, "dash"))
    title = f"{part.axis} axis" if len(part.axis) == 1 else part.axis
    x = Axis(part.label, ticks="quarters" if part.label.startswith("β") else "")
    return Panel((Rule(0.0, width=0.7), *lines), x, Axis(f"residual ({part.unit})"), remark=title,
                 legend="outside" if legend else "")  # fmt: skip


def signature(effect: Effect) -> list[Part]:
    """Residual of the linear model by the effect, axis by axis."""
    if effect.first_kind.field:
        return [field_part(effect)]
    if effect.first_kind.turning:
        return rate_parts(effect)
    effects_by_name = catalogue()
    linear: list[Step] = [
        (effects_by_name["bias"], Values(bias=np.full(3, 2.5))),
        (effects_by_name["scale-factor"], Values(scale=np.ones(3))),
    ]
    table = sweep() if effect.excluded(sweep()) is None else motion()
    v, a = forward(table, linear), force(table, linear)
    table = replace(table, columns={**table.columns, "vx_v": v[:, 0], "vy_v": v[:, 1]})
    change = forward(table, [*linear, (effect, shown_values(effect, table))]) - v
    lefts = [(k, _nonlinear_change(table, change[:, k], v[:, k], effect.name)) for k in range(v.shape[1])]
    return [_panel(effect, table, a, k, residual) for k, residual in lefts if residual.any()]


def _nonlinear_change(table: Table, change: Array, v: Array, name: str) -> Array:
    """The change of an output, V, less the straight line in that output that follows it best; mV.

    For bias and scale factor, the model has all effects but these.
    """
    one_turn = table.optional("beta_deg", 0.0) < 360.0  # the end of a turn is its beginning
    line = np.column_stack([np.ones(len(v)), v])
    line = {"bias": line[:, :0], "scale-factor": line[:, :1]}.get(name, line)
    residual = change - line @ np.linalg.lstsq(line[one_turn], change[one_turn], rcond=None)[0]
    return np.asarray(np.round(1e3 * residual, DIGITS) + 0.0)


def _panel(effect: Effect, table: Table, a: Array, k: int, residual: Array) -> Part:
    """The column of the picture: one that the effect needs, a force that determines the residual, or beta."""
    axis, other_axis = "xyz"[k], "yxx"[k]
    if table.type.moving:
        close = (table.time_s >= CLOSE_S[0]) & (table.time_s <= CLOSE_S[1])
        rows = np.flatnonzero(close) if "output" in effect.places else np.arange(0, table.n, 8)
        return Part(axis, residual, table.time_s, "time (s)", (JoinedRows("", BLUE, "-", rows),))
    if drivers := [name for name in effect.needs if name in LABELS]:
        abscissa = table.column(drivers[0]) / (60.0 if drivers[0] == "t_s" else 1.0)
        return Part(axis, residual, abscissa, LABELS[drivers[0]], tuple(_inclination_curves(table, ("-", "-"))))
    for name, component in ((axis, a[:, k]), (other_axis, other_in_plane(a)[:, k])):
        _, rows, group = np.unique(np.round(component, 6), return_index=True, return_inverse=True)
        if np.max(np.abs(residual - residual[rows][group])) < EQUAL_VALUES * np.ptp(residual) and _smooth(
            residual[rows]
        ):
            return Part(
                axis, residual, component, f"specific force along {name} (g)", (JoinedRows("", BLUE, "-", rows),)
            )
    styles = ("-", "--") if "direction" in effect.needs else ("-",)
    return Part(axis, residual, table.column("beta_deg"), "β (deg)", tuple(_inclination_curves(table, styles)))


def _smooth(values: Array) -> bool:
    """Whether neighbours are alike (von Neumann, 1941)."""
    steps, deviations = np.diff(values), values - values.mean()
    return float(steps @ steps) < SMOOTH * float(deviations @ deviations)


def _inclination_curves(table: Table, styles: tuple[str, ...]) -> Iterator[JoinedRows]:
    """The rows of each inclination, one line for each direction that has a style."""
    alpha, direction = table.column("alpha_deg"), table.column("direction")
    for inclination in sorted(INCLINATIONS_DEG):
        colour = INCLINATIONS[int((inclination - 30.0) / 30.0)]
        for side, style in zip((1.0, -1.0), styles, strict=False):
            rows = np.flatnonzero((alpha == inclination) & (direction == side))
            yield JoinedRows(f"α = {inclination:g}°", colour, style, rows)


def sweep() -> Table:
    """Full turns each way at each inclination from power-on, while room and supply rise and fall."""
    up = np.arange(0.0, 361.0, STEP_DEG)
    beta = np.tile(np.concatenate([up, up[::-1]]), len(INCLINATIONS_DEG))
    t = 2600.0 * np.linspace(0.0, 1.0, len(beta))
    columns = {
        "alpha_deg": np.repeat(INCLINATIONS_DEG, 2 * len(up)),
        "beta_deg": beta,
        "direction": np.tile(np.repeat([1.0, -1.0], len(up)), len(INCLINATIONS_DEG)),
        "t_s": t,
        "temperature_c": 25.0 + 4.0 * np.sin(2 * np.pi * t / 1300.0),
        "supply_v": 5.0 + 0.02 * np.sin(2 * np.pi * t / 900.0),
        "vx_v": 2.5 + np.sin(t),  # only its range counts, until the model has made it
        "vy_v": 2.5 + np.cos(t),
    }
    return Table.from_columns("poses", columns, source="a sweep")


def motion() -> Table:
    """Oscillation along x at 10 and 4 Hz, between rests."""
    t = np.arange(0.0, 8.0, 0.005)
    on = np.clip(np.minimum(t - 2.0, 6.0 - t) / 0.2, 0.0, 1.0)
    a = on * (0.12 * np.sin(2 * np.pi * 10 * t) + 0.05 * np.sin(2 * np.pi * 4 * t))
    columns = {"t_s": t, "displacement_m": np.zeros(len(t)), "vx_v": 2.5 + a, "vy_v": 2.5 + a}
    columns |= {"acceleration_m_s2": a, "alpha_deg": np.full(len(t), 45.0), "beta_deg": np.full(len(t), 90.0)}
    return Table.from_columns("motion", columns, source="a motion")


# Values of the effect; turns of magnetometers and gyroscopes


ACROSS = np.array([1.0, 0.6, 1.0])  # parameters of each axis, times those of x: no two are alike

# values for all axes that show an effect, where a parameter's typical one is only a step or a level
SHOWN: Mapping[str, Mapping[str, float]] = {
    "bias": {"bias": 0.02},
    "scale-factor": {"scale": 0.02},
    "quantisation": {"step": 0.5, "noise": 0.01, "offset": 0.07},
    "saturation": {"high": 3.3, "low": 1.6},
    "adc-nonlinearity": {"bend": -0.004},
    "stage-zero-offset": {"beta": 0.5},
    "stage-eccentricity": {"cosine": 0.1},
    "base-tilt": {"y": 0.5},
    "axis-misalignment": {"y": 1.0, "z": 0.5},
    "temperature-hysteresis": {"play": 1.0},
    "field-strength": {"total": 1.1},
    "hard-iron": {"offset": 0.2},
    "soft-iron": {"xx": 0.05, "yy": -0.02, "xy": 0.03, "xz": 0.0, "yz": -0.02},
    "gyro-bias": {"bias": 1.0},
    "gyro-scale-factor": {"scale": 1.02},
    "gyro-misalignment": {"xy": 0.5, "xz": 1.0, "yx": -0.5, "yz": 0.3, "zx": 0.0, "zy": -1.0},
    "gyro-g-sensitivity": {"x": 0.1, "y": 0.0, "z": -0.05},
}


@dataclass(frozen=True)
class JoinedRows:
    """Rows that one line joins."""

    label: str
    colour: str
    style: str
    rows: NDArray[np.intp]


@dataclass(frozen=True)
class Part:
    """The residual of one axis, in `unit`, shape (n,), over a column of that shape, and the rows that lines join."""

    axis: str
    residual: Array
    abscissa: Array
    label: str
    curves: tuple[JoinedRows, ...]
    unit: str = "mV"


def shown_values(effect: Effect, table: Table) -> Values:
    """The values that are shown, and the effect's constants."""
    constants = {name: make(table) for name, make in effect.constants.items()}
    return Values.of(constants | {p.name: shown_value(p, effect) for p in effect.parameters})


def shown_value(p: Parameter, effect: Effect) -> Array:
    """A typical value, of shape (3,) if per axis."""
    typical = p.typical if p.starts == (0.0,) else p.starts[-1]
    values = SHOWN.get(effect.name, {})
    factors = np.ones(3) if p.name in values else ACROSS
    value = values.get(p.name, typical)
    return value * factors if p.per_axis else np.asarray(value)


COLOURS = (VERMILION, GREEN, BLUE)
TURN_DEG = np.arange(0.0, 361.0, 5.0)
RATES_DEG_S = np.linspace(-100.0, 100.0, 21)


def field_part(effect: Effect) -> Part:
    """Residual of the field's magnitude by the effect, parts per thousand, over full turns of a magnetometer."""
    strength = catalogue()["field-strength"]
    table = _simulate_turns_in_field()
    steps: list[Step] = [] if effect.name == strength.name else [(strength, Values(total=np.asarray(1.0)))]
    steps.append((effect, shown_values(effect, table)))
    output = respond(sensed(table.outputs, table, steps), table, steps)
    residual = np.asarray(np.round(1e3 * (np.linalg.norm(output, axis=1) - 1.0), 4) + 0.0)
    curves = tuple(_curves(len(TURN_DEG)))
    return Part("|m|", residual, np.tile(TURN_DEG, 3), "angle of the turn (deg)", curves, "‰ of the field")


def rate_parts(effect: Effect) -> list[Part]:
    """Residual of each output by the effect, deg/s, over the rate of turns of a gyroscope about each edge."""
    ideal = catalogue()["gyro-scale-factor"]
    table = _simulate_turns_at_rates()
    rate = rate_deg_s(table)
    unit_scale = Values({**shown_values(ideal, table), "scale": np.ones(3)})
    steps: list[Step] = [] if effect.name == ideal.name else [(ideal, unit_scale)]
    steps.append((effect, shown_values(effect, table)))
    residual = respond(sensed(rate, table, steps), table, steps) - rate
    curves = tuple(_curves(len(RATES_DEG_S)))
    rates = table.column("rate_deg_s")
    return [
        Part(axis, np.asarray(np.round(residual[:, k], 4) + 0.0), rates, "rate (deg/s)", curves, "deg/s")
        for k, axis in enumerate(AXES)
    ]


def _curves(n: int) -> Iterator[JoinedRows]:
    """The curves, one for each edge that the sensor turns about."""
    for k, (axis, colour) in enumerate(zip(AXES, COLOURS, strict=True)):
        yield JoinedRows(f"about {axis}", colour, "-", np.arange(k * n, (k + 1) * n))


def _simulate_turns_in_field() -> Table:
    """Full turns about x, y and z across a field of 1."""
    c, s, zero = np.cos(np.radians(TURN_DEG)), np.sin(np.radians(TURN_DEG)), np.zeros(len(TURN_DEG))
    turns = [np.column_stack(components) for components in ((zero, c, s), (s, zero, c), (c, s, zero))]
    m: Array = np.vstack(turns)
    return Table.from_columns("positions", dict(zip(("mx", "my", "mz"), m.T, strict=True)), source="turns")


def _simulate_turns_at_rates() -> Table:
    """Turns about x, y and z, each upright in its turn."""
    up = np.repeat(np.eye(3), len(RATES_DEG_S), axis=0)
    rate = np.tile(RATES_DEG_S, 3)
    columns = dict(zip(("ax", "ay", "az"), up.T, strict=True)) | {"rate_deg_s": rate}
    columns |= dict(zip(("gx", "gy", "gz"), (up * rate[:, None]).T, strict=True))
    return Table.from_columns("rates", columns, {"unit": "deg/s"}, "turns")


# A noise effect's signature: its part of the Allan deviation and of the spectrum, on top of white noise.


RATE_HZ, SAMPLES = 10.0, 1 << 15
SPARE = 3  # one of this number of bands is drawn
WHITE = {"coefficient": 1.0}
NOISE_SHOWN: dict[str, NoiseValues] = {  # with white noise of 1 V/sqrt(Hz)
    "white-noise": {"coefficient": 2.0},
    "flicker-noise": {"coefficient": 0.5},
    "rate-random-walk": {"coefficient": 0.05},
    "quantisation-noise": {"coefficient": 1.0},
    "gauss-markov-noise": {"sigma": 0.5, "time_constant": 20.0},
    "sinusoidal-noise": {"amplitude_1": 0.5, "frequency_1": 0.05},
}


def shown_noise(effect: Effect) -> NoiseValues:
    """Parameters that make the effect visible above white noise of 1 unit/sqrt(Hz)."""
    return NOISE_SHOWN.get(effect.name) or {
        p.name: 0.5 if p is effect.parameters[0] else 20.0 for p in effect.parameters
    }


def noise_signature_chart(effect: Effect) -> Chart:
    """The Allan deviation on the left, the spectrum on the right; dashed lines are without the effect."""
    white_fit, effect_fit = _with_white(None), _with_white(effect)
    tau_s = np.geomspace(1, SAMPLES / 8, 70).round() / RATE_HZ
    styles: tuple[tuple[ChannelFit, Dash, str], ...] = ((white_fit, "dash", QUIET), (effect_fit, "solid", BLUE))
    deviations = tuple(
        Line(tau_s, deviation(fit, tau_s), colour=colour, width=1.6, dash=dash) for fit, dash, colour in styles
    )
    spectra = tuple(
        Line(fit.frequency_hz[::SPARE], root(fit.expected)[::SPARE], colour=colour, width=1.6, dash=dash)
        for fit, dash, colour in styles
    )
    lines = tuple(Rule(line.frequency_hz, "x", VERMILION, 1.6) for line in effect_fit.lines)
    panels = (_log_panel(deviations, "averaging time (s)", "Allan deviation (V)"),
              _log_panel((*spectra, *lines), "frequency (Hz)", "density (V/√Hz)"))  # fmt: skip
    return Chart((panels,), 1.95, SMALL)


def _log_panel(series: tuple[Line | Rule, ...], x: str, y: str) -> Panel:
    values = np.concatenate([line.y for line in series if isinstance(line, Line)])
    return Panel(series, Axis(x, log=True), Axis(y, log=True, low=values.min() / 1.5, high=1.5 * values.max()))


def _with_white(effect: Effect | None) -> ChannelFit:
    """White noise, with an effect or without, as a fit to a record without samples."""
    channel = Channel("x", "V", RATE_HZ, np.inf, SAMPLES, np.zeros(SAMPLES), 1, Welch(RATE_HZ).segments())
    white = catalogue()["white-noise"]
    effects, values = [white], {white.name: dict(WHITE)}
    lines: tuple[SpectralLine, ...] = ()
    if effect is not None:
        spectrum = shown_noise(effect)
        effects += [effect] if "spectrum" in effect.places and effect is not white else []
        values[effect.name] = spectrum
        lines = effect_lines(effect, spectrum)
    parts = (slow_bands(channel.means, Sampling(RATE_HZ)),)
    return ChannelFit(channel, parts, lines, tuple(effects), values)
