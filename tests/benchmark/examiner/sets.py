"""One set: a sensor with hidden causes on a drawn bench, as the table that a user would have, and its truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.benchmark.examiner.averaging import averaged, sampled
from tests.benchmark.examiner.cause import Cause, draw_constants
from tests.benchmark.examiner.chain import Hidden, converted, output, rms, sized
from tests.benchmark.examiner.imitation import remainders
from tests.benchmark.examiner.layouts import LAYOUTS, THERE_AND_BACK, Array
from tests.benchmark.examiner.record import Demands, Record, draw_record
from tests.benchmark.examiner.remarks import missed, remarks
from tests.benchmark.examiner.room import slow_noise, wander
from tests.benchmark.examiner.unknown import CAUSES

MANY = ("many5", "many8")
SIZES = (3.0, 300.0)  # of one of many causes, in white noise of a mean
BOUNDED = {"quantisation": 30.0, "saturation": 30.0}  # largest size
SUPPLY_NOISE_V = 2e-5
UNKNOWN = {cause.name for cause in CAUSES}


@dataclass(frozen=True)
class Observed:
    """Means and standard deviations, V, (n, 2). `clean_v` has neither white nor slow noise."""

    mean_v: Array
    std_v: Array
    clean_v: Array
    white_v: float
    slow_kind: str
    slow_over_white: float


def draw_set(kind: str, causes: Sequence[Cause], strength: float | None, seed: int) -> tuple[str, dict[str, Any]]:
    """CSV text and truth. `strength`: size of each cause in white noise of a mean; None draws each from `SIZES`."""
    random = np.random.default_rng(seed)
    demands = _demands(random, kind, causes)
    layout = _layout(random, kind, causes)
    record = draw_record(seed + 7, layout, _with_restart(demands, causes, layout))
    hidden = []
    for cause in causes:
        constants = draw_constants(random, record)
        hidden.append(sized(record, cause, constants, _size(random, cause) if strength is None else strength))
    observed = _observed(random, record, hidden)
    text = _table(random, record, observed)
    return text, {"kind": kind, **_truth(record, hidden, observed, strength)}


def _demands(random: np.random.Generator, kind: str, causes: Sequence[Cause]) -> Demands:
    needs = {need for cause in causes for need in cause.needs}
    averaging = None
    if "few samples" in needs:
        averaging = "few-samples"
    elif kind in MANY:
        averaging = str(random.choice(["full", "other-filter"]))
    elif "vibration" in needs:
        averaging = str(random.choice(["full", "other-filter", "silent-correlated", "no-n"]))
    if kind in MANY:
        needs |= {"temperature", "supply", "direction"}
    return Demands(needs, "cycle" if "cycle" in needs else None, averaging, None, kind in MANY)


def _with_restart(demands: Demands, causes: Sequence[Cause], layout: str) -> Demands:
    """A warm-up on two days starts again with the sensor; a drift goes on."""
    restarted = False if any(cause.name == "bias-drift" for cause in causes) else None
    if "young" in demands.needs and layout == "two_days":
        restarted = True
    return replace(demands, restarted=restarted)


def _layout(random: np.random.Generator, kind: str, causes: Sequence[Cause]) -> str:
    """A layout that shows all causes."""
    possible = [layout for layout in LAYOUTS if all(_shows(layout, cause) for cause in causes)]
    if kind not in ("null", "single"):
        possible = [layout for layout in possible if layout != "optimal60"]
    if kind in MANY:
        possible = [x for x in possible if x in (*THERE_AND_BACK, "serpentine", "random", "alpha_inner")]
    return str(random.choice(possible))


def _shows(layout: str, cause: Cause) -> bool:
    if cause.layouts and layout not in cause.layouts:
        return False
    if cause.name == "stage-eccentricity" and layout == "alpha_inner":
        return False
    if cause.name == "temperature-hysteresis" and layout in ("optimal60", "two_days"):
        return False
    return cause.is_smooth or layout != "optimal60"


def _size(random: np.random.Generator, cause: Cause) -> float:
    smallest, largest = SIZES[0], BOUNDED.get(cause.name, SIZES[1])
    return float(np.exp(random.uniform(math.log(smallest), math.log(largest))))


def _observed(random: np.random.Generator, record: Record, hidden: Sequence[Hidden]) -> Observed:
    floor, averaging, vibration = record.sensor.floor_v, record.averaging, record.vibration
    converters = [h for h in hidden if h.cause.stage == "converter"]
    before = [h for h in hidden if h.cause.stage != "converter"]
    clean = output(record, before) if before else record.ideal_v
    ratio, kind = float(random.uniform(0, 0.6)), str(random.choice(["flicker", "walk"]))
    slow = np.stack([slow_noise(random, record.clock.elapsed, kind) for _ in (0, 1)], 1) * ratio * floor
    mean = clean + slow
    if averaging.kind == "few-samples":
        samples = sampled(random, mean, averaging, vibration, record.sensor.scale_v)
        for h in converters:
            samples = h.applied(record, samples)
        observed, std = samples.mean(-1), samples.std(-1, ddof=1)
    else:
        observed, std = averaged(random, mean, averaging, vibration, record.sensor.scale_v, floor)
    white = floor
    if converters:
        clean = converted(record, clean, converters[0])
        white = math.sqrt(max(np.mean((observed - clean) ** 2) - (ratio * floor) ** 2, floor**2 / 4))
    return Observed(observed, std, clean, white, kind, ratio)


def _table(random: np.random.Generator, record: Record, observed: Observed) -> str:
    """The file: head and columns, some of which are missing."""
    poses, columns, averaging = record.poses, record.columns, record.averaging
    noise = columns.thermometer_noise_k * random.normal(size=record.n)
    celsius = np.round((record.temperature.celsius + noise) / columns.thermometer_step_k) * columns.thermometer_step_k
    supply = record.supply.volts + SUPPLY_NOISE_V * random.normal(size=record.n)
    has_mount = poses.layout == "flip_and_mount"
    table: list[tuple[bool, str, Array, str]] = [
        (True, "path", poses.path, "%d"),
        (True, "t_s", record.clock.t, "%.2f"),
        (True, "alpha_deg", poses.alpha, "%.4f"),
        (True, "beta_deg", poses.beta, "%.4f"),
        (columns.has_direction, "direction", poses.direction, "%d"),
        (columns.has_temperature, "temperature_c", celsius, "%.4f"),
        (True, "vx_v", observed.mean_v[:, 0], "%.7f"),
        (True, "vy_v", observed.mean_v[:, 1], "%.7f"),
        (averaging.states_std, "vx_std_v", observed.std_v[:, 0], "%.7f"),
        (averaging.states_std, "vy_std_v", observed.std_v[:, 1], "%.7f"),
        (averaging.states_n, "n", np.full(record.n, float(averaging.n)), "%d"),
        (columns.has_supply, "supply_v", supply, "%.7f"),
        (has_mount, "mount_deg", poses.mount, "%.1f"),
        (has_mount, "flip", poses.flip, "%d"),
    ]
    if columns.has_humidity:
        table.append((True, "humidity_pct", 45 + 4 * wander(random, record.clock.elapsed, 3000.0), "%.2f"))
    head = [f"# gravity_m_s2: {record.gravity_m_s2:.5f}"] if random.random() < 0.8 else []
    if averaging.states_filter:
        head += [f"# sample_rate_hz: {averaging.rate_hz:g}", f"# filter_corner_hz: {averaging.corner_hz:g}"]
    shown = [(name, values, form) for is_shown, name, values, form in table if is_shown]
    rows = [",".join(form % values[i] for _, values, form in shown) for i in range(record.n)]
    return "\n".join([*head, ",".join(name for name, _, _ in shown), *rows]) + "\n"


def _truth(record: Record, hidden: Sequence[Hidden], observed: Observed, strength: float | None) -> dict[str, Any]:
    """Causes, sizes and what makes the set difficult, as `tests.benchmark.hidden` reads it."""
    imitated: dict[str, dict[str, float]] = {}
    left: dict[str, float] = {}
    is_unknown = any(h.cause.name in UNKNOWN for h in hidden)
    for h in hidden if not is_unknown else ():
        by = remainders(record, h)
        if h.cause.name in by:
            left[h.cause.name] = round(by.pop(h.cause.name), 2)
        if near := {name: round(value, 2) for name, value in by.items() if value < 1.0}:
            imitated[h.cause.name] = near
    words = missed(hidden)
    if any(h.cause.stage == "converter" for h in hidden):
        scatter = observed.white_v / record.sensor.floor_v
        words.append(
            f"coarse converter: mean of n samples scatters {scatter:.2f} times the noise before the converter, "
            "in which the sizes are given"
        )
    words += remarks(record, hidden, imitated)
    changed = record.residual(observed.clean_v - record.ideal_v, "bias+scale")
    has_lag = any("lag" in h.cause.form for h in hidden)
    return {
        "causes": ["not in the catalogue"] if is_unknown else [h.cause.name for h in hidden],
        "strength": "3 to 300 times the noise" if strength is None else float(strength),
        "design": record.poses.layout,
        "effect_rms_v": rms(changed) if hidden else 0.0,
        "noise_of_a_mean_v": observed.white_v,
        "noise_before_converter_v": record.sensor.floor_v,
        "slow_over_white": observed.slow_over_white,
        "slow": observed.slow_kind,
        "sizes_in_floors": [round(h.size, 3) for h in hidden],
        "size_base": [h.cause.base for h in hidden],
        "forms": [": ".join(x for x in (h.cause.name, h.cause.form, h.cause.text) if x) for h in hidden],
        "textbook_leaves_floors": left,
        "imitated_by": imitated,
        "poses": record.n,
        "averaging": record.averaging.kind,
        "temperature": record.temperature.kind,
        "supply": record.supply.kind if record.columns.has_supply else None,
        "temperature_column": record.columns.has_temperature,
        "direction_column": record.columns.has_direction,
        "std_varies_by_vibration": record.vibration.is_on,
        "lag_s": round(record.temperature.lag_s, 1) if has_lag else None,
        "sensitivity_v_per_g": record.sensor.sensitivity_v.tolist(),
        "zero_v": record.sensor.zero_v.tolist(),
        "remark": "; ".join(words) or None,
    }
