"""The verdict: decided from facts by one function, and written by one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calibrations.discovery.results import Diagnosis
from calibrations.discovery.verdict import Judgement, Verdict
from calibrations.fitting.fit import Fit
from calibrations.loop import diagnose
from calibrations.model.file import read_model
from tests.calibrations import synthetic


@pytest.fixture(scope="module")
def clean() -> Diagnosis[Fit]:
    return clean_of(4)


def clean_of(seed: int) -> Diagnosis[Fit]:
    """Of a linear sensor at 70 poses."""
    columns = synthetic.turns((90, 30, 150, 60, 120), 60.0)
    ax, ay, _ = synthetic.components(columns)
    return diagnose(synthetic.poses(columns, 2.5 + 0.8 * ax, 2.5 + 0.8 * ay, seed=seed), read_model("linear"))


def test_a_clean_sensor_misses_nothing_and_that_is_likeliest(clean: Diagnosis[Fit]) -> None:
    assert clean.judgement.headline == "No effect is missing."
    assert sum(c.probability for c in clean.candidates) < 0.5


def test_a_candidate_that_chance_seldom_shows_is_named_with_its_threshold(clean: Diagnosis[Fit]) -> None:
    first = clean.candidates[0]
    best = replace(first, p_value=0.009, held_out_after=0.9 * clean.held_out_before)
    close = replace(clean.findings, candidates=(best, *clean.candidates[1:]))
    closest = f"Closest: {best.name} (p = 0.9 %, threshold 0.3 %). Repeat the measurement to decide."
    assert close.given.text == f"No effect is significant. {closest}"
    probable = replace(first, p_value=0.2, probability=0.69, held_out_after=0.9 * clean.held_out_before)
    assert "Closest" in replace(clean.findings, candidates=(probable,)).given.text
    unseen = replace(best, held_out_after=1.1 * clean.held_out_before)
    assert replace(clean.findings, candidates=(unseen,)).given.text == clean.judgement.text


def test_effects_that_complete_a_model_are_not_called_missing_from_it(clean: Diagnosis[Fit]) -> None:
    judgement = Judgement(model="linear", added=("a", "b"))
    assert judgement.summary == "No effect is missing."
    assert judgement.rest == "With a and b, no effect is missing. Remaining error: 1 times the noise floor."
    best = replace(clean.candidates[0], p_value=0.009, held_out_after=0.9 * clean.held_out_before)
    followed = replace(clean.findings, candidates=(best,), added=("a",))
    assert "With a, no effect is missing." in followed.given.text  # as `rig discover` writes it
    assert Judgement(model="linear", missing=("a",)).rest == ""
    formed = replace(clean.findings, added=("c", "a", "b"), followed=("c",), causes=("b", "a")).given
    assert (formed.added, formed.refinements) == (("b", "a"), ("c",))  # as the judgement on the whole search has them


def test_many_effects_are_counted_in_the_short_sentence_and_named_in_the_rest() -> None:
    many = tuple("abcdefg")
    grown = "+".join(("linear", *many))
    added = Judgement(model="linear", added=many, error=1.3, left="a trend", share_left=1e-4)
    assert added.summary == "Added: 7 effects. Remaining error: 1.3 times the noise floor."
    with_forms = replace(added, refinements=("x", "y"))
    assert with_forms.summary == (
        "Added: 7 effects, and 2 for their exact form. Remaining error: 1.3 times the noise floor."
    )
    assert "The model has 7 effects, and 2 for their exact form: x and y." in with_forms.text  # report and terminal
    compared = Judgement(model=grown, error=11.3, left="an error at beta 90 deg", searched=False)
    assert compared.verdict is Verdict.INCOMPLETE
    assert compared.summary == (
        'The model "linear with 7 added effects" is incomplete: its error is 11.3 times the noise floor.'
    )
    few = Judgement(model=grown, missing=("h",), added=many)
    assert few.summary == 'The model "linear with 7 added effects" misses h.'
    formed = Judgement(model=grown, missing=many, refinements=("a", "b"))
    assert formed.summary == ('The model "linear with 7 added effects" misses 5 effects, and 2 for their exact form.')
    assert all(judgement.rest == judgement.text for judgement in (added, few, formed))
    short = Judgement(model="linear", missing=("a",))
    assert (short.summary, short.rest) == (short.text, "")


def test_an_effect_that_noise_may_explain_as_well_is_no_form_of_a_cause() -> None:
    text = Judgement(model="linear", refinements=("bias-drift",)).text
    assert "The model also has bias-drift, which noise may explain as well." in text
    assert "exact form" not in text


@pytest.mark.parametrize(
    ("facts", "verdict"),
    [
        ({}, Verdict.ADEQUATE),
        ({"missing": ("a",)}, Verdict.EFFECT_MISSING),
        ({"missing": ("a",), "alternatives": {"a": ("b",)}}, Verdict.AMBIGUOUS),
        ({"missing": ("a",), "left": "a step", "share_left": 0.1}, Verdict.EFFECT_MISSING),
        ({"missing": ("a",), "left": "a step", "share_left": 0.3}, Verdict.UNEXPLAINED),
        ({"added": ("a",)}, Verdict.ADEQUATE),
        ({"added": ("a",), "alternatives": {"a": ("b",)}}, Verdict.AMBIGUOUS),
        ({"added": ("a",), "left": "a step", "share_left": 0.01}, Verdict.AMBIGUOUS),
        ({"added": ("a",), "left": "a step", "share_left": 0.1}, Verdict.UNEXPLAINED),
        ({"left": "a step", "share_left": 1.0}, Verdict.UNEXPLAINED),
        ({"left": "a step", "share_left": 1.0, "searched": False}, Verdict.INCOMPLETE),
        ({"left": "2 poses differ from the others", "spoilt": True}, Verdict.UNEXPLAINED),
        ({"undetermined": "too few orientations"}, Verdict.AMBIGUOUS),
        ({"left": "vy is constant", "unresponsive": True}, Verdict.NO_RESPONSE),
        ({"added": ("a",), "searched": False, "error": 27.1}, Verdict.AMBIGUOUS),
        ({"added": ("a",), "searched": False, "error": 1.0}, Verdict.ADEQUATE),
    ],
)
def test_a_verdict_follows_from_the_facts_alone(facts: dict[str, Any], verdict: Verdict) -> None:
    judgement = Judgement(model="linear", **facts)
    assert judgement.verdict is verdict
    if judgement.left:
        assert judgement.left in judgement.text
    for name in (*judgement.missing, *judgement.added):
        assert name in judgement.text


@pytest.mark.parametrize(
    "facts",
    [
        {"added": ("a",), "error": 27.1},
        {"left": "beta 0 to 30 deg", "share_left": 1.0, "error": 12.34},
    ],
    ids=["added", "left"],
)
def test_a_verdict_without_a_search_names_the_error_and_no_effect(golden, facts: dict[str, Any]) -> None:
    judgement = Judgement(model="linear", searched=False, **facts)
    golden.same(f"{judgement.headline}\n{judgement.text}")


def test_without_a_search_no_text_speaks_of_the_whole_catalogue() -> None:
    """`rig add` tests one effect, so it cannot know that no effect of the catalogue explains the residual."""
    facts: dict[str, Any] = {"model": "linear", "added": ("a",), "left": "follows temperature", "spoilt": True}
    assert "catalogue" in Judgement(**facts).text
    judgement = Judgement(**facts, searched=False)
    assert judgement.verdict is Verdict.UNEXPLAINED
    assert judgement.text == "With a, the residual is still more than noise: follows temperature."


def test_noise_above_the_floor_is_said_to_be_noise() -> None:
    assert "slow noise or scatter" in Judgement(model="linear", error=2.46).text
    assert "slow noise" not in Judgement(model="linear", error=1.02).text
    assert "slow noise" not in Judgement(model="linear", error=2.46, left="a step in time", share_left=0.04).text


def test_before_nothing_is_as_likely_as_anything() -> None:
    """No clean sensor is likely to miss something, however many effects are tried.

    With even odds of each effect every sensor has a sum near 1, so that 4 sensors tell as well as 12.
    """
    likely = [sum(c.probability for c in clean_of(seed).candidates) for seed in range(4)]
    assert np.mean(likely) < 0.1
