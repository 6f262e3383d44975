"""A model that grows on its data, step by step and back."""

from __future__ import annotations

import re
from html import escape
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

from calibrations.errors import ExpressionError, ModelError
from calibrations.importing.foreign import write_csv
from calibrations.model.file import dump_model
from calibrations.presentation.charts.discovery import levels
from calibrations.presentation.report.report import next_words
from calibrations.progress import show_progress
from rig.services.report import make_report, next_of
from rig.services.request import Request
from rig.services.session import ModelSession, model_session
from rig.web.calculations import begin
from tests.browser.measured import ambiguous, hidden, thousand, wandering
from tests.calibrations.test_common_floor import magnetometer


@pytest.fixture
def turned(tmp_path: Path) -> ModelSession:
    return model_session(Request(hidden(tmp_path, "package turned")))


def test_an_effect_is_tried_added_and_undone(turned: ModelSession) -> None:
    assert turned.diagnosed().candidates[0].name == "axis-misalignment"
    assert not turned.compared().adequate
    grown = turned.with_step(turned.tried(turned.effects["axis-misalignment"]))
    assert grown.compared().adequate
    assert [level.name for level in levels(grown)] == ["linear", "+ axis-misalignment"]
    assert grown.diagnosed().verdict == "adequate"
    assert grown.undone().end is turned.end
    assert turned.undone().end is turned.end


def test_any_added_effect_is_removed_and_the_others_stay(turned: ModelSession) -> None:
    grown = turned
    for name in ("quadratic-nonlinearity", "axis-misalignment", "stage-eccentricity"):
        grown = grown.with_step(grown.tried(grown.effects[name]))
    assert [step.effect.name for step in grown.steps] == list(grown.names)
    steps = list[str]()
    with show_progress(steps.append):
        grown.removed("quadratic-nonlinearity")
    assert steps == [
        f"Removing quadratic-nonlinearity, fitting {name} again" for name in ("axis-misalignment", "stage-eccentricity")
    ]
    for name in grown.names:
        left = grown.removed(name)
        assert left.names == tuple(each for each in grown.names if each != name)
        assert {term.effect.name for term in left.end.model.terms} == {"bias", "scale-factor", *left.names}


def test_the_error_falls_and_rises_again_if_no_column_states_the_noise(tmp_path: Path) -> None:
    write_csv(magnetometer(), path := tmp_path / "hemisphere.csv")
    begun = model_session(Request(str(path), "field"))
    grown = begun.with_step(begun.tried(begun.effects["hard-iron"]))
    assert grown.start.pooled_excess == grown.steps[0].before.pooled_excess > 5
    assert grown.end.pooled_excess == pytest.approx(1.0, abs=0.1)
    assert grown.undone().end.pooled_excess == begun.end.pooled_excess == pytest.approx(1.0, abs=0.1)


def test_an_effect_that_cannot_be_added_is_refused(golden, turned: ModelSession) -> None:
    with golden.refused(ModelError):
        turned.tried(turned.effects["bias"])
    with golden.refused(ModelError):
        turned.tried(turned.effects["hard-iron"])
    with golden.refused(ModelError):
        turned.tried(turned.written("mine", "a + 0*beta"))


def test_an_effect_of_ones_own_is_tried_like_any_other(turned: ModelSession) -> None:
    step = turned.tried(turned.written("mine", "a*az + b*cos(beta)*sin(2*alpha)"))
    assert step.after.pooled_excess < step.before.pooled_excess
    with pytest.raises(ExpressionError, match='did you mean "beta"'):
        turned.written("mine", "a*sin(5*betta)")
    with pytest.raises(ModelError, match="already in the catalogue"):
        turned.written("bias", "a*sin(5*beta)")


@pytest.mark.slow
def test_the_name_of_a_removed_effect_is_free_and_its_searches_are_forgotten(turned: ModelSession) -> None:
    first = turned.written("mine", "a*az")
    grown = turned.with_own(first)
    grown = grown.with_step(grown.tried(first))
    assert grown.diagnosed().findings in grown.plans.values()
    removed = grown.removed("mine")
    second = removed.written("mine", "a*sin(2*beta)")
    again = removed.with_own(second)
    assert again.effects["mine"].expression == "a*sin(2*beta)"
    assert again.with_step(again.tried(second))._plan() is None
    assert again.plans == {names: found for names, found in grown.plans.items() if "mine" not in names}


def test_a_report_takes_the_search_that_its_session_has_made(turned: ModelSession, undrawn: None) -> None:
    assert turned.search_made is None
    turned.diagnosed()
    assert turned.search_made is not None
    _, page = make_report(turned.request, pytest.fail, pytest.fail, lambda: turned)
    assert "misses axis-misalignment" in page()


def test_a_session_has_a_verdict_without_a_search_only_before_its_search(turned: ModelSession) -> None:
    judgement = turned.judged()
    assert judgement is not None
    assert judgement.verdict == "incomplete"
    turned.diagnosed()
    assert turned.judged() is None  # the search has decided


def test_a_model_that_fails_only_by_its_old_values_is_not_called_incomplete(tmp_path: Path) -> None:
    data = thousand(tmp_path)
    text = dump_model(model_session(Request(data)).complete_model())
    (model := tmp_path / "old.yaml").write_text(
        re.sub(r"(name: bias.*?value: )[\d.]+", r"\g<1>2.4", text, flags=re.DOTALL)
    )
    session = model_session(Request(data, str(model)))
    assert session.compared().fails
    assert session.judged() is None


def test_a_page_plans_the_next_experiment_beside_its_report(tmp_path: Path, undrawn: None) -> None:
    session = model_session(Request(ambiguous(tmp_path)))
    assert next_of(session, pytest.fail) is None  # before the search
    session.diagnosed()
    whole, brief = (
        make_report(session.request, pytest.fail, pytest.fail, lambda: session, plans_next=plans)[1]()
        for plans in (True, False)
    )
    assert "Next experiment" not in brief
    before, _, section = whole.partition("Next experiment")
    assert brief.startswith(before[: before.rindex("</section>")])
    experiment = next_of(session, pytest.fail)
    assert experiment is not None
    assert escape(next_words(experiment)) in section
    assert escape(experiment.command) in section


def test_a_report_without_a_next_experiment_says_so(turned: ModelSession, undrawn: None) -> None:
    turned.diagnosed()
    _, page = make_report(turned.request, pytest.fail, pytest.fail, lambda: turned, plans_next=False)
    assert "No further experiment is needed" in page()
    assert next_of(turned, pytest.fail) is None


def test_the_second_of_two_pages_waits_for_the_search_of_the_first(
    turned: ModelSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    searches, begun, go, doing = list[ModelSession](), Event(), Event(), Event()

    def search(session: ModelSession) -> Any:
        searches.append(session)
        begun.set()
        assert go.wait(60)
        return real(session)

    def show(text: str) -> None:
        if text.startswith("Waiting for the same search"):
            doing.set()

    def diagnose_second() -> Any:
        with show_progress(show):
            return turned.with_effects(dict(turned.effects)).diagnosed()

    real = ModelSession._search
    monkeypatch.setattr(ModelSession, "_search", search)
    first = begin(turned.diagnosed)
    assert begun.wait(60)
    second = begin(diagnose_second)
    assert doing.wait(60)
    go.set()
    assert first.future.result(60).findings is second.future.result(60).findings
    assert len(searches) == 1
    assert turned.searching == {}


def test_after_a_search_that_was_ended_the_page_that_waits_makes_its_own(turned: ModelSession) -> None:
    ended = Thread()
    ended.start()
    ended.join()
    turned.searching[()] = ended
    assert turned.diagnosed().missing == ("axis-misalignment",)
    assert turned.searching == {}


def test_a_process_is_added_to_a_noise_model_and_undone(tmp_path: Path) -> None:
    request = Request(wandering(tmp_path))
    found = model_session(request)
    result = found.diagnosed()
    assert (result.verdict, result.missing) == ("effect-missing", ("rate-random-walk",))
    step = found.tried(result.candidates[0].effect)
    grown = found.with_step(step)
    assert grown.end.pooled_excess == pytest.approx(1.0, abs=0.15)
    assert found.compared().fails
    assert not grown.compared().fails
    assert grown.diagnosed().verdict == "adequate"
    assert grown.undone() == found
    with pytest.raises(ModelError, match="rate-random-walk is already in the model"):
        grown.tried(result.candidates[0].effect)
