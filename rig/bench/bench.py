"""The bench as a whole: a checked bench file, and what follows from it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from procedures.session import Limits
from rig.bench.parts import Certificate, Displacement, Folders, Instrument, Lab, Laboratory, Sensor, Strict, Uncertainty

SENSOR = "^[A-Za-z0-9_-]+$"  # name of a batch's sensor: part of channels and of RUN/SENSOR


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
    certificates: dict[str, Certificate] = Field(default_factory=dict)  # of what plays no role, such as a hand level
    world: dict[str, Any] = Field(default_factory=dict)
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
    def wired(self) -> Mapping[str, int]:
        """All inputs of the converter by name, those on request too."""
        adc = self.instruments.get("adc")
        return adc.typed_settings().wired if adc else {}

    @property
    def constants(self) -> dict[str, str | float]:
        """What every table says of the sensor (those of a batch are named apart), of the way and of the inputs."""
        sensor = {} if self.sensors else self.sensor.constants
        return {**sensor, "approach_deg": self.limits.overrun_deg, **self.uncertainty.model_dump(exclude_none=True)}

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
        bench = self.model_dump(
            mode="json", exclude={"instruments": {"__all__": {"faults"}}, "laboratory": True, "lab": True}
        )
        text = json.dumps([procedure, settings, bench])
        return hashlib.sha256(text.encode()).hexdigest()
