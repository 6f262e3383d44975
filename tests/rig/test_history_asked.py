"""What the page of a sensor's life is asked, out of its address and back."""

from __future__ import annotations

from datetime import date

import pytest
from starlette.datastructures import QueryParams

from rig.errors import RigError
from rig.services.provenance import today
from rig.web.pages.history_results import Asked, asked


@pytest.mark.parametrize(
    "whole",
    [
        Asked(),
        Asked("17"),
        Asked("a 17/b", "my models/x.yaml", "bias-y", {"bias-x": 0.005, "bias-y": 1e-7}, 3, date(2024, 12, 1)),
    ],
)
def test_an_address_is_read_as_it_was_written(whole: Asked) -> None:
    path, _, query = whole.address.partition("?")
    assert path == "/history"
    assert asked(QueryParams(query)) == whole


def test_what_is_as_by_default_is_not_in_the_address() -> None:
    assert Asked("17", at=date.fromisoformat(today())).address == "/history?sensor=17"


@pytest.mark.parametrize(
    ("query", "told"),
    [
        ("baseline=1", "baseline=1: write how many calibrations set the charts, 2 at least"),
        ("baseline=%C2%B2", "baseline=²: write how many"),
        ("limit=bias-x", "write NAME=CHANGE, as in bias-x=0.005"),
        ("at=monday", "'monday' is no day: write it as 2"),
    ],
)
def test_an_address_that_asks_nothing_that_can_be_answered(query: str, told: str) -> None:
    with pytest.raises(RigError, match=told):
        asked(QueryParams(query))
