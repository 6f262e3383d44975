"""Intervals hold what they are said to hold, and so do their slopes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibrations.compensation.bound import bound
from calibrations.compensation.graph import Node, apply, evaluate, names, number, ordered, power
from calibrations.compensation.graph import given as named
from calibrations.compensation.interval import Interval, over

X, Y = named("x"), named("y")
TWO = number(2.0)
FORMS = {
    "product": apply("*", X, Y),
    "quotient": apply("/", X, apply("+", number(3.0), Y)),
    "cube": power(X, 3),
    "root": apply("sqrt", apply("+", TWO, Y)),
    "logarithm": apply("log", apply("+", TWO, X)),
    "waves": apply("-", apply("sin", apply("*", number(3.0), X)), apply("cos", Y)),
    "growth": apply("exp", apply("neg", X)),
    "corner": apply("+", apply("abs", X), apply("min", X, apply("max", Y, number(0.5)))),
    "choice": apply("where", apply(">", Y, number(0.2)), X, power(X, 2)),
}
ends = st.tuples(st.floats(-1.4, 1.4), st.floats(0, 0.6))


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@given(x=ends, y=ends, u=st.floats(0, 1), w=st.floats(0, 1))
def test_what_is_inside_stays_inside(
    form: Node, x: tuple[float, float], y: tuple[float, float], u: float, w: float
) -> None:
    ranges = {"x": Interval(*_ends(x)), "y": Interval(*_ends(y))}
    ((value, slopes),) = over([form], ranges, ("x",))
    at = {"x": np.array(x[0] + u * x[1]), "y": np.array(y[0] + w * y[1])}
    (here,) = evaluate([form], at)
    assert value.low[0] - 1e-12 <= here <= value.high[0] + 1e-12
    other = {**at, "x": np.array(x[0] + (1 - u) * x[1])}
    (there,) = evaluate([form], other)
    moved = float(other["x"] - at["x"])
    if abs(moved) > 1e-3:
        assert slopes.low[0, 0] - 1e-9 <= float(there - here) / moved <= slopes.high[0, 0] + 1e-9


def _ends(pair: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([pair[0]]), np.array([pair[0] + pair[1]])


def test_a_jump_by_what_is_sought_has_no_slope() -> None:
    jump = apply(">=", X, number(0.0))
    ((_, slopes),) = over([jump], {"x": Interval(np.array([-1.0, 0.5]), np.array([1.0, 1.0]))}, ("x",))
    assert slopes.high.tolist() == [[np.inf, 0.0]]
    assert bound([apply("+", X, jump)], ("x",), 1.0, {}, 1e-9) is None


def test_the_factor_is_the_one_that_is_known() -> None:
    bent = apply("+", X, apply("*", number(0.1), power(X, 2)))  # slope 1 + 0.2 x, from 0.76 to 1.24 within 1.2
    found = bound([bent], ("x",), 1.0, {}, 1e-9)
    assert found is not None
    assert 0.2 * 1.2 <= found.q < 0.2 * 1.45
    assert found.q**found.steps <= 1e-9 < found.q ** (found.steps - 1)


def test_equal_parts_are_one_node_and_nothing_is_computed_in_vain() -> None:
    first, again = apply("*", X, Y), apply("*", X, Y)
    assert first is again
    assert apply("+", first, number(0.0)) is first
    assert apply("*", first, number(0.0)).value == 0.0
    assert apply("+", number(1.5), TWO).value == 3.5
    assert apply("neg", apply("neg", X)) is X
    assert names([apply("+", first, again)]) == ["x", "y"]
    assert len(ordered([power(X, 8)])) == 4
