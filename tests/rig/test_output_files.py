"""Output files: one that exists is replaced only with --force, whole or not at all, and never an input or a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from errno import ENOSPC
from pathlib import Path

import click
import pytest

from calibrations.fitting.fit import fit
from calibrations.importing.foreign import read_csv
from calibrations.model.file import dump_model, read_model
from rig import files
from rig.cli import COMMANDS
from rig.cli import rig as program
from rig.errors import OutputError
from tests.rig.conftest import Rig

OLD = "what was there before"
OUTPUTS = {"out", "picture", "report", "folder"}  # parameters that name an output

WRITERS = {
    "fit": ("fit", "good.csv", "--out", "old"),
    "discover": ("discover", "good.csv", "--out", "old"),
    "discover --live": ("discover", "--live", "--unattended", "--out", "old"),
    "add": ("add", "hysteresis", "--model", "linear", "--data", "good.csv", "--out", "old"),
    "report": ("report", "good.csv", "--out", "old"),
    "report --pictures": ("report", "good.csv", "--pictures", "pictures"),
    "noise": ("noise", "good.csv", "--pictures", "pictures"),
    "history": ("history", "A1", "--pictures", "pictures"),
    "control": ("control", "--pictures", "pictures"),
    "certificate": ("certificate", "good.csv", "--model", "linear", "--out", "old.html"),
    "certificate, three": ("certificate", "good.csv", "--model", "linear", "--out", "three"),
    "compensate": ("compensate", "fitted.yaml", "--language", "json", "--out", "product"),
    "compensate --picture": (
        *("compensate", "fitted.yaml", "--language", "json", "--out", "new"),
        *("--data", "good.csv", "--picture", "old.png"),
    ),
    "export": ("export", "good.csv", "--out", "old"),
    "export-model": ("export-model", "fitted.yaml", "--for", "imu_tk", "--out", "old"),
    "plan": ("plan", "sweep", "--step-deg", "45", "--out", "old"),
    "draw": ("draw", "--alpha", "45", "--out", "old.svg"),
    "doctor": ("doctor", "--out", "old"),
    "demo": ("demo", "--folder", "demo"),
    "fleet discover": ("fleet", "discover", "good.csv", "--report", "old"),
    "fleet discover --out": ("fleet", "discover", "good.csv", "--out", "models"),
    "fleet calibrate": ("fleet", "calibrate", "good.csv", "--out", "models"),
}
PLACES = (
    "old", "old.html", "old.svg", "old.png", "three.pdf", "pictures/waterfall.png", "product/fitted.json",
    "demo/report.html", "models/a.yaml",
)  # fmt: skip


@pytest.fixture
def old(work: Path) -> Path:
    """The folder of commands, with a fitted model, and an old file wherever WRITERS would write."""
    fitted = fit(read_model("linear"), read_csv(work / "good.csv", "poses"))
    (work / "fitted.yaml").write_text(dump_model(fitted.model))
    for place in PLACES:
        (work / place).parent.mkdir(exist_ok=True)
        (work / place).write_text(OLD)
    return work


@pytest.mark.parametrize("words", WRITERS.values(), ids=WRITERS)
def test_a_file_that_exists_is_refused(refused: Callable[..., str], old: Path, words: tuple[str, ...]) -> None:
    said = refused(*words)
    place = said.partition("rig: ")[2].partition(": this file exists; give another file")[0]
    assert Path(place).is_file()
    assert "replace this one with --force" in said


FAST = ("export", "plan", "draw", "doctor", "fit", "compensate")


@pytest.mark.parametrize("words", [WRITERS[name] for name in FAST], ids=FAST)
def test_force_replaces_the_file_whole(rig: Rig, old: Path, words: tuple[str, ...]) -> None:
    ended = rig(*words, "--force")
    assert ended.status == 0, ended.err
    changed = [place for place in PLACES if (old / place).read_bytes() != OLD.encode()]
    assert len(changed) == 1
    assert not [path for path in old.rglob(".*") if path.is_file()], "a draft is left"


def test_force_replaces_neither_an_input_nor_a_folder(refused: Callable[..., str], old: Path) -> None:
    assert "would overwrite the input file good.csv" in refused("export", "good.csv", "--out", "good.csv", "--force")
    assert "fitted.yaml: this would overwrite the input file" in refused(
        "export-model", "fitted.yaml", "--for", "imu_tk", "--out", "fitted.yaml", "--force"
    )
    assert "is a directory" in refused("export", "good.csv", "--out", "pictures", "--force")


def test_a_write_that_fails_leaves_the_old_file(old: Path) -> None:
    def fail() -> None:
        with files.draft_of(old / "old") as draft:
            draft.write_text("half of")
            raise OSError(ENOSPC, "No space left on device")

    with pytest.raises(OutputError, match="old: cannot write the file: No space"):
        fail()
    assert (old / "old").read_text() == OLD
    assert not list(old.glob(".old*"))


@pytest.mark.parametrize("writable", [True, False])
def test_kernels_are_cached_by_the_record_where_no_other_place_can_be_written(
    writable: bool, rig_home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")  # what is set below is undone after the test
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setattr("rig.files.os.access", lambda _place, _mode: writable)
    files.choose_kernel_cache()
    assert os.environ.get("NUMBA_CACHE_DIR") == (None if writable else str(rig_home / "kernels"))


def _commands(group: click.Group, context: click.Context) -> Iterator[tuple[str, click.Command]]:
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from ((f"{name} {inner}", found) for inner, found in _commands(command, context))
        else:
            yield name, command


def test_every_command_with_an_output_takes_force() -> None:
    with click.Context(program) as context:
        commands = dict(_commands(program, context))
    assert len(commands) > len(COMMANDS)
    writers = {name for name, command in commands.items() if OUTPUTS & {p.name for p in command.params}}
    forced = {name for name, command in commands.items() if "force" in {p.name for p in command.params}}
    assert writers == forced
    assert writers == {name.partition(" --")[0].partition(",")[0] for name in WRITERS}
