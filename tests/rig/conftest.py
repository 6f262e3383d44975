"""Commands called in this process, and bench files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from calibrations.importing.foreign import write_csv
from rig.bench import DEFAULT
from rig.cli import main
from rig.lab_url import lab_url
from rig.record import Record
from rig.record.lab import prepare
from tests.calibrations.synthetic import components, poses, turns
from tests.rig.postgres import Server, serving

if TYPE_CHECKING:
    from distributed import LocalCluster

WORD = "g3heim"  # the password of people who read and write a lab's record
MODEL = """schema: rig.model/1
name: mine
unit: V
effects:
- effect: bias
  parameters:
  - {name: bias, axis: x, value: 2.5, std: 1.0e-5, unit: V}
  - {name: bias, axis: y, value: 2.5, std: 1.0e-5, unit: V}
- effect: scale-factor
"""


@dataclass(frozen=True)
class Ended:
    """How a command ended, and what it printed."""

    status: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        """What the command printed with `--json`."""
        assert self.out, self.err
        return json.loads(self.out)

    def done(self) -> Ended:
        """The same, of a command that must have succeeded."""
        assert self.status == 0, self.err
        return self


Rig = Callable[..., Ended]  # calls a command


@pytest.fixture
def rig(capsys: pytest.CaptureFixture[str]) -> Rig:
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


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A good table of poses, as CSV: line 1 is its header, line 4 holds beta 60."""
    columns = turns((90, 30), step_deg=30.0)
    x, y, _ = components(columns)
    path = tmp_path_factory.mktemp("good") / "good.csv"
    write_csv(poses(columns, 2.5 + x, 2.5 + y), path)
    return path.read_text()


@pytest.fixture
def work(tmp_path: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that commands are called in, with one good table and one good model."""
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    (folder / "good.csv").write_text(text)
    (folder / "mine.yaml").write_text(MODEL)
    return folder


@pytest.fixture
def refused(rig: Rig, work: Path) -> Callable[..., str]:
    """Call a command that must fail, and nothing else; its message."""

    def call(*arguments: str, status: int = 2) -> str:
        with Record() as record:
            runs = record.runs()
        before = contents(work)
        ended = rig(*arguments)
        assert ended.status == status, ended.out + ended.err
        assert ended.out == ""
        assert "Traceback" not in ended.err
        assert contents(work) == before
        with Record() as record:
            assert record.runs() == runs
        return str(ended.err)

    return call


def contents(folder: Path) -> Mapping[str, bytes | None]:
    """Every file below a folder, but for what Python keeps of what it compiled."""
    paths = [path for path in sorted(folder.rglob("*")) if "__pycache__" not in path.parts]
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in paths}


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    """A PostgreSQL server, with an empty lab's record to make others of."""
    with serving() as started:
        started.sql("CREATE DATABASE prepared")
        prepare(lab_url(started.url("prepared")))
        yield started


@pytest.fixture(scope="session")
def people(server: Server) -> Server:
    """The server, with a rig and a reader that have roles of their own."""
    for name, role in (("rig7", "rig_writer"), ("anna", "rig_reader")):
        server.sql(f"CREATE ROLE {name} LOGIN PASSWORD '{WORD}' IN ROLE {role}")
    return server


@pytest.fixture
def database(server: Server) -> str:
    """An empty lab's record on the server, by its name."""
    return server.new_database(like="prepared")


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    """A scheduler that listens, with one worker in this process."""
    from distributed import LocalCluster  # slow to import; few tests need it

    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as made:
        yield made
