"""The search on random combinations of causes, layouts, and missing columns, constants and rows."""

import pytest

from tests.benchmark.combinations import combination, ended
from tests.slow import before_release, slow


def test_few_rows_without_a_second_axis_end_in_an_answer() -> None:
    found = ended(20)  # 24 rows: too few to ask whether the response changed in mid-record
    assert found.outcome != "error", found.error


@pytest.mark.parametrize("seed", [*slow([0, 8]), *before_release([4, 5, 10, 18, 39])])
def test_a_combination_ends_in_an_answer_or_a_refusal(seed: int) -> None:
    found = ended(seed)
    assert found.outcome != "error", found.error


def test_a_combination_is_the_same_each_time() -> None:
    one, other = combination(4), combination(4)
    assert one.columns.keys() == other.columns.keys()
    assert (one.outputs == other.outputs).all()
