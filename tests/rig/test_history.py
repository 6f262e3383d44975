"""rig history, over tables of several years and of two sensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import pytest

from calibrations.fitting.fit import Fit, fit
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.table import Table
from rig.errors import RecordError
from rig.record import Record
from rig.services.history import (
    Calibration,
    History,
    ParameterValue,
    _most_frequent_kind,
    _quantity,
    history,
    judge_history,
    latest,
    type_of,
)
from rig.services.history_comparison import compare_rigs
from rig.services.history_words import next_due
from tests.rig.conftest import Rig
from tests.rig.lives import COLUMNS, calibrated


@pytest.fixture
def years() -> None:
    """Sensor 17 over five years, in another order than that of time: 1 mV a year; and another sensor."""
    for k in (3, 0, 4, 1, 2):
        calibrated("17", f"{2020 + k}-03-01", 2.5 + 0.001 * k, seed=k)
    calibrated("18", "2024-03-02", 2.52, seed=9)


def test_a_single_calibration_has_no_drift(rig: Rig, years: None) -> None:
    assert rig("history", "18").out.startswith("18: one calibration, 2024-03-02, model linear\n")
    said = rig("history", "18", "--json").document
    assert len(said["calibrations"]) == 1
    assert {q["drift_per_year"] for q in said["quantities"]} == {None}


def test_the_history_of_a_sensor_is_printed(rig: Rig, years: None, tmp_path: Path) -> None:
    words = ("--limit", "bias-x=0.005", "--quantity", "bias-x", "--pictures", str(tmp_path / "life"))
    ended = rig("history", "17", *words)
    assert ended.status == 0, ended.err
    assert ended.out.startswith("17: 5 calibrations from 2020-03-01 to 2024-03-01, model linear\n")
    assert ended.out.index("2021-03-01") < ended.out.index("2022-03-01")
    assert "Next calibration due on 202" in ended.out
    assert ": bias-x may exceed the limit then." in ended.out
    assert {path.name for path in (tmp_path / "life").iterdir()} == {"life.png", "charts.png"}


def test_the_document_of_a_history_has_its_figures(rig: Rig, years: None) -> None:
    said = rig("history", "17", "--limit", "bias-x=0.005", "--baseline", "3", "--json").document
    assert said["schema"] == "rig.history/1"
    bias = next(q for q in said["quantities"] if q["name"] == "bias-x")
    assert bias["drift_per_year"] == pytest.approx(0.001, rel=0.03)
    assert bias["chart"] == "out of control"
    due = date.fromisoformat(said["due"])
    assert date(2028, 1, 1) < due < date(2029, 3, 2)  # 5 mV at 1 mV a year, sooner by the uncertainty
    still = next(q for q in said["quantities"] if q["name"] == "scale-factor-x")
    assert (still["allowed"], still["due"]) == (None, None)


def test_the_calibration_closest_to_a_day_is_shown_with_its_staleness(rig: Rig, years: None) -> None:
    fresh = rig("history", "17", "--at", "2022-05-01")
    assert (fresh.status, "Closest to 2022-05-01" in fresh.out, "61 days before" in fresh.out) == (0, True, True)
    near = [rig("history", "17", "--at", f"2022-03-0{day}").out for day in (1, 2)]
    assert [end in out for end, out in zip((", the same day.", ", 1 day before."), near, strict=True)] == [True, True]
    old = rig("history", "17", "--at", "2026-01-01")
    assert old.status == 1
    assert "This calibration is stale: it was measured 671 days before that day." in old.out
    due = rig("history", "17", "--at", "2024-12-01", "--limit", "bias-x=0.0003")
    assert "This calibration is stale: it was due on 2024" in due.out


def test_sensors_and_dates_are_compared(rig: Rig, years: None) -> None:
    ended = rig("history", "17", "--beside", "18", "--between", "2020-01-01", "2024-01-01")
    assert ended.status == 1
    assert "17, 2024-03-01 compared with 18, 2024-03-02" in ended.out
    lines = [line.split() for line in ended.out.splitlines() if "agree" in line]
    verdicts = {(line[0], "not" in line) for line in lines}
    assert verdicts == {("bias-x", True), ("bias-y", False), ("scale-factor-x", False), ("scale-factor-y", False)}
    assert rig("history", "17", "--beside", "18", "--quantity", "bias-y").status == 0


def test_a_comparison_computes_only_the_last_calibration_of_the_other_sensor(
    years: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    fitted: list[str] = []

    def noted(model: Model, table: Table) -> Fit:
        fitted.append(table.source)
        return fit(model, table)

    monkeypatch.setattr("rig.services.history.fit", noted)
    with Record() as record:
        last = latest(record, "17", read_model("linear"))
    assert (last.day, fitted) == ("2024-03-01", [last.data])


def test_rigs_are_compared_by_all_calibrations_on_them() -> None:
    start = datetime(2025, 1, 1, tzinfo=UTC)
    of = [
        Calibration(
            f"r{k}",
            start + timedelta(days=k),
            "AB"[k % 2],
            {"bias-x": ParameterValue(2.5 + 0.001 * (k % 2), 1e-4, "V")},
            None,
        )
        for k in range(6)
    ]
    ((unit, found),) = compare_rigs(of, "A", "B").rows.values()
    assert (unit, found.difference, found.agrees) == ("V", pytest.approx(-0.001), False)
    assert found.expanded == pytest.approx(2 * 2**0.5 * 1e-4)  # each rig's own error may be the same every time
    with pytest.raises(RecordError, match="no calibration on the rig 'C'"):
        compare_rigs(of, "A", "C")


def test_a_later_poor_calibration_does_not_widen_the_limits_of_the_chart() -> None:
    start, stds = datetime(2025, 1, 1, tzinfo=UTC), [1e-4, 1e-4, 1e-4, 1e-4, 0.1]
    numbers = [2.5, 2.5, 2.5, 2.503, 2.5]
    quantities = [
        _quantity("bias-x", [_calibration(start, k, numbers[k], stds[k]) for k in range(count)], None, 3)
        for count in (4, 5)
    ]
    before, after = (quantity.chart for quantity in quantities)
    assert before is not None
    assert after is not None
    assert before.sigma == after.sigma == pytest.approx(1e-4)
    assert after.signals == [3, 4]  # a jump, and then the weighted mean is still outside its limit


def test_a_limited_quantity_without_a_drift_has_no_due_date() -> None:
    """bias-y is in two of five calibrations only; the drift of bias-x, which has no limit, says nothing about it."""
    start, value = datetime(2025, 1, 1, tzinfo=UTC), ParameterValue(2.5, 1e-4, "V")
    found = tuple(
        Calibration(
            f"r{k}",
            start + timedelta(days=100 * k),
            "A",
            {"bias-x": value} | ({"bias-y": value} if k > 2 else {}),
            None,
        )
        for k in range(5)
    )
    life = History("17", "linear", found, (), {})
    assert next_due(judge_history(life, {"bias-y": 0.005}), "") == (
        "A due date needs 3 calibrations at different times."
    )
    assert next_due(judge_history(life, {"bias-x": 0.005, "bias-y": 0.005}), "") == (
        "A due date of bias-y needs 3 calibrations at different times."
    )
    assert next_due(judge_history(life, {"bias-x": 0.005}), "").startswith("With this drift no calibration is due")


def _calibration(start: datetime, day: int, value: float, std: float) -> Calibration:
    return Calibration(f"r{day}", start + timedelta(days=day), "A", {"bias-x": ParameterValue(value, std, "V")}, None)


@pytest.mark.sockets
def test_a_run_of_a_batch_is_a_calibration_of_each_sensor(rig: Rig, bench_file: Callable[..., Path]) -> None:
    channels = {"a1.vx": 0, "a1.vy": 1, "a2.vx": 2, "a2.vy": 3}
    bench = {
        "sensors": {name: {"name": "ADXL203", "serial": serial} for name, serial in (("a1", "17"), ("a2", "18"))},
        "name": "the rig in the cellar",
    }
    import yaml

    from rig.bench import DEFAULT

    whole = yaml.safe_load(DEFAULT.read_text())
    whole["instruments"]["adc"]["settings"]["channels"] = channels
    whole.pop("sensor")
    whole.pop("d63")
    file = bench_file(yaml.safe_dump(whole | bench))
    sweep = ("--inclinations-deg", "90,30", "--step-deg", "90", "--dwell-s", "0.2", "--unattended")
    assert rig("run", "sweep", *sweep, "--bench", str(file)).status == 0
    for serial, member in (("17", "a1"), ("18", "a2")):
        (only,) = rig("history", serial, "--json").document["calibrations"]
        assert only["data"].endswith(f"/{member}")
        assert only["rig"] == "the rig in the cellar"


def test_a_run_names_the_history_of_its_sensor(rig: Rig, years: None) -> None:
    shown = {run["run"]: rig("show", run["run"]).out for run in rig("runs", "--json").document["runs"]}
    said = "The record has 5 calibration runs of the sensor 17: rig history 17"
    assert sum(said in text for text in shown.values()) == 5
    assert sum("rig history 18" in text for text in shown.values()) == 0  # one run makes no life


def test_a_run_that_is_no_calibration_is_passed_over_with_the_reason(rig: Rig, years: None) -> None:
    with Record() as record:
        columns = {name: values[:2] for name, values in COLUMNS.items()} | {"vx_v": [1.0, 2.0]}
        short = Table.from_columns("poses", columns, {"serial": "17"}, "short")
        record.add_table(short)
        rest = record.begin("noise-floor", {}, constants={"serial": "17"}, kind="still", bench={}, identities={},
                            configuration="", source="")  # fmt: skip
        record.set_state(rest, "complete", None, {})
        found = history(record, "17", read_model("linear"), {})
    assert len(found.calibrations) == 5
    why, unread = found.passed_over.values()
    assert "2 rows cannot determine" in why
    assert unread == "models are fitted to poses, positions, motion, rates or turns, not to a still record"
    assert f"Not used: {rest}: models are fitted to" in rig("history", "17").err


@pytest.mark.parametrize("search", [lambda record, sensor, model: history(record, sensor, model, {}), latest])
def test_a_run_that_gives_no_calibration_is_named_once(search: Callable[..., object]) -> None:
    columns = {name: values[:2] for name, values in COLUMNS.items()} | {"vx_v": [1.0, 2.0]}
    with Record() as record:
        run = record.add_table(Table.from_columns("poses", columns, {"serial": "19"}, "short"))
        with pytest.raises(RecordError, match=r"cannot use its runs: .* 2 rows cannot determine") as refused:
            search(record, "19", read_model("linear"))
    assert str(refused.value).count(run) == 1


def test_a_date_that_cannot_be_read_is_refused(golden, refused: Callable[..., str]) -> None:
    calibrated("19", "last week", 2.5)
    golden.same(refused("history", "19"))


def test_runs_of_one_day_have_no_drift_a_year(rig: Rig) -> None:
    for hour in (8, 12, 16):
        calibrated("17", f"2020-03-01T{hour:02}:00", 2.5 + 0.001 * hour, seed=hour)
    ended = rig("history", "17", "--limit", "bias-x=0.005", "--json")
    said = ended.document
    assert len(said["calibrations"]) == 3
    assert {q["drift_per_year"] for q in said["quantities"]} == {None}
    assert (
        "A due date needs calibrations over 30 days; these are of 0.33 days."
        in rig("history", "17", "--limit", "bias-x=0.005").out
    )


def test_calibrations_of_another_kind_or_by_an_incomplete_model_are_not_compared() -> None:
    start = datetime(2020, 3, 1, tzinfo=UTC)
    values = {"bias-x": ParameterValue(2.5, 1e-4, "V")}
    kinds = ("sweep", "misalignment", "sweep", "sweep")
    of = [
        Calibration(f"r{k}", start + timedelta(days=100 * k), "A", values, None, kind, 1.0)
        for k, kind in enumerate(kinds)
    ]
    found, others = _most_frequent_kind(of)
    assert [each.data for each in found] == ["r0", "r2", "r3"]
    assert list(others) == ["r1"]
    life = judge_history(History("17", "linear", tuple(found), (), others), {})
    assert life.quantities[0].line is not None
    assert life.warnings == ()
    found[1] = replace(found[1], excess=6.6)
    life = judge_history(History("17", "linear", tuple(found), (), others), {})
    assert life.quantities[0].line is None
    assert "not complete for 1 of 3" in life.warnings[0]


def test_a_sensor_is_shown_with_its_type_and_its_serial_number(years: None) -> None:
    with Record.to_read() as record:
        run = record.runs()[0]
    assert type_of("17", replace(run, constants={"serial": "17", "sensor": "ADXL203"})) == "ADXL203"
    assert type_of("ADXL203", replace(run, constants={"sensor": "ADXL203"})) == ""
    batch = {"sensors": {"a1": {"name": "ADXL203", "serial": "17"}, "a2": {"name": "ADXL203"}}}
    assert [type_of(sensor, replace(run, bench=batch)) for sensor in ("17", "ADXL203")] == ["ADXL203", ""]
