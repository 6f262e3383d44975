"""The world's settings: frozen dataclasses, one per mechanism, physical units in every name.

WorldConfig.adxl203()   the default: what Ang saw
WorldConfig.ideal()     a perfectly linear sensor with white noise only
WorldConfig.from_mapping({"preset": "ideal", "heat": {"ambient_c": 20.0}})
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar

from drivers.errors import did_you_mean
from drivers.world.accelerometer import Friction, OutOfPlane, Plates, Springs
from drivers.world.converter import Converter
from drivers.world.displacement_sensor import FibreProbe
from drivers.world.disturbances import Oddities, Supply
from drivers.world.errors import BadSetting, UnknownSetting
from drivers.world.gravity import Base, LevelErrors, Package, Seating
from drivers.world.heat import Heat, Oven
from drivers.world.laboratory import Laboratory
from drivers.world.noise import Noises
from drivers.world.pickup import Floor
from drivers.world.positioner import Positioner
from drivers.world.stage import Stage
from drivers.world.turned_sensors import Gyroscope, Magnetometer

# How far rigs of one kind differ.


@dataclass(frozen=True)
class Spread:
    """Standard deviations from rig to rig."""

    zero_g_v: float = 0.02
    sensitivity_fraction: float = 0.01
    imperfection_fraction: float = 0.1  # of every imperfection of stages, base and sensor that is not 0


Settings = TypeVar("Settings")


@dataclass(frozen=True)
class Stages:
    """The two rotary stages."""

    alpha: Stage = field(default_factory=Stage)
    beta: Stage = field(default_factory=Stage)


@dataclass(frozen=True)
class SensingAxis:
    """One sensing axis: its springs, its friction, its plates."""

    springs: Springs = field(default_factory=Springs)
    friction: Friction = field(default_factory=Friction)
    plates: Plates = field(default_factory=Plates)


@dataclass(frozen=True)
class Sensor:
    """A proof mass in a package, with two sensing axes in its plane and one out of it."""

    package: Package = field(default_factory=Package)
    x: SensingAxis = field(default_factory=SensingAxis)
    y: SensingAxis = field(default_factory=SensingAxis)
    sag_resonance_hz: float = 4000.0  # out-of-plane resonance: fixes the sag per g (15.5 nm)
    charging_s: float = 900.0  # time constant of the charge that creeps into the oxide
    z: OutOfPlane = field(default_factory=OutOfPlane)  # the ADXL203 does not lead it out


@dataclass(frozen=True)
class WorldConfig:
    """Everything that can be set about a simulated rig. Plain construction gives ideal mechanisms."""

    stages: Stages = field(default_factory=Stages)
    base: Base = field(default_factory=Base)
    seating: Seating = field(default_factory=Seating)
    sensor: Sensor = field(default_factory=Sensor)
    laboratory: Laboratory = field(default_factory=Laboratory)
    magnetometer: Magnetometer = field(default_factory=Magnetometer)
    gyroscope: Gyroscope = field(default_factory=Gyroscope)
    heat: Heat = field(default_factory=Heat)
    oven: Oven = field(default_factory=Oven)
    supply: Supply = field(default_factory=Supply)
    noise: Noises = field(default_factory=Noises)
    floor: Floor = field(default_factory=Floor)
    converter: Converter = field(default_factory=Converter)
    level: LevelErrors = field(default_factory=LevelErrors)
    positioner: Positioner = field(default_factory=Positioner)
    d63: FibreProbe = field(default_factory=FibreProbe)
    oddities: Oddities = field(default_factory=Oddities)
    spread: Spread = field(default_factory=Spread)

    @classmethod
    def ideal(cls) -> WorldConfig:
        """A perfectly linear sensor on perfect stages; its only noise is white."""
        return cls()

    @classmethod
    def adxl203(cls) -> WorldConfig:
        """The sensor and the rig of Ang: hysteresis, loads of the other axes, warm-up over hours."""
        return cls().changed(ADXL203)

    @classmethod
    def from_mapping(cls, settings: Mapping[str, Any]) -> WorldConfig:
        """A preset (key `preset`, default "adxl203") with changes, as a bench file gives them.

        Raises:
            UnknownSetting: a key that does not exist, with the nearest name.
            BadSetting: a value that is not a number, or not a mapping where one is needed.
        """
        changes = dict(settings)
        preset = changes.pop("preset", "adxl203")
        if preset not in PRESETS:
            raise UnknownSetting(f"unknown preset {preset!r} of the simulated world", did_you_mean(preset, PRESETS))
        return (cls.ideal() if preset == "ideal" else cls.adxl203()).changed(changes)

    def changed(self, changes: Mapping[str, Any]) -> WorldConfig:
        """A copy with nested `changes`; raises as `from_mapping` does."""
        return changed_settings(self, changes)


def changed_settings(settings: Settings, changes: Mapping[str, Any], path: str = "") -> Settings:
    """A copy of a (nested) dataclass with nested `changes`."""
    names = [f.name for f in fields(settings)]  # type: ignore[arg-type]
    new = {}
    for name, value in changes.items():
        path_of_name = f"{path}{name}"
        if name not in names:
            raise UnknownSetting(f"unknown setting {path_of_name!r} of the simulated world", did_you_mean(name, names))
        new[name] = _value(getattr(settings, name), value, path_of_name)
    return replace(settings, **new)  # type: ignore[type-var]


def _value(present: Any, value: Any, path: str) -> Any:
    if is_dataclass(present):
        if not isinstance(value, Mapping):
            raise BadSetting(f"{path} of the simulated world is {value!r}", f"Give a mapping of {_names(present)}")
        return (
            _noises(present, value, path)
            if isinstance(present, Noises)
            else changed_settings(present, value, f"{path}.")
        )
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise BadSetting(f"{path} of the simulated world is {value!r}", "Give a finite number")
    return float(value)


def _noises(present: Noises, value: Mapping[str, Any], path: str) -> Noises:
    """Settings of noise for both outputs; a setting without an output applies to both."""
    common = {name: settings for name, settings in value.items() if name not in ("x", "y")}
    both_outputs = Noises(
        changed_settings(present.x, common, f"{path}."), changed_settings(present.y, common, f"{path}.")
    )
    return changed_settings(
        both_outputs, {name: settings for name, settings in value.items() if name not in common}, f"{path}."
    )


def _names(settings: Any) -> str:
    return ", ".join(f.name for f in fields(settings))


PRESETS = ("adxl203", "ideal")

ADXL203: dict[str, Any] = {
    "stages": {
        "alpha": {"zero_offset_deg": 0.05, "play_deg": 0.02},
        "beta": {"zero_offset_deg": 0.05, "play_deg": 0.02, "wobble_deg": 0.03, "wobble_phase_deg": 40.0},
    },
    "base": {"tilt_x_deg": 0.04, "tilt_y_deg": -0.03},
    "seating": {"tilt_deg": 0.02, "grip_pm": 1.0},
    "sensor": {
        "package": {"turn_x_deg": 0.75, "turn_y_deg": -1.3, "turn_z_deg": 0.33, "beams_off_square_deg": 0.17},
        "x": {
            "springs": {
                "hardening_per_um2": -15.0,
                "foreshortening_per_um": -0.9,
                "sag_foreshortening_per_um": -0.05,
                "stress_pm_per_k": 4.0,
                "stiffening_ppm_per_k": -200.0,
            },
            "friction": {"stiffness_fraction": 0.0035, "slip_nm": 3.3, "pressing_per_g2": 0.5},
            "plates": {
                "plate_mismatch_fraction": 0.02,
                "stray_fraction": 1.0,
                "overlap_loss_per_um2": 60.0,
                "height_step_nm": 3.0,
            },
        },
        "y": {
            "springs": {
                "hardening_per_um2": -12.0,
                "foreshortening_per_um": -1.0,
                "sag_foreshortening_per_um": -0.1,
                "stress_pm_per_k": -3.0,
                "stiffening_ppm_per_k": -180.0,
            },
            "friction": {"stiffness_fraction": 0.004, "slip_nm": 3.0, "pressing_per_g2": 0.4},
            "plates": {
                "plate_mismatch_fraction": -0.015,
                "stray_fraction": 1.0,
                "overlap_loss_per_um2": 54.0,
                "height_step_nm": -2.0,
            },
        },
        "z": {"plates": {"plate_mismatch_fraction": 0.01, "stray_fraction": 1.0}, "stress_pm_per_k": 6.0},
    },
    "magnetometer": {
        "x": {"volts_per_ut": 0.0204, "offset_v": 0.013},
        "y": {"volts_per_ut": 0.0197, "offset_v": -0.021},
        "z": {"volts_per_ut": 0.0201, "offset_v": 0.034},
        "y_off_square_deg": 0.4,
        "z_off_square_deg": -0.3,
        "magnet": {"x_mm": 28.0, "y_mm": -12.0, "moment_x_ma_m2": 1.6, "moment_z_ma_m2": -2.1},
        "iron": {"x_mm": 9.0, "y_mm": 17.0, "z_mm": -4.0, "radius_mm": 7.0},
    },
    "gyroscope": {
        "turn_x_deg": 0.6,
        "turn_y_deg": -0.9,
        "turn_z_deg": 0.4,
        "x": {"off_square_ppm": 2.0, "off_square_per_nm": 40.0, "unbalance_fraction": 0.02, "demodulator_deg": 4.0},
        "y": {"off_square_ppm": -1.2, "off_square_per_nm": 40.0, "unbalance_fraction": -0.03, "demodulator_deg": 3.0},
        "z": {"off_square_ppm": 0.8, "off_square_per_nm": 40.0, "unbalance_fraction": 0.01, "demodulator_deg": 5.0},
    },
    "heat": {
        "board_rise_k": 6.0,
        "package_rise_k": 2.0,
        "ambient_wander_k": 0.03,
        "thermocouple_lag_s": 8.0,
        "thermocouple_offset_k": 0.3,
    },
    "supply": {"wander_v": 0.0002},
    "noise": {"flicker_v": 5e-6},
    "converter": {"noise_v": 60e-6},
    "level": {"offset_x_deg": 0.012, "offset_y_deg": -0.008},
}
