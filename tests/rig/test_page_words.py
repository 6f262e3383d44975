"""Messages of the command line as a page shows them, and the names in them: of settings, files and runs."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from calibrations.design.experiment import Experiment
from rig.bench import read_bench
from rig.bench.file import HAND
from rig.bench.result_names import RESULTS, label
from rig.files import home
from rig.planning.next_experiment import as_proposed
from rig.record import Record, Run
from rig.runs.background.status import Status
from rig.services.next_steps import result_rows
from rig.services.page_words import page_step
from rig.services.tables import with_run_ids
from rig.web.frame import news
from rig.web.pages.next_experiment import preparation
from rig.web.pages.run_record import _circumstances, shortened
from rig.web.pages.run_report import ReportVerdict, verdict_of
from rig.web.parts import for_page, with_labels

SUGGESTED = (
    "x.csv: vx_v is missing\nThe names and values suggest this import:\n\n    rig import x.csv --column vx_v=U:mV\n"
)


@pytest.mark.parametrize(
    ("line", "text", "to"),
    [
        (
            "run 7 has no pose yet; `rig resume` continues it",
            "run 7 has no pose yet; the page Run continues it",
            {"Run": "/run"},
        ),
        (
            "run 7 has no poses; `rig show 7` shows its results",
            "run 7 has no poses; the page Record shows its results",
            {"Record": "/record"},
        ),
        (
            "give a still record; `rig run noise-floor` or `rig run soak` makes one",
            "give a still record; the procedure noise-floor or the procedure soak makes one",
            {"Measure noise-floor": "/run?procedure=noise-floor", "Measure soak": "/run?procedure=soak"},
        ),
        (
            SUGGESTED,
            "x.csv: vx_v is missing\nThe names and values suggest this import (the page Import).",
            {"Import": "/import?file=x.csv"},
        ),
        ("`rig show RUN --poses` lists all", "the page Model lists all", {"Model": "/?data=x.csv"}),
        ("a log needs t_s (in `rig import`, --constant sample_rate_hz=100)",
         "a log needs t_s (in the page Import, the constant sample_rate_hz = 100)", {"Import": "/import?file=x.csv"}),
        (
            'planned for "simulated hand"; give the file of that bench with --bench.',
            'planned for "simulated hand"; choose that bench under Measure on, page Run.',
            {},
        ),
        ("errors of the rig report nothing", "errors of the rig report nothing", {}),
        ("`rig doctor --recover F` copies rows", "`rig doctor --recover F` copies rows", {}),
    ],
)  # fmt: skip
def test_a_page_is_named_in_place_of_its_command(line: str, text: str, to: dict[str, str]) -> None:
    step = page_step(line, "x.csv")
    assert (step.text, dict(step.to)) == (text, to)


def test_the_unit_is_named_in_place_of_its_option(golden) -> None:
    line = 'the column "vx_v" reaches 2500 V\nIf its unit is mV, import it with:\n\n    rig import x.csv --column vx_v=U:mV\n\nIf its unit is V after all, state it: --column vx_v=U:V'  # noqa: E501
    golden.same(page_step(line).text)


def test_the_sample_rate_is_named_as_its_field() -> None:
    line = (
        "log.csv: a raw log needs the column t_s, or a line such as `# sample_rate_hz: 100` above its header "
        "(in `rig import`, --constant sample_rate_hz=100)"
    )
    expected = 'log.csv: a raw log needs the column t_s, or the field "Sample rate (Hz)" of the page Import'
    assert page_step(line).text == expected


def test_a_notification_has_no_commands() -> None:
    running = Status("k", 1, "soak", "a rig", phase="running", run="r1")
    error = "stopped by a person; `rig resume r1` continues the run"
    ended = replace(running, phase="ended", state="stopped", error=error)
    told = "r1: stopped by a person; the page Run continues the run"
    assert news(running, ended) == ("soak: stopped", told)
    assert news(running, replace(ended, phase="paused")) == ("soak is paused", told.removeprefix("r1: "))
    assert news(running, replace(ended, state="complete", error="")) == ("soak: complete", "r1")
    assert news(running, running) is None


def _result(value: float, limit: object = None, std: float | None = None) -> dict[str, object]:
    return {"value": value, "std": std, "unit": "h", "limit": limit, "verdict": "fail" if limit else None}


@pytest.mark.parametrize("procedure", sorted(RESULTS))
def test_every_result_of_a_procedure_has_a_label_of_its_own(procedure: str) -> None:
    labels = Counter(label(procedure, name) for name in RESULTS[procedure])
    assert [text for text, count in labels.items() if count > 1] == []


def test_the_steady_state_is_one_sentence() -> None:
    forecast = {"earliest": _result(2.0), "expected": _result(3.0), "latest": _result(5.0, [0, 4])}
    not_yet = {"A/steady-state-x": _result(0.0, [1, 1])}
    not_yet |= {f"A/steady-state-{end}-x": result for end, result in forecast.items()}
    rows = result_rows(not_yet)
    assert [row.name for row in rows] == ["A/steady-state-x", "A/steady-state-latest-x"]  # a limit has its own row
    assert (
        rows[0].value == "Not confirmed in this run. Forecast: steady 3.00 h after power-on, 2.00 h to 5.00 h (95 %)."
    )
    assert (rows[0].limit, rows[0].verdict) == ("must be reached", "fail")
    reached = {"steady-state": _result(1.0), "steady-state-time": _result(3.25, std=0.11), "gap": _result(0.0)}
    assert [row.value for row in result_rows(reached)] == ["Reached 3.25(11) h after power-on.", "none"]
    early = {"steady-state": _result(1.0), "steady-state-time": _result(0.02, std=3.85)}
    assert result_rows(early)[0].value == "Reached at most 7.7 h after power-on."
    assert result_rows({"steady-state": _result(0.0)})[0].value == "Not confirmed in this run. There is no forecast."


def test_a_run_that_the_bench_cannot_do_has_no_button() -> None:
    sweep = Experiment("sweep", {"step_deg": 10.0, "face": "both"}, (), "for its physics", duration_s=600.0)
    assert preparation(sweep) == {"Prepare this run": "/run?procedure=sweep&step_deg=10&face=both"}
    by_hand = as_proposed(replace(sweep, duration_s=None), read_bench(HAND), None)
    assert "but not on this bench: the bench has no alpha" in by_hand.why
    assert preparation(by_hand) == {}


def test_the_head_of_a_report_has_its_verdict() -> None:
    head = (
        '<span class="state ambiguous">ambiguous</span><span class="what">x</span>\n<h1>It <b>misses</b> a &amp; b</h1>'
    )
    assert verdict_of(f"<body>{head}</body>") == ReportVerdict("ambiguous", "doubt", "It misses a & b")
    other = verdict_of(head.replace("ambiguous", "found"))
    assert other is not None
    assert (other.label, other.look) == ("found", "plain")
    assert verdict_of("<h1>no report</h1>") is None


def test_the_message_of_a_run_is_complete() -> None:
    text = 30 * "a reason, " + "and what to do"
    run = Run("r1", "poses", "sweep", "stopped", {}, {}, {}, "", {}, "", "", None, None, {}, 20)
    told = _circumstances(replace(run, message=text))[0]
    assert {shortened(name, value) for name, value in told.items() if value == text} == {text}
    assert shortened("columns", text) == f"{text[:200]} ..."
    assert shortened("step (deg)", "10") == "10"


def test_a_message_on_settings_has_the_labels_of_the_form() -> None:
    names = ("step_deg", "inclinations_deg", "dwell_s", "paths")
    text = "sweep: step_deg is 'ten'; dwell_s must be above 0, not most_dwell_s; paths is grid"
    assert with_labels(text, names) == (
        'sweep: "step (deg)" is \'ten\'; "dwell (s)" must be above 0, not most_dwell_s; paths is grid'
    )


def test_an_uploaded_file_has_its_own_name() -> None:
    assert for_page(f"{home()}/files/theirs.csv: line 3: no number") == "theirs.csv: line 3: no number"
    assert for_page("/data/theirs.csv: line 3: no number") == "/data/theirs.csv: line 3: no number"


def test_last_becomes_the_id_of_a_run(tmp_path: Path) -> None:
    def begin(procedure: str) -> str:
        return record.begin(procedure, {}, bench={}, identities={}, configuration="", source="a test", constants={})

    with Record() as record:
        sweep, soak = begin("sweep"), begin("soak")
    assert with_run_ids("last") == soak
    assert with_run_ids("last sweep") == sweep
    assert with_run_ids("last sweep + last/a1") == f"{sweep} + {soak}/a1"
    assert with_run_ids(sweep) == sweep
    (file := tmp_path / "last").write_text("a table")
    for unknown in ("nobody", "", str(file)):
        assert with_run_ids(unknown) == unknown
