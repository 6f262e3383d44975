"""Formulas of effects as HTML: subscripts, powers, Greek letters and signs in place of their ASCII spelling.

    V += k_i a_o^2 exp(-(t - t0) / tau)

A formula is text of a docstring, so it stays readable in a terminal and in a file. Everything is escaped first: the
formula of an effect of one's own is what a person wrote.
"""

from __future__ import annotations

import html
import re

GREEK = {
    "alpha": "α", "beta": "β", "theta": "θ", "tau": "τ", "sigma": "σ", "omega": "ω", "pi": "π", "Phi": "Φ", "sum": "Σ",
}  # fmt: skip
SIGNS = (  # of the escaped text, in this order
    (re.compile(r"&lt;-(?= )"), "←"),
    (re.compile(r"&lt;="), "≤"),
    (re.compile(r"&gt;="), "≥"),
    (re.compile(r"\+-(?=\w)"), "±"),
    (re.compile(r"(?<![\w)])-(?=[\w(|])|(?<= )-(?= )"), "−"),
    (re.compile(r"(?<=[\w)])\*(?=[\w(])"), "·"),
    (re.compile(r"\bsqrt\((\w+)\)"), r"√\1"),
    (re.compile(r"\bsqrt(?=\()"), "√"),
)
POWER = re.compile(r"\^(-?\w+)")
INDEX = re.compile(rf"\b({'|'.join(GREEK)}|SF|[A-Za-z])_([a-z]{{1,2}})\b")
NUMBERED_SYMBOL = re.compile(rf"\b({'|'.join(GREEK)}|[A-Za-z])(\d)(&#x27;)?(?!\w)")
LETTERS = re.compile(rf"\b({'|'.join(GREEK)})(?![\w-])")
REMARK = re.compile(r" {3,}")


def formula_html(formula: str, unit: str) -> str:
    """The formula with the unit of the output, a remark on a line of its own: HTML without style."""
    text = REMARK.sub("\n", formula.replace("{out}", unit)).replace("\n\n", "\n")
    return "<br>".join(map(_line, text.splitlines()))


def _line(text: str) -> str:
    """One line; `r_i^2` has its index below its power."""
    text = html.escape(text)
    for ascii_sign, sign in SIGNS:
        text = ascii_sign.sub(sign, text)
    text = INDEX.sub(r"\1<sub>\2</sub>", text)
    text = NUMBERED_SYMBOL.sub(lambda m: f"{m[1]}<sub>{m[2]}</sub>{'′' if m[3] else ''}", text)
    text = POWER.sub(r"<sup>\1</sup>", text)
    return LETTERS.sub(lambda m: GREEK[m[1]], text)
