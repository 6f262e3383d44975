"""Intervals hold what they are said to hold, and so do their slopes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibrations.compensation.bound import Interval, evaluate_interval, prove_bound
from calibrations.compensation.graph import (
    Node,
    apply_operation,
    evaluate_nodes,
    number,
    power,
    sort_nodes,
    variable_names,
)
from calibrations.compensation.graph import variable as named

X, Y = named("x"), named("y")
TWO = number(2.0)
FORMS = {
    "product": apply_operation("*", X, Y),
    "quotient": apply_operation("/", X, apply_operation("+", number(3.0), Y)),
    "cube": power(X, 3),
    "root": apply_operation("sqrt", apply_operation("+", TWO, Y)),
    "logarithm": apply_operation("log", apply_operation("+", TWO, X)),
    "waves": apply_operation(
        "-", apply_operation("sin", apply_operation("*", number(3.0), X)), apply_operation("cos", Y)
    ),
    "growth": apply_operation("exp", apply_operation("neg", X)),
    "knee": apply_operation("tanh", apply_operation("*", TWO, X)),
    "corner": apply_operation(
        "+", apply_operation("abs", X), apply_operation("min", X, apply_operation("max", Y, number(0.5)))
    ),
    "choice": apply_operation("where", apply_operation(">", Y, number(0.2)), X, power(X, 2)),
}
ends = st.tuples(st.floats(-1.4, 1.4), st.floats(0, 0.6))


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@given(x=ends, y=ends, u=st.floats(0, 1), w=st.floats(0, 1))
def test_what_is_inside_stays_inside(
    form: Node, x: tuple[float, float], y: tuple[float, float], u: float, w: float
) -> None:
    ranges = {"x": Interval(*_ends(x)), "y": Interval(*_ends(y))}
    ((value, slopes),) = evaluate_interval([form], ranges, ("x",))
    at = {"x": np.array(x[0] + u * x[1]), "y": np.array(y[0] + w * y[1])}
    (here,) = evaluate_nodes([form], at)
    assert value.low[0] - 1e-12 <= here <= value.high[0] + 1e-12
    other = {**at, "x": np.array(x[0] + (1 - u) * x[1])}
    (there,) = evaluate_nodes([form], other)
    moved = float(other["x"] - at["x"])
    if abs(moved) > 1e-3:
        assert slopes.low[0, 0] - 1e-9 <= float(there - here) / moved <= slopes.high[0, 0] + 1e-9


def _ends(pair: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([pair[0]]), np.array([pair[0] + pair[1]])


def test_the_interval_of_a_quotient_is_no_wider_than_its_values() -> None:
    quotient = Interval(*_ends((1.0, 1.0))) / Interval(*_ends((4.0, 1.0)))
    assert quotient.ends == (pytest.approx([0.2]), pytest.approx([0.5]))


def test_a_jump_by_what_is_sought_has_no_slope() -> None:
    jump = apply_operation(">=", X, number(0.0))
    ((_, slopes),) = evaluate_interval([jump], {"x": Interval(np.array([-1.0, 0.5]), np.array([1.0, 1.0]))}, ("x",))
    assert slopes.high.tolist() == [[np.inf, 0.0]]
    assert prove_bound([apply_operation("+", X, jump)], ("x",), 1.0, {}, 1e-9) is None


def test_a_choice_that_is_sure_has_the_slope_of_its_branch() -> None:
    """x where y > 0.2, else 3 x: only a range of y with the corner in it has both slopes."""
    choice = apply_operation("where", apply_operation(">", Y, number(0.2)), X, apply_operation("*", number(3.0), X))
    x, y = Interval(np.zeros(3), np.ones(3)), Interval(np.array([0.0, 0.1, 0.3]), np.array([0.1, 0.3, 0.4]))
    ((value, slopes),) = evaluate_interval([choice], {"x": x, "y": y}, ("x",))
    assert slopes.low[0] == pytest.approx([3.0, 1.0, 1.0])
    assert slopes.high[0] == pytest.approx([3.0, 3.0, 1.0])
    assert value.high == pytest.approx([3.0, 3.0, 1.0])


def test_the_factor_is_the_one_that_is_known() -> None:
    bent = apply_operation(
        "+", X, apply_operation("*", number(0.1), power(X, 2))
    )  # slope 1 + 0.2 x, from 0.76 to 1.24 within 1.2
    found = prove_bound([bent], ("x",), 1.0, {}, 1e-9)
    assert found is not None
    assert 0.2 * 1.2 <= found.q < 0.2 * 1.45
    assert found.q**found.steps <= 1e-9 < found.q ** (found.steps - 1)


def test_equal_parts_are_one_node_and_nothing_is_computed_in_vain() -> None:
    first, again = apply_operation("*", X, Y), apply_operation("*", X, Y)
    assert first is again
    assert apply_operation("+", first, number(0.0)) is first
    assert apply_operation("*", first, number(0.0)).value == 0.0
    assert apply_operation("+", number(1.5), TWO).value == 3.5
    assert apply_operation("neg", apply_operation("neg", X)) is X
    assert variable_names([apply_operation("+", first, again)]) == ["x", "y"]
    assert len(sort_nodes([power(X, 8)])) == 4
