"""The pages of docs/effects are what the effects' files say."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibrations.effect import catalogue
from calibrations.pages import page, pages, write
from tests.docs.markdown import ROOT

FOLDER = ROOT / "docs" / "effects"
REMEDY = "run: python -m calibrations.pages docs/effects"


def test_there_is_a_page_for_each_effect_and_no_other() -> None:
    assert {path.name for path in FOLDER.glob("*.md")} == set(pages(catalogue())), REMEDY


@pytest.mark.parametrize("name", pages(catalogue()))
def test_the_page_is_up_to_date(name: str) -> None:
    assert (FOLDER / name).read_text(encoding="utf-8") == pages(catalogue())[name], REMEDY


def test_a_page_tells_all_that_is_known_of_an_effect() -> None:
    effect = catalogue()["temperature-bias"]
    text = page(effect)
    for part in (effect.formula, effect.symptom, effect.excited_by, effect.confused_with, effect.source):
        assert part in text
    assert "with the column `temperature_c`" in text
    assert "| `slope` | {out}/K | one per axis | any | output per kelvin |" in text


def test_a_page_of_an_effect_that_is_no_more_is_removed(tmp_path: Path) -> None:
    (tmp_path / "phlogiston.md").write_text("# phlogiston\n", encoding="utf-8")
    write(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(pages(catalogue()))
