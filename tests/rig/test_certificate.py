"""rig certificate: from a run with its bench, from a file, and what it refuses."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.model.file import dump_model
from rig.bench import Bench
from rig.record import Record
from tests.calibrations.certified import before
from tests.rig.conftest import Rig

BENCH = {
    "sensor": {"name": "ADXL203", "serial": "17", "manufacturer": "Analog Devices", "filter_corner_hz": 15.07},
    "laboratory": {"name": "The Lab", "person": "A. Person", "city": "Town", "country": "DE", "customer": "Somebody"},
    "limits": {"results": {"bias-x": [1.0, 4.0], "scale-factor-x": [0.1, 0.2]}},
    "uncertainty": {"gain_std": 1e-4},
    "certificates": {"hand level": {"number": "L-1", "due": "2001-01-01"}},
}
SWEEP = (
    "run",
    "sweep",
    "--inclinations-deg",
    "90,30",
    "--step-deg",
    "45",
    "--dwell-s",
    "0.2",
    "--unattended",
    "--json",
)


@pytest.mark.sockets
def test_a_run_gives_all_three_forms(rig: Rig, bench_file: Callable[..., Path], tmp_path: Path) -> None:
    file = str(bench_file(BENCH))
    run = rig(*SWEEP, "--bench", file).document["run"]
    ended = rig("certificate", run, "--model", "linear", "--out", str(tmp_path / "c"))
    assert ended.status == 1, ended.err  # the scale factor is beyond its limit
    assert "pass (over 99.9 %)" in ended.out
    assert "hand level's certificate L-1 expired" in ended.out
    assert "This document certifies no sensor." in ended.out
    assert "step (deg)" in (tmp_path / "c.html").read_text(encoding="utf-8")
    assert "Simulated calibration, no certificate" in (tmp_path / "c.html").read_text(encoding="utf-8")
    for form, text in ((".html", "The Lab"), (".xml", "<dcc:city>Town</dcc:city>"), (".pdf", "")):
        path = tmp_path / f"c{form}"
        assert f"written: {path}" in ended.out
        assert form == ".pdf" or text in path.read_text(encoding="utf-8")
    last = ("certificate", "last", "--model", "linear", "--out", str(tmp_path / "d.xml"))
    document = rig(*last, "--json").document
    assert document["number"].startswith(run), "the number names the run, also where a command says `last`"
    assert document["schema"] == "rig.certificate/1"
    assert (document["serial"], document["customer"], document["laboratory"]["country"]) == ("17", "Somebody", "DE")
    assert {i["role"] for i in document["instruments"]} >= {"alpha", "adc", "hand level"}
    _check_that_samples_can_be_found(run, document)
    listed = rig("show", run, "--poses", "--json").document["kept"]
    assert [pose["sha256"] for pose in listed] == [s["sha256"] for s in document["samples"]]


def _check_that_samples_can_be_found(run: str, document: dict[str, Any]) -> None:
    """By run, pose and digest, with nothing of the program but its record."""
    with Record() as record:
        kept = list(record.kept(run))
    assert [s["number"] for s in document["samples"]] == [k.number for k in kept]
    for said, k in zip(document["samples"], kept, strict=True):
        block = ",".join(k.samples.channels).encode() + np.ascontiguousarray(k.samples.volts, "<f8").tobytes()
        assert said["sha256"] == hashlib.sha256(block).hexdigest()
        assert said["means"][0] == pytest.approx(k.dwell.means["vx"])


def test_a_file_is_certified_without_a_rig(rig: Rig, work: Path) -> None:
    (work / "last-year.yaml").write_text(dump_model(before()))
    ended = rig(
        "certificate", "good.csv", "--model", "last-year.yaml", "--out", "good", "--number", "C-1", "--customer", "Me"
    )
    assert ended.status == 0, ended.err
    page = (work / "good.html").read_text()
    for text in (
        "C-1",
        "Me",
        "measured elsewhere",
        "As found: by the model last-year.yaml",
        "does not name the laboratory",
    ):
        assert text in page
    assert "No values as found" in _page(rig, "linear", work)


def _page(rig: Rig, model: str, work: Path) -> str:
    assert rig("certificate", "good.csv", "--model", model, "--out", "only.html").status == 0
    assert not (work / "only.pdf").exists()
    return (work / "only.html").read_text()


def test_the_configuration_of_a_run_does_not_include_the_laboratory() -> None:
    bench: dict[str, Any] = {"instruments": {}}
    one, other = (Bench.model_validate(bench | {"laboratory": {"name": name}}) for name in ("A", "B"))
    assert one.configuration("sweep", {}) == other.configuration("sweep", {})


def test_a_gravity_that_the_place_cannot_have_is_remarked(rig: Rig, work: Path) -> None:
    """Standard gravity is that of 45 deg at the sea; at the equator it is off by 0.026 m/s^2."""
    table = (work / "good.csv").read_text()
    said = []
    for latitude_deg in (45, 0):
        (work / "placed.csv").write_text(f"# latitude_deg: {latitude_deg}\n# height_m: 0\n{table}")
        said.append(rig("certificate", "placed.csv", "--model", "linear", "--out", "placed.html", "--force").out)
    assert "Check: the stated local gravity" not in said[0]
    assert "differs by +0.026 m/s² from 9.78033 m/s²" in said[1]
    assert "local gravity, 9.80665 m/s²; its direction from the stage angles" in (work / "placed.html").read_text()


def test_a_part_that_another_program_measured_is_remarked(rig: Rig, work: Path) -> None:
    changed = "from pose 5: inertial-rig 2, procedure sweep b; before: inertial-rig 1, procedure sweep a"
    (work / "changed.csv").write_text(f"# program_changed: {changed}\n{(work / 'good.csv').read_text()}")
    rig("certificate", "changed.csv", "--model", "linear", "--out", "changed.html", "--force")
    assert f"The program or the procedure changed during the run, {changed}." in (work / "changed.html").read_text()
