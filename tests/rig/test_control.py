"""The check standard from its measurement to its control charts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from calibrations.discovery.check_poses import MARK
from rig.bench.result_names import names_with_limits
from rig.record import Record
from rig.record.measured import table_of
from tests.rig.conftest import Rig

QUIET = [2.50001, 2.49999] * 5
ONE = {"sensor": {"name": "ADXL203", "serial": "CS-1"}}


def checks(
    values: Sequence[float],
    bench: dict[str, Any] = ONE,
    name: str = "bias-x",
    state: str = "complete",
    std: float | None = 2e-6,
) -> list[str]:
    """Check-standard runs with these results, oldest first."""
    names = []
    with Record() as record:
        for value in values:
            about: dict[str, Any] = {"identities": {}, "configuration": "", "constants": {}, "source": "bench"}
            names.append(record.begin("check-standard", {}, bench=bench, **about))
            record.set_state(names[-1], state, None, {name: {"value": value, "std": std, "unit": "V"}})
    return names


@pytest.mark.sockets
def test_a_check_standard_is_measured_and_begins_its_baseline(rig: Rig) -> None:
    for _ in range(2):
        ended = rig("run", "check-standard", "--dwell-s", "1", "--unattended", "--json")
    document = ended.document
    results = document["results"]
    with Record() as record:
        marks = set(table_of(record, document["run"]).labels["path"])
    assert (len(marks), any(mark.startswith(MARK) for mark in marks)) == (1, False), "no check poses of another run"
    assert (ended.status, document["poses"], set(results)) == (0, 8, {"bias-x", "scale-x", "bias-y", "scale-y"})
    assert (results["bias-x"]["unit"], results["scale-x"]["unit"]) == ("V", "V/g")
    assert set(results) <= set(names_with_limits())
    assert results["scale-x"]["value"] == pytest.approx(1.0, abs=0.03)
    assert 0 < results["bias-x"]["std"] < 1e-3
    charted = rig("control", "simulated")
    assert charted.status == 0
    assert charted.out.count("2 of 20") == 4
    fitted = rig("fit", "last", "--model", "linear")
    assert (fitted.status, "check poses" in fitted.out) == (0, False), fitted.err
    assert charted.out.endswith("\nbaseline\n")


def test_a_jump_is_out_of_control_and_named(rig: Rig) -> None:
    runs = checks([*QUIET, 2.5, 2.5001, 2.5])
    ended = rig("control", "--baseline", "10")
    assert ended.status == 1
    assert f"{runs[11]}: CS-1 bias-x is +" in ended.out
    assert ended.out.endswith("out of control\n")
    document = rig("control", "CS-1", "--baseline", "10", "--json").document
    (chart,) = document["charts"]
    assert (document["schema"], document["verdict"], chart["sensor"]) == ("rig.control/1", "out of control", "CS-1")
    assert {"chart": "individuals", "run": runs[11]} in chart["signals"]
    assert chart["limits"] == pytest.approx([2.5 - 3 * 2e-5 / 1.128, 2.5 + 3 * 2e-5 / 1.128], abs=1e-7)
    assert (chart["runs"], len(chart["ewma"]), len(chart["ewma_limits"])) == (runs, 13, 13)


def test_after_a_repair_a_new_baseline_is_begun(rig: Rig) -> None:
    checks([*QUIET, 2.6])
    repaired = checks([value + 0.1 for value in [*QUIET, *QUIET]])
    assert rig("control", "--baseline", "10").status == 1
    ended = rig("control", "--baseline", "10", "--since", repaired[0])
    assert (ended.status, ended.out.splitlines()[-1]) == (0, "in control")


def test_a_chart_belongs_to_one_sensor(rig: Rig) -> None:
    checks(QUIET)
    checks(["x"], state="failed")
    batch = {
        "sensor": {"name": "sensor"},
        "sensors": {"a1": {"name": "ADXL203", "serial": "CS-2"}, "a2": {"name": "A2"}},
    }
    checks([2.4, 2.4001], batch, "a1/bias-x")
    checks([2.3, 2.3001], batch, "a2/bias-x")
    document = rig("control", "--json").document
    assert [(chart["sensor"], len(chart["runs"])) for chart in document["charts"]] == [
        ("CS-1", 10),
        ("CS-2", 2),
        ("A2", 2),
    ]
    assert len(rig("control", "CS-2", "--json").document["charts"]) == 1


def test_its_pictures_are_files_of_each_sensor(rig: Rig, tmp_path: Path) -> None:
    checks([*QUIET, 2.5001])
    ended = rig("control", "--baseline", "10", "--pictures", str(tmp_path / "charts"), "--format", "svg")
    picture = (tmp_path / "charts" / "control-CS-1.svg").read_text()
    assert f"written: {tmp_path / 'charts' / 'control-CS-1.svg'}" in ended.out
    assert all(
        words in picture
        for words in (
            "Single runs",
            "Change from run to run",
            "(EWMA)",
            "bias-x − centre",
            "centre 2.5 V",
            "out of control",
        )
    )


def test_a_standard_with_one_measurement_does_not_prevent_the_charts_of_others(rig: Rig) -> None:
    checks(QUIET)
    checks(QUIET[:1], ONE | {"sensor": {"name": "ADXL203", "serial": "CS-9"}})
    ended = rig("control", "--json")
    assert {chart["sensor"] for chart in ended.document["charts"]} == {"CS-1"}


def test_a_baseline_of_equal_values_without_uncertainty_is_named(golden, rig: Rig) -> None:
    runs = checks([2.50001] * 10 + [2.50001, 2.50003], std=None)
    ended = rig("control", "--baseline", "10")
    assert ended.status == 1
    golden.same(ended.out.replace(runs[11], "RUN"))
    assert rig("control", "--baseline", "10", "--json").document["charts"][0]["sigma"] == 0


def test_equal_values_are_in_control(rig: Rig) -> None:
    checks([2.50001] * 22, std=None)  # numpy's mean of 20 of them is another number
    assert rig("control").out.splitlines()[-1] == "in control"


def test_control_gives_the_reason_if_there_is_no_chart(golden, rig: Rig) -> None:
    golden.same(rig("control").err)
    checks(QUIET[:1])
    golden.same(rig("control").err)
