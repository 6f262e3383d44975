"""README.md and the how-to pages, followed by a reader from top to bottom; and nothing goes without a word."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import click
import h5py
import numpy as np
import pytest

from calibrations.table import STANDARD_GRAVITY
from rig.cli import Commands
from rig.cli import rig as group
from tests.docs.markdown import ROOT, commands, gist, section

FOLLOWED = {
    "README.md": "A calibration in minutes",
    "docs/how-to/measurements.md": "My own measurements",
    "docs/how-to/instrument.md": "My first real instrument",
}
BENCHES = (
    ("docs/how-to/digital.md", "A flight controller"),
    ("docs/how-to/digital.md", "An Xsens MTi"),
    ("docs/how-to/epics.md", "The bench file"),
    ("docs/how-to/scpi.md", "The bench file"),
)
COMMANDS = Commands().list_commands(click.Context(group))
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"\]\(([^)#:\s]*)(?:#([^)\s]+))?\)")


@pytest.mark.slow
@pytest.mark.parametrize(("page", "title"), FOLLOWED.items())
def test_a_section_works_as_written(page: str, title: str, follow: Callable[..., Any]) -> None:
    follow(commands(section(page, title)))


@pytest.mark.slow
@pytest.mark.parametrize(("page", "title"), BENCHES)
def test_a_bench_file_works_as_written(page: str, title: str, tmp_path: Path, follow: Callable[..., Any]) -> None:
    text = section(page, title)
    (bench,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    (name,) = set(re.findall(r"--bench (\S+)", text))
    (tmp_path / name).write_text(bench, encoding="utf-8")
    follow(commands(text))


def test_every_how_to_page_with_a_bench_is_followed() -> None:
    with_bench = {page for page in (ROOT / "docs/how-to").glob("*.md") if "```yaml\nname:" in page.read_text("utf-8")}
    assert with_bench == {ROOT / page for page, _ in BENCHES}


@pytest.mark.slow
def test_a_log_of_another_format_is_imported_as_written(tmp_path: Path, follow: Callable[..., Any]) -> None:
    rng, (recipe,) = np.random.default_rng(1), commands((ROOT / "docs/how-to/formats.md").read_text(encoding="utf-8"))
    sides = np.array([side for side in product((-1, 0, 1), repeat=3) if any(side)], dtype=float)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    turned = np.concatenate(
        [np.vstack([rng.normal(0, 0.5, (20, 3)) + side, np.tile(side, (100, 1))]) for side in sides]
    )
    with h5py.File(tmp_path / "flight.h5", "w") as file:
        file["imu/acc"] = STANDARD_GRAVITY * turned + rng.normal(0, 1e-2, turned.shape)
        file["imu/time"] = 0.02 * np.arange(len(turned))
    follow([recipe])


@pytest.mark.slow
def test_the_first_story_works_as_written_and_makes_the_picture(tmp_path: Path, follow: Callable[..., Any]) -> None:
    follow(commands(section("docs/how-to/commands.md", "Find missing effects")))
    made, shown = tmp_path / "pictures" / "waterfall.svg", ROOT / "docs" / "falling-error.svg"
    assert labels(made) == labels(shown), "docs/falling-error.svg: make it again as docs/how-to/commands.md says"
    assert shown.stat().st_size < 200_000


def labels(picture: Path) -> list[str]:
    """The words in a picture."""
    return [gist(text) for text in re.findall(r">([^<>]+)</text>", picture.read_text(encoding="utf-8"))]


def test_the_readme_is_one_page() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < 130


def test_the_two_commands_are_targets_of_the_makefile() -> None:
    lines = [line for block in commands(section("README.md", "Two commands")) for line in block.lines]
    assert lines == ["make demo", "make test"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(f"\n{line.split()[1]}:" in makefile for line in lines)


def test_what_the_page_shows_of_an_own_effect_is_that_of_the_recipe() -> None:
    recipe = section("CONTRIBUTING.md", "An effect")
    shown = re.findall(r"```text\n(.*?)```", section("docs/how-to/effect.md", "My own effect"), re.DOTALL)
    assert shown[0] in recipe
    assert "worm-error" in shown[1]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_documented(name: str) -> None:
    assert f"\n| `rig {name}" in (ROOT / "docs" / "commands.md").read_text(encoding="utf-8"), (
        f"docs/commands.md has no line for rig {name}"
    )


def test_no_command_is_documented_that_is_not_there() -> None:
    named = re.findall(r"^\| `rig ([a-z-]+)", (ROOT / "docs" / "commands.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(named) == set(COMMANDS)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_of_the_pages_lead_somewhere(page: Path) -> None:
    for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        place = (page.parent / target) if target else page
        assert place.exists(), f"{page}: {target}"
        if anchor:
            titles = re.findall(r"^#+ (.*)$", place.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in {title.lower().replace(" ", "-") for title in titles}, f"{page}: #{anchor}"
