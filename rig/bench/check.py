"""Checks of a bench file: values, and the relations between its parts, their drivers and the simulated world."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from calibrations.table import gravity_fault
from drivers.errors import LinkRefused, did_you_mean
from drivers.transport.address import Url
from drivers.transport.faults import Fault, kinds_of
from drivers.transport.person import PERSON
from drivers.world.errors import SimulationError
from procedures.session import Limits
from rig.bench.bench import Bench
from rig.bench.parts import D63, ROLES, Certificate, Displacement, Folders, Instrument, Lab, Sensor, Uncertainty
from rig.bench.result_names import names_with_limits
from rig.errors import BenchError, RecordError

UNKNOWN_KEYS = ("extra_forbidden", "unexpected_keyword_argument")


def describe_error(error: ValidationError, model: type[BaseModel]) -> str:
    """The first fault with its key. A misspelt key comes before the missing key that it should be."""
    faults = error.errors()
    fault = min(faults, key=lambda fault: fault["type"] not in UNKNOWN_KEYS)
    key_path = [str(part) for part in fault["loc"] if "[" not in str(part)]  # the type of a union is not a key
    if key_path[0] == "lab":  # a URL may hold a password
        fault = {**fault, "input": "..."}
    return f"key {'.'.join(key_path)}: {describe_fault(fault, _keys(model, key_path[:-1]))}"


def describe_fault(fault: Any, keys: list[str]) -> str:
    """One fault of a value; `keys` are the known keys at its place."""
    if fault["type"] in UNKNOWN_KEYS:
        return f"no such key.{did_you_mean(str(fault['loc'][-1]), keys)}"
    if fault["type"] == "missing":
        return "this key is missing; `rig check --example` prints a complete bench file"
    reason = fault["msg"].removeprefix("Value error, ")  # the message of our own validator
    comma = fault["type"] == "float_parsing" and str(fault["input"]).count(",") == 1
    hint = f"; write {str(fault['input']).replace(',', '.')}, with a decimal point" if comma else ""
    return f"{reason}; the value is {fault['input']!r}{hint}"


def _keys(model: Any, key_path: list[str]) -> list[str]:
    """The known keys at a place of the file."""
    parts: dict[str, Any] = {"limits": Limits, "d63": Displacement, "uncertainty": Uncertainty, "lab": Lab}
    parts |= {"instruments": Instrument, "sensor": Sensor, "folders": Folders}
    part = parts.get(key_path[0], model) if key_path else model
    if key_path and (key_path[0] == "certificates" or key_path[-1] == "certificate"):
        part = Certificate
    if "faults" in key_path:
        part = Fault
    if dataclasses.is_dataclass(part):
        return [field.name for field in dataclasses.fields(part)]
    return list(part.model_fields)


def check(bench: Bench, path: Path) -> None:
    """Raises BenchError with file, key and what to do."""
    for role, instrument in bench.instruments.items():
        _check_instrument(role, instrument, path)
    check_lines(bench, f"{path}, key instruments")
    _check_worlds(bench, path)
    _check_batch(bench, path)
    _check_d63(bench, path)
    _check_lab(bench, path)


def check_lines(bench: Bench, source: str) -> None:
    """Raises BenchError for two roles on one unit of one line: each would execute the commands of the other.

    `source` begins the message. Stages that a person turns share the person.
    """
    claims = [claim for role, instrument in bench.instruments.items() for claim in _claims(role, instrument)]
    for first, second in itertools.combinations(claims, 2):
        if first.line == second.line and (fault := _conflict(first, second)):
            raise BenchError(f"{source}.{second.key}: {fault}")


def drivers() -> list[str]:
    """The names of all drivers: the folders that have a `driver.py`."""
    folder = Path(importlib.import_module("drivers").__file__ or "").parent
    return sorted(path.parent.name for path in folder.glob("*/driver.py"))


def _check_instrument(role: str, instrument: Instrument, path: Path) -> None:
    key = f"{path}, key instruments.{role}"
    if role not in ROLES:
        raise BenchError(f"{key}: no such role.{did_you_mean(role, ROLES)}")
    if instrument.driver not in drivers():
        raise BenchError(f"{key}.driver: no driver {instrument.driver!r}.{did_you_mean(instrument.driver, drivers())}")
    _check_addresses(key, instrument)
    try:
        instrument.parse_settings()
    except ValidationError as error:
        kind = importlib.import_module(f"drivers.{instrument.driver}.driver").Settings
        fault = error.errors()[0]
        setting = ".".join(str(part) for part in fault["loc"])
        names = [field.name for field in dataclasses.fields(kind)]
        raise BenchError(f"{key}.{setting}: {describe_fault(fault, names)}") from None
    _check_faults(f"{key}.faults", instrument)


@dataclass(frozen=True)
class _Claim:
    """A key that gives a role a line; `unit` is None if the instrument has no unit number."""

    key: str
    url: str
    line: str
    unit: int | None

    @property
    def role(self) -> str:
        return self.key.partition(".")[0]


def _claims(role: str, instrument: Instrument) -> list[_Claim]:
    """The lines of an instrument. Twins of one driver with the same address share a line."""
    module = importlib.import_module(f"drivers.{instrument.driver}.driver")
    unit = instrument.unit if "links.unit(" in inspect.getsource(module.connect) else None
    if instrument.simulated:
        line = f"{instrument.driver} {instrument.listen or ''}"
        return [] if unit is None else [_Claim(f"{role}.unit", instrument.url, line, unit)]
    claims = [] if instrument.url == PERSON else [_Claim(f"{role}.unit", instrument.url, "", unit)]
    if instrument.stream_url is not None:
        claims.append(_Claim(f"{role}.stream_url", instrument.stream_url, "", None))
    return [replace(claim, line=Url.parse(claim.url).line) for claim in claims]


def _conflict(first: _Claim, second: _Claim) -> str | None:
    """Why two roles cannot share a line, and what to do; None if they can."""
    at = first.url if first.url == second.url else f"{first.url} (also written {second.url})"
    if first.unit is None or second.unit is None:
        whole_line = first if first.unit is None else second
        return (
            f"{first.role} and {second.role} are both at {at}, but {whole_line.key.removesuffix('.unit')} "
            "has no unit number and cannot share a line; give each its own address"
        )
    if first.unit == second.unit:
        return (
            f"{first.role} and {second.role} are both unit {first.unit} at {at}, so both execute the same commands; "
            "set another unit number at one instrument and write it here as `unit` (default: 1)"
        )
    if first.url != second.url:
        return f"{first.role} and {second.role} are on one line, {at}; write the same address for both"
    return None


def _check_addresses(key: str, instrument: Instrument) -> None:
    """Raises BenchError for a wrong address. A simulated instrument and a person have no address.

    Modbus over serial line has units 1 to 247; unit 0 is a broadcast.
    """
    address = None if instrument.simulated or instrument.url == PERSON else instrument.url
    for name, url in (("url", address), ("stream_url", instrument.stream_url)):
        try:
            _ = url and Url.parse(url)
        except LinkRefused as error:
            raise BenchError(f"{key}.{name}: {error}") from None
    if address is not None and Url.parse(address).rtu and not 1 <= instrument.unit <= 247:
        raise BenchError(f"{key}.unit: unit {instrument.unit} is not possible on a serial line; give 1 to 247")


def _check_lab(bench: Bench, path: Path) -> None:
    """Raises BenchError for a wrong URL of the lab's record, and for a password: every run keeps the bench."""
    if bench.lab is None:
        return
    from rig.lab_url import has_password, lab_url  # slow to import, and only a rig with a lab needs it

    key = f"{path}, key lab.url"
    try:
        url = lab_url(bench.lab.url, key)
    except RecordError as error:
        raise BenchError(str(error)) from None
    if has_password(url):
        raise BenchError(
            f"{key}: the URL has a password, and every run would store it; put it into ~/.pgpass or PGPASSWORD"
        )


def _check_faults(key: str, instrument: Instrument) -> None:
    """Raises BenchError for an unknown fault of a twin, and for faults of a real instrument."""
    if instrument.faults and not instrument.simulated:
        raise BenchError(f"{key}: only a simulated instrument can have faults; remove them, or write `url: simulated`")
    for k, fault in enumerate(instrument.faults):
        if fault.what not in (kinds := kinds_of(instrument.driver)):
            raise BenchError(f"{key}.{k}.what: no fault {fault.what!r}.{did_you_mean(fault.what, kinds)}")
        if refusal := kinds[fault.what].refusal(fault.size):
            raise BenchError(f"{key}.{k}.size: {refusal}")


def _check_worlds(bench: Bench, path: Path) -> None:
    # the simulated world loads slowly, and most commands only read what a bench has measured
    from drivers.handheld.world import handheld
    from drivers.world.batch import with_own
    from drivers.world.config import WorldConfig

    key = f"{path}, key world"
    try:
        settings, hand = handheld(bench.world)
        config = WorldConfig.from_mapping(settings)
        if hand is not None and bench.sensors:
            raise BenchError(f"{key}: a hand holds one sensor; remove `hand` and `triad`, or the batch in `sensors`")
        for name, sensor in bench.sensors.items():
            key = f"{path}, key sensors.{name}.world"
            with_own(config, name, sensor.world)
    except SimulationError as error:
        raise BenchError(f"{key}: {error}") from None


def _check_batch(bench: Bench, path: Path) -> None:
    """Raises BenchError if sensors and channels do not match."""
    if bench.sensors and "sensor" in bench.model_fields_set:
        raise BenchError(f"{path}, key sensor: the file also has a batch in `sensors`; remove one of the two keys")
    if bench.sensor.world:
        raise BenchError(f"{path}, key sensor.world: only a sensor of a batch has its own world; move it to `world`")
    if "adc" not in bench.instruments:
        return
    sensor_names = {name.partition(".")[0] for name in bench.channels if "." in name}
    for name in sorted(sensor_names - set(bench.sensors)):
        key = f"{path}, key instruments.adc.settings.channels"
        raise BenchError(f"{key}: no sensor {name!r} in `sensors`.{did_you_mean(name, bench.sensors)}")
    for name in bench.sensors:
        if f"{name}.vx" not in bench.channels:
            raise BenchError(f"{path}, key sensors.{name}: the adc has no channel {name}.vx; add it to channels")


def _check_d63(bench: Bench, path: Path) -> None:
    """Raises BenchError for a displacement sensor without a curve."""
    if D63 in bench.channels and bench.d63 is None:
        raise BenchError(f"{path}, key d63: this key is missing; the channel {D63} needs its calibration curve")
    if bench.d63 and not getattr(bench.d63.curve, bench.d63.side):
        raise BenchError(f"{path}, key d63.side: the curve has no {bench.d63.side} side; give the other side")


# Impossible values, and limits of unknown results.

KeyFault = tuple[str, str]  # key; fault and remedy


def check_values(bench: Bench, path: Path) -> None:
    """Raises BenchError with file, key and what to do."""
    for key, fault in _faults(bench):
        raise BenchError(f"{path}, key {key}: {fault}")


def _faults(bench: Bench) -> Iterator[KeyFault]:
    yield from _sensor_faults("sensor", bench.sensor)
    for name, sensor in bench.sensors.items():
        yield from _sensor_faults(f"sensors.{name}", sensor)
    yield from _channel_faults(bench)
    yield from _limit_faults(bench)
    yield from _result_limit_faults(bench)


def _sensor_faults(key: str, sensor: Sensor) -> Iterator[KeyFault]:
    if fault := gravity_fault(sensor.gravity_m_s2):
        yield f"{key}.gravity_m_s2", f"is {fault}"
    corner_hz = sensor.filter_corner_hz
    if corner_hz is not None and not 0 < corner_hz < math.inf:
        yield f"{key}.filter_corner_hz", f"the corner is {corner_hz:g} Hz; give one above 0, or remove the key"


def _channel_faults(bench: Bench) -> Iterator[KeyFault]:
    names: dict[int, str] = {}
    for name, number in bench.wired.items():
        if (earlier := names.setdefault(number, name)) != name:
            yield (
                "instruments.adc.settings.channels",
                f"{earlier} and {name} are both input {number}; give each its own",
            )


def _limit_faults(bench: Bench) -> Iterator[KeyFault]:
    limits = bench.limits
    if not limits.temperature_c[0] < limits.temperature_c[1]:
        yield "limits.temperature_c", f"{_pair(limits.temperature_c)} is not a range; give the lowest, then the highest"
    if not 0 <= limits.overrun_deg < math.inf:
        yield "limits.overrun_deg", f"the distance is {limits.overrun_deg:g} deg; give 0 or more"
    if limits.level_deg is not None and not limits.level_deg > 0:
        fault = f"the limit is {limits.level_deg:g} deg; give a tilt above 0, or remove the key to switch the check off"
        yield "limits.level_deg", fault


def _result_limit_faults(bench: Bench) -> Iterator[KeyFault]:
    """A misspelt limit has no effect, so it is a fault. Results of the user's own procedures are not known here."""
    for name, limit in bench.limits.results.items():
        if isinstance(limit, tuple) and not limit[0] <= limit[1]:
            yield f"limits.results.{name}", f"{_pair(limit)} is not a range; give the lowest, then the highest"
        if not isinstance(limit, tuple) and not limit >= 0:
            yield f"limits.results.{name}", f"the limit is {limit:g}; give 0 or more, or a range [lowest, highest]"
    if bench.limits.results and bench.folders.procedures is None:
        result_names = names_with_limits()
        for name in bench.limits.results:
            if name not in result_names:
                yield f"limits.results.{name}", f"no procedure has such a result.{did_you_mean(name, result_names)}"


def _pair(values: tuple[float, float]) -> str:
    return f"[{values[0]:g}, {values[1]:g}]"
