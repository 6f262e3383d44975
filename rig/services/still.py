"""DATA of a sensor at rest as a stream of samples: from a table, an array, or a run of the record."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError, nearest
from calibrations.importing.units import UNIT_OF
from calibrations.noise.record import Sensed
from calibrations.noise.samples import hidden_step
from calibrations.table import AXES, STANDARD_GRAVITY, Array, Table
from procedures.instruments import OUTPUTS
from procedures.noise_floor import STILL
from procedures.soak import HOLD
from rig.errors import RecordError
from rig.record.measured import MeasuredRun
from rig.record.store import Record
from rig.record.tables import units_of
from rig.record.values import KeptPose
from rig.services.tables import BESIDE, INFLUENCES, load

SENSOR = tuple(chain(*OUTPUTS))  # channels of the accelerometer's outputs
TIME_TOLERANCE = 0.5  # in sampling intervals: a larger deviation of a time is a gap
DISAGREE = 0.01  # of two rates
AXIS = re.compile(r"(v|a|g|m|)([xyz])(|_v)")  # of a channel, by its name
SENSED_UNITS = {  # more usual units for these
    "m/s^2": Sensed(1 / STANDARD_GRAVITY, "g"),
    "m/s2": Sensed(1 / STANDARD_GRAVITY, "g"),
    "deg/s": Sensed(3600.0, "deg/h"),
}
SENSITIVITIES = {
    "output_per_g": "g",
    "output_per_deg_s": "deg/s",
    "output_per_field": "field",
}  # constants that data may have


@dataclass
class SampleStream:
    """Samples of one channel, in blocks that are read once. The other values are complete after the last block."""

    source: str
    channel: str
    rate_hz: float
    unit: str
    blocks: Iterator[NDArray[Any]]
    corner_hz: float = np.inf
    others: tuple[str, ...] = ()
    closed: list[tuple[float, float]] = field(default_factory=list)  # gaps: where each begins and how long it is, s
    uneven_s: float = 0.0  # largest difference of the times from evenly spaced times
    upright: dict[int, float] = field(default_factory=dict)  # output along gravity, +1 and -1 g
    constants: Mapping[str, str | float] = field(default_factory=dict)
    logged: dict[str, list[Array]] = field(default_factory=dict)  # other columns of the record, in the same blocks
    coarse: dict[str, float] = field(default_factory=dict)  # steps of those columns whose noise is less than a step

    @property
    def sensed(self) -> Sensed | None:
        """From the output to the sensed quantity, if the scale factor is known.

        It is known by the unit, from poses along gravity, or by a constant of the data (`output_per_g`,
        `output_per_deg_s`, `output_per_field`).
        """
        if self.unit in SENSED_UNITS:
            return SENSED_UNITS[self.unit]
        if scale := self.scale_per_g:
            return Sensed(1 / scale, "g")
        scales = ((_number(self.constants.get(name)), unit) for name, unit in SENSITIVITIES.items())
        return next((Sensed(1 / abs(scale), unit) for scale, unit in scales if scale), None)

    @property
    def scale_per_g(self) -> float | None:
        """Output per g, from poses of the same run at +1 and -1 g; None without these poses."""
        if {1, -1} <= self.upright.keys() and self.upright[1] != self.upright[-1]:
            return abs(self.upright[1] - self.upright[-1]) / 2
        return None


def repairs(samples: SampleStream, n: int) -> Iterable[str]:
    """How the samples were changed before the analysis, and what limits them."""
    if samples.closed:
        missing = sum(length for _, length in samples.closed)
        gaps = "a gap" if len(samples.closed) == 1 else f"{len(samples.closed)} gaps"
        yield (
            f"The analysis joins the samples across {gaps}, {missing:.3g} s in total: long averaging times are too "
            f"short by up to {100 * missing * samples.rate_hz / n:.2g} %."
        )
    if samples.uneven_s:
        yield (
            f"Times are uneven by up to {samples.uneven_s:.2g} s, as if samples reached the computer in bursts; "
            f"the analysis assumes {samples.rate_hz:.6g} evenly spaced samples a second."
        )
    for name, step in samples.coarse.items():
        yield (
            f"{name} was read in steps of {1e3 * step:.3g} mV, larger than its noise. Its means are wrong by part of a "
            "step, and the slope of an output that follows it is less certain than stated."
        )


def _number(constant: str | float | None) -> float:
    """The stated scale factor; 0 if there is none."""
    return constant if isinstance(constant, float) and np.isfinite(constant) else 0.0


def channel_of(channels: tuple[str, ...], channel: str | None, source: str) -> str:
    """The requested channel, or the first one. Raises DataError."""
    if not channels:
        raise DataError(f"{source}: has no channel except the time; add a column with the sensor's output")
    channel_name = channel or channels[0]
    name_there = next((name for name in (channel_name, f"{channel_name}_v") if name in channels), None)
    if name_there is None:
        raise DataError(f'{source}: has no channel "{channel_name}"{nearest(channel_name, channels)}')
    return name_there


def agree_on_rate(measured: float | None, stated_hz: float, source: str) -> float:
    """The sample rate, Hz. Raises DataError if the measured and the stated rate differ, or if none is known."""
    if measured is None and not stated_hz > 0:
        raise DataError(
            f"{source}: its sample rate is unknown; give --rate HZ, or a line `# sample_rate_hz: 100` above the header"
        )
    if measured is None:
        return stated_hz
    if stated_hz > 0 and abs(measured / stated_hz - 1) > DISAGREE:
        raise DataError(
            f"{source}: the stated rate is {stated_hz:g} samples a second, the column t_s gives {measured:g}; "
            "correct one"
        )
    return measured


# A still table as a stream; its times must be evenly spaced.


MOST_MISSING = 0.1  # of a record, in gaps across which samples are joined
WHOLE = 0.1  # of a sampling interval: tolerance of a step about a whole number of intervals, if single samples are lost
FEW_GAPS = 0.01  # of all steps
UNEVENNESS = 1e-3  # of a record: tolerance of its times about evenly spaced ones; samples can arrive in bursts
EVEN_REMEDY = "record again with evenly spaced samples (interpolated samples have less white noise than the sensor)"


def table_stream(table: Table, channel: str | None, rate_hz: float | None) -> SampleStream:
    if table.kind != "still" or "alpha_deg" in table:
        kind = "poses" if table.kind == "still" else table.kind
        raise _no_record(f"{table.source}: a table of {kind}")
    if "n" in table and (samples_per_row := float(np.median(table.column("n")))) > 1:
        raise _no_record(f"{table.source}: a row is the mean of {samples_per_row:.0f} samples (column n), as in poses")
    channels = tuple(name for name in table.columns if name not in BESIDE)
    channel_name = channel_of(channels, channel, table.source)
    stated_hz = rate_hz or table.number("sample_rate_hz", 0.0)
    times = _times(table)
    rate = agree_on_rate(times.rate_hz if times else None, stated_hz, table.source)
    unit, corner_hz = _unit_of_channel(table, channel_name), table.number("filter_corner_hz", np.inf)
    other_channels = tuple(name for name in channels if name != channel_name)
    samples = SampleStream(
        table.source, channel_name, rate, unit, iter([table.column(channel_name)]), corner_hz, other_channels,
        constants=table.constants,
        logged={name: [table.column(name)] for name in _list_logged_columns(table, channel_name)},
    )  # fmt: skip
    return replace(samples, closed=list(times.gaps), uneven_s=times.uneven_s) if times else samples


def _unit_of_channel(table: Table, name: str) -> str:
    """The unit of a channel: its sensor's, else that of the outputs."""
    of_outputs = "V" if name.endswith("_v") else str(table.constants.get("unit", "count"))
    return str(table.constants.get(f"{UNIT_OF}{name[0]}", of_outputs)) if name[1:] in AXES else of_outputs


def _no_record(subject: str) -> DataError:
    """The error for data that are not a still record."""
    return DataError(
        f"{subject}; a noise analysis needs single samples of a sensor at rest: give a still record, or `rig run "
        "noise-floor`"
    )


def _list_logged_columns(table: Table, channel: str) -> Iterator[str]:
    """Columns that an output may follow: temperature, supply, and columns whose names are not those of outputs."""
    for name in table.columns:
        is_channel = name not in BESIDE and AXIS.fullmatch(channel) is not None and AXIS.fullmatch(name) is None
        if name in INFLUENCES or (is_channel and name != channel):
            yield name


@dataclass(frozen=True)
class _Times:
    """The rate by a column of times, its gaps (begin, length), and the largest deviation from even times, s."""

    rate_hz: float
    gaps: tuple[tuple[float, float], ...] = ()
    uneven_s: float = 0.0


def _times(table: Table) -> _Times | None:
    """The rate and the gaps; None without a column of times. Raises DataError for decreasing or uneven times."""
    if "t_s" not in table or table.n < 2:
        return None
    t_s = table.column("t_s")
    step_s, length_s = np.diff(t_s), float(t_s[-1] - t_s[0])
    typical = float(np.median(step_s))
    if step_s.min() <= 0:
        row = int(np.argmin(step_s > 0)) + 2
        raise DataError(f"{table.source}: row {row}: the time does not increase; sort the rows and remove duplicates")
    far = np.flatnonzero(np.abs(step_s - typical) > TIME_TOLERANCE * typical)
    if len(far) <= FEW_GAPS * table.n and np.all(step_s[far] > typical):
        gaps = tuple((float(t_s[i]), float(step_s[i] - typical)) for i in far)
        _check_gaps(gaps, (table.n - 1) * typical, table.source)
        return _Times((table.n - 1 - len(far)) / float(np.sum(np.delete(step_s, far))), gaps)
    missing_steps = np.round(step_s / typical) - 1
    if 0 < missing_steps.sum() < table.n and np.all(np.abs(step_s / typical - 1 - missing_steps) < WHOLE):
        raise DataError(
            f"{table.source}: {missing_steps.sum():.0f} single samples are missing, the first after row {far[0] + 2}; "
            f"{EVEN_REMEDY}, or analyse {_longest_stretch_text(far, table.n)} alone"
        )
    off_s = float(np.max(np.abs(t_s - np.linspace(t_s[0], t_s[-1], table.n))))
    if off_s > UNEVENNESS * length_s:
        raise DataError(
            f"{table.source}: row {far[0] + 2} comes {step_s[far[0]]:.3g} s after the one before, others after "
            f"{typical:.3g} s; samples must be evenly spaced: {EVEN_REMEDY}"
        )
    return _Times((table.n - 1) / length_s, (), off_s)


def _longest_stretch_text(far: NDArray[np.intp], n: int) -> str:
    """The longest stretch of n rows without a late one, counted from 1; `far` are the last rows before these."""
    edges = np.array([-1, *far, n - 1])
    k = int(np.argmax(np.diff(edges)))
    return f"rows {edges[k] + 2} to {edges[k + 1] + 1}, the longest stretch without a loss,"


def _check_gaps(gaps: Sequence[tuple[float, float]], length_s: float, source: str) -> None:
    """Raises DataError if too much is missing to join the samples across the gaps."""
    missing = sum(length for _, length in gaps)
    if missing > MOST_MISSING * length_s:
        longest = max(gaps, key=lambda gap: gap[1])
        raise DataError(
            f"{source}: {len(gaps)} gaps, {missing:g} s in total, and {length_s:g} s of samples; the longest, of "
            f"{longest[1]:g} s, is at t = {longest[0]:g} s: analyse the parts between the gaps separately"
        )


# The still record of a run as a stream from its samples; each block is read once.


UPRIGHT = 0.999  # g: a pose that is as good as along gravity


def of_run(measured: MeasuredRun, channel: str | None, rate_hz: float | None) -> SampleStream:
    first = next((recorded for recorded in measured.kept() if _is_still(recorded)), None)
    if first is None:
        raise RecordError(f"run {measured.name} has no still record; `rig run noise-floor` or `rig run soak` makes one")
    names = first.samples.channels
    channel_name = channel_of(tuple(names), (channel or "").removesuffix("_v") or None, f"run {measured.name}")
    rate = agree_on_rate(first.samples.rate_hz, rate_hz or 0.0, f"run {measured.name}")
    corner = float(measured.constants.get("filter_corner_hz", np.inf))
    outputs = tuple(name for name in names if name in SENSOR and name != channel_name)
    unit = units_of(measured.run, [channel_name]).get(channel_name, "V")
    samples = SampleStream(
        measured.name, channel_name, rate, unit, iter(()), corner if channel_name in SENSOR else np.inf, outputs
    )
    samples.blocks, samples.constants = _still_blocks(measured, samples), measured.constants
    return samples


def _is_still(recorded: KeptPose) -> bool:
    return recorded.pose.path.split(" ")[0] in (STILL, HOLD)


def _still_blocks(measured: MeasuredRun, stream: SampleStream) -> Iterator[NDArray[Any]]:
    """Blocks of the still record in order. Gaps, logged columns and poses along gravity are added to `stream`."""
    next_s = None
    for recorded in measured.kept():
        samples = recorded.samples
        if stream.channel not in samples.channels:
            continue
        volts = samples.volts[:, samples.channels.index(stream.channel)]
        if not _is_still(recorded):
            _note_upright(recorded, volts, stream)
            continue
        if next_s is not None and abs(samples.start_s - next_s) > TIME_TOLERANCE / stream.rate_hz:
            stream.closed.append((next_s, samples.start_s - next_s))
        next_s = samples.start_s + len(volts) / stream.rate_hz
        if not stream.logged:
            stream.coarse |= coarse(recorded)
        for name, values in _supply_and_temperature(recorded):
            stream.logged.setdefault(name, []).extend(values)
        yield volts


def _supply_and_temperature(recorded: KeptPose) -> Iterator[tuple[str, list[Array]]]:
    """Temperature and supply of a block, as means of one second each, to use little memory."""
    samples, n = recorded.samples, len(recorded.samples.volts)
    temperature, supply = INFLUENCES
    if recorded.temperature_c is not None:
        yield temperature, [np.broadcast_to(recorded.temperature_c, n)]
    if (channel := supply.removesuffix("_v")) in samples.channels:
        volts = samples.volts[:, samples.channels.index(channel)]
        pieces = np.array_split(volts, max(1, round(n / samples.rate_hz)))
        yield supply, [np.broadcast_to(piece.mean(), len(piece)) for piece in pieces]


def coarse(recorded: KeptPose) -> dict[str, float]:
    """The steps of the supply's readings, where its noise does not smooth them in means."""
    channel = INFLUENCES[1].removesuffix("_v")
    if channel not in recorded.samples.channels:
        return {}
    step = hidden_step(recorded.samples.volts[:, recorded.samples.channels.index(channel)])
    return {} if step is None else {INFLUENCES[1]: step}


def _note_upright(recorded: KeptPose, volts: Array, stream: SampleStream) -> None:
    """The mean output of the channel's axis along gravity."""
    alpha, beta = np.radians(recorded.pose.alpha_deg), np.radians(recorded.pose.beta_deg)
    gravity: Mapping[str, float] = {"x": np.sin(alpha) * np.cos(beta), "y": np.sin(alpha) * np.sin(beta)}
    g = gravity.get(stream.channel[-1], 0.0) if stream.channel in SENSOR else 0.0
    if abs(g) > UPRIGHT and recorded.pose.flip == 0 and recorded.pose.mount_deg == 0:
        stream.upright.setdefault(round(g), float(volts.mean()))


# The stream of DATA: a table, an array in a file, or a run.


BLOCK = 1 << 17


def axes(record: Record | None, data: str, channel: str | None, rate_hz: float | None) -> dict[str, SampleStream]:
    """The samples of one sensor's axes by name: the requested axis alone, or all axes of the first sensor.

    A channel whose name has no axis in it is called x. `rate_hz` is for data without a rate of their own. Raises
    DataError and RecordError: no such file, run or channel; a rate that is missing or disagrees; gaps.
    """
    source = _source(record, data, rate_hz)
    first = source(channel)
    names = (first.channel, *first.others)
    name_parts = next(filter(None, map(AXIS.fullmatch, names)), None)
    if channel is not None or name_parts is None:
        return {_axis(first.channel): first}
    axis_names = [f"{name_parts[1]}{axis}{name_parts[3]}" for axis in AXES]
    return {_axis(name): source(name) for name in axis_names if name in names}


def _axis(channel: str) -> str:
    name_parts = AXIS.fullmatch(channel)
    return name_parts[2] if name_parts else AXES[0]


def _source(record: Record | None, data: str, rate_hz: float | None) -> Callable[[str | None], SampleStream]:
    """The function that gives the stream of a channel; a table is read once for all channels."""
    path = Path(data)
    if path.suffix == ".npy":
        if not path.is_file():
            raise DataError(f"{data}: there is no such file; `rig runs` lists the names of runs")
        return lambda _: _array_stream(path, rate_hz)
    if path.exists() or record is None:
        table = load(data, "still" if path.suffix != "" else None)
        return lambda channel: table_stream(table, channel, rate_hz)
    measured = MeasuredRun.named(record, data)
    if record.columns(measured.run.run)[0]:
        table = measured.table()
        return lambda channel: table_stream(table, channel, rate_hz)
    return lambda channel: of_run(measured, channel, rate_hz)


def _array_stream(path: Path, rate_hz: float | None) -> SampleStream:
    if rate_hz is None:
        raise DataError(f"{path}: an array does not contain the sample rate; give --rate HZ")
    try:
        with warnings.catch_warnings(action="ignore"):  # of a header as Python 2 wrote it
            array = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # its header is parsed as Python, which fails in many ways
        raise DataError(f"{path}: is not an array from numpy.save: {error}") from None
    if not isinstance(array, np.ndarray):
        raise DataError(f"{path}: is an archive of several arrays (.npz); save one array with numpy.save")
    if array.ndim == 2 and 1 in array.shape:
        array = array.reshape(-1)
    if array.ndim != 1:
        raise DataError(f"{path}: has an array of shape {array.shape}; save one channel, of shape (n,)")
    return SampleStream(
        str(path), "values", rate_hz, "count", (array[i : i + BLOCK] for i in range(0, len(array), BLOCK))
    )
