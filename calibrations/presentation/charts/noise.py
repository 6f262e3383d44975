"""Charts of noise: how it averages (Allan deviation), its spectrum, each with a model, and the record over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibrations.criteria import COVERAGE
from calibrations.discovery.findings import Step
from calibrations.discovery.results import Discovery
from calibrations.noise.analysis import ChannelNoise, NoiseAnalysis
from calibrations.noise.comparison import DeviationComparison, deviation, mismatch, variance_parts
from calibrations.noise.deviations import DeviationCurve
from calibrations.noise.fit import NoiseFit
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.record import Channel, Still
from calibrations.presentation.chart import (
    AMBER,
    BLUE,
    CANDIDATE,
    GREEN,
    INK,
    MEASURED,
    MODEL,
    PURPLE,
    QUIET,
    VERMILION,
    Axis,
    Band,
    Chart,
    Dash,
    Line,
    Note,
    Panel,
    Picture,
    Points,
    Rule,
    Series,
    side_by_side,
    single_chart,
)
from calibrations.presentation.charts.discovery import Measure, model_levels, waterfall
from calibrations.spectrum import GAUSS_MARKOV
from calibrations.table import MILLI, Array, in_time
from calibrations.text import in_milli, rounded

POINTS = 160
HEIGHT = 3.8
ROOM = 4.0  # above and below a spectrum
MOST = 2000  # points of a record over time: more are not visible on a page
LESS = "after removing non-noise signals"
SUM = "sum of the processes"
TIME = "averaging time (s)"
FREQUENCY = "frequency (Hz)"
OTHERS = (("modified", "modified Allan", BLUE), ("hadamard", "Hadamard", GREEN), ("total", "total", VERMILION))
MEASURE = Measure("mismatch of the spectrum / chance", "chance", "the record", "the other half")
COLOURS = {
    "white-noise": BLUE,
    "flicker-noise": AMBER,
    "rate-random-walk": VERMILION,
    "quantisation-noise": GREEN,
    GAUSS_MARKOV: QUIET,
}


@dataclass(frozen=True)
class Scaling:
    """Values of a channel are drawn `factor` times as large, in `unit`."""

    factor: float
    unit: str


@dataclass(frozen=True)
class ModelCurve:
    """One model's curve: its fit, label and look."""

    fit: ChannelFit
    label: str
    colour: str = MODEL
    width: float = 1.8
    dash: Dash = "solid"


def output_scale(unit_name: str) -> Scaling:
    """Thousandths of the unit of an output, because noise is small."""
    return Scaling(*in_milli(unit_name))


def choose_scale(still: Still, axis: str, in_sensed: bool) -> Scaling:
    """Thousandths of the output's unit or of the sensed quantity, because noise is small."""
    sensed = still.sensed.get(axis)
    if sensed is None or not in_sensed:
        return output_scale(still.unit)
    if sensed.unit not in MILLI:
        return Scaling(sensed.factor, sensed.unit)
    return Scaling(1e3 * sensed.factor, MILLI[sensed.unit])


def units(still: Still) -> dict[bool, str]:
    """Units in which all axes can be drawn: False that of the output, True that of the sensed quantity."""
    names = {sensed.unit for sensed in still.sensed.values()}
    has_one_unit = set(still.sensed) == set(still.axes) and len(names) == 1
    return {False: still.unit} | ({True: names.pop()} if has_one_unit else {})


# One channel with noise models


def allan(
    curve: DeviationCurve | DeviationComparison,
    scaled: Scaling,
    models: Sequence[ModelCurve],
    raw: DeviationCurve | None = None,
) -> Panel:
    """Dots are measured, bars intervals of 95 %; lines are the models, thin lines the parts of the first.

    `raw` is the curve of the record before non-noise signals were removed.
    """
    factor = scaled.factor
    values = curve.deviation if isinstance(curve, DeviationCurve) else curve.measured
    series: list[Line | Points] = []
    if raw is not None:
        series.append(Points(raw.tau_s, factor * raw.deviation, "measured", QUIET, "circle-open", 5))
    dots = measured_points(curve.tau_s, factor * values, factor * curve.low, factor * curve.high, scaled.unit,
                           "measured" if raw is None else f"measured, {LESS}")  # fmt: skip
    first = models[0].fit
    rate_hz = first.channel.rate_hz
    tau_s = whole_steps(1 / rate_hz, float(curve.tau_s[-1]), rate_hz)
    if len(first.effects) + len(first.lines) > 1:
        variances = variance_parts(first, tau_s)
        series += [_part(name, tau_s, factor * np.sqrt(variance)) for name, variance in variances.items()]
    series += [_model(model, tau_s, factor * deviation(model.fit, tau_s)) for model in models]
    is_certain = curve.edf > 1
    low = factor * float(curve.low.min())
    high = factor * float(curve.high[is_certain].max() if is_certain.any() else curve.high.max())
    y = Axis(f"Allan deviation ({scaled.unit})", log=True, low=low / 2, high=3 * high)
    return Panel((*series, dots), Axis(TIME, log=True), y, legend="upper center")


def ratio(curve: DeviationComparison) -> Panel:
    """Measured over modelled deviation: the model fails where the interval does not contain 1."""
    hover = [f"{abs(d):.1f} standard deviations off at {t:.4g} s"
             for d, t in zip(curve.deviations, curve.tau_s, strict=True)]  # fmt: skip
    low, high = curve.low / curve.modelled, curve.high / curve.modelled
    dots = Points(curve.tau_s, curve.ratio, low=low, high=high, hover=hover)
    least = float(low.min(initial=0.5, where=low > 0))  # the axis is logarithmic
    most = float(high.max(initial=2.0, where=np.isfinite(high)))
    y = Axis("measured / model", log=True, low=0.9 * least, high=1.1 * most)
    return Panel((Rule(1.0, colour=MODEL, width=1.4), dots), Axis(TIME, log=True), y)


def spectrum(
    fit: ChannelFit, scaled: Scaling, models: Sequence[ModelCurve], bounds: tuple[Array, Array] | None = None
) -> Panel:
    """Dots are measured; 95 % of them should be in the grey band by the model `fit`; lines are the models.

    `bounds` (b,) are the intervals of the measured densities.
    """
    order, factor = np.argsort(fit.frequency_hz), scaled.factor
    f = fit.frequency_hz[order]
    low, high = (factor * root(bound[order]) for bound in fit.interval(COVERAGE))
    density = factor * root(fit.density[order])
    hover = [
        f"{value:.3g} {scaled.unit}/√Hz at {frequency_hz:.4g} Hz"
        for frequency_hz, value in zip(f, density, strict=True)
    ]
    lowest, highest = (factor * root(bound[order]) for bound in bounds) if bounds else (None, None)
    dots = Points(f, density, "measured", size=4, low=lowest, high=highest, hover=hover)
    series: list[Series] = [Band(f, low, high), dots]
    for effect in fit.effects if len(fit.effects) > 1 else ():
        series.append(_part(effect.name, f, factor * root(fit.part_of(effect)[order])))
    for curve in models:
        by_frequency = np.argsort(curve.fit.frequency_hz)
        series.append(
            _model(curve, curve.fit.frequency_hz[by_frequency], factor * root(curve.fit.expected[by_frequency]))
        )
    series += [mark for line in fit.lines for mark in _mark_frequency(line.frequency_hz)]
    expected = factor * root(fit.expected)
    bottom = min(float(expected.min()) / ROOM, float(density.min()) / 2)  # no measured point is cut off
    top = max(ROOM * float(expected.max()), 2 * float(density.max()))
    y = Axis(f"density ({scaled.unit}/√Hz)", log=True, low=bottom, high=top)
    return Panel(tuple(series), Axis(FREQUENCY, log=True), y, legend="upper right")


def record(channel: Channel, scaled: Scaling) -> Panel:
    """A still record over time: means of its samples, less the mean of all."""
    samples_per_point = max(1, -(-len(channel.means) // MOST))
    used = len(channel.means) // samples_per_point * samples_per_point
    values = scaled.factor * channel.means[:used].reshape(-1, samples_per_point).mean(axis=1)
    each_s = samples_per_point * channel.size / channel.rate_hz
    size, unit = in_time(channel.length_s)
    hover = f"%{{y:.4g}} {scaled.unit} at %{{x:.4g}} {unit}"
    times = np.asarray((np.arange(len(values)) + 0.5) * each_s / size)
    line = Line(times, np.asarray(values), colour=MEASURED, width=1, hover=hover)
    x, y = f"time ({unit}); means of {rounded(each_s, 2)} s", f"{channel.axis} − mean ({scaled.unit})"
    return Panel((line,), Axis(x), Axis(y))


def steps_chart(start: NoiseFit, steps: Sequence[Step[NoiseFit]]) -> Chart:
    """Error by model: the mismatch of its spectrum, with that of its Allan deviation."""
    return waterfall(model_levels(start, steps, _mismatch_text), MEASURE)


def fit_chart(fit: NoiseFit) -> Chart:
    """The measured Allan deviation of each channel, and that of the model."""
    scaled = output_scale(fit.still.unit)
    curves = (fit.still.allan[channel.channel.axis] for channel in fit.channels)
    curves_by_channel = ([ModelCurve(channel, fit.model.name, INK)] for channel in fit.channels)
    return _with_axis_titles(
        [allan(curve, scaled, models) for curve, models in zip(curves, curves_by_channel, strict=True)], fit
    )


def _mismatch_text(fit: NoiseFit) -> str:
    return " and ".join(f"{100 * value:.2g} %" for value in mismatch(fit).values())


def steps_picture(discovery: Discovery[NoiseFit]) -> Picture:
    """Error by model, with its caption."""
    caption = (
        "Mismatch of the model before and after each effect, as a multiple of what chance leaves (grey): bars on the "
        "whole record, diamonds on the part that the fit did not use."
    )
    return Picture("waterfall", "Error by model", caption, steps_chart(discovery.start, discovery.steps))


def still_album(end: NoiseFit, start: NoiseFit) -> list[Picture]:
    """Both charts of a report on a noise model, fitted. `start` is the model as it was given; both may be the same."""
    name, cleaned = end.model.name, end.still is not start.still
    line = f"The broken grey line is the model {start.model.name}, the full line {name}; thin lines are its parts."
    dashed = f", the broken grey line is the model {start.model.name}"
    if _are_one_curve(end, start):
        line, dashed = f"The full line is the model {name}; thin lines are its parts.", ""
    averaging = (
        "Difference of neighbouring means over the time of a mean. Dots are measured, bars are intervals of 95 %. "
        + line
    )
    if cleaned:
        averaging += " Rings are the record as measured; dots are the record after removing non-noise signals."
    power = (
        "Power over frequency, one-sided, without the lines that were found. Dots are averages over narrow bands; the "
        f"grey band holds 95 % of them by the model {name}{dashed}."
    )
    curves, densities = [], []
    scaled = output_scale(end.still.unit)
    for end_fit, start_fit in zip(end.channels, start.channels, strict=True):
        axis = end_fit.channel.axis
        models = [ModelCurve(end_fit, _name(end, start), INK)]
        if not _are_one_curve(end, start):
            models.append(ModelCurve(start_fit, start.model.name, dash="dash"))
        raw = start.still.allan[axis] if cleaned else None
        curves.append(allan(end.still.allan[axis], scaled, models, raw))
        densities.append(spectrum(end_fit, scaled, models))
    return [
        Picture("allan", "Allan deviation and model", averaging, _with_axis_titles(curves, end)),
        Picture("spectrum", "Spectrum and model", power, _with_axis_titles(densities, end)),
    ]


def _with_axis_titles(panels: Sequence[Panel], end: NoiseFit) -> Chart:
    if len(panels) == 1:
        return single_chart(panels[0], HEIGHT)
    titles = [f"axis {channel.channel.axis}" for channel in end.channels]
    return side_by_side([replace(panel, title=title) for panel, title in zip(panels, titles, strict=True)], HEIGHT)


def _are_one_curve(end: NoiseFit, start: NoiseFit) -> bool:
    """Whether both are one curve: the same effects with the same values, on the same record."""
    unchanged = [
        end_fit.values == start_fit.values for end_fit, start_fit in zip(end.channels, start.channels, strict=True)
    ]
    return all(unchanged) and end.model.effects == start.model.effects


def _name(end: NoiseFit, start: NoiseFit) -> str:
    """Name of the final model; the start may have the same name with other values or another record."""
    if end.model.name != start.model.name or _are_one_curve(end, start):
        return end.model.name
    return f"{end.model.name}, {LESS if end.still is not start.still else 'fitted'}"


# Coefficients of `rig noise`


def noise_album(analysis: NoiseAnalysis) -> list[Picture]:
    """Two charts of each channel; the names of all but the first channel have its axis."""
    averaging = (
        "Difference of neighbouring means over the averaging time. Dots are measured, bars are intervals of 95 %; the "
        "full line is the sum of the processes, broken lines are the single processes. On the right the other "
        "deviations, with their intervals."
    )
    power = (
        "Power over frequency, one-sided. Dots are averages over narrow bands with intervals of 95 %, the grey band "
        "should hold 95 % of them; the full line is the sum of the processes, dotted lines are spectral lines that "
        "were removed."
    )
    album = []
    for k, (axis, noise) in enumerate(analysis.channels.items()):
        end, of_axis = (f"-{axis}", f" of {axis}") if k else ("", "")
        model, scaled = _present_processes(noise), output_scale(noise.unit)
        density = single_chart(spectrum(model.fit, scaled, [model], noise.interval), 4.0)
        album.append(Picture(f"allan{end}", f"Allan deviation{of_axis}", averaging, _deviations(noise, model, scaled)))
        album.append(Picture(f"spectrum{end}", f"Spectrum{of_axis}", power, density))
    return album


def _present_processes(noise: ChannelNoise) -> ModelCurve:
    """The fit of a channel without processes of no power; one process alone has its name."""
    effects = tuple(effect for effect in noise.fit.effects if noise.power(effect) > 0)
    is_alone = len(effects) == 1 and not noise.lines
    return ModelCurve(replace(noise.fit, effects=effects), effects[0].name if is_alone else SUM, INK)


def _deviations(noise: ChannelNoise, model: ModelCurve, scaled: Scaling) -> Chart:
    """The overlapping deviation with its interval, the processes and their sum; on the right the other deviations."""
    curve = noise.allan
    panel = allan(curve, scaled, [model])
    left_panel = replace(
        panel, y=replace(panel.y, label=f"deviation ({scaled.unit})"), title="Overlapping Allan deviation"
    )
    curves = [
        part for kind, name, colour in OTHERS for part in _other_deviation(noise.deviations[kind], scaled, name, colour)
    ]
    line = Line(curve.tau_s, scaled.factor * curve.deviation, "overlapping Allan", QUIET)
    right_panel = Panel((*curves, line), Axis(TIME, log=True), left_panel.y, "Other deviations", legend="upper center")
    return side_by_side([left_panel, right_panel], 4.0, share_y=True)


def _other_deviation(curve: DeviationCurve, scaled: Scaling, name: str, colour: str) -> tuple[Band, Line]:
    factor = scaled.factor
    band = Band(curve.tau_s, factor * curve.low, factor * curve.high, colour=colour, opacity=0.18)
    return band, Line(curve.tau_s, factor * curve.deviation, name, colour, markers=True)


def _mark_frequency(frequency_hz: float) -> Iterator[Rule | Note]:
    yield Rule(frequency_hz, "x", VERMILION, 0.9, "dot")
    yield Note(f"{frequency_hz:.4g} Hz", frequency_hz, 1, "y", "right", "top", upright=True)


# Parts of these charts


def measured_points(tau_s: Array, values: Array, low: Array, high: Array, unit: str, label: str) -> Points:
    """Measured deviations with their intervals."""
    hover = [f"{value:.3g} {unit} at {tau:.4g} s, measured" for tau, value in zip(tau_s, values, strict=True)]
    return Points(tau_s, values, label, low=low, high=high, hover=hover)


def whole_steps(first_s: float, last_s: float, rate_hz: float) -> Array:
    """Averaging times in whole samples, evenly spaced on a logarithmic axis."""
    steps = np.geomspace(first_s * rate_hz, last_s * rate_hz, POINTS)
    return np.unique(np.round(steps)).astype(np.float64) / rate_hz


def root(two_sided: Array) -> Array:
    """One-sided amplitude density from a two-sided power density."""
    return np.asarray(np.sqrt(2 * two_sided))


def candidate(fit: ChannelFit, name: str) -> ModelCurve:
    """The curve of a model with an effect that is considered."""
    return ModelCurve(fit, f"with {name}", CANDIDATE, 2.6)


def _part(name: str, x: Array, values: Array) -> Line:
    return Line(x, values, name, COLOURS.get(name, PURPLE), 1.0, "dash", hover=f"{name}: %{{y:.3g}}")


def _model(curve: ModelCurve, x: Array, values: Array) -> Line:
    return Line(x, values, curve.label, curve.colour, curve.width, curve.dash, hover=f"{curve.label}: %{{y:.3g}}")
