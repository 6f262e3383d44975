"""What each command prints, as a person sees it: the transcripts `COMMAND*.txt` beside this file.

To add one: a line `$ rig WORDS` in a file, then `pytest tests/golden --update-golden`, and read what came.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import click
import pytest

from rig.cli import Commands
from rig.cli import rig as group
from rig.record import Record
from tests import recorded
from tests.golden import texts
from tests.golden.transcript import commands, difference, made, placeholder

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]
FILES = sorted(path.stem for path in FOLDER.glob("*.txt"))
WITHOUT = {
    "completion",
    "demo",
    "doctor",
    "push",
    "resume",
    "simulate",
    "web",
}  # they serve, need a server, or are tested whole
REFUSALS = "refusals"  # commands that end with status 2, print nothing on standard output, and change nothing
REFUSED = re.compile(r"\$ rig .*\n(!.*\n)+exit status 2")
REMEDY = "if this is meant: pytest tests/golden --update-golden, and read the difference that git shows"


@pytest.fixture
def laboratory(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch, rig_home: Path
) -> Iterator[Path]:
    """The folder to call commands in, beside the record of a small laboratory."""
    shutil.copytree(recorded.record(tmp_path_factory, "laboratory"), rig_home)
    folder = tmp_path / "work"
    shutil.copytree(FOLDER / "files", folder)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "100")
    with mock.patch.dict(os.environ):  # Dask sets variables for its workers here
        yield folder


@pytest.mark.parametrize("name", FILES)
def test_a_command_prints_its_transcript(name: str, laboratory: Path, request: pytest.FixtureRequest) -> None:
    path = FOLDER / f"{name}.txt"
    golden = path.read_text(encoding="utf-8")
    with Record() as record:
        before_runs = [run.run for run in reversed(record.runs())]
    runs = {placeholder(run): run for run in before_runs}
    before = contents(laboratory)
    now = made(commands(golden), runs, {laboratory: "WORK", laboratory.parent: "HOME", ROOT: "ROOT"})
    assert "a fault of this program" not in now, now
    if name == REFUSALS:
        assert all(REFUSED.fullmatch(block) for block in now.rstrip().split("\n\n")), now
        assert contents(laboratory) == before
        with Record() as record:
            assert sorted(run.run for run in record.runs()) == sorted(before_runs)
    if request.config.getoption("--update-golden"):
        path.write_text(now, encoding="utf-8")
    else:
        assert not difference(golden, now), f"{difference(golden, now)}\n\n{REMEDY}"


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_every_command_has_a_transcript() -> None:
    texts = [(FOLDER / f"{name}.txt").read_text(encoding="utf-8") for name in FILES if name != REFUSALS]
    called = {line.split()[0] for text in texts for line in commands(text)}
    assert called == set(Commands().list_commands(click.Context(group))) - WITHOUT


@pytest.mark.parametrize("path", sorted(texts.FOLDER.glob("*.txt")), ids=lambda path: path.stem)
def test_every_message_is_one_of_a_test(path: Path) -> None:
    for head in texts.messages(path.read_text(encoding="utf-8")):
        file, test = head.split(" ", 1)
        (source,) = (texts.TESTS / path.stem).rglob(file)
        name = test.replace("[", " ").split()[0]
        assert re.search(rf"^def {name}\(", source.read_text(encoding="utf-8"), re.MULTILINE), head


def test_the_last_digit_and_the_width_of_columns_may_differ_and_nothing_else() -> None:
    assert not difference("a  1.005 V  ###\n", "a 1.006 V #\n")
    assert not difference("a 1.005(16) V\n", "a 1.006(17) V\n")
    for other in ("a 1.05 V\n", "b 1.005 V\n", "a 1.005 mV\n", "a -1.005 V\n", "a 1.005 V\nmore\n"):
        assert difference("a 1.005 V\n", other), other
    assert difference("a 1.005(16) V\n", "a 1.005(19) V\n")
    assert difference("114 poses\n", "112 poses\n")
