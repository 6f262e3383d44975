"""The bench file: which instrument plays which role, where it is, and what must not be exceeded.

Unknown keys are refused with file, key and nearest key. An instrument whose url is `simulated` is served in this
process by the twin of its driver, in the world that the file describes; `simulated:ADDRESS` says where it listens.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import json
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model, field_validator

from calibrations.error_table import ErrorTable, Point, read_error_table
from calibrations.errors import DataError
from drivers.links.address import Address
from drivers.links.faults import Fault
from drivers.links.wire_faults import kinds_of
from drivers.philtec_d63 import SIMULATED as SIMULATED_CURVE
from drivers.philtec_d63 import Curve
from drivers.simulation.batch import with_own
from drivers.simulation.config import WorldConfig
from drivers.simulation.errors import SimulationError
from procedures.session import Limits
from rig.errors import BenchError
from rig.nearest import did_you_mean

DEFAULT = Path(__file__).with_name("bench_default.yaml")
SIMULATED = "simulated"
UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
D63 = "d63"  # the displacement sensor's channel
ROLES = ("alpha", "beta", "adc", "oven", "level", "positioner")
SENSOR = "^[A-Za-z0-9_-]+$"  # name of a batch's sensor: part of channels and of RUN/SENSOR
TURNING = ("alpha", "beta")


class Strict(BaseModel):
    """A part of the file: its keys are these and no others."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Certificate(Strict):
    """A calibration certificate, good until the end of the day `due`."""

    model_config = ConfigDict(coerce_numbers_to_str=True)

    number: str
    due: date


class Instrument(Strict):
    """One instrument: a driver's name, an address, and settings that the driver declares.

    `error_table` is a stage's own, as points or as a CSV file beside the bench file; `read_bench` leaves the points.
    `faults` are what goes wrong with a simulated one.
    """

    driver: str
    url: str
    unit: int = 1
    stream_url: str | None = None
    settings: dict[str, Any] = {}
    faults: tuple[Fault, ...] = ()
    certificate: Certificate | None = None
    error_table: tuple[Point, ...] | Path | None = None

    @property
    def simulated(self) -> bool:
        return self.url.partition(":")[0] == SIMULATED

    @property
    def listen(self) -> str | None:
        """Where its twin listens, if the file says so."""
        return self.url.partition(":")[2] or None

    @property
    def address(self) -> Address:
        return Address(self.url, self.unit, self.stream_url)

    def typed_settings(self) -> Any:
        """The driver's frozen Settings. Raises ValidationError."""
        kind = importlib.import_module(f"drivers.{self.driver}").Settings
        checker = create_model("Checked", settings=(kind, ...), __config__=ConfigDict(extra="forbid"))
        return checker(settings=self.settings).settings  # type: ignore[attr-defined]


class Sensor(Strict):
    """A sensor under test; these become constants of its tables, apart from what its simulated twin has of its own."""

    name: str = "sensor"
    serial: str = ""
    gravity_m_s2: float = 9.80665
    filter_corner_hz: float | None = None
    world: dict[str, Any] = {}

    @property
    def constants(self) -> dict[str, str | float]:
        """What every table of this sensor says of it."""
        said = self.model_dump(exclude_none=True, exclude={"world"})
        return {"sensor": said.pop("name"), **{key: value for key, value in said.items() if value != ""}}


class Displacement(Strict):
    """The D63 behind the channel `d63`: its calibration curve, which side of the optical peak it works on, and
    whether the gap grows (1) or closes (-1) as the carriage moves towards the sensor's +x.

    `curve` is a YAML file beside the bench file, `simulated`, or the curve itself, which `read_bench` leaves.
    """

    curve: Curve
    side: Literal["near", "far"] = "near"
    direction: Literal[1, -1] = 1

    @field_validator("curve", mode="before")
    @classmethod
    def _shipped(cls, given: Any) -> Any:
        return Curve.from_file(SIMULATED_CURVE) if given == SIMULATED else given


class Folders(Strict):
    """The user's own effects and procedures."""

    effects: Path | None = None
    procedures: Path | None = None


class Bench(Strict):
    """A checked bench file. `read_bench` makes it."""

    name: str = "bench"
    seed: int = Field(default=1, ge=0)
    instruments: dict[str, Instrument]
    sensor: Sensor = Sensor()
    sensors: dict[Annotated[str, Field(pattern=SENSOR)], Sensor] = {}
    limits: Limits = Limits()
    d63: Displacement | None = None
    certificates: dict[str, Certificate] = {}  # of what plays no role: a hand level, a displacement sensor's curve
    world: dict[str, Any] = {}
    folders: Folders = Folders()

    @property
    def simulated(self) -> bool:
        """Whether every instrument is a twin; then time is simulated too."""
        return all(instrument.simulated for instrument in self.instruments.values())

    @property
    def first_sensor(self) -> str | None:
        """The one of a batch that adaptive procedures go by; None where there is no batch."""
        return next(iter(self.sensors), None)

    @property
    def channels(self) -> Mapping[str, int]:
        """The converter's channels by name."""
        adc = self.instruments.get("adc")
        return adc.typed_settings().channels if adc else {}

    @property
    def constants(self) -> dict[str, str | float]:
        """What every table from this bench says of the sensor (those of a batch are named apart), and of the way."""
        sensor = {} if self.sensors else self.sensor.constants
        return {**sensor, "approach_deg": self.limits.overrun_deg}

    @property
    def result_limits(self) -> Mapping[str, float | tuple[float, float]]:
        """What results are judged by: those of the file, and the limit that the level check has anyway."""
        level_deg = self.limits.level_deg
        level = {} if level_deg is None else {"level-x": level_deg, "level-y": level_deg}
        return {**level, **self.limits.results}

    def document(self) -> dict[str, Any]:
        """The whole configuration as JSON; `Bench.model_validate` reads it back."""
        return self.model_dump(mode="json")

    def configuration(self, procedure: str, settings: Mapping[str, Any]) -> str:
        """Hash of all that a run depends on: procedure, settings, bench. Faults are not: they can be repaired."""
        bench = self.model_dump(mode="json", exclude={"instruments": {"__all__": {"faults"}}})
        text = json.dumps([procedure, settings, bench])
        return hashlib.sha256(text.encode()).hexdigest()


def read_bench(path: Path | None = None) -> Bench:
    """The bench in the file `path`; without one, the simulated rig.

    Raises BenchError with file, key and nearest key.
    """
    path = path or DEFAULT
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BenchError(f"{path}: the bench file cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: no text, no date
        raise BenchError(f"{path}: is not a YAML file: {error}") from None
    if not isinstance(document, dict):
        raise BenchError(f"{path}: a bench file is a mapping that begins with `instruments:`")
    return _checked(document, path)


def _checked(document: dict[str, Any], path: Path) -> Bench:
    try:
        bench = Bench.model_validate({**document, **_with_curve(document.get("d63"), path)})
    except ValidationError as error:
        raise BenchError(_told(error, path, Bench)) from None
    instruments = {role: _checked_instrument(role, part, path) for role, part in bench.instruments.items()}
    _check_worlds(bench, path)
    _check_batch(bench, path)
    _check_d63(bench, path)
    return bench.model_copy(update={"instruments": instruments, "folders": _beside(bench.folders, path)})


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


def _checked_instrument(role: str, instrument: Instrument, path: Path) -> Instrument:
    """The instrument with what its files hold. Raises BenchError."""
    key = f"{path}, key instruments.{role}"
    if role not in ROLES:
        raise BenchError(f"{key}: no such role.{did_you_mean(role, ROLES)}")
    if instrument.driver not in drivers():
        raise BenchError(f"{key}.driver: no driver {instrument.driver!r}.{did_you_mean(instrument.driver, drivers())}")
    try:
        instrument.typed_settings()
    except ValidationError as error:
        kind = importlib.import_module(f"drivers.{instrument.driver}").Settings
        fault = error.errors()[0]
        where = ".".join(str(part) for part in fault["loc"])
        names = [field.name for field in dataclasses.fields(kind)]
        raise BenchError(f"{key}.{where}: {_fault(fault, names)}") from None
    _check_faults(f"{key}.faults", instrument)
    return instrument.model_copy(update={"error_table": _error_table(role, instrument.error_table, path)})


def _check_faults(key: str, instrument: Instrument) -> None:
    """Raises BenchError for a fault that the twin cannot have, and for those of a real instrument."""
    if instrument.faults and not instrument.simulated:
        raise BenchError(f"{key}: a real instrument has its own; remove them, or write `url: simulated`")
    for k, fault in enumerate(instrument.faults):
        if fault.what not in (kinds := kinds_of(instrument.driver)):
            raise BenchError(f"{key}.{k}.what: no fault {fault.what!r}.{did_you_mean(fault.what, kinds)}")


def _error_table(role: str, given: tuple[Point, ...] | Path | None, path: Path) -> tuple[Point, ...] | None:
    """The points of a stage's error table, from its file if it is one."""
    key = f"{path}, key instruments.{role}.error_table"
    if given is None:
        return None
    if role not in TURNING:
        raise BenchError(f"{key}: only {' and '.join(TURNING)} have errors of angle; remove it")
    try:
        points = read_error_table(path.parent / given.expanduser()) if isinstance(given, Path) else given
        return ErrorTable(points).points
    except DataError as error:
        raise BenchError(f"{key}: {error}") from None


def _with_curve(given: Any, path: Path) -> dict[str, Any]:
    """The key d63 with the points of the curve that it names. Raises BenchError."""
    if not isinstance(given, dict) or not isinstance(name := given.get("curve"), str) or name == SIMULATED:
        return {}
    try:
        curve = Curve.from_file(path.parent / Path(name).expanduser())
    except ValueError as error:
        raise BenchError(f"{path}, key d63.curve: {error}") from None
    return {"d63": {**given, "curve": dataclasses.asdict(curve)}}


def _check_d63(bench: Bench, path: Path) -> None:
    """What a run would find out when all is measured. Raises BenchError."""
    if D63 in bench.channels and bench.d63 is None:
        raise BenchError(f"{path}, key d63: is missing: the channel {D63} needs its calibration curve")
    if bench.d63 and not getattr(bench.d63.curve, bench.d63.side):
        raise BenchError(f"{path}, key d63.side: the curve has no {bench.d63.side} side")


def drivers() -> list[str]:
    """The names of all drivers: the modules that have a `connect`."""
    folder = Path(importlib.import_module("drivers").__file__ or "").parent
    return sorted(p.stem for p in folder.glob("*.py") if "\ndef connect(" in p.read_text(encoding="utf-8"))


def _beside(folders: Folders, path: Path) -> Folders:
    """Folders as the file means them: relative to itself. Raises BenchError where there is none."""
    given = {name: place for name, place in folders if place is not None}
    found = {name: (path.parent / place.expanduser()).resolve() for name, place in given.items()}
    for name, place in found.items():
        if not place.is_dir():
            raise BenchError(f"{path}, key folders.{name}: there is no folder {place}")
    return Folders(**found)


def _told(error: ValidationError, path: Path, model: type[BaseModel]) -> str:
    """The first fault, with the key's place in the file; a misspelt key comes before the one that it was meant for."""
    faults = error.errors()
    fault = min(faults, key=lambda fault: fault["type"] not in UNKNOWN)
    where = [str(part) for part in fault["loc"] if "[" not in str(part)]  # a type of several is no key
    return f"{path}, key {'.'.join(where)}: {_fault(fault, _keys(model, where[:-1]))}"


def _fault(fault: Any, keys: list[str]) -> str:
    if fault["type"] in UNKNOWN:
        return f"no such key.{did_you_mean(str(fault['loc'][-1]), keys)}"
    if fault["type"] == "missing":
        return "is missing"
    return f"{fault['msg']}, is {fault['input']!r}"


def _keys(model: Any, where: list[str]) -> list[str]:
    """The keys that are known at a place of the file."""
    parts = {"instruments": Instrument, "sensor": Sensor, "folders": Folders, "limits": Limits, "d63": Displacement}
    part = parts.get(where[0], model) if where else model
    if where and (where[0] == "certificates" or where[-1] == "certificate"):
        part = Certificate
    if "faults" in where:
        part = Fault
    if dataclasses.is_dataclass(part):
        return [field.name for field in dataclasses.fields(part)]
    return list(part.model_fields)
