"""A search that tells how far it is, and that ends when nobody waits for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.free_forms import search
from calibrations.free_forms.search import MOST_MISFIT
from calibrations.progress import report, show_progress
from rig.services.request import Request
from rig.services.search import Cancelled, CountedEffects
from rig.services.session import model_session
from tests.browser.measured import hidden, two_faults


def test_a_counted_search_shows_what_it_tests() -> None:
    counted = CountedEffects({name: catalogue()[name] for name in ("bias", "hysteresis")})
    assert (counted.text, counted.share) == ("Fitting the model", 0.0)
    effects = iter(counted.values())
    next(effects)
    next(effects)
    assert (counted.text, counted.share) == ("Round 1, effect 2 of 2: hysteresis", 0.5)
    assert list(effects) == []
    assert (counted.text, counted.share) == ("Round 1: comparing the results", 1.0)
    counted.doing = "fitting curves"
    assert counted.text == "Round 1: fitting curves"
    assert list(counted) == ["bias", "hysteresis"]
    assert (counted.round, counted.doing) == (2, "")


def test_an_analysis_shows_its_present_step(tmp_path: Path) -> None:
    texts: list[str] = []

    def seen(text: str) -> None:
        texts.append(text)
        if text.startswith("searching"):
            raise Cancelled

    with show_progress(seen), pytest.raises(Cancelled):
        model_session(Request(two_faults(tmp_path))).diagnosed()
    report("nobody shows this")
    assert [text.partition(" ")[0] for text in texts] == ["Reading", "Fitting", "searching"]
    assert texts[-1] == "searching for places (effects first), pass 1 of at most 7"


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the descents that a search makes; each ends far above the noise, with a component of the history."""
    steps: list[str] = []

    def descended(_setting: object, _general: bool, step: str, **_options: object) -> SimpleNamespace:
        steps.append(step)
        place = SimpleNamespace(place="history")
        return SimpleNamespace(
            ratio=MOST_MISFIT + 0.1, leaves_noise=False, active=["loop"], criterion=0.0, component=lambda _: place
        )

    monkeypatch.setattr(search, "descend", descended)
    return steps


def test_searches_that_follow_each_other_have_different_names(steps: list[str]) -> None:
    """Else the progress seems to go back from the last pass of one to the first pass of the next."""
    for reason in ("", "with larger noise, round 1, "):
        search._search_from_all(SimpleNamespace(first_jumps="the steps", flicker=False), True, reason)
    jumps = "with steps of a converter"
    starts = [
        "effects first",
        "all forms together",
        "with loops",
        f"{jumps}, effects first",
        f"{jumps}, all forms together",
    ]
    assert steps == [*starts, *(f"with larger noise, round 1, {start}" for start in starts)]


def test_a_search_in_flicker_ends_after_two_starts_if_effects_remain(steps: list[str]) -> None:
    search._search_from_all(SimpleNamespace(first_jumps="the steps", flicker=True), True, "")
    assert steps == ["effects first", "all forms together"]


def test_a_cancelled_search_ends(tmp_path: Path) -> None:
    found = model_session(Request(hidden(tmp_path, "package turned")))
    counted = CountedEffects(found.effects)
    counted.cancelled = True
    with pytest.raises(Cancelled):
        replace(found, effects=counted).diagnosed()
