"""The angles of a run's table: what was commanded, put right by the stage's error table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from calibrations.geometry.error_table import ErrorTable
from calibrations.importing.foreign import read_csv
from rig.bench import DEFAULT
from rig.record import Record
from rig.record.measured import table_of
from rig.record.tables import correct_angles
from tests.rig.conftest import Rig

WOBBLE_DEG, PHASE_DEG = 0.07, 30.0
STAGES = {"beta": {"wobble_deg": WOBBLE_DEG, "wobble_phase_deg": PHASE_DEG}}
WORLD = {"preset": "ideal", "spread": {"imperfection_fraction": 0.0}, "stages": STAGES}


def autocollimator(folder: Path) -> None:
    """What is measured at the eccentric stage every 15 deg: its true angle less the one that is set."""
    angles = np.arange(0.0, 360.0, 15.0)
    errors = WOBBLE_DEG * np.sin(np.radians(angles - PHASE_DEG))
    noise = 0.0005 * np.random.default_rng(5).standard_normal(len(angles))
    rows = [f"{a:g},{e:.5f},0.0005" for a, e in zip(angles, errors + noise, strict=True)]
    (folder / "beta.csv").write_text("\n".join(["# polygon 24, 2026-03-02", "angle_deg,error_deg,std_deg", *rows, ""]))


def bench(folder: Path, **beta: object) -> str:
    document = yaml.safe_load(DEFAULT.read_text()) | {"world": WORLD}
    document["instruments"]["beta"] |= beta
    path = folder / "bench.yaml"
    path.write_text(yaml.safe_dump(document))
    return str(path)


def swept(rig: Rig, bench_file: str, *more: str) -> Any:
    settings = ("--inclinations-deg", "90,30,150", "--step-deg", "20", "--dwell-s", "1", *more)
    return rig("run", "sweep", *settings, "--bench", bench_file, "--unattended", "--json")


@pytest.mark.slow
@pytest.mark.sockets
def test_an_eccentric_stage_is_found_until_its_error_table_is_given(rig: Rig, tmp_path: Path) -> None:
    autocollimator(tmp_path)
    found = {}
    for name, beta in (("without", {}), ("with", {"error_table": "beta.csv"})):
        run = swept(rig, bench(tmp_path, **beta)).document["run"]
        found[name] = rig("diagnose", run, "--json").document
    assert found["without"]["verdict"] == "effect-missing"
    assert found["without"]["candidates"][0]["effect"] == "stage-eccentricity"
    assert found["with"]["verdict"] == "adequate"


@pytest.mark.sockets
def test_the_commanded_angles_stay_as_a_column(rig: Rig, tmp_path: Path) -> None:
    points = [[a, 0.2 * np.sin(np.radians(a)).item(), 0.004] for a in range(0, 360, 30)]
    file = bench(tmp_path, error_table=points)
    run = swept(rig, file, "--inclinations-deg", "90").document["run"]
    with Record() as record:
        table = table_of(record, run)
        kept = list(record.kept(run))
    expected, _ = ErrorTable(tuple(map(tuple, points))).true_deg([k.pose.beta_deg for k in kept])
    np.testing.assert_allclose(table.column("beta_deg"), expected)
    np.testing.assert_array_equal(table.column("beta_set_deg"), [k.pose.beta_deg for k in kept])
    assert table.constants["beta_std_deg"] == pytest.approx(0.004)
    assert "alpha_set_deg" not in table
    assert "alpha_std_deg" not in table.constants
    out = tmp_path / "out.csv"
    rig("export", run, "--out", str(out))
    assert read_csv(out).number("beta_std_deg", 0.0) == pytest.approx(0.004)


@pytest.mark.sockets
def test_a_sweep_beyond_a_partial_table_is_refused_before_anything_moves(rig: Rig, tmp_path: Path) -> None:
    file = bench(tmp_path, error_table=[[a, 0.01, 0.001] for a in range(-90, 91, 30)])
    ended = swept(rig, file)
    assert ended.status == 2
    assert "beta: at 100 deg the stage's error table has no point between 90 and 270 deg" in ended.err
    with Record() as record:
        assert record.runs() == []


def test_every_row_of_a_motion_has_the_true_attitude_and_a_still_record_needs_none() -> None:
    document = yaml.safe_load(DEFAULT.read_text())
    document["instruments"]["alpha"]["error_table"] = [[a, 0.1, 0.02] for a in range(0, 360, 30)]
    with Record() as record:
        about: dict[str, Any] = {"identities": {}, "configuration": "", "constants": {}, "source": "bench"}
        run = record.run(record.begin("motion", {}, bench=document, **about))
    columns = {"alpha_deg": np.full(3, 45.0), "beta_deg": np.full(3, 90.0), "vx_v": np.arange(3.0)}
    found, stds = correct_angles(run, columns)
    np.testing.assert_allclose(found["alpha_deg"], 45.1)
    np.testing.assert_array_equal(found["alpha_set_deg"], 45.0)
    assert stds == {"alpha_std_deg": pytest.approx(0.02)}
    still = {"t_s": np.arange(3.0)}
    assert correct_angles(run, still) == (still, {})
