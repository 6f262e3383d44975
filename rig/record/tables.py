"""Tables of runs for the analysis, from the samples of the record: poses, and single samples.

The record has the commanded angles of the poses. The table has the actual angles: for a manual stage the reading of its
dial, and for a stage with an error table the true angle. The commanded angles are in the column `alpha_set_deg`. The
constant `alpha_std_deg` is the standard uncertainty of the angles (rms over the poses).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from math import sqrt
from typing import Any

import numpy as np

from calibrations.geometry.error_table import ErrorTable
from calibrations.means.noise import measured_inflation
from calibrations.table import Array, Table, std_column
from calibrations.tables import KINDS
from drivers.recorder import Samples
from procedures.instruments import OUTPUTS
from rig.bench import D63, TURNING, Bench, Instrument
from rig.errors import RecordError
from rig.record.values import KeptPose, Run

Columns = Mapping[str, Array]


def correct_angles(run: Run, columns: Columns) -> tuple[dict[str, Array], dict[str, float]]:
    """Columns with the actual angles of `run`, and constants with their standard uncertainties.

    Raises DataError for an angle outside an error table.
    """
    corrected, constants = dict(columns), {}
    for role in TURNING:
        if f"{role}_deg" not in corrected:
            continue
        read_deg = corrected.pop(f"{role}_read_deg", None)
        part = run.bench.get("instruments", {}).get(role)
        points = part and part.get("error_table")
        if read_deg is None and not points:
            continue
        shown_deg = corrected[f"{role}_deg"] if read_deg is None else read_deg
        variance = np.full(len(shown_deg), 0.0 if read_deg is None else _resolution_deg(part) ** 2 / 12)
        true_deg = shown_deg
        if points:
            true_deg, table_std_deg = ErrorTable(tuple(map(tuple, points))).true_deg(shown_deg)
            variance = variance + table_std_deg**2
        corrected |= {f"{role}_set_deg": corrected[f"{role}_deg"], f"{role}_deg": true_deg}
        constants[f"{role}_std_deg"] = sqrt(float(variance.mean()))
    return corrected, constants


def _resolution_deg(part: Mapping[str, Any]) -> float:
    """Resolution of the dial of a manual stage, deg."""
    return float(Instrument.model_validate(part).parse_settings().resolution_deg)


# Displacement of the carriage, from the channel d63 and the calibration curve of the run's bench. It is positive
# towards the sensor's +x. The converter samples the channels of a scan in turn; the constants have the delays.

UM = 1e-6
DIGITAL = {f"{sensor}{axis}" for sensor in "agm" for axis in "xyz"}  # channels that may have another unit than V
AXES = tuple(chain(*OUTPUTS))  # outputs of the sensor; other channels are regressors
OUT_OF_PLANE = tuple(names[2] for names in OUTPUTS)  # which no motion of the carriage changes


def units_of(run: Run, channels: Iterable[str]) -> dict[str, str]:
    """The unit of those of `channels` that are not in V, as a digital sensor's."""
    possible = [channel for channel in channels if channel in DIGITAL]
    if not possible or not run.bench.get("instruments"):  # the bench of an imported run is unknown
        return {}
    bench = Bench.model_validate(run.bench)
    return {channel: unit for channel in possible if (unit := bench.unit_of(channel)) != "V"}


def column_of(channel: str, units: Mapping[str, str]) -> str:
    """The column of a channel: `vx` -> `vx_v`; that of a digital sensor's output has no unit in its name."""
    return channel if channel in units else f"{channel}_v"


def stated_unit(units: Mapping[str, str]) -> dict[str, str]:
    """The unit of outputs whose columns do not name it, as a constant of the table."""
    return {"unit": next(iter(units.values()))} if units else {}


def displacement_m(run: Run, volts: Array) -> Array:
    """Displacement of each sample, m, shape (n,), from an arbitrary zero.

    Raises SensorFault for a reading outside the curve, RecordError without a curve in the run's bench.
    """
    sensor = Bench.model_validate(run.bench).d63
    if sensor is None:
        raise RecordError(f"run {run.run}: its bench has no key d63 with the curve of the displacement sensor")
    return sensor.direction * UM * sensor.curve.displacement_um(volts, sensor.side)


def constants(run: Run, sensor: str | None) -> dict[str, str | float]:
    """Serial number and date of the displacement sensor's curve, and the delay of each axis after it, s."""
    bench = Bench.model_validate(run.bench)
    if bench.d63 is None:
        return {}
    adc, prefix = bench.instruments["adc"].parse_settings(), f"{sensor}." if sensor else ""
    channels = {axis: f"{prefix}{axis}" for axis in AXES if f"{prefix}{axis}" in adc.channels}
    skews = {f"skew_{axis[1]}_s": round(adc.lag_s(channel) - adc.lag_s(D63), 9) for axis, channel in channels.items()}
    return {"d63_serial": bench.d63.curve.serial, "d63_calibrated": bench.d63.curve.date, **skews}


# Tables of single samples: from the poses whose path begins with the kind of the table, such as `still 0`. A table of
# `motion` has the displacement in place of the displacement sensor's volts, and the attitude.


def samples_table(run: Run, poses: Iterable[KeptPose]) -> Table:
    """Every sample of the run's kind with its time. Raises RecordError without samples."""
    stretches = [recorded for recorded in poses if recorded.pose.path.split(" ")[0] == run.kind]
    if not stretches:
        raise RecordError(f"run {run.run} has no samples of kind {run.kind} yet; `rig resume` continues it")
    names = stretches[0].samples.channels
    units = units_of(run, names)
    volts = np.concatenate([recorded.samples.volts for recorded in stretches])
    columns = {"t_s": np.concatenate([_times_s(recorded) for recorded in stretches])}
    columns |= {
        column_of(name, units): volts[:, k]
        for k, name in enumerate(names)
        if not (KINDS[run.kind].moving and name in OUT_OF_PLANE)
    }
    if KINDS[run.kind].moving:
        columns |= _attitude(stretches) | {"displacement_m": displacement_m(run, columns.pop(f"{D63}_v"))}
    columns, angle_stds = correct_angles(run, columns)
    constants = {**run.constants, **stated_unit(units), **angle_stds, "sample_rate_hz": stretches[0].samples.rate_hz}
    return Table.from_columns(run.kind, columns, constants, run.run)


def _attitude(stretches: Sequence[KeptPose]) -> dict[str, Array]:
    """Stage angles and temperature, one value for each stretch; columns with an unknown value are omitted."""
    lengths = [len(recorded.samples.volts) for recorded in stretches]
    values: dict[str, list[float | None]] = {
        "alpha_deg": [recorded.pose.alpha_deg for recorded in stretches],
        "beta_deg": [recorded.pose.beta_deg for recorded in stretches],
        "alpha_read_deg": [recorded.alpha_read_deg for recorded in stretches],
        "beta_read_deg": [recorded.beta_read_deg for recorded in stretches],
        "temperature_c": [recorded.temperature_c for recorded in stretches],
    }
    return {name: np.repeat(np.array(v, dtype=float), lengths) for name, v in values.items() if None not in v}


def _times_s(recorded: KeptPose) -> Array:
    """Times of the samples of a stretch on the run's clock, s."""
    n, rate_hz = len(recorded.samples.volts), recorded.samples.rate_hz
    return np.asarray(recorded.t_s + (np.arange(n) - n / 2) / rate_hz)


# Tables of poses: mean, standard deviation and number of the samples. The displacement sensor is omitted: at rest its
# signal is noise, which must not become a regressor.

MOST_BLOCKS = 256  # blocks of a run for the measurement of its noise: bounds the memory
SURE = 0.1  # relative standard error above which the formula of the filter is better


def poses_table(run: Run, poses: Iterable[KeptPose]) -> Table:
    """A row for each of the run's `poses`. Raises RecordError without one."""
    rows: list[dict[str, float]] = []
    paths: list[str] = []
    numbers: list[int] = []
    blocks: list[Samples] = []
    stride = 1 + run.rows // MOST_BLOCKS
    units: Mapping[str, str] | None = None
    for number, recorded in enumerate(poses):
        units = units_of(run, recorded.samples.channels) if units is None else units
        rows.append(_row(recorded, units))
        paths.append(recorded.pose.path)
        numbers.append(recorded.number)
        if number % stride == 0:
            blocks.append(recorded.samples)
    if not rows:
        raise no_poses(run)
    names = [name for name in rows[0] if all(name in row for row in rows)]
    columns = {name: np.array([row[name] for row in rows]) for name in names}
    labels = {"path": tuple(paths)} if any(paths) else {}
    columns, angle_stds = correct_angles(run, columns)
    constants = {**run.constants, **stated_unit(units or {}), **angle_stds, "sample_rate_hz": blocks[0].rate_hz}
    constants |= inflations(blocks)
    table = Table.from_columns(run.kind, _useful(columns), constants, run.run, labels)
    return replace(table, numbers=np.array(numbers))


def no_poses(run: Run) -> RecordError:
    """The error of a run from which no table can be made: it has not begun, or its procedure measures no poses."""
    if run.state == "complete":
        return RecordError(f"run {run.run} has no poses; `rig show {run.run}` shows its results")
    return RecordError(f"run {run.run} has no pose yet; `rig resume` continues it")


def _row(recorded: KeptPose, units: Mapping[str, str]) -> dict[str, float]:
    """The numbers of one pose by column."""
    pose, samples = recorded.pose, recorded.samples
    row: dict[str, float] = {"alpha_deg": pose.alpha_deg, "beta_deg": pose.beta_deg, "direction": pose.direction}
    row |= {"mount_deg": pose.mount_deg, "flip": pose.flip, "t_s": recorded.t_s}
    optional = {name: getattr(recorded, name) for name in ("temperature_c", "alpha_read_deg", "beta_read_deg")}
    row |= {name: value for name, value in optional.items() if value is not None}
    means = samples.volts.mean(axis=0)
    names = [column_of(name, units) for name in samples.channels]
    row |= {name: float(m) for name, m in zip(names, means, strict=True) if name != f"{D63}_v"}
    if len(samples.volts) > 1:
        stds = samples.volts.std(axis=0, ddof=1)
        columns = zip(samples.channels, names, stds, strict=True)
        row |= {std_column(name): float(s) for channel, name, s in columns if channel in AXES}
    return row | {"n": len(samples.volts)}


def _useful(columns: dict[str, Array]) -> dict[str, Array]:
    """The columns, with those of the mounting only if it was changed."""
    return {k: column for k, column in columns.items() if k not in ("mount_deg", "flip") or column.any()}


def inflations(blocks: Sequence[Samples], axes: Sequence[str] = AXES) -> dict[str, float]:
    """Ratio of the noise of a mean to that of independent samples, from the blocks with the length of the first."""
    first = blocks[0]
    places = [k for k, name in enumerate(first.channels) if name in axes]
    equal_blocks = np.stack([b.volts[:, places] for b in blocks if b.volts.shape == first.volts.shape])
    names = [f"noise_inflation_{first.channels[k][1:]}" for k in places]
    factors = zip(names, *measured_inflation(equal_blocks), strict=True)
    return {name: float(factor) for name, factor, std in factors if std < SURE * factor}
