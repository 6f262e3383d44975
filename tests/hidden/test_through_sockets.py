"""Rigs swept through the instruments' sockets: the answers and the voltages of the world's own dwell means."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from calibrations.loop import diagnose
from calibrations.model.file import read_model
from calibrations.table import Table
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import read_bench
from rig.cli.terminal.watch import Quiet
from rig.record import Record
from rig.record.measured import table_of
from rig.runs.runner import start
from tests.hidden import rigs
from tests.hidden.defects import DEFECTS

EVERY_INCLINATION = {"step_deg": "20"}
GRID = EVERY_INCLINATION | {"inclinations_deg": "90,30,150"}  # enough for most defects of ten times the noise


def swept(config: WorldConfig, seed: int, folder: Path, **settings: str) -> Table:
    """The table of a sweep that went over the wires."""
    bench = read_bench(None).model_copy(update={"world": asdict(config), "seed": seed})
    procedure = find("sweep", None)
    with Record(folder) as record:
        outcome = start(record, bench, procedure, parse(procedure, settings), Quiet({}))
        assert outcome.run.state == "complete"
        return table_of(record, outcome.run.run)


@pytest.mark.slow
@pytest.mark.sockets
@pytest.mark.parametrize(
    ("defect", "effect", "grid"),
    [
        ("plate mismatch", "quadratic-nonlinearity", GRID),
        ("package stress", "temperature-bias", GRID),
        ("slipping contacts", "hysteresis", EVERY_INCLINATION),
        ("gear play", "stage-backlash", GRID),
    ],
)
def test_the_missing_effect_is_named(defect: str, effect: str, grid: dict[str, str], tmp_path: Path) -> None:
    config = rigs.scaled(DEFECTS[defect], rigs.IDEAL, 11, 10 * rigs.noise_floor_v())
    found = diagnose(swept(config, 11, tmp_path, **grid), read_model("linear"))
    named = found.candidates[0]
    assert found.verdict == ("ambiguous" if named.indistinguishable_from else "effect-missing")
    assert effect in (named.name, *named.indistinguishable_from)
    assert named.held_out_after <= 1.15


@pytest.mark.slow
@pytest.mark.sockets
def test_nothing_is_named_on_a_clean_rig(tmp_path: Path) -> None:
    found = diagnose(swept(rigs.IDEAL, 12, tmp_path, **GRID), read_model("linear"))
    assert (found.verdict, found.missing) == ("adequate", ())


@pytest.mark.sockets
def test_means_over_the_wire_are_the_worlds_own(tmp_path: Path) -> None:
    """Beside noise of the expected size: no shift, no scale, nothing that follows the angles."""
    config = rigs.scaled(DEFECTS["package turned"], WorldConfig.ideal(), 13, 30 * rigs.noise_floor_v())
    table = swept(config, 13, tmp_path, step_deg="30")
    at = {name: table.column(name) for name in ("alpha_deg", "beta_deg")}
    own = World(config, 13).dwell_mean(**at, direction=table.column("direction").astype(int), noise_free=True)
    for name in ("vx_v", "vy_v"):
        z = (table.column(name) - own[name]) / rigs.noise_floor_v(config)
        assert abs(np.mean(z)) < 4 / np.sqrt(table.n)
        assert np.std(z) == pytest.approx(1.0, abs=4 / np.sqrt(2 * table.n))
        assert abs(np.corrcoef(z, own[name])[0, 1]) < 4 / np.sqrt(table.n)


@pytest.mark.slow
@pytest.mark.sockets
def test_the_proposed_sweep_on_both_faces_tells_the_sensor_from_the_stages(tmp_path: Path) -> None:
    config = rigs.IDEAL.changed({"sensor": {"package": {"turn_z_deg": 0.3}}})
    grid = {"step_deg": "30", "inclinations_deg": "90,30,150", "dwell_s": "2"}
    once = diagnose(swept(config, 14, tmp_path / "once", **grid), read_model("linear"))
    assert once.verdict == "ambiguous"
    assert once.next_experiment is not None
    more = {name: str(value) for name, value in once.next_experiment.settings.items()}
    both = diagnose(swept(config, 14, tmp_path / "both", **grid, **more), read_model("linear"))
    assert (both.verdict, both.missing[0]) == ("effect-missing", "axis-misalignment")
