"""The recipes of CONTRIBUTING.md, as they are written there."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.docs.markdown import ROOT, commands, files, missing, section, write_files

ROOMS = ("rig", "procedures", "drivers", "calibrations")
PAGE = "CONTRIBUTING.md"


@pytest.mark.slow
@pytest.mark.parametrize("title", ["An effect", "A procedure"])
def test_a_recipe_for_a_folder_of_your_own(title: str, tmp_path: Path, follow: Callable[..., Any]) -> None:
    recipe = section(PAGE, title)
    write_files(recipe, tmp_path)
    follow(commands(recipe))


@pytest.mark.slow
def test_the_recipe_for_a_driver_works_as_written(tmp_path: Path) -> None:
    recipe = section(PAGE, "A driver")
    copy_rooms(tmp_path)
    for part in ("wire", "drivers"):
        shutil.copytree(ROOT / "tests" / part, tmp_path / "tests" / part)
    for module in (ROOT / "tests").glob("*.py"):  # what the tests of these parts share
        shutil.copy(module, tmp_path / "tests")
    write_files(recipe, tmp_path)
    for block in commands(recipe):
        output = "\n".join(in_own_process(line, tmp_path) for line in block.lines)
        assert not missing(block.shown, output), output


def copy_rooms(folder: Path) -> None:
    """A tree of our own code that a recipe may add to."""
    shutil.copy(ROOT / "pyproject.toml", folder)
    for room in ROOMS:
        shutil.copytree(ROOT / room, folder / room)


def in_own_process(line: str, folder: Path) -> str:
    """A command of one of our programs, in a tree that holds one driver more."""
    program = [sys.executable, "-m", *shlex.split(line)]
    environment = os.environ | {"RIG_HOME": str(folder / "home")}
    ended = subprocess.run(
        program, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def test_each_recipe_shows_whole_files() -> None:
    assert set(files(section(PAGE, "A driver"))) == {
        "drivers/example_tc1/driver.py",
        "drivers/example_tc1/twin.py",
        "tests/wire/test_example_tc1_bytes.py",
        "tc1.yaml",
    }
    assert "my-effects/worm_error.py" in files(section(PAGE, "An effect"))
    assert "my-procedures/come_back.py" in files(section(PAGE, "A procedure"))


@pytest.mark.parametrize("title", ["An effect", "A procedure", "A driver"])
def test_the_files_shown_keep_the_house_style(title: str, tmp_path: Path) -> None:
    recipe = section(PAGE, title)
    copy_rooms(tmp_path)
    write_files(recipe, tmp_path)
    shown = shlex.join(name for name in files(recipe) if name.endswith(".py"))
    as_the_catalogue = "--extend-per-file-ignores 'my-effects/*:ARG002'"  # every effect has the same signature
    in_own_process(f"ruff check --no-cache {as_the_catalogue} {shown}", tmp_path)
    in_own_process(f"ruff format --no-cache --check {shown}", tmp_path)
