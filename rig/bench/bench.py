"""The bench: a checked bench file, and the values derived from it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from procedures.instruments import output_channel
from procedures.session import Limits
from rig.bench.parts import Certificate, Displacement, Folders, Instrument, Lab, Laboratory, Sensor, Strict, Uncertainty

SENSOR = "^[A-Za-z0-9_-]+$"  # name of a sensor of a batch: a part of channel names and of RUN/SENSOR


class Bench(Strict):
    """A checked bench file. `read_bench` makes it."""

    name: str = "bench"
    seed: int = Field(default=1, ge=0)
    instruments: dict[str, Instrument]
    sensor: Sensor = Sensor()
    sensors: dict[Annotated[str, Field(pattern=SENSOR)], Sensor] = Field(default_factory=dict)
    limits: Limits = Limits()
    d63: Displacement | None = None
    uncertainty: Uncertainty = Uncertainty()
    laboratory: Laboratory = Laboratory()
    lab: Lab | None = None
    certificates: dict[str, Certificate] = Field(default_factory=dict)  # of things without a role, such as a hand level
    world: dict[str, Any] = Field(default_factory=dict)
    folders: Folders = Folders()

    @property
    def simulated(self) -> bool:
        """Whether every instrument is a twin; then time is simulated as well."""
        return all(instrument.simulated for instrument in self.instruments.values())

    @property
    def first_sensor(self) -> str | None:
        """The sensor of a batch that adaptive procedures use; None without a batch."""
        return next(iter(self.sensors), None)

    @property
    def channels(self) -> Mapping[str, int]:
        """The converter's channels by name."""
        adc = self.instruments.get("adc")
        return adc.parse_settings().channels if adc else {}

    @property
    def wired(self) -> Mapping[str, int]:
        """All inputs of the converter by name, with those on request."""
        adc = self.instruments.get("adc")
        return adc.parse_settings().wired if adc else {}

    def unit_of(self, channel: str) -> str:
        """Unit of the samples of a channel: V, or that of a digital sensor."""
        adc = self.instruments.get("adc")
        units: Mapping[str, str] = getattr(adc.parse_settings(), "units", {}) if adc else {}
        return units.get(channel, "V")

    @property
    def unit(self) -> str:
        """Unit of the accelerometer's outputs."""
        channel = output_channel("x", self.channels)
        return self.unit_of(channel) if channel else "V"

    @property
    def constants(self) -> dict[str, str | float]:
        """The constants of every table: sensor (not for a batch), approach and uncertainties."""
        sensor = {} if self.sensors else self.sensor.constants
        unit = {} if self.unit == "V" else {"unit": self.unit}
        return {
            **sensor,
            **unit,
            "approach_deg": self.limits.overrun_deg,
            **self.uncertainty.model_dump(exclude_none=True),
        }

    @property
    def result_limits(self) -> Mapping[str, float | tuple[float, float]]:
        """The limits of results: those of the file, and limits.level_deg for the level check."""
        level_deg = self.limits.level_deg
        level = {} if level_deg is None else {"level-x": level_deg, "level-y": level_deg}
        return {**level, **self.limits.results}

    def document(self) -> dict[str, Any]:
        """The whole configuration as JSON; `Bench.model_validate` reads it."""
        return self.model_dump(mode="json")

    def configuration(self, procedure: str, settings: Mapping[str, Any]) -> str:
        """Hash of procedure, settings and bench, without the faults of twins, which can be repaired."""
        bench = self.model_dump(
            mode="json", exclude={"instruments": {"__all__": {"faults"}}, "laboratory": True, "lab": True}
        )
        text = json.dumps([procedure, settings, bench])
        return hashlib.sha256(text.encode()).hexdigest()
