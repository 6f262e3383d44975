"""A reader who follows a page: in a folder of their own, with a record of their own."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from rig.cli import main
from tests.docs.markdown import ROOT, Commands, missing


@pytest.fixture
def follow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[[list[Commands]], None]:
    """Call every `rig` command of a page, RUN being the newest run, and look for the output that the page shows."""
    for name in ("docs", "rig", "tests"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)

    def call(words: list[str]) -> str:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main(words)
        shown = capsys.readouterr()
        assert not ended.value.code, f"rig {shlex.join(words)}: {shown.err}"
        return shown.out

    def newest() -> str:
        return str(json.loads(call(["runs", "--json"]))["runs"][0]["run"])

    def run(line: str) -> str:
        words = [newest() if word == "RUN" else word for word in shlex.split(line)]
        assert words[0] == "rig", f"no test can follow {line!r}"
        command, target = (words[1 : words.index(">")], words[-1]) if ">" in words else (words[1:], None)
        output = call(command)
        if target:
            Path(target).write_text(output, encoding="utf-8")
        return output

    def follow(blocks: list[Commands]) -> None:
        for block in blocks:
            output = "\n".join(run(line) for line in block.lines)
            assert not missing(block.shown, output), output

    return follow
