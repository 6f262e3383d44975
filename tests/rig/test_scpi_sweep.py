"""A whole sweep with a SCPI scanner for a converter: on its twin, and in real time through PyVISA."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from drivers.clock import serve_forever
from rig.bench import Bench
from rig.instruments.wiring import serve, world_of
from tests.rig.conftest import Rig

SWEEP = ("--inclinations-deg", "90", "--step-deg", "90", "--dwell-s", "0.5", "--settle-s", "0.3", "--unattended")
STAGE = {
    "driver": "oriental_az",
    "url": "simulated",
    "settings": {"speed_deg_s": 1200, "acceleration_deg_s2": 36000},
}
SCALE_V_PER_G = (0.9744, 0.9943)  # of this sensor; a LabJack T7 gives the same
SCANNER = {"channels": {"vx": 101, "vy": 102}, "rate_hz": 20, "nplc": 1}
BENCH = {
    "name": "a SCPI scanner",
    "seed": 3,
    "instruments": {
        "alpha": {**STAGE, "unit": 1},
        "beta": {**STAGE, "unit": 2},
        "adc": {"driver": "scpi_meter", "url": "simulated", "settings": SCANNER},
    },
    "world": {"preset": "ideal"},
}


def swept(rig: Rig, tmp_path: Path, bench: dict[str, Any]) -> tuple[float, float]:
    """Scale factors of both axes, V/g, after a sweep."""
    file = tmp_path / "scpi.yaml"
    file.write_text(yaml.safe_dump(bench))
    answers = tmp_path / "answers.yaml"
    answers.write_text("mounting: yes\n")
    assert rig("check", "--bench", str(file)).status == 0
    ended = rig("run", "sweep", "--bench", str(file), *SWEEP, "--answers", str(answers))
    assert ended.status == 0, ended.err
    fitted = rig("fit", "last", "--model", "linear", "--json")
    document = fitted.done().document
    scale = {(p["name"], p.get("axis")): p["value"] for p in document["parameters"]}
    return tuple(value for (name, _), value in scale.items() if "scale" in name)


@pytest.fixture
def lab() -> Iterator[dict[str, Any]]:
    """The same bench, its instruments served in real time by a thread, as others' instruments are."""
    twins = serve(bench := Bench.model_validate(BENCH), world_of(bench))
    ended = threading.Event()
    thread = threading.Thread(target=serve_forever, args=(list(twins.values()), ended.is_set), daemon=True)
    thread.start()
    found = {role: address for server in twins.values() for role, address in server.addresses.items()}
    port = found["adc"].url.rpartition(":")[2]
    urls = {role: address.url for role, address in found.items()} | {"adc": f"visa:TCPIP0::127.0.0.1::{port}::SOCKET"}
    yield {
        **{key: value for key, value in BENCH.items() if key != "world"},
        "instruments": {role: {**part, "url": urls[role]} for role, part in BENCH["instruments"].items()},  # type: ignore[attr-defined]
    }
    ended.set()
    thread.join()
    for server in twins.values():
        server.close()


@pytest.mark.slow
@pytest.mark.sockets
def test_a_simulated_scanner_measures_the_simulated_sensor(rig: Rig, tmp_path: Path) -> None:
    assert swept(rig, tmp_path, BENCH) == pytest.approx(SCALE_V_PER_G, rel=2e-3)


@pytest.mark.slow
@pytest.mark.sockets
def test_through_pyvisa_it_measures_the_same(rig: Rig, tmp_path: Path, lab: dict[str, Any]) -> None:
    pytest.importorskip("pyvisa_py")
    assert swept(rig, tmp_path, lab) == pytest.approx(SCALE_V_PER_G, rel=2e-3)
