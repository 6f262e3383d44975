"""docs/bibliography.md: every source that the code cites has its full title there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from calibrations.effects.catalogue import catalogue
from tests.docs.markdown import ROOT

BIBLIOGRAPHY = (ROOT / "docs" / "bibliography.md").read_text(encoding="utf-8")
STANDARD = re.compile(
    r"\bIEEE(?: Std)? \d{3,4}|\b(?:ISO(?:/IEC)?|NIST SP|NISTIR|JCGM|ILAC-|OIML D) ?G?\d{1,5}(?:-\d+)?"
)
SHORT = re.compile(r"\b(Ang|Book|GUM|VIM|SI Brochure|D-SI|IERS Conventions|e-Handbook)\b")
SURNAME = r"[A-Z][a-zà-ÿ][a-zA-Zà-ÿ]*(?:-[A-Z][a-z]+)?"
AUTHORS = re.compile(
    rf"({SURNAME})(?:, {SURNAME})* and ({SURNAME})|({SURNAME})(?: et al\.,| \(\d{{4}}\))"
    rf"|(?:^|[;:,] )({SURNAME})(?=, [A-Z][^;:]*\(\d{{4}}\))"
)
PLACES = {"Journal", "Computing", "Biometrika", "Sensors"}  # of a publication, before its year
CITED = re.compile(r"^[ #]*Source:? +(.*(?:\n(?![ #]*$|[ #]*\"\"\").*)*)", re.MULTILINE)


def cited(text: str) -> set[str]:
    """Standards, short names and authors in a source; `IEEE 1293` is `IEEE Std 1293`."""
    text = " ".join(text.replace("#", " ").split())
    standards = {re.sub(r"IEEE (?=\d)", "IEEE Std ", name) for name in STANDARD.findall(text)}
    authors = {name for groups in AUTHORS.findall(text) for name in groups if name and name not in PLACES}
    return standards | set(SHORT.findall(text)) | authors


def unknown(names: set[str]) -> set[str]:
    return {name for name in names if not re.search(rf"\b{re.escape(name)}\b", BIBLIOGRAPHY)}


@pytest.mark.parametrize("effect", catalogue().values(), ids=lambda effect: effect.name)
def test_the_bibliography_has_the_sources_of_an_effect(effect: object) -> None:
    source = str(effect.source)  # type: ignore[attr-defined]
    assert cited(source), f"no source can be recognised in {source!r}"
    assert not unknown(cited(source))


@pytest.mark.parametrize("room", ["calibrations", "drivers", "procedures", "rig"])
def test_the_bibliography_has_the_sources_of_the_code(room: str) -> None:
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(Path(ROOT / room).rglob("*.py"))}
    missing = {
        f"{path.relative_to(ROOT)}: {name}"
        for path, text in texts.items()
        for source in CITED.findall(text)
        for name in unknown(cited(source))
    }
    assert not missing


def test_a_source_is_recognised_in_every_form() -> None:
    text = "Ang (2); IEEE 1293, K0; Iwan (1966); Bar-Shalom, Li and Kirubarajan, Estimation; Gelman et al., Data; "
    text += "JCGM 101; Kasdin, Proc. IEEE 83 (1995); ISO 230-2"
    assert cited(text) == {
        "Ang",
        "IEEE Std 1293",
        "Iwan",
        "Bar-Shalom",
        "Kirubarajan",
        "Gelman",
        "JCGM 101",
        "Kasdin",
        "ISO 230-2",
    }
