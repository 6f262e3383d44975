"""Outputs of a digital sensor, and the settings that all digital sensors have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from drivers.errors import LimitError
from drivers.instrument import require_positive
from drivers.recorder import NoDigitalLines

FORCES, RATES, FIELDS = ("ax", "ay", "az"), ("gx", "gy", "gz"), ("mx", "my", "mz")
OUTPUTS = (*FORCES, *RATES, *FIELDS)
TEMPERATURE = "temperature"  # of the sensor, in C
VOLTAGES = ("supply", "d63")  # of the board's own converter, in V, sampled with the sensor


class DigitalSettings(NoDigitalLines):
    """Settings of a digital sensor: a subclass has the fields, and `wired`, `kinds` and `chosen`.

    `range` is the end of the accelerometer's range each way, in its unit. A record with more than the share `most_lost`
    of its samples lost is refused.
    """

    rate_hz: float
    range: float | None
    most_lost: float
    is_chosen: ClassVar[bool] = False  # whether a procedure asked for these outputs; `only` sets it on the copy

    @property
    def wired(self) -> Mapping[str, int | str]:
        """All outputs by name, each with its place in a line or message."""
        raise NotImplementedError

    @property
    def kinds(self) -> tuple[str, str, str]:
        """The units of accelerometer, gyroscope and magnetometer."""
        raise NotImplementedError

    def chosen(self, outputs: Sequence[str]) -> Self:
        """Settings with these outputs only."""
        raise NotImplementedError

    @property
    def channels(self) -> Mapping[str, int | str]:
        """The recorded outputs if a procedure does not ask for others: those of one sensor, and the voltages."""
        if self.is_chosen:
            return self.wired
        first = next((names for names in (FORCES, RATES, FIELDS) if set(names) & set(self.wired)), ())
        return {name: place for name, place in self.wired.items() if name in (*first, *VOLTAGES)}

    @property
    def units(self) -> Mapping[str, str]:
        """The unit of each output."""
        groups = zip((FORCES, RATES, FIELDS), self.kinds, strict=True)
        return {name: unit for names, unit in groups for name in names if name in self.wired}

    def lag_s(self, channel: str) -> float:  # noqa: ARG002 - as the converter's
        """Delay between outputs, s: 0, because all are sampled at once."""
        return 0.0

    def only(self, name: str, outputs: Sequence[str]) -> Self:
        """Settings with these outputs. Raises LimitError for one that the sensor does not send."""
        if missing := [output for output in outputs if output not in self.wired]:
            raise LimitError(
                f"{name}: the sensor sends no {', '.join(missing)}; its outputs are {', '.join(self.wired)}",
                "Name the outputs in the bench file, in the sensor's settings",
            )
        chosen = self.chosen(outputs)
        object.__setattr__(chosen, "is_chosen", True)  # no setting of a bench file
        return chosen

    def require_valid(self) -> None:
        """Raises ValueError for an invalid rate, range or share of lost samples."""
        require_positive(self, "rate_hz", *([] if self.range is None else ["range"]))
        if not 0 <= self.most_lost < 1:
            raise ValueError("most_lost must be a share of 0 or more, and less than 1")


@dataclass(frozen=True)
class MessageSettings(DigitalSettings):
    """Settings of a sensor whose messages have each output at a fixed place. Raises ValueError for wrong values."""

    outputs: tuple[str, ...] = OUTPUTS
    rate_hz: float = 100.0
    range: float | None = None
    most_lost: float = 0.01

    def __post_init__(self) -> None:
        self.require_valid()
        if not self.outputs or not set(self.outputs) <= set(OUTPUTS) or len(set(self.outputs)) < len(self.outputs):
            raise ValueError(f"outputs must be different outputs of {', '.join(OUTPUTS)}, at least one")

    @property
    def wired(self) -> Mapping[str, int | str]:
        return {name: name for name in self.outputs}

    def chosen(self, outputs: Sequence[str]) -> Self:
        return replace(self, outputs=tuple(name for name in self.outputs if name in outputs))
