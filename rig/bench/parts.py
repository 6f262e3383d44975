"""The parts of a bench file. Other keys are refused."""

from __future__ import annotations

import importlib
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model, field_validator

from calibrations.geometry.error_table import Point
from drivers.philtec_d63 import SIMULATED as SIMULATED_CURVE
from drivers.philtec_d63 import CalibrationCurve
from drivers.transport.address import Address
from drivers.transport.faults import Fault

SIMULATED = "simulated"
D63 = "d63"  # the displacement sensor's channel
ROLES = ("alpha", "beta", "adc", "oven", "level", "positioner")
TURNING = ("alpha", "beta")


class Strict(BaseModel):
    """A part of the file. Other keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Certificate(Strict):
    """A calibration certificate, valid until the end of the day `due`."""

    model_config = ConfigDict(coerce_numbers_to_str=True)

    number: str
    due: date


class Instrument(Strict):
    """One instrument: the name of its driver, its address, and the driver's settings.

    `error_table` of a stage: points, or a CSV file in the folder of the bench file, which `read_bench` replaces by the
    points. `faults`: faults of a simulated instrument.
    """

    driver: str
    url: str
    unit: int = Field(default=1, ge=0, le=255)  # one byte on the wire; `bench.check` refuses 0 on a serial line
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
        """The address of its twin, if the file gives one."""
        return self.url.partition(":")[2] or None

    @property
    def address(self) -> Address:
        return Address(self.url, self.unit, self.stream_url)

    def parse_settings(self) -> Any:
        """The driver's frozen Settings. Raises ValidationError."""
        kind = importlib.import_module(f"drivers.{self.driver}.driver").Settings
        return _checker(kind)(settings=self.settings).settings


@cache
def _checker(kind: type[Any]) -> Any:
    """The model that checks settings of this kind. Making it takes longer than a check."""
    return create_model("Checked", settings=(kind, ...), __config__=ConfigDict(extra="forbid"))


class Sensor(Strict):
    """A sensor under test. Its keys become constants of its tables, except `world`, the settings of its twin."""

    name: str = "sensor"
    serial: str = ""
    manufacturer: str = ""
    gravity_m_s2: float = 9.80665
    filter_corner_hz: float | None = None
    latitude_deg: float | None = Field(
        default=None, ge=-90, le=90
    )  # of the laboratory: a gyroscope measures the earth's rotation
    height_m: float | None = Field(default=None, ge=-500, le=9000)  # of the laboratory above the sea
    heading_deg: float | None = Field(default=None, ge=-360, le=360)  # of the base's x axis, clockwise from true north
    world: dict[str, Any] = {}

    @property
    def constants(self) -> dict[str, str | float]:
        """The constants of every table of this sensor."""
        values = self.model_dump(exclude_none=True, exclude={"world"})
        return {"sensor": values.pop("name"), **{key: value for key, value in values.items() if value != ""}}


class Uncertainty(Strict):
    """Standard uncertainties of inputs that are not fitted, for the budget (`fitting/inputs.py`); None: not given.

    The converter's are those of its specification or certificate, as the range is used: a limit over sqrt(3).
    """

    repeat_std_deg: float | None = Field(default=None, ge=0)  # of a stage's angle, from pose to pose
    tilt_std_deg: float | None = Field(default=None, ge=0)  # of the base against the vertical
    mount_std_deg: float | None = Field(default=None, ge=0)  # of the sensor's edges against the table
    rate_std: float | None = Field(default=None, ge=0)  # of a turning stage's speed, relative
    gravity_std_m_s2: float | None = Field(default=None, ge=0)
    gain_std: float | None = Field(default=None, ge=0)  # of the converter, relative
    offset_std_v: float | None = Field(default=None, ge=0)
    temperature_std_c: float | None = Field(default=None, ge=0)


class Laboratory(Strict):
    """The laboratory that signs certificates. `country` is the ISO 3166 code of two letters."""

    name: str = "not stated"
    person: str = "not stated"
    role: str = "head of the laboratory"
    email: str = ""
    street: str = ""
    post_code: str = ""
    city: str = "not stated"
    country: str = Field(default="ZZ", pattern="^[A-Z]{2}$")
    customer: str = ""


class Lab(Strict):
    """The PostgreSQL database for `rig push`, without a password; `push`: push after every run."""

    url: str
    push: bool = False


class Displacement(Strict):
    """The displacement sensor D63 on the channel `d63`: its calibration curve, the side of the optical peak, and the
    direction: 1 if the gap grows when the carriage moves towards the sensor's +x, -1 if it closes.

    `curve` is a YAML file in the folder of the bench file, `simulated`, or the curve. `read_bench` gives the curve.
    """

    curve: CalibrationCurve
    side: Literal["near", "far"] = "near"
    direction: Literal[1, -1] = 1

    @field_validator("curve", mode="before")
    @classmethod
    def _load_shipped(cls, curve: Any) -> Any:
        return _simulated_curve() if curve == SIMULATED else curve


@cache
def _simulated_curve() -> CalibrationCurve:
    """The curve of the simulated sensor, which every simulated bench has."""
    return CalibrationCurve.from_file(SIMULATED_CURVE)


class Folders(Strict):
    """The user's own effects and procedures."""

    effects: Path | None = None
    procedures: Path | None = None
