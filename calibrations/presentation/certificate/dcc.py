"""The certificate as PTB's Digital Calibration Certificate, DCC 3.2.0: for machines, values in SI units.

Results as found and as left are lists of quantities, each with its expanded uncertainty, its budget and its statement
of conformity as metadata. A list of correlation coefficients for each result follows, for programs that read lists, and
all results as one vector with their covariance matrix, as D-SI has it. The whole certificate as JSON, with the digest
and weight of every row, is the attached document. The template `dcc.xml` has the elements in the order of the schema.

Source  https://ptb.de/dcc/v3.2.0/; D-SI 2.1.0, https://ptb.de/si.
"""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from markupsafe import Markup
from scipy.special import chdtri

from calibrations.presentation.certificate.content import (
    RULE,
    UNSTATED,
    Certificate,
    Condition,
    Decision,
    Outcome,
    document,
)
from calibrations.presentation.certificate.terms import in_si, product_in_si
from calibrations.presentation.page import templates

PROBABILITY = "0.95"


def dcc(c: Certificate) -> str:
    """The XML document. Raises DataError for a unit without an SI form."""
    program, _, release = c.program.rpartition(" ")
    gravity = Condition("local gravity", "m/s^2", c.gravity_m_s2, c.gravity_m_s2, c.gravity_m_s2)
    count = len(c.figures.outcomes)
    text = json.dumps(document(c), allow_nan=False, ensure_ascii=False)
    return (
        templates()
        .overlay(finalize=_collapse_blanks)
        .get_template("dcc.xml")
        .render(
            c=c,
            program=program,
            release=release,
            remarks=(*c.figures.remarks, *c.remarks),
            facts=[f"{name}: {value}" for name, value in c.facts.items()],
            rule=RULE,
            unstated=UNSTATED,
            conditions=(gravity, *c.conditions),
            si=lambda unit: in_si(unit, c.gravity_m_s2),
            budget=_budget,
            conformity=_conformity,
            coefficients=[" ".join(f"{r:.6f}" for r in row) for row in c.figures.correlations],
            covariances=_covariances(c),
            probability=PROBABILITY,
            joint_coverage=f"{np.sqrt(chdtri(count, 1 - float(PROBABILITY))):.4f}",
            attached=base64.b64encode(text.encode()).decode(),
        )
    )


def _collapse_blanks(value: Any) -> Any:
    """A text without blanks at its ends and in a row, as the schema wants it."""
    return " ".join(value.split()) if isinstance(value, str) and not isinstance(value, Markup) else value


def _budget(o: Outcome, factor: float, unit: str) -> list[str]:
    """The sources of a result's uncertainty, in words."""
    lines = [
        f"{s.name}: type {s.kind}, {abs(factor) * s.contribution:.3g} {unit}"
        + (f", sensitivity {s.sensitivity:.3g} {o.unit} per {s.unit}, u = {s.std:.3g}" if s.std is not None else "")
        + f", degrees of freedom {s.freedom:.4g}"
        for s in o.sources
    ]
    return [*lines, f"effective degrees of freedom {o.freedom:.4g}"]


def _conformity(decision: Decision, factor: float, unit: str) -> list[str]:
    """Limits and probability of a statement of conformity, in words."""
    limits = f"limits {factor * decision.low:.6g} to {factor * decision.high:.6g} {unit}"
    return [limits, f"probability of conformity {decision.probability:.4f}"]


def _covariances(c: Certificate) -> list[list[tuple[float, str]]]:
    """Columns of the covariance matrix of all results, in SI units."""
    outcomes = c.figures.outcomes
    stds = [in_si(o.unit, c.gravity_m_s2)[0] * o.std for o in outcomes]
    return [
        [
            (c.figures.correlations[i][j] * stds[i] * stds[j], product_in_si(first.unit, second.unit))
            for i, first in enumerate(outcomes)
        ]
        for j, second in enumerate(outcomes)
    ]
