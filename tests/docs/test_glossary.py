"""docs/glossary.md: every name that a JSON document, a column, a kind or a verdict has is described there."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from calibrations.discovery.verdict import Verdict
from calibrations.effects.catalogue import catalogue
from calibrations.table import OPTIONAL
from calibrations.tables import KINDS
from tests import recorded
from tests.docs.markdown import ROOT
from tests.slow import slow

TEXT = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
NAMES = set(re.findall(r"`([^`]+)`", TEXT))
TERMS = [line.split("|")[1].strip() for line in TEXT.splitlines() if re.match(r"\| (?!term|---)", line)]
ORDINARY = {"schema", "data", "name", "text", "why", "x", "y", "z", "rate_hz"}
RUN = "RUN"  # of the simulated rig: its search takes seconds
THERMAL = str(ROOT / "tests" / "golden" / "files" / "thermal.csv")
DOCUMENTS = [
    *(("compare", RUN), ("fit", RUN), ("noise", RUN), ("diagnose", THERMAL), ("discover", THERMAL)),
    *slow([("diagnose", RUN), ("discover", RUN)]),
]


def keys(document: Any) -> Iterator[str]:
    """Every key, at any depth; values that are names of effects or of models are no keys."""
    if isinstance(document, dict):
        yield from document
        for value in document.values():
            yield from keys(value)
    if isinstance(document, list):
        for value in document:
            yield from keys(value)


@pytest.mark.parametrize(("command", "data"), DOCUMENTS)
def test_the_glossary_has_the_keys_of_a_document(
    command: str, data: str, rig_home: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    if data == RUN:
        kind = "noise-floor" if command == "noise" else "sweep"
        shutil.copytree(recorded.record(tmp_path_factory, kind), rig_home)
    out = ("--out", str(tmp_path / "model.yaml")) if command in ("fit", "discover") else ()
    _, document, problem = recorded.command(command, "last" if data == RUN else data, "--json", *out)
    assert document, problem
    undescribed = set(keys(json.loads(document))) - NAMES - ORDINARY - set(catalogue())
    assert not undescribed, " ".join(sorted(undescribed))


def test_the_glossary_has_kinds_columns_and_verdicts() -> None:
    required = {name for kind in KINDS.values() for wanted in kind.columns for name in wanted}
    assert not {*KINDS, *required, *OPTIONAL, *Verdict} - NAMES


def test_a_term_is_defined_once() -> None:
    assert len(TERMS) > 90
    assert len(set(TERMS)) == len(TERMS)
