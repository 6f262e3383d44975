"""A question accepts what makes sense as its answer, and says what that is."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from procedures.errors import BadAnswer
from procedures.questions import Choice, Confirm, Dial, Number, Question

MOUNTED = Confirm("mounting", "Is it mounted?")
LEVEL = Number("level-x", "What does it show?", unit="deg", low=-45, high=45)
DIAL = Dial("beta-90", "Turn beta to 90 deg", unit="deg", low=89.5, high=90.5, stage="beta", expected=90.0)
SIDE = Choice("side", "Which side?", choices=("front", "back"))


@pytest.mark.parametrize(("said", "kept"), [("yes", "yes"), (" Y ", "yes"), ("TRUE", "yes"), ("n", "no"), ("No", "no")])
def test_several_words_for_yes_and_no_are_understood(said: str, kept: str) -> None:
    assert MOUNTED.checked(said) == kept


@given(st.floats(-45, 45))
def test_a_number_is_written_and_read_bit_for_bit(value: float) -> None:
    assert float(LEVEL.checked(f" {value!r} deg")) == value
    assert float(LEVEL.checked(repr(value).replace(".", ","))) == value


@pytest.mark.parametrize("said", ["", "yes", "True", "90", "90 deg"])
def test_a_dial_is_confirmed_or_read(said: str) -> None:
    assert (DIAL.checked(said), DIAL.checked("90,083")) == ("90.0", "90.083")


def test_a_choice_question_accepts_one_of_its_choices() -> None:
    assert SIDE.checked(" back ") == "back"


@pytest.mark.parametrize(
    ("question", "said", "told"),
    [
        (MOUNTED, "maybe", "answer with yes or no"),
        (MOUNTED, "", "answer with yes or no"),
        (LEVEL, "45.1", "answer with a number from -45 to 45 deg"),
        (LEVEL, "nan", "answer with a number from -45 to 45 deg"),
        (LEVEL, "level", "answer with a number from -45 to 45 deg"),
        (DIAL, "9", "answer with yes for 90 deg, or a number from 89.5 to 90.5 deg"),
        (DIAL, "no", "answer with yes for 90 deg"),
        (replace(DIAL, expected=None), "", "answer with a number from 89.5 to 90.5 deg"),
        (SIDE, "bakc", "answer with one of front, back. Did you mean 'back'?"),
        (SIDE, "", "answer with one of front, back."),
        (replace(SIDE, choices=("resume", "repeat", "end")), "re", "answer with one of resume, repeat, end."),
    ],
)
def test_invalid_answers_are_refused(question: Question, said: str, told: str) -> None:
    with pytest.raises(BadAnswer, match=question.name) as refused:
        question.checked(said)
    assert told in str(refused.value)
    assert told in refused.value.beside
    assert question.text not in refused.value.beside


@pytest.mark.parametrize(("said", "chosen"), [("front", "front"), ("Back", "back"), ("b", "back")])
def test_the_beginning_of_a_choice_selects_it(said: str, chosen: str) -> None:
    assert SIDE.checked(said) == chosen
