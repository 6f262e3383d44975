"""Omega CN7500: temperature controller of the oven, and the rig's thermometer. Modbus RTU.

Source: CN7500 manual, communication registers. Temperatures are counts of 0.1 C.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.errors import OverTemperature, SensorFault
from drivers.instrument import OUTSIDE_TEMPERATURE, Check, Identity, require_range, require_within
from drivers.transport import Address, Links
from drivers.transport.modbus import Register, Unit

PROCESS_VALUE = Register(0x1000, "int16", "process value", "C", 0.1)
SET_POINT = Register(0x1001, "int16", "set point", "C", 0.1)
CONTROL_METHOD = Register(0x1005, "uint16", "control method")
METHODS = ("PID", "on/off", "manual", "ramp and soak")
RUN_BIT = 0x0814
ARRIVAL_K = 5.0  # from the set point: closer to it the temperature may be constant
NO_TEMPERATURE = {  # process values that are not a temperature [M]
    0x8002: "it has no reading yet",
    0x8003: "no thermocouple is connected",
    0x8004: "the thermocouple's signal is out of range",
    0x8006: "its converter failed",
    0x8007: "its memory failed",
}


@dataclass(frozen=True)
class Settings:
    """The range of set points that the oven and its content allow, and the allowed overshoot above it.

    `stale_s` is how long the temperature may stand still on its way to a set point. Raises ValueError for what cannot
    be.
    """

    limits_c: tuple[float, float] = (0.0, 85.0)
    overshoot_k: float = 10.0
    stale_s: float = 300.0

    def __post_init__(self) -> None:
        require_range(self, "limits_c")
        if not (self.overshoot_k >= 0 and self.stale_s > 0):
            raise ValueError("overshoot_k must not be negative, stale_s must be positive")


class Oven:
    """The controller: set point, run and stop, temperature."""

    def __init__(self, unit: Unit, settings: Settings, clock: Clock) -> None:
        self.name = unit.name
        self.settings = settings
        self._unit, self._clock = unit, clock
        self._told_c: float | None = None  # the last set point sent
        self._running = False  # whether it was switched on
        self._shown_c, self._first_s = math.nan, 0.0  # the last temperature, and the time of the first equal reading
        self._since_s = 0.0  # since when it should have changed

    def identify(self) -> Identity:
        """A general name, after an exchange: the controller has no register with its name."""
        self._unit.read(CONTROL_METHOD)
        return Identity("Omega CN7500")

    def self_test(self) -> list[Check]:
        """Thermometer and control method."""
        method = int(self._unit.read(CONTROL_METHOD))
        name = METHODS[method] if method < len(METHODS) else f"unknown ({method})"
        try:
            thermometer = Check("thermometer", True, f"{self.temperature_c():.1f} C")
        except SensorFault as fault:
            thermometer = Check("thermometer", False, fault.what)
        return [thermometer, Check("control", method == 0, f"{name} control")]

    def temperature_c(self) -> float:
        """The temperature of the thermocouple, C.

        Raises SensorFault when it shows none, or one that stands still where it should change; OverTemperature.
        """
        value = self._unit.read(PROCESS_VALUE)
        (word,) = PROCESS_VALUE.encode(value)
        if word in NO_TEMPERATURE:
            raise SensorFault(f"{self.name}: {NO_TEMPERATURE[word]}", "Check the thermocouple and its terminals")
        self._require_bearable(value)
        self._require_fresh(value)
        return value

    def set_point_c(self) -> float:
        """The set point, in C."""
        return self._unit.read(SET_POINT)

    def set_temperature(self, temperature_c: float) -> None:
        """Give a new set point; raises LimitError before anything is sent."""
        require_within(f"{self.name}: ", temperature_c, self.settings.limits_c, "C", OUTSIDE_TEMPERATURE)
        self._unit.write(SET_POINT, temperature_c)
        if temperature_c != self._told_c:  # repeating a set point gives a stuck thermometer no more time
            self._told_c, self._since_s = temperature_c, self._clock.now()

    def run(self, on: bool) -> None:
        """Let the controller heat, or stop it."""
        self._unit.write_bit(RUN_BIT, on, "run")
        if on and not self._running:
            self._since_s = self._clock.now()
        self._running = on

    def running(self) -> bool:
        """Whether the controller heats."""
        return self._unit.read_bit(RUN_BIT, "run")

    def _require_bearable(self, shown_c: float) -> None:
        high, over_k = self.settings.limits_c[1], self.settings.overshoot_k
        if shown_c > high + over_k:
            raise OverTemperature(
                f"{self.name}: shows {shown_c:.1f} C, more than {over_k:g} K above its limit {high:g} C",
                "Switch the heater off at its mains, let it cool, and find out why the controller did not hold it",
            )

    def _require_fresh(self, shown_c: float) -> None:
        """Check that the reading changes on the way to a set point; otherwise the thermometer is stuck.

        It is stuck since the first of the equal readings, which may be at an earlier set point.
        """
        now_s, is_new = self._clock.now(), shown_c != self._shown_c
        if is_new:
            self._shown_c, self._first_s = shown_c, now_s
        under_way = self._running and self._told_c is not None and abs(shown_c - self._told_c) > ARRIVAL_K
        if is_new or not under_way:
            self._since_s = now_s
        elif (still_s := now_s - self._since_s) > self.settings.stale_s:
            raise SensorFault(
                f"{self.name}: has shown {shown_c:.1f} C for {still_s:.0f} s while approaching {self._told_c:g} C",
                "Check the place of the thermocouple and the heater; switch the controller off and on",
                self._first_s,
            )


def connect(address: Address, links: Links, settings: Settings, name: str) -> Oven:
    """The controller at `address`. Raises LinkRefused when its wire cannot be opened; sends nothing."""
    return Oven(links.unit(address, name), settings, links.clock)
