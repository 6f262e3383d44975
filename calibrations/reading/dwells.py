"""Raw samples of poses: a log of stage angles and outputs, many rows to a dwell, as a table of means.

Nobody repeats one pose for fifty rows on end where a row is a mean of seconds; a logger at 10 Hz or more does so in
each dwell of 5 s. So a table that does not count averaged samples is a log where its times follow each other as no
means can and the stages rest at all; without times, where most rows stand in such stretches. Poses measured twice or
three times stay as they are, and so does a soak with a row every few seconds.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.noise_estimation.mean_noise import measured_inflation
from calibrations.table import Array, Constant, Table

SHORTEST = 50  # rows in a stretch
FASTEST_MEANS_S = 0.5  # from one row to the next: no stage moves and settles in less
JITTER_DEG = 0.05  # of an encoder that holds still, peak to peak; stages resolve 5 arcmin
SHARE = 0.25  # of the typical stretch: what is shorter is a stage that stops on its way
SETTLE_S = 0.2  # at each end of a dwell where the log shows the stages moving
GAP, GAP_S = 20.0, 0.2  # times the usual distance of samples, and at least: the logger paused between two dwells
MOST_BLOCKS = 256  # stretches that the noise is measured on: bounds time and memory
SURE = 0.1  # relative standard error above which a measured inflation is left out
OUTPUTS = ("vx_v", "vy_v", "vz_v")
FIXED = ("direction", "mount_deg", "flip")


def is_pose_log(table: Table) -> bool:
    """Whether rows of poses are samples rather than means."""
    if table.kind != "poses" or table.n < 2 * SHORTEST or "n" in table or any(_std(v) in table for v in OUTPUTS):
        return False
    still = _windows(table, SHORTEST)
    if "t_s" in table:
        apart_s = float(np.median(np.abs(np.diff(table.column("t_s")))))
        return apart_s <= FASTEST_MEANS_S and len(still) > 0
    return 2 * sum(last - first for first, last in still) > table.n


def pose_means(log: Table) -> Table:
    """The mean of each dwell of `log`, with `n`, standard deviations, and the inflation of a mean's noise.

    Rows while the stages move are left out. The direction, where it is not given, follows from beta, dwell by dwell.
    Raises DataError where the stages never rest.
    """
    bounds = dwells(log)
    if not bounds:
        raise DataError(f"{log.source}: no dwell: alpha and beta never hold still for {SHORTEST} rows on end")
    axes = [name for name in OUTPUTS if name in log]
    columns = {name: _means(values, bounds) for name, values in log.columns.items()}
    for name in axes:
        columns[_std(name)] = np.array([log.columns[name][a:b].std(ddof=1) for a, b in bounds])
    columns["n"] = np.array([float(b - a) for a, b in bounds])
    for name in ("alpha_deg", "beta_deg"):
        columns[name] = np.round(columns[name], 3)  # a jittering encoder's mean too is that of the same pose again
    for name in FIXED:
        if name in log:
            columns[name] = np.array([log.columns[name][a] for a, _ in bounds])
    if "direction" not in log:
        columns |= _direction(columns["alpha_deg"], columns["beta_deg"])
    labels = {name: tuple(words[a] for a, _ in bounds) for name, words in log.labels.items()}
    constants = {**log.constants, **_rate(log, bounds), **_inflations(log, axes, bounds), "samples": float(log.n)}
    return Table.from_columns("poses", columns, constants, log.source, labels)


def dwells(log: Table) -> list[tuple[int, int]]:
    """First row and row after the last of each dwell.

    Windows grow until none of them lets a slow movement pass for rest.
    """
    width = SHORTEST
    stretches = _windows(log, width)
    while _is_moving(log, stretches) and 4 * width < log.n:
        width *= 2
        stretches = _windows(log, width)
    stretches = [(a, b) for a, b in stretches if not _is_moving(log, [(a, b)])]
    if not stretches:
        return []
    lengths = np.array([b - a for a, b in stretches])
    typical = np.sort(lengths)[np.searchsorted(np.cumsum(np.sort(lengths)), lengths.sum() / 2)]
    return _settled(log, [(a, b) for a, b in stretches if b - a >= SHARE * typical])


def _windows(log: Table, width: int) -> list[tuple[int, int]]:
    """Stretches in which every `width` rows on end have the same pose, but for jitter."""
    starts = log.n - width + 1
    if starts < 1:
        return []
    still = np.ones(starts, dtype=bool)
    for name in ("alpha_deg", "beta_deg"):
        still &= _span(log.columns[name], width) <= JITTER_DEG
    changes = np.cumsum(_changed(log))
    still &= changes[width - 1 :] == changes[:starts]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    return [(int(a), int(b) + width - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _span(values: Array, width: int) -> Array:
    """Greatest less least of every `width` values on end, shape (n - width + 1,)."""
    high, low, done = values, values, 1
    while done < width:  # the extremes over twice as many are those of two halves
        more = min(done, width - done)
        high, low = np.maximum(high[:-more], high[more:]), np.minimum(low[:-more], low[more:])
        done += more
    return np.asarray(high - low)


def _changed(log: Table) -> NDArray[np.bool_]:
    """Rows that are mounted, turned or labelled otherwise than the row before, or stand after a gap in time."""
    changed = np.zeros(log.n, dtype=bool)
    if "t_s" in log:
        gaps = np.abs(np.diff(log.columns["t_s"]))
        changed[1:] = gaps > max(GAP_S, GAP * float(np.median(gaps)))
    for name in FIXED:
        if name in log:
            changed[1:] |= np.diff(log.columns[name]) != 0
    for words in log.labels.values():
        changed[1:] |= np.array([a != b for a, b in pairwise(words)])
    return changed


def _is_moving(log: Table, stretches: list[tuple[int, int]]) -> bool:
    """Whether an angle changes more over a stretch than jitter can."""
    angles = [log.columns[name] for name in ("alpha_deg", "beta_deg")]
    return any(np.ptp(angle[a:b]) > 2 * JITTER_DEG for a, b in stretches for angle in angles)


def _settled(log: Table, stretches: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Without the rows at an end beyond which the stages move; at most a quarter of a dwell goes."""
    rate = _rate(log, stretches).get("sample_rate_hz", 0.0)
    rows = round(SETTLE_S * float(rate)) or SHORTEST // 5
    befores = [0, *(b for _, b in stretches)]
    afters = [*(a for a, _ in stretches[1:]), log.n]
    trimmed = []
    for (a, b), before, after in zip(stretches, befores, afters, strict=False):
        trim = min(rows, (b - a) // 8)
        trimmed.append((a + trim * (a > before), b - trim * (b < after)))
    return trimmed


def _means(values: Array, bounds: list[tuple[int, int]]) -> Array:
    return np.array([values[a:b].mean() for a, b in bounds])


def _direction(alpha: Array, beta: Array) -> dict[str, Array]:
    """Whether beta grew or fell to each dwell; 0 for the first at an inclination. Nothing where it never fell."""
    direction = np.zeros(len(beta))
    direction[1:] = np.where(np.abs(np.diff(alpha)) > JITTER_DEG, 0.0, np.sign(np.diff(beta)))
    return {"direction": direction} if {-1.0, 1.0} <= set(direction) else {}


def _rate(log: Table, bounds: list[tuple[int, int]]) -> dict[str, Constant]:
    """Samples a second, from the times within dwells, where no constant gives it."""
    if "sample_rate_hz" in log.constants or "t_s" not in log:
        return {}
    a, b = max(bounds, key=lambda bound: bound[1] - bound[0])
    length_s = float(abs(log.columns["t_s"][b - 1] - log.columns["t_s"][a]))
    return {"sample_rate_hz": (b - a - 1) / length_s} if length_s > 0 else {}


def _inflations(log: Table, axes: list[str], bounds: list[tuple[int, int]]) -> dict[str, Constant]:
    """`noise_inflation_x`, ...: how much more a mean scatters than one of independent samples, where it is known."""
    length = int(np.quantile([b - a for a, b in bounds], 0.1))
    starts = [a for a, b in bounds if b - a >= length][:: 1 + len(bounds) // MOST_BLOCKS]
    blocks = np.stack([np.column_stack([log.columns[name][a : a + length] for name in axes]) for a in starts])
    found = zip(axes, *measured_inflation(blocks), strict=True)
    return {f"noise_inflation_{name[1]}": float(factor) for name, factor, std in found if std < SURE * factor}


def _std(output: str) -> str:
    """`vx_v` -> `vx_std_v`."""
    return output.replace("_v", "_std_v")
