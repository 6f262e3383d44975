"""The search for the axes through the whole program: its results, its plan, an interruption."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from calibrations.analyses.misalignment import along_reference
from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import DEFAULT, Bench, read_bench
from rig.bench.result_names import names_with_limits
from rig.planning.plan import plan
from rig.record import Record
from rig.runs.runner import start
from tests.rig.conftest import Rig
from tests.rig.rigging import Onlooker

PACKAGE = {"turn_x_deg": 0.75, "turn_y_deg": -1.3, "turn_z_deg": 0.33, "beams_off_square_deg": 0.17}
KNOWN = {"preset": "ideal", "spread": {"imperfection_fraction": 0.0}, "sensor": {"package": PACKAGE}}


@pytest.mark.sockets
def test_known_axes_are_found_within_0_02_deg(rig: Rig, tmp_path: Path) -> None:
    document = yaml.safe_load(DEFAULT.read_text()) | {"world": KNOWN}
    document["limits"] |= {"results": {"alpha-x": 2.0, "beta-x": 0.1}}
    file = tmp_path / "bench.yaml"
    file.write_text(yaml.safe_dump(document))
    ended = rig("run", "misalignment", "--dwell-s", "2", "--bench", str(file), "--unattended", "--json")
    results = ended.document["results"]
    assert set(results) <= set(names_with_limits())
    axes = {axis: np.array([results[f"theta-{axis}{r}"]["value"] for r in "xyz"]) for axis in "xy"}
    # the package is turned about x, y, z in turn; its y beam leans to its x beam
    a, b, c = np.radians([0.75, -1.3, 0.33])
    x = np.array([np.cos(b) * np.cos(c), np.sin(a) * np.sin(b) * np.cos(c) - np.cos(a) * np.sin(c), 0.0])
    x[2] = np.cos(a) * np.sin(b) * np.cos(c) + np.sin(a) * np.sin(c)
    assert np.degrees(np.abs(axes["x"] - x)).max() < 0.02
    assert results["non-orthogonality"]["value"] == pytest.approx(0.17, abs=0.02)
    assert results["alpha-x"]["value"] == pytest.approx(-np.degrees(np.arcsin(x[2])), abs=0.02)
    assert 0 < results["alpha-x"]["std"] < 0.003
    assert (results["alpha-x"]["verdict"], results["beta-x"]["verdict"], ended.status) == ("pass", "fail", 1)
    matrix = np.array([[results[f"correction-{row}{column}"]["value"] for column in "xyz"] for row in "xy"])
    felt = np.random.default_rng(1).uniform(-1, 1, (5, 3))
    np.testing.assert_allclose(felt @ matrix.T, along_reference(felt, axes["x"], axes["y"]), atol=1e-12)


def test_its_plan_is_a_rehearsal_on_twins() -> None:
    search = find("misalignment")
    planned = plan(read_bench(), search, parse(search, {"dwell_s": "1", "most_rounds": "1"}))
    assert (search.adaptive, planned.poses) == (True, 6 + 16)
    assert planned.reach["beta"] == ((-180, 270), (-400, 400))
    whats = [step.what for step in planned.steps]
    assert whats[:2] == ["alpha seeks its home", "beta seeks its home"]
    assert sum(what.startswith("adc records") and "d63" in what for what in whats) == planned.poses
    assert "level is read" in whats
    assert planned.questions[0].startswith("mounting: ")


@pytest.mark.sockets
def test_its_plan_takes_as_long_as_the_run_and_keeps_nothing(rig_home: Path) -> None:
    search = find("misalignment")
    settings = parse(search, {"dwell_s": "0.5", "most_rounds": "1"})
    planned = plan(read_bench(), search, settings)
    assert not rig_home.exists()
    with Record() as record:
        run = start(record, read_bench(), search, settings, Onlooker()).run
        state: Any = record.state(run.run)
    assert run.rows == planned.poses
    assert state["rig"]["clock_s"] == pytest.approx(planned.duration_s, rel=0.05)


@pytest.mark.sockets
def test_a_rehearsal_uses_no_real_instrument_and_not_its_limits_of_level() -> None:
    document = read_bench().document()
    for part in document["instruments"].values():
        part["url"] = "tcp://192.0.2.1:502"
    document["limits"]["level_deg"] = 0.001
    search = find("misalignment")
    planned = plan(Bench.model_validate(document), search, parse(search, {"dwell_s": "0.1", "most_rounds": "1"}))
    assert planned.poses == 22
