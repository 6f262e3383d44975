"""What a command says of a run, and writes, is the same out of the rig's own record and out of the lab's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from calibrations.model.file import dump_model
from rig.bench import DEFAULT
from rig.cli import main
from rig.files import RECORD
from rig.record import Record
from rig.services.tables import load_all
from tests.calibrations.fitted import LINEAR, model
from tests.rig.conftest import Ended, Rig, contents
from tests.rig.postgres import Server
from tests.rig.pushing import pushed
from tests.rig.test_control import QUIET, checks

pytestmark = pytest.mark.sockets
WORLD = {"preset": "ideal", "spread": {"imperfection_fraction": 0.0}, "noise": {"white_v": 1.5e-4}}
SWEEP = ("--step-deg", "60", "--dwell-s", "0.2", "--inclinations-deg")
MEASURED: Mapping[str, tuple[str, ...]] = {
    "poses": ("sweep", *SWEEP, "90,30"),
    "later": ("sweep", *SWEEP, "60,120"),
    "still": ("noise-floor", "--duration-s", "20"),
    "motion": ("motion", "--duration-s", "4", "--still-s", "4", "--block-s", "4", "--dwell-s", "0.2"),
}
OF_POSES = {
    "show": ("show", "{}", "--poses", "--log"),
    "compare": ("compare", "{}"),
    "fit": ("fit", "{}", "--out", "fitted.yaml"),
    "diagnose": ("diagnose", "{}"),
    "add": ("add", "axis-misalignment", "--model", "linear", "--data", "{}", "--out", "grown.yaml"),
    "discover": ("discover", "{}"),
    "export": ("export", "{}", "--out", "table.csv"),
}
OF_STILL = {
    **{name: OF_POSES[name] for name in ("show", "compare", "fit", "diagnose", "discover")},
    "add": ("add", "flicker-noise", "--model", "still", "--data", "{}", "--out", "grown.yaml"),
    "noise": ("noise", "{}"),
}
ASKED = {
    **{("poses", name): words for name, words in OF_POSES.items()},
    **{("still", name): words for name, words in OF_STILL.items()},
    **{("motion", name): OF_POSES[name] for name in ("show", "compare", "fit", "diagnose", "export")},
    ("motion", "report"): ("report", "{}", "--out", "page.html"),
    ("poses", "discover of two"): ("discover", "{}", "{later}", "--out", "grown.yaml"),
    ("poses", "compare with known noise"): ("compare", "{}", "--noise", "noise.yaml"),
    ("poses", "certificate"): ("certificate", "{}", "--model", "linear", "--out", "certificate.xml"),
    ("poses", "compensate"): ("compensate", "made.yaml", "--language", "c", "--out", "made", "--data", "{}"),
    ("poses", "export of events"): ("export", "{}", "--format", "event-model", "--out", "events.jsonl"),
    ("record", "runs"): ("runs",),
    ("record", "control"): ("control", "CS-1"),
    ("record", "history"): ("history", "simulated"),
}


@dataclass(frozen=True)
class Laboratory:
    """A rig's own record in the folder `home`, with its runs by name, and the lab's with the same at `url`."""

    home: Path
    url: str
    runs: Mapping[str, str]


@pytest.fixture(scope="module")
def laboratory(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Laboratory:
    home, url = tmp_path_factory.mktemp("rig"), server.url(server.new_database(like="prepared"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RIG_HOME", str(home))
        bench = home / "bench.yaml"
        bench.write_text(yaml.safe_dump(yaml.safe_load(DEFAULT.read_text()) | {"world": WORLD}))
        found = {"poses": _measured(*MEASURED["poses"], "--bench", str(bench))}
        with Record() as own, own.engine.begin() as to:  # long before the others
            to.exec_driver_sql("UPDATE runs SET created = '2020-01-01T00:00:00+00:00', checksum = NULL")
        checks(QUIET)
        found |= {name: _measured(*words, "--bench", str(bench)) for name, words in MEASURED.items() if name != "poses"}
        with Record() as own:
            assert len(pushed(own, url)) == len(QUIET) + len(MEASURED)
    return Laboratory(home, url, found)


def _measured(*words: str) -> str:
    with pytest.raises(SystemExit) as ended:
        main(["run", *words, "--unattended"])
    assert not ended.value.code
    with Record() as record:
        return record.runs()[0].run


@pytest.fixture
def both(rig: Rig, laboratory: Laboratory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Call a command on either record, in a folder and a home of its own: it says and writes the same."""

    def call(*words: str) -> None:
        made: list[tuple[Ended, Mapping[str, bytes | None]]] = []
        for place, home, to in (("own", laboratory.home, ()), ("lab", tmp_path, ("--record", laboratory.url))):
            (tmp_path / place).mkdir()
            monkeypatch.chdir(tmp_path / place)
            monkeypatch.setenv("RIG_HOME", str(home))
            Path("made.yaml").write_text(dump_model(model(LINEAR)))
            Path("noise.yaml").write_text(dump_model(model({"white-noise": {"coefficient": (1e-4, 1e-4)}})))
            made.append((rig(*words, *to), {name: _undated(text) for name, text in contents(tmp_path / place).items()}))
        own, lab = made
        assert own[0].status == 0, own[0].err
        assert own == lab

    return call


def _undated(text: bytes | None) -> bytes:
    """Without the line of a model file that says when it was made."""
    return b"".join(line for line in (text or b"").splitlines(True) if not line.startswith(b"  created: "))


@pytest.mark.slow
@pytest.mark.parametrize(("what", "words"), [(key[0], words) for key, words in ASKED.items()], ids=map(" ".join, ASKED))
def test_a_command_prints_and_writes_the_same_from_either_record(
    both: Callable[..., None], laboratory: Laboratory, undrawn: None, what: str, words: tuple[str, ...]
) -> None:
    run = laboratory.runs.get(what, "")
    json = () if words[0] == "export" else ("--json",)
    both(*(word.format(run, **laboratory.runs) for word in words), *json)


def test_a_fleet_is_read_in_the_lab_and_its_answers_are_stored_on_the_rig(
    both: Callable[..., None], laboratory: Laboratory, monkeypatch: pytest.MonkeyPatch, rig_home: Path
) -> None:
    monkeypatch.setattr("rig.cli.commands.fleet.connect_workers", lambda *_: nullcontext())
    monkeypatch.setattr("rig.fleet.questions.run_tasks", lambda _, do, chunks: ((tasks, do(tasks)) for tasks in chunks))
    both("fleet", "calibrate", laboratory.runs["poses"], "--json")
    with Record() as own:
        assert own.runs() == []
        assert own.engine.connect().exec_driver_sql("SELECT count(*) FROM answers").scalar()


def test_runs_of_a_simulated_bench_are_joined_by_its_own_clock(
    laboratory: Laboratory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lab has not its state, which is not pushed."""
    two = [laboratory.runs[name] for name in ("poses", "later")]
    monkeypatch.setenv("RIG_HOME", str(laboratory.home))
    own = load_all(two)
    monkeypatch.setenv(RECORD, laboratory.url)
    assert load_all(two).digest == own.digest
