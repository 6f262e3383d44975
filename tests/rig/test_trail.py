"""A model that grows on its data, step by step and back."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibrations.errors import ExpressionError, ModelError
from calibrations.pictures.waterfall import levels
from rig.analysis.trail import Trail, trail
from tests.browser.measured import hidden


@pytest.fixture
def turned(tmp_path: Path) -> Trail:
    return trail(hidden(tmp_path, "package turned"), None, None)


def test_an_effect_is_tried_added_and_undone(turned: Trail) -> None:
    assert turned.diagnosed().candidates[0].name == "axis-misalignment"
    assert not turned.compared().adequate
    grown = turned.with_step(turned.tried(turned.effects["axis-misalignment"]))
    assert grown.compared().adequate
    assert [level.name for level in levels(grown)] == ["linear", "+ axis-misalignment"]
    assert grown.diagnosed().verdict == "adequate"
    assert grown.undone().end is turned.end
    assert turned.undone().end is turned.end


def test_what_says_nothing_new_is_refused(turned: Trail) -> None:
    with pytest.raises(ModelError, match="bias is in the model already"):
        turned.tried(turned.effects["bias"])
    with pytest.raises(ModelError, match="hard-iron is not defined for poses"):
        turned.tried(turned.effects["hard-iron"])
    with pytest.raises(ModelError, match="mine adds nothing that linear does not have"):
        turned.tried(turned.written("mine", "a + 0*beta"))


def test_an_effect_of_ones_own_is_tried_like_any_other(turned: Trail) -> None:
    step = turned.tried(turned.written("mine", "a*az + b*cos(beta)*sin(2*alpha)"))
    assert step.after.pooled_excess < step.before.pooled_excess
    with pytest.raises(ExpressionError, match='did you mean "beta"'):
        turned.written("mine", "a*sin(5*betta)")
    with pytest.raises(ModelError, match="in the catalogue already"):
        turned.written("bias", "a*sin(5*beta)")
