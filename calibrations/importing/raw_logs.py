"""Raw logs as tables of means: dwells of poses, still positions, sections of rates; directions of a turned
magnetometer.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibrations.criteria import (
    FASTEST_MEANS_S,
    FEWEST_ROWS_AT_REST,
    JITTER_DEG,
    LEAST_HANDLED_SPREAD,
    LEAST_TURNED_SPREAD,
    LONGEST_PAUSE,
    MOST_STILL_NOISE,
    MOST_UNCERTAIN_INFLATION,
    SHORTEST_DWELL_SHARE,
    SHORTEST_PAUSE_S,
    SHORTEST_STILL_S,
)
from calibrations.errors import DataError, MissingConstant
from calibrations.geometry.sphere import sphere_centre
from calibrations.importing.plausible import log_rate_hz
from calibrations.importing.sessions import average_sections, is_section_log
from calibrations.means.noise import autocovariance, measured_inflation
from calibrations.table import Array, Constant, Table, std_column

# Still intervals of a raw log: a table of positions from samples of a sensor that was put down again and again.
#
# A window is still if its standard deviation over the three axes is near that of the quietest windows. An interval
# of still windows is trimmed at both ends, where the hand still touches the sensor.

WINDOW_S = 0.5
TRIM_S = 0.2
SHORTEST_LOG_S = 2 * SHORTEST_STILL_S  # two still intervals
QUIET_QUANTILE = 0.05  # of the windows are certainly still


def average_still_positions(log: Table, rate_hz: float) -> Table:
    """The mean of each still interval of `log` (ax, ay, az or mx, my, mz, and the other columns).

    `norm_std` is the noise of the magnitude alone: a swaying hand turns the sensor but does not change |a|.

    Raises DataError for fewer than two intervals, and where the sensor was not turned between them.
    """
    samples = log.outputs
    bounds = still_intervals(samples, rate_hz)
    if len(bounds) < 2:
        count = "one still interval" if bounds else "no still intervals"
        length = f"{log.n / rate_hz:.3g} s at {rate_hz:.4g} samples a second"
        remedy = "keep the sensor still for 1 s or more in each of many positions; for a log at rest use `rig noise`"
        raise DataError(f"{log.source}: found {count} in {length}; if the log is longer, correct its time; {remedy}")
    if _is_alike(samples, bounds):
        raise DataError(
            f"{log.source}: {', '.join(log.output_names)} are the same in all {len(bounds)} still intervals within "
            "the noise; turn the accelerometer between them, so that gravity acts along other axes"
        )
    names = [name for name in log.columns if not name.endswith("_std")]
    columns: dict[str, list[float]] = {name: [] for name in names}
    columns |= {f"{name}_std": [] for name in (*log.output_names, "norm")} | {"n": []}
    centre = sphere_centre(np.array([samples[first:last].mean(axis=0) for first, last in bounds]))
    for first, last in bounds:
        for name in names:
            columns[name].append(float(np.mean(log.columns[name][first:last])))
        for name in log.output_names:
            columns[f"{name}_std"].append(_effective_std(log.columns[name][first:last]))
        columns["norm_std"].append(_effective_std(np.linalg.norm(samples[first:last] - centre, axis=1)))
        columns["n"].append(last - first)
    if "t_s" not in columns:
        columns["t_s"] = [(first + last) / 2 / rate_hz for first, last in bounds]
    constants: Mapping[str, Constant] = {k: v for k, v in log.constants.items() if k != "filter_corner_hz"}
    return Table.from_columns("positions", columns, constants, log.source)


def _is_alike(samples: Array, bounds: list[tuple[int, int]]) -> bool:
    """Whether the means of the still intervals differ by noise only, as those of a gyroscope do."""
    means = np.array([samples[first:last].mean(axis=0) for first, last in bounds])
    noise = np.median([np.linalg.norm(samples[first:last].std(axis=0)) for first, last in bounds])
    return bool(np.linalg.norm(means.std(axis=0)) < LEAST_TURNED_SPREAD * noise)


def is_raw_log(table: Table) -> bool:
    """Whether rows are samples of positions: many rows, and no count of averaged samples."""
    return table.type.magnitude and table.n >= 1000 and "n" not in table


def still_intervals(samples: Array, rate_hz: float) -> list[tuple[int, int]]:
    """First row and end row of each still interval; `samples` has shape (n, 3)."""
    width = max(4, round(WINDOW_S * rate_hz))
    if len(samples) < width:
        return []
    spread = _moving_std(samples, width)
    quiet = float(np.quantile(spread, QUIET_QUANTILE))
    if np.max(spread) < LEAST_HANDLED_SPREAD * quiet:
        return []
    still = spread < MOST_STILL_NOISE * max(quiet, np.finfo(float).tiny)
    trim, shortest = round(TRIM_S * rate_hz), round(SHORTEST_STILL_S * rate_hz)
    runs = [(a + trim, b + width - 1 - trim) for a, b in _runs(still)]
    return [(a, b) for a, b in runs if b - a >= shortest]


def _moving_std(samples: Array, width: int) -> Array:
    """Root of the summed variances in each window, shape (n - width + 1,)."""
    variance = np.zeros(len(samples) - width + 1)
    for values, mean in zip(samples.T, samples.mean(axis=0), strict=True):  # one axis at a time takes a third of memory
        centred = values - mean
        first, second = (np.concatenate([[0.0], np.cumsum(power)]) for power in (centred, centred**2))
        variance += (second[width:] - second[:-width]) / width - ((first[width:] - first[:-width]) / width) ** 2
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Begin and end (exclusive) of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _effective_std(x: Array) -> float:
    """The standard deviation whose quotient by sqrt(n) is that of the mean, so that it contains the samples'
    correlation.

    From the autocovariance, summed until it first falls below zero (initial positive sequence).
    """
    n = len(x)
    acov = autocovariance(x, n // 2)
    negative_lags = np.flatnonzero(acov <= 0)
    end = int(negative_lags[0]) if len(negative_lags) else len(acov)
    return float(np.sqrt(max(acov[0] + 2 * acov[1:end].sum(), 0.0) * n / (n - 1)))


CELLS_PER_EDGE = 9  # of a cube's face


def thin_by_direction(log: Table) -> Table:
    """Thin the log of a hand-turned magnetometer to one row for each direction, in order.

    The sphere of directions is divided into cells of about 10 deg (a cube's faces in squares). The middle row in time
    represents a cell: a mean over a turn would be too short, and a long rest would outweigh the turns.
    """
    u = log.outputs - sphere_centre(log.outputs)
    rows, face = np.arange(log.n), np.argmax(np.abs(u), axis=1)
    height = u[rows, face]
    size = np.where(height == 0, 1.0, np.abs(height))
    place = np.stack([u[rows, (face + k) % 3] / size for k in (1, 2)])
    square = np.clip(np.floor((place + 1) / 2 * CELLS_PER_EDGE), 0, CELLS_PER_EDGE - 1)
    cells = np.stack([face, height < 0, *square])
    _, cell = np.unique(cells, axis=1, return_inverse=True)
    order = np.argsort(cell.ravel(), kind="stable")
    edges = np.flatnonzero(np.diff(cell.ravel()[order], prepend=-1, append=-1))
    middle = (edges[:-1] + edges[1:] - 1) // 2
    return log.rows(np.sort(order[middle]))


# Raw samples of poses: a log of stage angles and outputs, many rows to a dwell, as a table of means.
#
# Nobody repeats one pose for fifty rows on end where a row is a mean of seconds; a logger at 10 Hz or more does so in
# each dwell of 5 s. So a table that does not count averaged samples is a log where its times follow each other as no
# means can and the stages rest at all; without times, where most rows are in such stretches. Poses measured twice
# or three times stay as they are, and so does a soak with a row every few seconds.

SETTLE_S = 0.2  # dropped at each end of a dwell where the log shows the stages moving
MOST_BLOCKS = 256  # stretches for the noise: limits time and memory
MOUNTING_COLUMNS = ("direction", "mount_deg", "flip")


def is_pose_log(table: Table) -> bool:
    """Whether rows of poses are samples, not means."""
    if (
        not table.type.stage_angles
        or table.n < 2 * FEWEST_ROWS_AT_REST
        or "n" in table
        or any(name in table for name in table.std_names)
    ):
        return False
    still = _windows(table, FEWEST_ROWS_AT_REST)
    if "t_s" in table:
        apart_s = float(np.median(np.abs(np.diff(table.column("t_s")))))
        return apart_s <= FASTEST_MEANS_S and len(still) > 0
    return 2 * sum(last - first for first, last in still) > table.n


def average_dwells(log: Table) -> Table:
    """The mean of each dwell of `log`, with `n`, standard deviations, and the inflation of a mean's noise.

    Rows while the stages move are left out. A missing direction is derived from beta, dwell by dwell. Raises DataError
    where the stages never rest.
    """
    bounds = find_dwells(log)
    if not bounds:
        raise DataError(
            f"{log.source}: no dwell: alpha and beta never rest for {FEWEST_ROWS_AT_REST} successive rows; "
            "record longer dwells"
        )
    axes = list(log.output_names)
    columns = {name: _means(values, bounds) for name, values in log.columns.items()}
    for name in axes:
        columns[std_column(name)] = np.array([log.columns[name][a:b].std(ddof=1) for a, b in bounds])
    columns["n"] = np.array([float(b - a) for a, b in bounds])
    for name in ("alpha_deg", "beta_deg"):
        columns[name] = np.round(columns[name], 3)  # a jittering encoder's mean too is that of the same pose again
    for name in MOUNTING_COLUMNS:
        if name in log:
            columns[name] = np.array([log.columns[name][a] for a, _ in bounds])
    if "direction" not in log:
        columns |= _direction(columns["alpha_deg"], columns["beta_deg"])
    labels = {name: tuple(words[a] for a, _ in bounds) for name, words in log.labels.items()}
    constants = {**log.constants, **_rate(log, bounds), **_inflations(log, axes, bounds), "samples": float(log.n)}
    return Table.from_columns("poses", columns, constants, log.source, labels)


def find_dwells(log: Table) -> list[tuple[int, int]]:
    """First row and end row of each dwell.

    Windows grow until a slow movement no longer counts as rest.
    """
    width = FEWEST_ROWS_AT_REST
    stretches = _windows(log, width)
    while _is_moving(log, stretches) and 4 * width < log.n:
        width *= 2
        stretches = _windows(log, width)
    stretches = [(a, b) for a, b in stretches if not _is_moving(log, [(a, b)])]
    if not stretches:
        return []
    lengths = np.array([b - a for a, b in stretches])
    typical = np.sort(lengths)[np.searchsorted(np.cumsum(np.sort(lengths)), lengths.sum() / 2)]
    return _select_settled(log, [(a, b) for a, b in stretches if b - a >= SHORTEST_DWELL_SHARE * typical])


def _windows(log: Table, width: int) -> list[tuple[int, int]]:
    """Stretches in which any `width` successive rows have the same pose within jitter."""
    starts = log.n - width + 1
    if starts < 1:
        return []
    still = np.ones(starts, dtype=bool)
    for name in ("alpha_deg", "beta_deg"):
        still &= _span(log.columns[name], width) <= JITTER_DEG
    changes = np.cumsum(_find_changes(log))
    still &= changes[width - 1 :] == changes[:starts]
    return [(begin, end + width - 1) for begin, end in _runs(still)]


def _span(values: Array, width: int) -> Array:
    """Maximum less minimum of any `width` successive values, shape (n - width + 1,)."""
    high, low, covered = values, values, 1
    while covered < width:  # the extremes over twice as many are those of two halves
        step = min(covered, width - covered)
        high, low = np.maximum(high[:-step], high[step:]), np.minimum(low[:-step], low[step:])
        covered += step
    return np.asarray(high - low)


def _find_changes(log: Table) -> NDArray[np.bool_]:
    """Rows with another mounting or label than the row before, or after a gap in time."""
    is_change = np.zeros(log.n, dtype=bool)
    if "t_s" in log:
        gaps = np.abs(np.diff(log.columns["t_s"]))
        is_change[1:] = gaps > max(SHORTEST_PAUSE_S, LONGEST_PAUSE * float(np.median(gaps)))
    for name in MOUNTING_COLUMNS:
        if name in log:
            is_change[1:] |= np.diff(log.columns[name]) != 0
    for words in log.labels.values():
        is_change[1:] |= np.array([a != b for a, b in pairwise(words)])
    return is_change


def _is_moving(log: Table, stretches: list[tuple[int, int]]) -> bool:
    """Whether an angle changes by more than jitter over a stretch."""
    angles = [log.columns[name] for name in ("alpha_deg", "beta_deg")]
    return any(np.ptp(angle[a:b]) > 2 * JITTER_DEG for a, b in stretches for angle in angles)


def _select_settled(log: Table, stretches: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The stretches without rows near a movement; at most a quarter of a dwell is dropped."""
    rate = _rate(log, stretches).get("sample_rate_hz", 0.0)
    rows = round(SETTLE_S * float(rate)) or FEWEST_ROWS_AT_REST // 5
    befores = [0, *(b for _, b in stretches)]
    afters = [*(a for a, _ in stretches[1:]), log.n]
    trimmed = []
    for (a, b), end_before, start_after in zip(stretches, befores, afters, strict=False):
        trim = min(rows, (b - a) // 8)
        trimmed.append((a + trim * (a > end_before), b - trim * (b < start_after)))
    return trimmed


def _means(values: Array, bounds: list[tuple[int, int]]) -> Array:
    return np.array([values[a:b].mean() for a, b in bounds])


def _direction(alpha: Array, beta: Array) -> dict[str, Array]:
    """The sense in which beta reached each dwell; 0 for the first at an inclination. Nothing where beta never fell."""
    direction = np.zeros(len(beta))
    direction[1:] = np.where(np.abs(np.diff(alpha)) > JITTER_DEG, 0.0, np.sign(np.diff(beta)))
    return {"direction": direction} if {-1.0, 1.0} <= set(direction) else {}


def _rate(log: Table, bounds: list[tuple[int, int]]) -> dict[str, Constant]:
    """Sample rate from the times within dwells, where no constant gives it."""
    if "sample_rate_hz" in log.constants or "t_s" not in log:
        return {}
    a, b = max(bounds, key=lambda bound: bound[1] - bound[0])
    length_s = float(abs(log.columns["t_s"][b - 1] - log.columns["t_s"][a]))
    return {"sample_rate_hz": (b - a - 1) / length_s} if length_s > 0 else {}


def _inflations(log: Table, axes: list[str], bounds: list[tuple[int, int]]) -> dict[str, Constant]:
    """`noise_inflation_x`, ...: scatter of a mean over that of independent samples, where it is known well enough."""
    length = int(np.quantile([b - a for a, b in bounds], 0.1))
    starts = [a for a, b in bounds if b - a >= length][:: 1 + len(bounds) // MOST_BLOCKS]
    blocks = np.stack([np.column_stack([log.columns[name][a : a + length] for name in axes]) for a in starts])
    inflations = zip(axes, *measured_inflation(blocks), strict=True)
    return {
        f"noise_inflation_{name[1]}": float(factor)
        for name, factor, std in inflations
        if std < MOST_UNCERTAIN_INFLATION * factor
    }


# A raw log as a table: means of dwells, of rests and turns, or of still positions.

RATE_NAMES = ("fs", "sample rate", "sampling rate", "sample frequency", "sampling frequency", "odr")


def average_raw_log(log: Table) -> Table:
    """The means of a raw log; the table itself if its rows are means. Raises DataError, MissingConstant."""
    if is_pose_log(log):
        return average_dwells(log)
    if is_raw_log(log) and log.type.field:
        return thin_by_direction(log)
    if is_section_log(log):
        return average_sections(log)
    return average_still_positions(log, _rate_hz(log)) if is_raw_log(log) else log


def _rate_hz(log: Table) -> float:
    """Sample rate, Hz. Raises MissingConstant where the log does not give it, DataError for one that does not fit."""
    rate_hz = log_rate_hz(log.columns.get("t_s"), log.number("sample_rate_hz", 0.0), log.source)
    if rate_hz > 0 and log.n < SHORTEST_LOG_S * rate_hz:
        raise DataError(
            f"{log.source}: at {rate_hz:g} samples a second this log of {log.n} samples lasts "
            f"{log.n / rate_hz:.2g} s, too short for still intervals; correct sample_rate_hz or t_s"
        )
    if rate_hz > 0:
        return rate_hz
    name, likely = _likely_rate(log.constants)
    requirement = f"the column t_s, or a line such as `# sample_rate_hz: {likely or 100:g}` above its header"
    hint = f'; the constant "{name}" is likely the sample rate' if likely else ""
    option = f"in `rig import`, --constant sample_rate_hz={likely or 100:g}"
    raise MissingConstant(f"{log.source}: a raw log needs {requirement} ({option}){hint}", "sample_rate_hz", likely)


def _likely_rate(constants: Mapping[str, Constant]) -> tuple[str, float | None]:
    """A constant that is likely the sample rate, and its value."""
    for name, value in constants.items():
        if name.lower().replace("_", " ") in RATE_NAMES and isinstance(value, float) and value > 0:
            return name, value
    return "", None
