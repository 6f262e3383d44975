"""Expressions: what can be written, what it is worth, and that nothing else gets through."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from calibrations.effects.expression import FUNCTIONS, Apply, Name, Number, evaluate, nodes, parse
from calibrations.effects.expression_start import find_linear_parameters
from calibrations.errors import ExpressionError

T = np.array([-2.0, 0.0, 0.5, 3.0])
VALUES = [
    ("2*t + 1", 2 * T + 1),
    ("-t**2/4", -(T**2) / 4),
    ("abs(t) ** 0.5", np.sqrt(np.abs(T))),
    ("step(t - 0.5)", [0, 0, 1, 1]),
    ("sign(t)", [-1, 0, 1, 1]),
    ("(0 <= t) * t", [0, 0, 0.5, 3]),
    ("0 < t < 1", [0, 0, 1, 0]),
    ("t != 3", [1, 1, 1, 0]),
    ("where(t > 0, 1, t)", [-2, 0, 1, 1]),
    ("min(t, 1, 2*t)", [-4, 0, 0.5, 1]),
    ("max(t, 0)", [0, 0, 0.5, 3]),
    ("sin(t)**2 + cos(t)**2", np.ones(4)),
    ("exp(log(abs(t) + 1))", np.abs(T) + 1),
    ("tanh(t)", np.tanh(T)),
    ("tan(pi/4) + sqrt(4) + t - +t", np.full(4, 3.0)),
]


@pytest.mark.parametrize(("text", "value"), VALUES)
def test_an_expression_has_its_value(text: str, value: np.ndarray) -> None:
    assert evaluate(parse(text).root, {"t": T}) == pytest.approx(np.broadcast_to(value, 4))


@pytest.mark.parametrize(
    ("text", "target"),
    [("a*t", "v"), ("v += a*t", "v"), ("vy += a*t", "vy"), ("beta_deg += a*sin(beta_deg*pi/180)", "beta_deg")],
)
def test_what_it_is_added_to_stands_first(text: str, target: str) -> None:
    assert parse(text).target == target


REFUSED = [
    ("", "is empty"),
    ("a*", "column 3: cannot be read"),
    ("a*sn(5*beta)", r'column 3: there is no function "sn"; did you mean "sin"\?'),
    ("a*sin", r"column 3: sin is a function: write sin\(...\)"),
    ("a*min(t)", "column 3: min takes 2 or more between its brackets, not 1"),
    ("a*sin(5*beta_deg)", "column 3: sin takes rad, and beta_deg is in degrees: write beta, the same in rad"),
    ("a*sin(t, 2)", "column 3: sin takes 1 between its brackets, not 2"),
    ("a^2", r"a power is \*\*"),
    ("a*t; b", "one expression at a time"),
    ("a = 3", "write the added term"),
    ("gamma += a", 'an expression cannot change "gamma"'),
    ("v -= a", "write the added term"),
    ("a.real", "column 1: 'a.real' is not allowed here"),
    ("a[0]", "is not allowed here"),
    ("a if t else b", "is not allowed here"),
    ("lambda: a", "is not allowed here"),
    ("[a for a in t]", "is not allowed here"),
    ("(a := t)", "is not allowed here"),
    ("a and t", "is not allowed here"),
    ("a in t", "is not allowed here"),
    ("'a'", "is not allowed here"),
    ("f'{a}'", "is not allowed here"),
    ("True", "is not allowed here"),
    ("1j*a", "is not allowed here"),
    ("sin(x=a)", "is not allowed here"),
    ("min(a, *t)", "is not allowed here"),
    ("sin(a)(t)", "is not allowed here"),
    ("__import__('os').system('true')", "is not allowed here"),
    ("__import__('os')", 'there is no function "__import__"'),
    ("import os", "is not an expression"),
    ("a*β", "written in the letters a to z"),
    ("1e999*a", "a number too large"),
    ("9" * 390, "a number too large"),
    ("a" * 401, "401 characters, more than 400"),
    ("-" * 60 + "a", "operations within one another"),
    ("a\x00", "invisible characters"),
    ("\ud800", "invisible characters"),
    ("a*\x1b[31mt", "invisible characters"),
]


@pytest.mark.parametrize(("text", "says"), REFUSED)
def test_what_is_no_expression_is_refused_with_its_column(text: str, says: str) -> None:
    with pytest.raises(ExpressionError, match=says):
        parse(text)


def test_the_message_points_into_the_text() -> None:
    with pytest.raises(ExpressionError) as error:
        parse("a*t +  sn(t)")
    _, shown, mark = str(error.value).splitlines()
    assert shown[mark.index("^")] == "s"


TOKENS = st.sampled_from(
    [*"abtvx.,:;=+-*/%<>!&|^~@()[]{}'\"\\#_ 0123456789", "**", "+=", "sin(", "where(", "if ", "beta"]
)


@given(st.one_of(st.text(max_size=450), st.lists(TOKENS, max_size=120).map("".join)))
@example("((((a" * 80)
@example("9**9**9**9**9**9")
@settings(deadline=None, max_examples=300)
def test_any_text_is_an_expression_or_the_documented_error_in_bounded_time(text: str) -> None:
    began = time.perf_counter()
    try:
        expression = parse(text)
        evaluate(expression.root, dict.fromkeys(expression.names, T))
    except ExpressionError:
        pass
    else:
        assert all(isinstance(node, Number | Name | Apply) for node in nodes(expression.root))
        assert parse(expression.text) == expression
    assert time.perf_counter() - began < 1.0


LEAVES = st.one_of(st.sampled_from(["a", "b", "t", "beta"]), st.floats(0, 1e6).map(repr), st.just("pi"))
TREES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**", "<", ">="]), inner).map(
            lambda e: f"({''.join(e)})"
        ),
        st.tuples(st.sampled_from([n for n, f in FUNCTIONS.items() if f.least == 1]), inner).map(
            lambda e: f"{e[0]}({e[1]})"
        ),
        st.tuples(inner, inner, inner).map(lambda e: f"where({', '.join(e)})"),
        st.tuples(inner, inner).map(lambda e: f"max({', '.join(e)})"),
    ),
    max_leaves=8,
)


@given(TREES, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
@settings(deadline=None, max_examples=200)
def test_what_is_computed_is_a_number_that_is_not_huge_or_none(text: str, a: float, b: float) -> None:
    """Never a Python integer that grows, nor a warning."""
    value = evaluate(parse(text).root, {"a": np.array(a), "b": np.array(b), "t": T, "beta": T})
    assert value.dtype == np.float64


SHAPES = [
    ("a*t + b*sin(t) + c", ("a", "b", "c")),
    ("a*exp(-t/tau)", ("a",)),
    ("(a + b*t)*sin(w*t)", ("a", "b")),
    ("a*b*t", ("a",)),
    ("a*abs(t)**p", ("a",)),
    ("where(t > c, a, b)", ("a", "b")),
    ("a/b", ("a",)),
    ("exp(-t/tau)", ()),
    ("-a*t - +b", ("a", "b")),
]


@pytest.mark.parametrize(("text", "straight"), SHAPES)
def test_which_parameters_it_is_straight_in(text: str, straight: tuple[str, ...]) -> None:
    expression = parse(text)
    parameters = tuple(sorted(set(expression.names) - {"t"}))
    assert set(find_linear_parameters(expression.root, parameters)) == set(straight)
