"""Philtec D63 fibre-optic displacement sensor: volts turned into the gap in um by the sensor's own calibration.

It has no wire of its own: its output goes into a channel of the converter. The output rises with the gap on the
near side, has an optical peak, and falls on the far side, so the side must be known. A curve belongs to one sensor
and one calibration: serial number and date go with every result. Source: Philtec, model D63; the form of its
calibration sheet [M].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy  # scipy.interpolate loads slowly: it is imported at its first use
import yaml
from numpy.typing import ArrayLike, NDArray

from drivers.errors import SensorFault

Side = Literal["near", "far"]
SIMULATED = Path(__file__).with_name("philtec_d63_simulated.yaml")
KEYS = ("serial", "date", "near", "far")
FEWEST_POINTS = 4


@dataclass(frozen=True)
class CalibrationCurve:
    """One calibration of one sensor: points (gap in um, output in V) in order of the gap, for each side.

    Raises ValueError for points that are no curve.
    """

    serial: str
    date: str
    near: tuple[tuple[float, float], ...]
    far: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        _require_curve(f"near side of D63 {self.serial}", self.near, rising=True)
        if self.far:
            _require_curve(f"far side of D63 {self.serial}", self.far, rising=False)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> CalibrationCurve:
        """A curve as a bench file gives it: keys serial, date, near, far. Raises ValueError."""
        if unknown := sorted(map(str, set(values) - set(KEYS))):
            raise ValueError(f"{', '.join(unknown)}: not a key of a D63's curve; the keys are {', '.join(KEYS)}")
        if missing := sorted({"serial", "date", "near"} - set(values)):
            raise ValueError(f"{', '.join(missing)}: missing in a D63's curve")
        near, far = (_points(side, values.get(side, ())) for side in ("near", "far"))
        return cls(str(values["serial"]), str(values["date"]), near, far)

    @classmethod
    def from_file(cls, path: Path) -> CalibrationCurve:
        """A curve in a YAML file that the user wrote. Raises ValueError with the file's name."""
        try:
            document = yaml.safe_load(path.read_text(encoding="utf-8"))
            if not isinstance(document, dict):
                raise ValueError(f"must be a mapping with the keys {', '.join(KEYS)}")
            return cls.from_mapping(document)
        except (OSError, yaml.YAMLError, ValueError) as error:
            raise ValueError(f"{path}: {error}") from error

    def displacement_um(self, volts: ArrayLike, side: Side = "near") -> NDArray[np.float64]:
        """The gap in um of each of `volts`, of the same shape: monotone cubics through the points of one side.

        Raises SensorFault for a reading that the curve does not reach, at its far ends or on its peak.
        """
        points = np.array(self._side(side))
        gaps, levels = points.T if side == "near" else points[::-1].T
        values = np.asarray(volts, dtype=np.float64)
        self._require_on_curve(values, side, levels[0], levels[-1])
        return np.asarray(scipy.interpolate.PchipInterpolator(levels, gaps)(values))

    def _side(self, side: Side) -> tuple[tuple[float, float], ...]:
        points: tuple[tuple[float, float], ...] = getattr(self, side) if side in ("near", "far") else ()
        if not points:
            raise SensorFault(f"D63 {self.serial}: its curve of {self.date} has no {side} side", "Use the other side")
        return points

    def _require_on_curve(self, volts: NDArray[np.float64], side: Side, low: float, high: float) -> None:
        """NaN is not on the curve either."""
        off = np.flatnonzero(~((volts >= low) & (volts <= high)))
        if not off.size:
            return
        worst = float(volts.ravel()[off[0]])
        place = f"reading {off[0]} of {volts.size}" if volts.size > 1 else "the reading"
        curve = f"the {side} side of the calibration curve of {self.date}"
        subject = f"D63 {self.serial}: {place}, {worst:.4f} V, is outside {curve}"
        if worst > high:
            raise SensorFault(
                f"{subject}: above {high:g} V the reading is near the optical peak, where the sensor cannot measure",
                REMEDIES[side],
            )
        raise SensorFault(
            f"{subject}: {low:g} .. {high:g} V", "Check lamp, cable and target, then the distance of the tip"
        )


REMEDIES = {"near": "Move the tip closer to the target", "far": "Move the tip away from the target"}


def _points(side: str, values: Any) -> tuple[tuple[float, float], ...]:
    try:
        return tuple((float(gap), float(volt)) for gap, volt in values)
    except (TypeError, ValueError):
        raise ValueError(f"{side}: must be a list of pairs [gap in um, output in V]") from None


def _require_curve(subject: str, points: tuple[tuple[float, float], ...], *, rising: bool) -> None:
    """Points that are enough, finite, in order of the gap, and always rising or always falling."""
    steps = np.diff(np.array(points, dtype=np.float64).reshape(-1, 2), axis=0)
    if len(points) < FEWEST_POINTS:
        raise ValueError(f"{subject}: needs {FEWEST_POINTS} points or more, has {len(points)}")
    is_wrong = ~((steps[:, 0] > 0) & (steps[:, 1] * (1 if rising else -1) > 0))  # NaN is wrong as well
    if is_wrong.any():
        k = int(np.flatnonzero(is_wrong)[0])
        direction = "rise" if rising else "fall"
        raise ValueError(f"{subject}: from {points[k]} to {points[k + 1]} the gap must grow and the output {direction}")
