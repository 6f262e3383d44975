"""Soaks through the whole program in simulated time: a night, an oven, an early end, kills, and the report on them."""

from __future__ import annotations

import random
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from calibrations import discover
from calibrations.analyses.forecast import Bounds, Forecast, SoakForecast
from procedures.catalogue import find
from procedures.soak import schedule
from rig import load
from rig.bench import DEFAULT, read_bench
from rig.bench.result_names import names_with_limits
from rig.record import Record
from rig.record.measured import MeasuredRun
from rig.results.soak import read_soak
from rig.runs.estimates import SoakForecaster, lines, outlook
from rig.runs.runner import resume, start
from rig.services.exclusion import exclude
from tests.rig.conftest import Rig
from tests.rig.nursery import Harm, Nursery
from tests.rig.rigging import Onlooker, sigterm_at

pytestmark = pytest.mark.sockets
NIGHT = ("--block-s", "450", "--unattended", "--json")
SHORT = {"duration_s": 60.0, "interval_s": 20.0, "block_s": 5.0}
SHORT_RUN = ("soak", "--duration-s", "60", "--interval-s", "20", "--dwell-s", "0.2", "--settle-s", "0", "--unattended")


@pytest.fixture
def cold(tmp_path: Path) -> str:
    """A bench whose converter switches the sensor's power, and samples slowly: a night in seconds."""
    document = yaml.safe_load(DEFAULT.read_text())
    document["instruments"]["adc"]["settings"] |= {"power_dio": 0, "rate_hz": 25}
    document["limits"]["results"] = {"steady-state": [1, 1], "steady-state-time": [0, 12]}
    path = tmp_path / "cold.yaml"
    path.write_text(yaml.safe_dump(document))
    return str(path)


@pytest.mark.slow
def test_a_night_reaches_its_steady_state_after_hours_and_is_told_on_one_page(
    rig: Rig, cold: str, tmp_path: Path
) -> None:
    ended = rig("run", "soak", "--bench", cold, "--off-s", "36000", "--interval-s", "1800", *NIGHT)
    document = ended.document
    found = document["results"]
    assert set(found) <= set(names_with_limits())
    assert (ended.status, document["state"]) == (0, "complete"), ended.err
    assert found["steady-state"]["verdict"] == found["steady-state-time"]["verdict"] == "pass"
    assert 2.0 < found["steady-state-time"]["value"] < 12.0
    assert found["time-constant-x"]["value"] == pytest.approx(1.5, abs=4 * found["time-constant-x"]["std"])
    assert abs(found["bias-drift-x"]["value"]) > 1e-3
    assert "final value not yet known" in ended.err
    assert "bias-x " in ended.err
    assert "final value 2." in ended.err
    assert 0.5 < found["scale-foreseen-x"]["value"] < 12
    assert found["scale-final-x"]["std"] < 1e-3
    page = tmp_path / "night.html"
    assert rig("report", document["run"], "--out", str(page)).status == 0
    text = page.read_text(encoding="utf-8")
    assert "are steady" in text
    assert "Forecasts of the final values" in text
    assert "steady-state-time" in text
    assert "; interval (s): 1800; " in text
    assert re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC", text), "times as people read them"
    assert str(tmp_path) not in text


@pytest.mark.slow
def test_a_soak_in_an_oven_is_steady_within_an_hour(rig: Rig, cold: str) -> None:
    ended = rig("run", "soak", "--bench", cold, "--oven-c", "45", "--off-s", "36000", "--duration-s", "21600", *NIGHT)
    found = ended.document["results"]
    assert 0.05 < found["steady-state-time"]["value"] < 1.0


@pytest.mark.slow
def test_a_resumed_soak_has_the_same_forecast_as_an_undisturbed_one(rig: Rig, rig_home: Path) -> None:
    """The part that was being kept when the first half ended is all that a follower misses."""
    run = rig("run", *SHORT_RUN, "--block-s", "5", "--json").document["run"]
    with Record(rig_home) as record:
        kept = list(record.kept(run))
    whole, resumed = SoakForecaster(), SoakForecaster()
    for watch in (whole, resumed):
        watch.begun(run)  # the record holds all of it
    begun = {name: each.forecast() for name, each in whole.followers[0].forecast.followed.items()}
    assert set(begun) == {"bias-x", "scale-x", "bias-y", "scale-y"}
    assert "not yet known" in lines(begun, "V")
    resumed.followers[0].forecast = SoakForecast({})
    told = [forecasts for each in kept if (forecasts := resumed.forecasts(each))]
    assert len(told) == len([pose for pose in schedule(**SHORT) if pose.path.startswith("reversal")]) / 8
    assert told[-1]["scale-x"].final.value == pytest.approx(begun["scale-x"].final.value, rel=1e-6)


@pytest.mark.parametrize(
    ("steady_h", "half_v", "said"),
    [
        ((3.0, 5.0, 9.0), 1e-5, "final value 2.50000 +- 10 uV (95 %); steady in 3.0 h (1.0 h to 7.0 h)"),
        ((2.0, 3.0, 9.0), 5e-3, "final value not yet known: 2.4950 to 2.5050 V (95 %); steady in at most 7.0 h"),
        ((3.0, 5.0, 99.0), 5e-3, "2.5050 V (95 %); steady in 1.0 h at the earliest"),
        ((2.0, 5.0, 99.0), 5e-3, "2.5050 V (95 %); time of steady state not yet known"),
        ((1.0, 1.5, 2.0), 1e-5, "+- 10 uV (95 %); steady"),
    ],
)
def test_the_forecast_shows_its_bounds_at_any_width(
    steady_h: tuple[float, float, float], half_v: float, said: str
) -> None:
    final = Bounds(2.5 - half_v, 2.5, 2.5 + half_v)
    steady_s = Bounds(*(3600.0 * h for h in steady_h))
    forecast = Forecast(7200.0, Bounds(2.49, 2.491, 2.492), final, steady_s, 1e-4, 9e-3, 1.0)
    assert outlook("bias-x", forecast, "V").endswith(said)
    step = replace(forecast, innovation_ratio=9.0)
    assert outlook("bias-x", step, "V") == "the drift does not look like a warm-up, so there is no forecast"


@pytest.mark.slow
def test_a_soak_until_steady_ends_early_and_states_the_time(rig: Rig, cold: str) -> None:
    ended = rig("run", "soak", "--until-steady", "--bench", cold, "--off-s", "36000", *NIGHT)
    document = ended.document
    assert (ended.status, document["state"]) == (0, "complete"), ended.err
    assert document["poses"] < len(list(schedule(43200.0, 900.0, 450.0)))
    assert document["results"]["steady-state"]["value"] == 1.0
    with Record() as record:
        measured = MeasuredRun.named(record, document["run"])
        t_s = read_soak(measured).courses["bias-x"].t_s
    assert 0 < measured.table().time_s[0] < 30  # since power-on, ten hours after the run's beginning
    assert 0 < t_s[0] < 60
    last_h = t_s[-1] / 3600
    assert document["results"]["steady-state-time"]["value"] < last_h < 12


@pytest.mark.slow
def test_a_soak_that_measures_its_first_pose_again_stays_on(rig: Rig, cold: str) -> None:
    """A second cold start in mid-run would warm the sensor up anew, and all times would count from it."""
    settings = {**SHORT, "duration_s": 10.0, "dwell_s": 0.2, "off_s": 20.0, "oven_c": 0.0}
    with Record() as record:
        with sigterm_at(12):
            start(record, read_bench(Path(cold)), find("soak"), settings, Onlooker())
        (stopped,) = record.runs()
        begun = MeasuredRun.named(record, stopped.run)
        on_s, before_s = begun.readings(), begun.table().time_s
        exclude(record, stopped.run, [0], "touched")
        resume(record, stopped.run, Onlooker())
        done = MeasuredRun.named(record, stopped.run)
        assert done.readings() == on_s
        assert list(done.table().time_s[: len(before_s) - 1]) == list(before_s[1:])


@pytest.mark.slow
def test_the_result_does_not_depend_on_the_blocks(rig: Rig) -> None:
    words = ("--duration-s", "96", "--interval-s", "32", "--json")
    volts, runs = [], [rig("run", *SHORT_RUN, *words, "--block-s", s).document["run"] for s in ("2", "1")]
    with Record() as record:
        for run in runs:
            kept = [each for each in record.kept(run) if each.pose.path in ("hold 5", "reversal 6")]
            assert {each.pose.path for each in kept} == {"hold 5", "reversal 6"}
            volts.append(np.concatenate([each.samples.volts for each in kept]))
    assert volts[0].shape == volts[1].shape
    assert np.array_equal(*volts)


@pytest.mark.slow
def test_killed_at_random_moments_it_ends_with_every_block_once(tmp_path: Path) -> None:
    luck, words = random.Random(1), ("run", *SHORT_RUN, "--block-s", "5")
    with Nursery() as nursery:
        whole = nursery.run(tmp_path / "whole", *words)
        for seed in range(2):
            home, run = tmp_path / f"{seed}", ""
            for _ in range(3):
                harm = Harm("sql", luck.randint(1, whole.points["sql"] // 2))
                nursery.run(home, *(("resume", run, "--unattended") if run else words), harm=harm)
                with Record(home) as record:
                    run = "".join(each.run for each in record.runs())
            last = ("resume", run, "--unattended") if run else words
            assert nursery.run(home, *last).status == 0
            with Record(home) as record:
                run = record.runs()[0].run
                assert Counter(kept.pose for kept in record.kept(run)) == Counter(schedule(**SHORT))
                assert record.run(run).state == "complete"


@pytest.mark.slow
def test_a_kill_in_a_hold_is_a_gap_in_the_results(rig_home: Path) -> None:
    with Nursery() as nursery:
        killed = nursery.run(rig_home, "run", *SHORT_RUN, "--block-s", "5", harm=Harm("INSERT INTO blocks", 48))
        assert killed.status < 0
        with Record(rig_home) as record:
            run = record.runs()[0].run
        assert nursery.run(rig_home, "resume", run, "--unattended").status == 0
    with Record(rig_home) as record:
        (gap,) = read_soak(MeasuredRun.named(record, run)).gaps
        assert gap.path == "hold 4"
        assert 0 < gap.length_s == pytest.approx(record.run(run).results["gap"]["value"])


def test_the_plan_of_a_night_is_quick_and_complete(rig: Rig) -> None:
    document = rig("plan", "soak", "--until-steady", "--json").document
    assert document["settings"]["until_steady"] is True
    assert document["poses"] == len(list(schedule(43200.0, 900.0, 10.0)))
    assert 13 * 3600 < document["duration_s"] < 15 * 3600  # an hour without power first


def test_a_switch_may_have_a_value_too(rig: Rig) -> None:
    assert rig("plan", "soak", "--until-steady", "no", "--json").document["settings"]["until_steady"] is False
    assert "true or false" in rig("plan", "soak", "--until-steady", "maybe").err


@pytest.mark.release
def test_a_search_on_a_soak_publishes_no_scale_factor_that_its_orientations_do_not_show(rig: Rig) -> None:
    """A scale factor of 1.1356(21) V/g, where the sensor's is 0.985, had companions that were not identified."""
    rig("run", "soak", "--duration-s", "7200", "--interval-s", "900", "--unattended")
    found = discover(load("last"), "linear")
    scales = [estimate for key, estimate in found.end.params.items() if key.startswith("scale-factor.")]
    assert len(scales) == 2
    for scale in scales:
        assert scale.std is not None
        assert not scale.identified or abs(scale.value - 1.0) < 0.02 + 3 * scale.std
