"""After a run: what each verdict asks for, which poses are left out, and what is called next."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest

from rig.bench.result_names import label
from rig.cli import COMMANDS
from rig.record import Run
from rig.services.next_steps import REMEDIES, next_steps, page_steps, result_rows, results_table

RUN = Run("r1", "poses", "sweep", "complete", {}, {}, {}, "", {}, "", "", None, None, {}, 20)


def result(verdict: str | None, limit: float | None = 1.0) -> dict[str, Any]:
    return {"value": 1.0, "std": 0.1, "unit": "V", "limit": limit, "verdict": verdict}


def steps(run: Run = RUN, excluded: dict[int, str] | None = None, **results: dict[str, Any]) -> str:
    named = {name.replace("_", "-"): each for name, each in results.items()}
    return "\n".join(next_steps(replace(run, results=named), excluded or {}))


def failed(*names: str) -> dict[str, dict[str, Any]]:
    return {name: result("fail") for name in names}


@pytest.mark.parametrize(
    "results",
    [
        failed("noise-rms-x", "noise-pp-x", "level-x") | {"fine": result("pass")},
        failed("a1/rmse-linear-x", "a2/rmse-linear-x"),
        failed("mass"),
        {"amplitude": result(None, None)},
        {"amplitude": result("pass")},
    ],
    ids=["kinds", "sensors", "unknown", "without limit", "pass"],
)
def test_each_verdict_has_its_steps(golden, results: dict[str, Any]) -> None:
    golden.same(steps(**results))


@pytest.mark.parametrize(("procedure", "said"), [("check-standard", True), ("sweep", False)])
def test_uncertainties_of_the_noise_alone_are_called_so(procedure: str, said: bool) -> None:
    run = replace(RUN, procedure=procedure, results={"bias-x": result(None, None)})
    assert ("noise alone" in "\n".join(next_steps(run, {}))) == said
    assert any("noise alone" in step.text for step in page_steps(run, {})) == said
    assert "noise alone" not in "\n".join(next_steps(replace(run, results={}), {}))


@pytest.mark.parametrize(
    ("settings", "hint"),
    [
        ({"duration_s": 60.0, "dwell_s": 2.0}, " (--duration-s 240)"),
        ({"times": 5, "dwell_s": 2.0}, " (--times 20)"),
        ({"dwell_s": 5.0}, " (--dwell-s 20)"),
        ({}, ""),
    ],
)
def test_a_marginal_result_proposes_a_longer_measurement(settings: dict[str, Any], hint: str) -> None:
    text = steps(replace(RUN, settings=settings), noise_rms_x=result("marginal"))
    assert (
        f"Marginal: noise-rms-x reaches across the limit with its uncertainty; 4 times the duration{hint} halves"
        in text
    )


def test_the_next_command_is_named() -> None:
    assert steps().endswith("Next: rig compare r1, rig discover r1, rig report r1 --out report.html")
    assert steps(replace(RUN, state="stopped")) == "Next: rig resume r1"
    assert steps(replace(RUN, kind="still")) == ""
    assert "rig compare r1/a1," in steps(replace(RUN, bench={"sensors": {"a1": {}, "a2": {}}}))


def test_excluded_poses_are_named_with_their_reasons() -> None:
    assert "Left out: pose 6 (repeated by hand); pose 9 (a lorry)" in steps(
        excluded={6: "repeated by hand", 9: "a lorry"}
    )


def test_every_command_that_a_remedy_names_is_there() -> None:
    named = {name for text in REMEDIES.values() for name in re.findall(r"rig ([a-z]+)", text)}
    assert named <= set(COMMANDS)


def test_results_are_a_table() -> None:
    both = {"a": result("fail", 1.0), "b": {**result("pass"), "limit": [0.0, 2.0]}, "c": result(None, None)}
    both |= {"d": {**result("fail"), "value": -1.0}, "d-tolerance": {**result(None, None), "value": 0.0012345}}
    assert [line.split() for line in results_table(both)] == [
        ["result", "value", "limit", "verdict"],
        ["a", "1.00(10)", "V", "at", "most", "1", "V", "fail"],
        ["b", "1.00(10)", "V", "0", "to", "2", "V", "pass"],
        ["c", "1.00(10)", "V", "-"],
        ["d", "-1.00(10)", "V", "at", "least", "-1", "V", "fail"],
        ["d-tolerance", "1.2", "mV", "-"],
    ]
    assert results_table({}) == []


def test_a_result_and_its_limit_have_a_unit_that_is_easy_to_read() -> None:
    def of(value: float, std: float | None, unit: str, limit: object = None) -> dict[str, Any]:
        return {"value": value, "std": std, "unit": unit, "limit": limit, "verdict": None}

    results = {
        "noise-pp-x": of(785.5e-6, 7.3e-6, "V", 0.0035),
        "bias-x": of(2.5, 1e-5, "V", [2.4, 2.6]),
        "A/scale-temperature-x": of(1.88e-4, 0.21e-4, "1/K", 0.0003),
        "scale-tolerance-x": of(1.5e-4, None, ""),
        "temperature-wander": of(153.0, None, "K"),
        "scale-drift-x": of(0.0, 1.2e-4, ""),
        "scale-x": of(1.006169, 2.5e-5, "V/g"),
        "improvement-x": of(0.97648, 0.00048, "", [0.9, 1]),
        "rate-residual-z": of(0.00247273, None, "deg/s"),
        "field": of(0.0410672, None, "per mille"),
        "scale-as-is-x": of(0.0, 2.2e-5, ""),
        "bias-power-x": of(1.2e-4, 0.2e-4, "V"),
        "a1/bias-mount-x": of(0.0, 0.2e-3, "V"),
        "correction-xx": of(1.0003951, None, ""),
        "a1/correction-xy": of(0.0065870211, None, ""),
        "rounds": of(1234.0, None, ""),
    }
    assert [(row.value, row.limit) for row in result_rows(results)] == [
        ("785.5(73) µV", "at most 3.5 mV"),
        ("2.500000(10) V", "2.4 to 2.6 V"),
        ("0.0188(21) %/K", "at most 0.03 %/K"),
        ("0.015 %", ""),
        ("153 K", ""),
        ("0.000(12) %", ""),
        ("1.006169(25) V/g", ""),
        ("97.648(48) %", "90 to 100 %"),
        ("0.0025 deg/s", ""),
        ("0.0411 per mille", ""),
        ("at most 0.0044 %", ""),
        ("120(20) µV", ""),
        ("at most 0.40 mV", ""),
        ("1.000395", ""),
        ("0.006587", ""),
        ("1234", ""),
    ]
    assert results_table(results)[1].split()[1:] == ["785.5(73)", "uV", "at", "most", "3.5", "mV"]


def test_the_steady_state_is_a_sentence_with_times_of_three_digits() -> None:
    time = {"std": None, "unit": "h", "limit": None, "verdict": None}
    not_reached = {"steady-state": {**time, "value": 0.0, "unit": ""}}
    forecast = {f"steady-state-{end}": {**time, "value": 2.35022} for end in ("earliest", "expected", "latest")}
    assert results_table(not_reached | forecast)[1:] == [
        "steady-state  Not confirmed in this run. Forecast: steady 2.35 h after power-on.  -",
    ]
    wider = forecast | {"steady-state-latest": {**time, "value": 3.1}}
    assert "2.35 h to 3.10 h (95 %)" in results_table(not_reached | wider)[1]
    early = {
        "steady-state": {**time, "value": 1.0, "unit": ""},
        "steady-state-time": {**time, "value": 0.5, "std": 0.4},
    }
    assert "Reached at most 1.3 h after power-on." in results_table(early)[1]


@pytest.mark.parametrize("remedy", REMEDIES.values())
def test_a_page_has_buttons_in_place_of_commands(remedy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.services.next_steps.REMEDIES", {"": remedy})
    (step,) = page_steps(replace(RUN, results={"mass": result("fail")}), {})
    assert "rig " not in step.text
    assert "--" not in step.text
    assert bool(step.to) == ("rig " in remedy)
    assert all(to.startswith("/") and "{" not in to for to in step.to.values())


def test_a_page_names_results_in_words() -> None:
    run = replace(
        RUN, procedure="noise-floor", results={"noise-rms-x": result(None, None), "noise-pp-x": result("fail")}
    )
    fail, limit = (step.text for step in page_steps(run, {}))
    assert fail.startswith(f'Fail: "{label("noise-floor", "noise-pp-x")}": look for vibration')
    assert f'for "{label("noise-floor", "noise-rms-x")}" for example' in limit
    assert not any("`" in text or "noise-" in text for text in (fail, limit))


def test_a_page_proposes_the_longer_measurement() -> None:
    settings = {"duration_s": 60.0}
    run = replace(RUN, procedure="noise-floor", settings=settings, results={"noise-rms-x": result("marginal")})
    (step,) = page_steps(run, {})
    assert step.to == {"Measure longer": "/run?procedure=noise-floor&duration_s=240"}
    assert step.text.startswith(f'Marginal: "{label("noise-floor", "noise-rms-x")}" reaches across the limit')
    assert "4 times the duration halves" in step.text
