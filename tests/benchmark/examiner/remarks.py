"""Remarks in `truth.json` on why a set is difficult: causes resemble each other, or the file lacks information."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tests.benchmark.examiner.chain import Hidden, contribution
from tests.benchmark.examiner.layouts import Array
from tests.benchmark.examiner.record import Record

Imitated = Mapping[str, Mapping[str, float]]  # remainders by imitating name, by cause
ROUNDING = 3.46  # step over standard deviation of its error, sqrt(12)


def missed(hidden: Sequence[Hidden]) -> list[str]:
    """Causes whose size is not the demanded one."""
    return [
        f"{h.cause.name}: size {h.size:.2f} instead of {h.target:g}" for h in hidden if abs(h.size / h.target - 1) > 0.1
    ]


def remarks(record: Record, hidden: Sequence[Hidden], imitated: Imitated) -> list[str]:
    """All other remarks."""
    names = [h.cause.name for h in hidden]
    return [
        *_drivers(record, names),
        *_geometry(record, names),
        *_imitations(imitated),
        *_resemblances(record, hidden),
        *_thermometer(record, hidden),
        *_file(record, names),
        *(h.cause.remark for h in hidden if h.cause.remark),
    ]


def _correlation(a: Array, b: Array) -> float:
    return float(abs(np.corrcoef(a, b)[0, 1]))


def _drivers(record: Record, names: Sequence[str]) -> list[str]:
    celsius, elapsed, volts = record.temperature.celsius, record.clock.elapsed, record.supply.volts
    out = []
    if any(name.startswith(("temperature", "warm", "bias-drift")) for name in names):
        r = _correlation(celsius, elapsed)
        if r > 0.95:
            out.append(f"temperature and time run together (r = {r:.3f})")
    if "supply-sensitivity" in names:
        r = _correlation(volts, celsius)
        if r > 0.9:
            out.append(f"supply and temperature run together (r = {r:.3f})")
        if _correlation(volts, elapsed) > 0.9:
            out.append("supply and time run together")
    return out


def _geometry(record: Record, names: Sequence[str]) -> list[str]:
    out = []
    if "stage-zero-offset" in names:
        separable = " (separable here: flip)" if record.poses.layout == "flip_and_mount" else ""
        out.append(f"alpha0 equals base-tilt about y exactly; beta0 equals a rotation about z{separable}")
    if "base-tilt" in names:
        out.append("the part ty (10 to 30 % of tx) equals an offset of alpha")
    if {"base-tilt", "stage-zero-offset"} <= set(names):
        out.append("base-tilt and stage-zero-offset overlap in principle")
    one_driver = ({"warm-up-bias", "bias-drift"}, {"temperature-bias", "temperature-hysteresis"})
    if any(pair <= set(names) for pair in one_driver):
        out.append("two causes with one driver")
    return out


def _imitations(imitated: Imitated) -> list[str]:
    if not imitated:
        return []
    lists = (f"{name}: {', '.join(f'{a} ({b})' for a, b in by.items())}" for name, by in imitated.items())
    return [f"imitated within one noise floor by the textbook form of: {'; '.join(lists)}"]


def _resemblances(record: Record, hidden: Sequence[Hidden]) -> list[str]:
    if len(hidden) < 2:
        return []
    out, traces = [], [record.residual(contribution(record, h), "bias+scale").ravel() for h in hidden]
    for i in range(len(traces)):
        for j in range(i):
            r = _correlation(traces[i], traces[j])
            if r > 0.9:
                first, second = hidden[j].cause.name, hidden[i].cause.name
                out.append(f"{first} and {second} have like contributions (r = {r:.2f})")
    return out


def _thermometer(record: Record, hidden: Sequence[Hidden]) -> list[str]:
    sizes = [round(h.size, 3) for h in hidden if h.cause.name.startswith("temperature")]
    columns = record.columns
    if not sizes or not columns.has_temperature:
        return []
    error_k = math.hypot(columns.thermometer_noise_k, columns.thermometer_step_k / ROUNDING)
    left = max(sizes) * error_k / record.temperature.celsius.std()
    return [f"noise of the thermometer alone leaves {left:.1f} floors"] if left > 0.5 else []


def _file(record: Record, names: Sequence[str]) -> list[str]:
    kind, rho, out = record.averaging.kind, record.averaging.rho, []
    if kind == "silent-correlated":
        factor = math.sqrt((1 + rho) / (1 - rho))
        out.append(
            f"samples are correlated and no filter is stated: std/sqrt(n) understates the floor {factor:.1f} times"
        )
    if kind == "bare":
        out.append("no std, no n: the floor comes from the scatter")
    if kind == "no-n":
        out.append("std without n and without filter")
    if record.clock.restarted:
        out.append("two days, sensor switched off between: t_s starts again")
    if record.vibration.is_on and "vibration-rectification" not in names:
        out.append("vibration varies (in std) and does nothing")
    return out
