"""Values that no rig and no sensor can have, and limits of results that there are not: found before anything moves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from rig.bench.bench import Bench
from rig.bench.parts import Sensor
from rig.errors import BenchError
from rig.nearest import did_you_mean

GRAVITY_M_S2 = (9.76, 9.84)  # from the highest mountain near the equator to the poles
Fault = tuple[str, str]  # key; what is wrong there and what to do


def check_values(bench: Bench, path: Path) -> None:
    """Raises BenchError with file, key and what to do."""
    for key, fault in _faults(bench):
        raise BenchError(f"{path}, key {key}: {fault}")


def _faults(bench: Bench) -> Iterator[Fault]:
    yield from _of_sensor("sensor", bench.sensor)
    for name, sensor in bench.sensors.items():
        yield from _of_sensor(f"sensors.{name}", sensor)
    yield from _of_channels(bench)
    yield from _of_limits(bench)
    yield from _of_result_limits(bench)


def _of_sensor(key: str, sensor: Sensor) -> Iterator[Fault]:
    low, high = GRAVITY_M_S2
    if not low <= sensor.gravity_m_s2 <= high:
        fault = f"{sensor.gravity_m_s2:g} m/s2 is the gravity of no laboratory; give the local one, {low} to {high}"
        yield f"{key}.gravity_m_s2", fault
    corner_hz = sensor.filter_corner_hz
    if corner_hz is not None and not 0 < corner_hz < math.inf:
        fault = (
            f"{corner_hz:g} Hz is no corner of a low-pass filter; give one above 0, or leave it out if it is unknown"
        )
        yield f"{key}.filter_corner_hz", fault


def _of_channels(bench: Bench) -> Iterator[Fault]:
    seen: dict[int, str] = {}
    for name, number in bench.wired.items():
        if (other := seen.setdefault(number, name)) != name:
            fault = f"{other} and {name} are both input {number}; give each its own"
            yield "instruments.adc.settings.channels", fault


def _of_limits(bench: Bench) -> Iterator[Fault]:
    limits = bench.limits
    if not limits.temperature_c[0] < limits.temperature_c[1]:
        yield "limits.temperature_c", f"{_pair(limits.temperature_c)} is no range; give the lowest, then the highest"
    if not 0 <= limits.overrun_deg < math.inf:
        yield "limits.overrun_deg", f"{limits.overrun_deg:g} deg is no way to approach a pose; give 0 or more"
    if limits.level_deg is not None and not limits.level_deg > 0:
        fault = f"no table is within {limits.level_deg:g} deg; give a tilt above 0, or leave it out to not look at it"
        yield "limits.level_deg", fault


def _of_result_limits(bench: Bench) -> Iterator[Fault]:
    """A limit that is misspelt would judge nothing. Results of the user's own procedures are known only when given."""
    for name, limit in bench.limits.results.items():
        if isinstance(limit, tuple) and not limit[0] <= limit[1]:
            yield f"limits.results.{name}", f"{_pair(limit)} is no range; give the lowest, then the highest"
        if not isinstance(limit, tuple) and not limit >= 0:
            yield f"limits.results.{name}", f"{limit:g} is no magnitude; give 0 or more, or a range [lowest, highest]"
    if bench.limits.results and bench.folders.procedures is None:
        from rig.results.names import names  # which need the bench themselves

        known = names()
        for name in bench.limits.results:
            if name not in known:
                yield f"limits.results.{name}", f"no procedure has such a result.{did_you_mean(name, known)}"


def _pair(values: tuple[float, float]) -> str:
    return f"[{values[0]:g}, {values[1]:g}]"
