"""The motion through the whole program: unmodified drivers, sockets, the record, its tables, results and report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.loop import compare, diagnose, discover
from calibrations.model.file import read_model
from calibrations.motion.reference import fit_four_parameter
from calibrations.motion.spectrum import find_records
from drivers.errors import LimitError, SensorFault
from procedures.catalogue import find
from procedures.errors import ProcedureError, SettingError
from procedures.motion import KIND, STILL, SWEEP
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.bench.result_names import names_with_limits
from rig.planning.plan import plan
from rig.record import KeptPose, Record
from rig.record.measured import MeasuredRun
from rig.runs.runner import Outcome, resume, start
from rig.services.report import of_run
from tests.rig.conftest import Rig
from tests.rig.rigging import Onlooker
from tests.slow import first_fast

pytestmark = pytest.mark.sockets
MOTION = find("motion")
BRIEF = {"duration_s": "12", "still_s": "4", "block_s": "4", "dwell_s": "0.5"}
STAGES = {axis: {"zero_offset_deg": 0.0, "play_deg": 0.0, "wobble_deg": 0.0} for axis in ("alpha", "beta")}
PAPERS = {  # the paper's sensor and noise on stages without defects; its linear model errs by 300 mm/s^2
    "stages": STAGES,
    "base": {"tilt_x_deg": 0.0, "tilt_y_deg": 0.0},
    "spread": {"imperfection_fraction": 0.0},
    "sensor": {"package": {"turn_y_deg": -1.03}},
}
NOISE = {"white_v": 1.5e-4}  # half a step of the converter: with less, its rounding would follow the motion
QUIET = {"preset": "ideal", "spread": {"imperfection_fraction": 0.0}, "noise": NOISE}


def bench(world: Mapping[str, Any], seed: int = 1, **changes: Any) -> Bench:
    return Bench.model_validate(read_bench().document() | {"world": dict(world), "seed": seed} | changes)


def shaken(record: Record, on: Bench, watch: Any = None, **settings: str) -> Outcome:
    return start(record, on, MOTION, parse(MOTION, settings), watch or Onlooker())


@pytest.fixture
def few_swings(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ideal sensor has no friction whose history swings would remove."""
    monkeypatch.setattr("procedures.motion.SWINGS_DEG", (90.0,))


@pytest.mark.slow
@pytest.mark.parametrize("seed", first_fast([1, 2, 3]))
def test_the_physical_model_reaches_the_limit_that_noise_sets(seed: int, rig_home: Path) -> None:
    with Record() as record:
        results = shaken(record, bench(PAPERS, seed), duration_s="30").run.results
    found = {name: result["value"] for name, result in results.items()}
    assert set(found) <= set(names_with_limits())
    assert found["rmse-linear-x"] == pytest.approx(300, abs=10)
    assert found["improvement-x"] >= 0.97
    assert found["rmse-physical-x"] <= 1.2 * found["noise-limit-x"]
    assert found["frequency"] == pytest.approx(10.0, abs=1e-6)
    servo = abs(1 / complex(1 - (10 / 120) ** 2, 2 * 0.8 * 10 / 120))  # the carriage follows its command so far
    assert found["amplitude"] == pytest.approx(1e3 * servo * 30e-6 * (2 * np.pi * 10) ** 2, rel=1e-4)
    assert {result["unit"] for result in results.values()} == {"mm/s^2", "", "Hz"}


@pytest.mark.slow
def test_the_plan_of_a_motion_takes_as_long_as_the_run(rig_home: Path) -> None:
    planned = plan(read_bench(), MOTION, parse(MOTION, BRIEF))
    with Record() as record:
        outcome = shaken(record, read_bench(), **BRIEF)
        state: Any = record.state(outcome.run.run)
    assert outcome.run.rows == planned.poses == 54 + 1 + 3
    assert state["rig"]["clock_s"] == pytest.approx(planned.duration_s, rel=0.01)
    assert "positioner swings x by 60 um peak to peak at 10 Hz" in [step.what for step in planned.steps]
    assert planned.steps[-1].what == "positioner stops"


@pytest.mark.parametrize(
    ("settings", "error", "said"),
    [
        ({"frequency_hz": "2000"}, LimitError, "the wave tables cannot play 2000 Hz; nothing was moved"),
        ({"frequency_hz": "1e-300"}, LimitError, "cannot play 1e-300 Hz; nothing was moved"),
        ({"frequency_hz": "10,-4"}, SettingError, "motion: amplitude, frequencies and times must be above 0"),
        ({"peak_to_peak_um": "120"}, LimitError, "positioner: x = -10 um is outside its limits 0 .. 100 um"),
        ({"centre_um": "20"}, LimitError, "positioner: x = -10 um is outside its limits"),
        ({"duration_s": "0"}, SettingError, "motion: amplitude, frequencies and times must be above 0"),
    ],
)
def test_the_plan_refuses_a_motion_beyond_the_positioner(
    settings: dict[str, str], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        plan(read_bench(), MOTION, parse(MOTION, settings))


def test_a_bench_without_its_instruments_is_refused_before_anything_moves(golden) -> None:
    document = read_bench().document()
    document["instruments"]["adc"]["settings"]["channels"].pop("d63")
    with golden.refused(ProcedureError):
        plan(Bench.model_validate(document), MOTION, parse(MOTION, {}))
    del (document := read_bench().document())["instruments"]["positioner"]
    with golden.refused(ProcedureError):
        plan(Bench.model_validate(document), MOTION, parse(MOTION, {}))


@pytest.mark.slow
@pytest.mark.parametrize("reversed_channels", first_fast([False, True]))
def test_a_motion_run_holds_three_tables(rig_home: Path, few_swings: None, reversed_channels: bool) -> None:
    document = bench(QUIET).document()
    channels = document["instruments"]["adc"]["settings"]["channels"]
    if reversed_channels:
        document["instruments"]["adc"]["settings"]["channels"] = dict(reversed(channels.items()))
    with Record() as record:
        outcome = shaken(record, Bench.model_validate(document), **BRIEF)
        measured = MeasuredRun.named(record, outcome.run.run)
        table, sweep, still = measured.table(), measured.part("poses", SWEEP), measured.part(STILL)
    assert (table.kind, table.n, sweep.kind, sweep.n, still.n) == (KIND, 12000, "poses", 54, 4000)
    names = {"t_s", "vx_v", "vy_v", "supply_v", "displacement_m", "alpha_deg", "beta_deg", "temperature_c"}
    assert set(table.columns) == names
    assert "d63_v" not in sweep
    assert {*table.column("alpha_deg"), *table.column("beta_deg")} == {45.0, 90.0}
    late_s = 15e-6 if not reversed_channels else -15e-6
    assert table.number("skew_x_s", 0) == pytest.approx(-3 * late_s)  # vx, vy, supply, d63 in turn
    assert table.number("skew_y_s", 0) == pytest.approx(-2 * late_s)
    assert table.constants["d63_serial"] == "SIM-0063"
    assert table.constants["d63_calibrated"] == "2026-11-21"
    displacement_um = 1e6 * table.column("displacement_m")
    assert np.ptp(displacement_um) == pytest.approx(60, abs=0.5)
    assert displacement_um.mean() == pytest.approx(150 + 50, abs=0.2)


@pytest.mark.slow
def test_a_probe_in_front_of_the_carriage_has_the_opposite_sign(rig_home: Path) -> None:
    backward = read_bench().document()["d63"] | {"direction": -1}
    with Record() as record:
        run = shaken(record, bench(QUIET, d63=backward), **BRIEF).run
        assert MeasuredRun(record, run).table().column("displacement_m").mean() < 0
    assert (run.state, run.rows, run.results) == ("complete", 58, {})
    assert "falls where the sensor's acceleration along x rises" in (run.message or "")


def test_a_reading_outside_the_calibration_curve_fails_the_run_and_gives_no_result(
    rig_home: Path, few_swings: None
) -> None:
    with Record() as record:
        outcome = shaken(record, bench(QUIET | {"d63": {"standoff_um": 290.0}}), **BRIEF)
        kept = list(record.kept(outcome.run.run))
    assert isinstance(outcome.error, SensorFault)
    assert "the reading is near the optical peak" in str(outcome.error)
    assert "Move the tip closer" in str(outcome.error)
    assert (outcome.run.state, outcome.run.results) == ("failed", {})
    assert len(kept) == 58  # what was measured stays


@dataclass
class StopsAt(Onlooker):
    """A person who presses Ctrl-C when so many poses are kept."""

    at: int = 0

    def __init__(self, at: int) -> None:
        super().__init__()
        self.at = at

    def kept(self, kept: KeptPose) -> None:
        super().kept(kept)
        if len(self.seen) == self.at:
            raise KeyboardInterrupt("SIGINT")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stops", "lengths_s"),
    [
        ([20, 54, 55], [12]),  # in the sweep, before the still record, before the motion
        ([56], [4, 8]),  # in the motion: a gap parts the records, and the longest is judged
    ],
)
def test_an_interrupted_motion_resumes_and_the_longest_record_is_judged(
    rig_home: Path, few_swings: None, stops: list[int], lengths_s: list[int]
) -> None:
    with Record() as record:
        outcome = shaken(record, bench(QUIET), StopsAt(stops[0]), **BRIEF)
        for before, at in pairwise(stops):
            outcome = resume(record, outcome.run.run, StopsAt(at - before))
            assert (outcome.run.state, outcome.run.rows) == ("stopped", at)
        outcome = resume(record, outcome.run.run, Onlooker())
        assert (outcome.run.state, outcome.run.rows, outcome.error) == ("complete", 58, None)
        table = MeasuredRun.named(record, outcome.run.run).table()
        whole = shaken(record, bench(QUIET), Onlooker(), **BRIEF).run.run
        for a, b in islice(zip(record.kept(whole), record.kept(outcome.run.run), strict=True), 54):
            assert (a.pose, a.t_s) == (b.pose, b.t_s)
            np.testing.assert_array_equal(a.samples.volts, b.samples.volts)
    assert [round((r.end - r.first) / r.rate_hz) for r in find_records(table)] == lengths_s
    assert outcome.run.results["rmse-linear-x"]["value"] < 3


def test_the_carriage_is_stopped_whatever_ends_the_motion(
    rig_home: Path, few_swings: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drivers.pi_e727.driver import Positioner

    stops: list[bool] = []
    real = Positioner.stop
    monkeypatch.setattr(Positioner, "stop", lambda self: (real(self), stops.append(self._still())))
    with Record() as record:
        shaken(record, bench(QUIET), StopsAt(56), **BRIEF)
    assert len(stops) >= 2  # before the first move, and after the motion
    assert all(stops)


@pytest.mark.slow
def test_two_frequencies_make_two_records_and_the_first_is_judged(rig_home: Path) -> None:
    with Record() as record:
        outcome = shaken(record, bench(QUIET), **BRIEF, frequency_hz="10,4")
        table = MeasuredRun.named(record, outcome.run.run).table()
    assert outcome.run.results["frequency"]["value"] == pytest.approx(10, abs=1e-4)
    for record_of, hz in zip(find_records(table), (10.0, 4.0), strict=True):
        line = fit_four_parameter(record_of.times_s(table.time_s), table.column("displacement_m")[record_of.rows])
        assert line.frequency_hz == pytest.approx(hz, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "effect", "parameter", "true"),
    [
        ({"noise": NOISE | {"filter_farad": 0.36e-6}}, "output-filter", "off_nominal", -1.255),
        ({"converter": {"skew_s": 315e-6}}, "sampling-delay", "delay", 3 * 300e-6),
    ],
    ids=["corner 13.8 Hz", "skew 0.3 ms"],
)
def test_a_hidden_defect_of_the_output_is_found_added_and_right(
    hidden: dict[str, Any], effect: str, parameter: str, true: float, rig_home: Path
) -> None:
    with Record() as record:
        outcome = shaken(record, bench(QUIET | hidden), **BRIEF, frequency_hz="10,4")
        table = MeasuredRun.named(record, outcome.run.run).table()
    assert not compare(table, read_model("linear")).adequate
    found = diagnose(table, read_model("linear"))
    assert (found.verdict, found.candidates[0].name) == ("effect-missing", effect)
    complete = discover(table, read_model("linear"))
    (estimate,) = [
        e
        for term in complete.end.model.terms
        if term.name == effect
        for e in term.estimates
        if (e.name, e.axis) == (parameter, "x")
    ]
    assert estimate.value == pytest.approx(true, abs=4 * (estimate.std or 0) + 0.01 * abs(true))


@pytest.mark.slow
def test_a_sensor_turned_on_its_mount_is_found_by_the_axis_that_should_not_move(rig_home: Path) -> None:
    turned = QUIET | {"sensor": {"package": {"turn_z_deg": 1.0}}}
    with Record() as record:
        outcome = shaken(record, bench(turned), **BRIEF)
        table = MeasuredRun.named(record, outcome.run.run).table()
    found = diagnose(table, read_model("linear"))
    first = found.candidates[0]
    assert found.verdict == "ambiguous"  # at one attitude a product of both axes does the same
    assert first.name in {"axis-misalignment", "axis-nonorthogonality", "cross-axis-scale"}
    assert len(first.indistinguishable_from) > 0
    assert "axis-misalignment" in {c.name for c in found.candidates}


@pytest.mark.slow
def test_every_command_takes_a_motion_run(rig: Rig, tmp_path: Path) -> None:
    arguments = [part for name, value in BRIEF.items() for part in (f"--{name.replace('_', '-')}", value)]
    ended = rig("run", "motion", *arguments, "--unattended", "--json")
    document = ended.document
    assert (ended.status, document["procedure"], document["state"]) == (0, "motion", "complete")
    run = document["run"]
    model, page, csv = (str(tmp_path / name) for name in ("model.yaml", "page.html", "run.csv"))
    assert rig("compare", run, "--json").document["model"] == "linear"
    assert rig("add", "output-filter", "--model", "linear", "--data", run, "--out", model).status == 0
    assert "output-filter" in Path(model).read_text()
    assert rig("export", run, "--out", csv).status == 0
    assert "12000 samples" in rig("compare", csv).out
    assert rig("report", run, "--model", "linear", "--out", page).status == 0
    text = Path(page).read_text()
    parts = (
        "<h1>In motion, the physical model has an rms error of ",
        "linear model of the sweep",
        "Comparison with the displacement sensor",
        "rms error of the physical model",
        "Errors of the filters",
        "The model linear, fitted to the motion",
        "Error by model",
    )
    places = [text.index(part) for part in parts]
    assert places == sorted(places)


@pytest.mark.slow
def test_an_imported_motion_has_no_sweep_to_be_judged_by(rig_home: Path) -> None:
    with Record() as record:
        outcome = shaken(record, bench(QUIET), **BRIEF)
        imported = record.add_table(MeasuredRun.named(record, outcome.run.run).table())
    assert of_run(imported)[0] is None
    assert of_run(outcome.run.run)[0] is not None
