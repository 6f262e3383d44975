"""Simulated hands: hand-positions beside the prescriptions of imu_tk and imucal, and beside a stage.

`python -m tests.benchmark.hands 100` prints errors, positions and time as JSON: rms over the hands and axes.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from procedures.errors import NoAnswer
from tests.handling import LinearCalibration, by_imu_tk, by_imucal, by_procedure, on_stage, truth, world_of


def _ended(seed: int, target_g: float) -> LinearCalibration | None:
    """None for a hand that found no new position in time."""
    try:
        return by_procedure(seed, target_g=target_g)
    except NoAnswer:
        return None


METHODS: dict[str, Callable[[int], LinearCalibration | None]] = {
    "hand-positions, 1 mg": lambda seed: _ended(seed, 0.001),
    "hand-positions, 0.1 mg": lambda seed: _ended(seed, 0.0001),
    "imu_tk, 16 positions": by_imu_tk,
    "imu_tk, 36 positions": lambda seed: by_imu_tk(seed, positions=36),
    "imucal": by_imucal,
    "stage, 26 poses": on_stage,
}


def compared(hands: int) -> dict[str, dict[str, Any]]:
    """For each method: rms and largest errors, mean positions and time, and the share of hands that it failed."""
    return {name: _summary(method, hands) for name, method in METHODS.items()}


def _summary(method: Callable[[int], LinearCalibration | None], hands: int) -> dict[str, Any]:
    found = [(method(seed), truth(world_of(seed))) for seed in range(1, hands + 1)]
    ended = [(calibration, true) for calibration, true in found if calibration is not None]
    errors = [calibration.errors(true) for calibration, true in ended]
    values = {name: np.array([each[name] for each in errors]) for name in errors[0]} if errors else {}
    rounded = {name: float(f"{np.sqrt(np.mean(value**2)):.3g}") for name, value in values.items()}
    largest = {f"{name}_largest": float(f"{np.abs(value).max():.3g}") for name, value in values.items()}
    return {
        **rounded,
        **largest,
        "positions": float(np.mean([c.positions for c, _ in ended])) if ended else None,
        "time_s": round(float(np.mean([c.time_s for c, _ in ended])), 1) if ended else None,
        "failed": 1 - len(ended) / hands,
    }


if __name__ == "__main__":
    json.dump({"hands": int(sys.argv[1]), "methods": compared(int(sys.argv[1]))}, sys.stdout, indent=1)
