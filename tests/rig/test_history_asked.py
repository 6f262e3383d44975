"""What the page of a sensor's life is asked, out of its address and back."""

from __future__ import annotations

from datetime import date

import pytest
from starlette.datastructures import QueryParams

from rig.errors import RigError
from rig.services.provenance import today
from rig.web.pages.history_results import HistoryRequest, parse_request


@pytest.mark.parametrize(
    "whole",
    [
        HistoryRequest(),
        HistoryRequest("17"),
        HistoryRequest("a 17/b", "my models/x.yaml", "bias-y", {"bias-x": 0.005, "bias-y": 1e-7}, 3, date(2024, 12, 1)),
    ],
)
def test_an_address_is_read_as_it_was_written(whole: HistoryRequest) -> None:
    path, _, query = whole.address.partition("?")
    assert path == "/history"
    assert parse_request(QueryParams(query)) == whole


def test_default_values_are_not_in_the_address() -> None:
    assert HistoryRequest("17", at=date.fromisoformat(today())).address == "/history?sensor=17"


@pytest.mark.parametrize(
    ("query", "told"),
    [
        ("baseline=1", "baseline=1: give the number of calibrations for the limits, at least 2"),
        ("baseline=%C2%B2", "baseline=²: give the number of calibrations"),
        ("limit=bias-x", "write NAME=CHANGE, as in bias-x=0.005"),
        ("at=monday", "'monday' is not a date: write it like 2"),
    ],
)
def test_an_invalid_request_in_an_address_is_refused(query: str, told: str) -> None:
    with pytest.raises(RigError, match=told):
        parse_request(QueryParams(query))
