"""A search that tells how far it is, and that ends when nobody waits for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from calibrations.effects.catalogue import catalogue
from rig.services.request import Request
from rig.services.search import Cancelled, Counted
from rig.services.session import model_session
from tests.browser.measured import hidden


def test_it_tells_what_is_tried() -> None:
    counted = Counted({name: catalogue()[name] for name in ("bias", "hysteresis")})
    assert (counted.text, counted.share) == ("Fitting the model", 0.0)
    effects = iter(counted.values())
    next(effects)
    next(effects)
    assert (counted.text, counted.share) == ("Round 1, effect 2 of 2: hysteresis", 0.5)
    assert list(effects) == []
    assert (counted.text, counted.share) == ("Round 1: comparing the results", 1.0)
    assert list(counted) == ["bias", "hysteresis"]
    assert counted.round == 2


def test_what_is_cancelled_ends(tmp_path: Path) -> None:
    found = model_session(Request(hidden(tmp_path, "package turned")))
    counted = Counted(found.effects)
    counted.cancelled = True
    with pytest.raises(Cancelled):
        replace(found, effects=counted).diagnosed()
