"""A question accepts what makes sense as its answer, and says what that is."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from procedures.errors import BadAnswer
from procedures.questions import Choice, Confirm, Number, Question

MOUNTED = Confirm("mounting", "Is it mounted?")
LEVEL = Number("level-x", "What does it show?", unit="deg", low=-45, high=45)
SIDE = Choice("side", "Which side?", choices=("front", "back"))


@pytest.mark.parametrize(("said", "kept"), [("yes", "yes"), (" Y ", "yes"), ("TRUE", "yes"), ("n", "no"), ("No", "no")])
def test_yes_and_no_in_many_words(said: str, kept: str) -> None:
    assert MOUNTED.checked(said) == kept


@given(st.floats(-45, 45))
def test_a_number_comes_back_to_the_last_bit(value: float) -> None:
    assert float(LEVEL.checked(f" {value!r} deg")) == value
    assert float(LEVEL.checked(repr(value).replace(".", ","))) == value


def test_a_choice_is_one_of_its_own() -> None:
    assert SIDE.checked(" back ") == "back"


@pytest.mark.parametrize(
    ("question", "said", "told"),
    [
        (MOUNTED, "maybe", "it takes yes or no"),
        (MOUNTED, "", "it takes yes or no"),
        (LEVEL, "45.1", "it takes a number from -45 to 45 deg"),
        (LEVEL, "nan", "it takes a number from -45 to 45 deg"),
        (LEVEL, "level", "it takes a number from -45 to 45 deg"),
        (SIDE, "bakc", "it takes one of front, back; did you mean 'back'?"),
    ],
)
def test_what_makes_no_sense_is_refused(question: Question, said: str, told: str) -> None:
    with pytest.raises(BadAnswer, match=question.name) as refused:
        question.checked(said)
    assert told in str(refused.value)
