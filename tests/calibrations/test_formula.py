"""Formulas as HTML: typeset, with nothing of their ASCII spelling left, and escaped."""

from __future__ import annotations

import re

import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.presentation.formula import formula_html

TAG = re.compile(r"</?(?:sub|sup)>|<br>")


@pytest.mark.parametrize(
    ("formula", "typeset"),
    [
        ("V += k a_i^2      k in {out}/g^2", "V += k a<sub>i</sub><sup>2</sup><br>k in mV/g<sup>2</sup>"),
        ("V += exp(-(t - t0) / tau)", "V += exp(−(t − t<sub>0</sub>) / τ)"),
        ("beta <- beta - d s; s = +-1", "β ← β − d s; s = ±1"),
        ("v += a*sin(5*beta)", "v += a·sin(5·β)"),
        ("K sqrt(tau / 3), V/sqrt(Hz)", "K √(τ / 3), V/√Hz"),
        ("K1' = 2 k", "K<sub>1</sub>′ = 2 k"),
        ("z-axis and in-plane, of -1 g", "z-axis and in-plane, of −1 g"),
        ("a < 3 <script>", "a &lt; 3 &lt;script&gt;"),
    ],
)
def test_formulas_are_typeset(formula: str, typeset: str) -> None:
    assert formula_html(formula, "mV") == typeset


@pytest.mark.parametrize("name", catalogue())
def test_the_formula_of_every_effect_is_typeset(name: str) -> None:
    text = TAG.sub("", formula_html(catalogue()[name].formula, "V"))
    assert not re.search(r"[_^{}<>]|&lt;-|sqrt|\b(tau|theta|alpha|beta)\b", text), text
