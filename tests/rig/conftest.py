"""Commands called in this process, and bench files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from rig.bench import DEFAULT
from rig.cli import main


@dataclass(frozen=True)
class Ended:
    """How a command ended, and what it printed."""

    status: int
    out: str
    err: str


@pytest.fixture
def rig(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    """Call a command."""

    def call(*arguments: str) -> Ended:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        shown = capsys.readouterr()
        return Ended(int(ended.value.code or 0), shown.out, shown.err)

    return call


@pytest.fixture
def bench_file(tmp_path: Path) -> Callable[[Mapping[str, object] | str], Path]:
    """Write a bench file: the simulated rig with changes at its top level, or a text as it is."""

    def write(changes: Mapping[str, object] | str) -> Path:
        path = tmp_path / "bench.yaml"
        whole = (
            changes if isinstance(changes, str) else yaml.safe_dump(yaml.safe_load(DEFAULT.read_text()) | dict(changes))
        )
        path.write_text(whole, encoding="utf-8")
        return path

    return write
