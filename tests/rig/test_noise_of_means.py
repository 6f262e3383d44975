"""The noise of a mean, measured on a run's samples, is what the simulated rig's filter makes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from calibrations.means.noise import inflation, measured_inflation, white_std
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.session import Pose
from rig.record import KeptPose, Record
from rig.record.measured import table_of

CLEAN = WorldConfig.ideal().changed({"converter": {"noise_v": 0.0}, "noise": {"flicker_v": 0.0}})
FILTER = {"filter_corner_hz": 15.07}


@dataclass(frozen=True)
class Samples:
    """What a converter gives."""

    volts: np.ndarray
    start_s: float
    channels: tuple[str, ...] = ("supply", "vx", "vy")
    rate_hz: float = 1000.0


def dwells(count: int, n: int) -> list[Samples]:
    """Held still in the clean world."""
    world, made = World(CLEAN, seed=5), []
    for _ in range(count):
        start_s = world.now_s + 1e-3
        made.append(Samples(world.adc_volts(Samples.channels, start_s, 1e-3, n), start_s))
    return made


def run_of(record: Record, blocks: list[Samples]) -> str:
    run = record.begin("sweep", {}, bench={}, identities={}, configuration="", constants=FILTER, source="test")
    for number, samples in enumerate(blocks):
        record.keep(run, number, KeptPose(Pose(90.0, float(number)), samples, samples.start_s, None), None)
    return run


def test_the_clean_rig_has_the_noise_of_its_filter() -> None:
    blocks = dwells(64, 5000)
    factor, std = measured_inflation(np.stack([samples.volts[:, 1:] for samples in blocks]))
    rho = np.exp(-2 * np.pi * 15.07 / 1000)
    assert np.all(np.abs(factor - (1 + rho) / (1 - rho)) < 2 * std)
    with Record() as record:
        table = table_of(record, run_of(record, blocks))
    assert [table.constants[f"noise_inflation_{axis}"] for axis in "xy"] == pytest.approx(factor)
    said = white_std(table)
    assert said is not None
    assert said.mean() == pytest.approx(table.outputs.std(axis=0, ddof=1).mean(), rel=3 / np.sqrt(2 * 2 * 64))


def test_short_dwells_fall_back_to_the_filter() -> None:
    with Record() as record:
        table = table_of(record, run_of(record, dwells(4, 100)))
    assert "noise_inflation_x" not in table.constants
    assert inflation(table, "x") == pytest.approx(21.14, abs=0.01)
