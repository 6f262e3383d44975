"""A whole sweep with motors and analog records of EPICS: on their twins, and with an IOC that others wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.epics_ioc import serving
from tests.rig.conftest import Rig

SWEEP = ("--inclinations-deg", "90", "--step-deg", "90", "--dwell-s", "1", "--settle-s", "0.3", "--unattended")
FAST = {"speed_deg_s": 200, "speed_limit_deg_s": 400, "acceleration_deg_s2": 4000}


def swept(rig: Rig, tmp_path: Path, adc: dict[str, Any], **stages: dict[str, Any]) -> list[float]:
    """Scale factors of both axes, V/g, after a sweep."""
    instruments = {role: {"driver": "epics_motor", **stage} for role, stage in stages.items()}
    instruments["adc"] = {"driver": "epics_adc", **adc}
    bench = {"name": "EPICS", "seed": 3, "instruments": instruments, "world": {"preset": "ideal"}}
    if "simulated" not in (stage["url"] for stage in stages.values()):
        del bench["world"]
    file = tmp_path / "epics.yaml"
    file.write_text(yaml.safe_dump(bench))
    answers = tmp_path / "answers.yaml"
    answers.write_text("mounting: yes\n")
    assert rig("check", "--bench", str(file)).status == 0
    ended = rig("run", "sweep", "--bench", str(file), *SWEEP, "--answers", str(answers))
    assert ended.status == 0, ended.err
    document = rig("fit", "last", "--model", "linear", "--json").document
    return [p["value"] for p in document["parameters"] if "scale" in p["name"]]


@pytest.mark.slow
@pytest.mark.sockets
def test_simulated_records_turn_and_measure_the_simulated_sensor(rig: Rig, tmp_path: Path) -> None:
    stage = {"url": "simulated", "settings": FAST}
    adc = {"url": "simulated", "settings": {"channels": {"vx": "ai1", "vy": "ai2"}, "rate_hz": 20}}
    assert swept(rig, tmp_path, adc, alpha=stage, beta=stage) == pytest.approx([0.9744, 0.9943], rel=5e-3)


@pytest.mark.slow
@pytest.mark.sockets
def test_an_ioc_of_others_is_found_turned_and_measured(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = {**FAST, "deg_per_unit": 1.0}
    adc = {"url": "ca:test:", "settings": {"channels": {"vx": "ai1", "vy": "ai2"}, "rate_hz": 5}}
    alpha, beta = ({"url": f"ca:test:{role}", "settings": settings} for role in ("alpha", "beta"))
    with serving(monkeypatch):
        assert swept(rig, tmp_path, adc, alpha=alpha, beta=beta) == pytest.approx([1.0, 1.0], rel=1e-3)
