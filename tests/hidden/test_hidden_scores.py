"""The scores of answers on sets with hidden causes, and the search for places on some of these sets."""

import json

import pytest

from tests.benchmark.hidden import FOLDER, Answer, score, shipped, summary, timed


def test_a_named_cause_replaces_a_hidden_one_only_if_the_answer_lists_it() -> None:
    truth = ["stage-backlash"]
    listed = Answer("ambiguous", ["hysteresis"], {"hysteresis": ["stage-backlash"]}, 1.0)
    assert score("set", truth, listed, 1.0).exact
    assert not score("set", truth, Answer("adequate", ["hysteresis"], {}, 1.0), 1.0).exact
    unlike = Answer("ambiguous", ["quantisation"], {"quantisation": ["stage-backlash"]}, 1.0)
    assert not score("set", truth, unlike, 1.0).exact


def test_a_cause_too_many_lowers_the_precision_and_a_missing_one_the_recall() -> None:
    more = score("set", ["hysteresis"], Answer("adequate", ["hysteresis", "dead-zone"], {}, 1.0), 1.0)
    less = score("set", ["hysteresis", "saturation"], Answer("adequate", ["hysteresis"], {}, 2.0), 3.0)
    assert not more.exact
    assert not less.exact
    line = summary("pair", [more, less])
    assert "exact 0%, recall 67%, precision 67%" in line
    assert "held-out error <= 1.15: 50%, 1.5: 50%, 3: 100%" in line
    assert "median 2.0 s, longest 3.0 s" in line


def test_an_exception_of_the_search_is_an_error_and_no_answer() -> None:
    def fails(path: object) -> Answer:
        raise ArithmeticError("no fit")

    answer, _ = timed(fails, FOLDER, 10)
    assert answer.verdict == "error"
    assert "no fit" in answer.note
    assert "errors: 1" in summary("single", [score("set", ["hysteresis"], answer, 0.0)])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["single-010", "null-154", "pair-270"])
def test_the_search_for_places_names_one_cause_and_none_on_a_clean_sensor(name: str) -> None:
    truth = json.loads((FOLDER / "truth.json").read_text())[name]["causes"]
    answer = shipped(FOLDER / "sets" / f"{name}.csv.gz")
    assert list(answer.causes) == truth
    assert answer.held_out is not None
    assert answer.held_out < 1.15


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "least"), [("single", 0.85), ("null", 1.0)])
def test_most_sensors_of_another_simulation_get_the_right_answer(kind: str, least: float) -> None:
    """The share of right answers on all sets of a kind; the sets do not change, and so neither does the share."""
    truths = json.loads((FOLDER / "truth.json").read_text())
    sets = {name: truth["causes"] for name, truth in truths.items() if truth["kind"] == kind}
    scores = [score(n, causes, *timed(shipped, FOLDER / "sets" / f"{n}.csv.gz", 120)) for n, causes in sets.items()]
    wrong = [f"{s.name}: {s.answer}" for s in scores if not s.is_good(kind)]
    assert 1 - len(wrong) / len(scores) >= least, wrong


@pytest.mark.slow
def test_a_small_cause_that_other_places_explain_in_part_is_named() -> None:
    truth = json.loads((FOLDER / "truth.json").read_text())["triple-315"]["causes"]
    assert set(shipped(FOLDER / "sets" / "triple-315.csv.gz").causes) == set(truth)


@pytest.mark.slow
def test_second_order_remainders_of_large_effects_bring_in_no_other_place() -> None:
    """Beside a cubic nonlinearity of 170 noise floors and an out-of-plane scale factor of 118, no converter is bent."""
    truth = json.loads((FOLDER / "truth.json").read_text())["many5-340"]["causes"]
    answer = shipped(FOLDER / "sets" / "many5-340.csv.gz")
    assert set(answer.causes) == set(truth)
    assert answer.held_out is not None
    assert answer.held_out < 1.15
