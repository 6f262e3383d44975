"""The pages of docs/effects are what the effects' files say."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.presentation.effect_pages import drawing, page, pages, write
from tests.docs.markdown import ROOT

FOLDER = ROOT / "docs" / "effects"
REMEDY = "run: python -m calibrations.presentation.effect_pages docs/effects"


def test_there_is_a_page_for_each_effect_and_no_other() -> None:
    assert {path.name for path in FOLDER.glob("*.md")} == set(pages(catalogue())), REMEDY
    assert {path.stem for path in (FOLDER / "pictures").iterdir()} == set(catalogue()), REMEDY


@pytest.mark.parametrize("name", pages(catalogue()))
def test_pages_of_effects_are_up_to_date(name: str) -> None:
    assert (FOLDER / name).read_text(encoding="utf-8") == pages(catalogue())[name], REMEDY


def test_a_page_tells_all_that_is_known_of_an_effect() -> None:
    effect = catalogue()["temperature-bias"]
    text = page(effect)
    for part in (effect.formula, effect.symptom, effect.excited_by, effect.confused_with, effect.source):
        assert part in text
    assert "with the column `temperature_c`" in text
    assert "| `slope` | {out}/K | one per axis | any | output per kelvin |" in text


@pytest.mark.parametrize("name", catalogue())
def test_the_picture_is_up_to_date_and_small(name: str) -> None:
    made = drawing(catalogue()[name])
    assert (FOLDER / "pictures" / f"{name}.svg").read_text(encoding="utf-8") == made, REMEDY
    assert len(made.encode()) < 20_000
    assert ("Allan deviation (V)" if catalogue()[name].kinds == ("still",) else "residual (") in made  # text stays text
    ET.fromstring(made)  # noqa: S314 what we have just made


def test_a_page_of_an_effect_that_is_no_more_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = {"bias": catalogue()["bias"]}
    monkeypatch.setattr("calibrations.presentation.effect_pages.catalogue", lambda: one)
    (tmp_path / "pictures").mkdir()
    for stale in ("phlogiston.md", "pictures/phlogiston.svg"):
        (tmp_path / stale).write_text("# phlogiston\n", encoding="utf-8")
    write(tmp_path)
    assert {path.name for path in tmp_path.rglob("*.*")} == {"README.md", "bias.md", "bias.svg"}
