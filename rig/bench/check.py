"""What the parts of a bench must be to each other, to their drivers and to the simulated world."""

from __future__ import annotations

import dataclasses
import importlib
from pathlib import Path

from pydantic import ValidationError

from drivers.errors import LinkRefused
from drivers.links.person import PERSON
from drivers.links.url import Url
from drivers.links.wire_faults import kinds_of
from drivers.simulation.batch import with_own
from drivers.simulation.config import WorldConfig
from drivers.simulation.errors import SimulationError
from rig.bench.bench import Bench
from rig.bench.faults import fault_of
from rig.bench.parts import D63, ROLES, Instrument
from rig.errors import BenchError, RecordError
from rig.nearest import did_you_mean


def check(bench: Bench, path: Path) -> None:
    """Raises BenchError with file, key and what to do."""
    for role, instrument in bench.instruments.items():
        _check_instrument(role, instrument, path)
    _check_worlds(bench, path)
    _check_batch(bench, path)
    _check_d63(bench, path)
    _check_lab(bench, path)


def drivers() -> list[str]:
    """The names of all drivers: the modules that have a `connect`."""
    folder = Path(importlib.import_module("drivers").__file__ or "").parent
    return sorted(p.stem for p in folder.glob("*.py") if "\ndef connect(" in p.read_text(encoding="utf-8"))


def _check_instrument(role: str, instrument: Instrument, path: Path) -> None:
    key = f"{path}, key instruments.{role}"
    if role not in ROLES:
        raise BenchError(f"{key}: no such role.{did_you_mean(role, ROLES)}")
    if instrument.driver not in drivers():
        raise BenchError(f"{key}.driver: no driver {instrument.driver!r}.{did_you_mean(instrument.driver, drivers())}")
    _check_addresses(key, instrument)
    try:
        instrument.typed_settings()
    except ValidationError as error:
        kind = importlib.import_module(f"drivers.{instrument.driver}").Settings
        fault = error.errors()[0]
        where = ".".join(str(part) for part in fault["loc"])
        names = [field.name for field in dataclasses.fields(kind)]
        raise BenchError(f"{key}.{where}: {fault_of(fault, names)}") from None
    _check_faults(f"{key}.faults", instrument)


def _check_addresses(key: str, instrument: Instrument) -> None:
    """Raises BenchError for what is the address of no wire; a simulated instrument and a person have none."""
    own = None if instrument.simulated or instrument.url == PERSON else instrument.url
    for name, url in (("url", own), ("stream_url", instrument.stream_url)):
        try:
            _ = url and Url.parse(url)
        except LinkRefused as refused:
            raise BenchError(f"{key}.{name}: {refused}") from None


def _check_lab(bench: Bench, path: Path) -> None:
    """Raises BenchError for what is no URL of a lab's record, and for a password: the bench is kept with every run."""
    if bench.lab is None:
        return
    from rig.record.lab_url import has_password, lab_url  # only a rig with a lab needs SQL to read its bench

    key = f"{path}, key lab.url"
    try:
        url = lab_url(bench.lab.url, key)
    except RecordError as error:
        raise BenchError(str(error)) from None
    if has_password(url):
        raise BenchError(f"{key}: has a password, which every run would keep; leave it to ~/.pgpass or PGPASSWORD")


def _check_faults(key: str, instrument: Instrument) -> None:
    """Raises BenchError for a fault that the twin cannot have, and for those of a real instrument."""
    if instrument.faults and not instrument.simulated:
        raise BenchError(f"{key}: a real instrument has its own; remove them, or write `url: simulated`")
    for k, fault in enumerate(instrument.faults):
        if fault.what not in (kinds := kinds_of(instrument.driver)):
            raise BenchError(f"{key}.{k}.what: no fault {fault.what!r}.{did_you_mean(fault.what, kinds)}")
        if refusal := kinds[fault.what].refusal(fault.size):
            raise BenchError(f"{key}.{k}.size: {refusal}")


def _check_worlds(bench: Bench, path: Path) -> None:
    key = f"{path}, key world"
    try:
        config = WorldConfig.from_mapping(bench.world)
        for name, sensor in bench.sensors.items():
            key = f"{path}, key sensors.{name}.world"
            with_own(config, name, sensor.world)
    except SimulationError as error:
        raise BenchError(f"{key}: {error}") from None


def _check_batch(bench: Bench, path: Path) -> None:
    """Raises BenchError where sensors and channels do not fit together."""
    if bench.sensors and "sensor" in bench.model_fields_set:
        raise BenchError(f"{path}, key sensor: there is a batch in `sensors` too; leave one of them")
    if bench.sensor.world:
        raise BenchError(f"{path}, key sensor.world: only sensors of a batch differ from the bench's `world`; move it")
    if "adc" not in bench.instruments:
        return
    named = {name.partition(".")[0] for name in bench.channels if "." in name}
    for name in sorted(named - set(bench.sensors)):
        key = f"{path}, key instruments.adc.settings.channels"
        raise BenchError(f"{key}: no sensor {name!r} in `sensors`.{did_you_mean(name, bench.sensors)}")
    for name in bench.sensors:
        if f"{name}.vx" not in bench.channels:
            raise BenchError(f"{path}, key sensors.{name}: no channel {name}.vx of the adc carries its output")


def _check_d63(bench: Bench, path: Path) -> None:
    """What a run would find out when all is measured. Raises BenchError."""
    if D63 in bench.channels and bench.d63 is None:
        raise BenchError(f"{path}, key d63: is missing: the channel {D63} needs its calibration curve")
    if bench.d63 and not getattr(bench.d63.curve, bench.d63.side):
        raise BenchError(f"{path}, key d63.side: the curve has no {bench.d63.side} side")
