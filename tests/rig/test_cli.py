"""The command line itself: lazy commands, help, exit statuses, one message and no traceback."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import click
import pytest

from calibrations.errors import DataError
from drivers.errors import LimitError, LinkTimeout
from procedures.errors import SafetyLimit, UnknownProcedure
from rig.cli import SECTIONS, Commands, main
from rig.cli import rig as group
from rig.cli.terminal.failure import BROKEN_PIPE, PROGRAM_FAULT, exit_status, status_of
from rig.errors import BenchError, InstrumentFailed, Stopped
from rig.record import Record
from tests.rig.conftest import Rig

COMMANDS = Commands().list_commands(click.Context(group))


def loaded(program: str) -> tuple[str, set[str]]:
    """What statements print in a process of their own, and the modules that it has loaded by its end."""
    whole = f"import sys\ntry: {program}\nfinally: print(*sys.modules, file=sys.stderr)"
    ended = subprocess.run([sys.executable, "-c", whole], capture_output=True, text=True, timeout=30, check=True)
    return ended.stdout, set(ended.stderr.split())


def test_help_groups_every_command_once() -> None:
    grouped = [name for section in SECTIONS.values() for name in section]
    assert sorted(grouped) == COMMANDS


def test_help_lists_every_command_and_imports_none() -> None:
    out, modules = loaded("from rig.cli import main; main(['--help'])")
    assert all(f"  {name} " in out for name in COMMANDS)
    assert not {"numpy", "sqlalchemy", "rich", "yaml", "rig.cli.commands.run"} & modules


def test_a_run_loads_no_module_that_only_reports_and_motions_need() -> None:
    """These take as long to load as all the rest."""
    _, modules = loaded("import rig.cli.commands.run")
    assert "rig.runs.runner" in modules
    assert not {"matplotlib", "scipy.signal", "scipy.stats", "scipy.interpolate"} & modules


@pytest.mark.parametrize("name", ["effects", "models"])
def test_a_list_loads_no_compiler_and_no_analysis(name: str) -> None:
    """They took most of its second."""
    _, modules = loaded(f"from rig.cli import main; main(['{name}'])")
    assert "calibrations.effects.catalogue" in modules
    slow = {"numba", "scipy.stats", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "rig.services.load"}
    assert not slow & modules


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name: str, rig: Rig) -> None:
    ended = rig(name, "--help")
    assert ended.status == 0
    assert f"Usage: rig {name}" in ended.out


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (BenchError("x"), 2),
        (DataError("x"), 2),
        (UnknownProcedure("x"), 2),
        (FileNotFoundError("x"), 2),
        (InstrumentFailed("x"), 3),
        (LinkTimeout("x", "y"), 3),
        (LimitError("x", "y"), 4),
        (SafetyLimit("x"), 4),
        (Stopped("x"), 4),
        (KeyError("x"), PROGRAM_FAULT),
    ],
)
def test_every_error_has_its_exit_status(error: Exception, status: int) -> None:
    assert status_of(error) == status


def raising(error: BaseException) -> Callable[[], None]:
    def call() -> None:
        raise error

    return call


def test_an_error_is_one_message(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(raising(BenchError("bench.yaml, key x: no such key"))) == 2
    assert capsys.readouterr().err == "rig: bench.yaml, key x: no such key\n"


def test_a_fault_of_the_program_is_called_a_fault_of_the_program(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert exit_status(raising(KeyError("x"))) == PROGRAM_FAULT
    assert capsys.readouterr().err == "rig: a fault of this program: KeyError: 'x'. RIG_DEBUG=1 shows where.\n"
    monkeypatch.setenv("RIG_DEBUG", "1")
    exit_status(raising(KeyError("x")))
    assert "Traceback" in capsys.readouterr().err


def test_a_command_may_return_its_status() -> None:
    assert exit_status(lambda: 1) == 1
    assert exit_status(lambda: None) == 0


def test_ctrl_c_ends_with_status_4(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(raising(KeyboardInterrupt())) == 4
    assert exit_status(raising(click.Abort())) == 4
    assert "stopped" in capsys.readouterr().err


def test_a_closed_pipe_is_no_fault() -> None:
    program = "import sys\nfrom rig.cli import main\nsys.stdin.read()\nmain(['--help'])"
    child = subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert child.stdin
    assert child.stdout
    assert child.stderr
    child.stdout.close()
    child.stdin.close()  # now it goes on, and nobody reads
    with child.stderr as err:
        assert err.read() == b""
    assert child.wait(timeout=30) == BROKEN_PIPE


def completed(capture: pytest.CaptureFixture[bytes]) -> str:
    """What the program answers to a shell."""
    with pytest.raises(SystemExit) as ended:
        main(())
    assert ended.value.code == 0
    return capture.readouterr().out.decode()


CYCLE = """
import atexit, sys
class Cycle:
    def __init__(self):
        self.own = self
    def __del__(self):
        print("collected", file=sys.stderr)
sys.argv = ["rig", "models"]
from rig.cli import main
try:
    main()
finally:
    atexit.register(Cycle)
"""


def test_the_end_of_a_program_collects_no_garbage() -> None:
    """It took half a second after a run, while its caller waited; nothing in it needs a finaliser."""
    ended = subprocess.run([sys.executable, "-c", CYCLE], capture_output=True, text=True, timeout=60, check=True)
    assert (ended.stdout != "", ended.stderr) == (True, "")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_gets_its_completion_script(
    shell: str, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    monkeypatch.setattr("click.shell_completion.BashComplete._check_version", lambda *_: None)
    monkeypatch.setenv("_RIG_COMPLETE", f"{shell}_source")
    assert f"_RIG_COMPLETE={shell}_complete" in completed(capsysbinary)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_command_prints_the_completion_script(shell: str, rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("click.shell_completion.BashComplete._check_version", lambda *_: None)
    assert f"_RIG_COMPLETE={shell}_complete" in rig("completion", shell).out


def test_runs_sensors_and_files_are_completed(
    monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    with Record() as record:
        constants = {"sensor": "QA-7"}
        run = record.begin("sweep", {}, bench={}, identities={}, configuration="", source="a test", constants=constants)
    monkeypatch.setenv("_RIG_COMPLETE", "bash_complete")
    wanted = {"fit 2": ["file,2", f"plain,{run}"], "show la": ["plain,last"], "history Q": ["plain,QA-7"]}
    for line, offered in wanted.items():
        monkeypatch.setenv("COMP_WORDS", f"rig {line}")
        monkeypatch.setenv("COMP_CWORD", "2")
        assert completed(capsysbinary).split() == offered
    for line, number, first in (("rig show ", 2, "plain,last"), ("rig fit last ", 3, "plain,sweep")):
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(number))
        assert completed(capsysbinary).split()[0] == first
    monkeypatch.setenv("COMP_WORDS", "rig show last so")  # there is no soak yet
    assert completed(capsysbinary).split() == []


def test_commands_and_procedures_are_completed(
    monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    monkeypatch.setenv("_RIG_COMPLETE", "bash_complete")
    for line, number, wanted in (
        ("rig disc", 1, "plain,discover"),
        ("rig run swe", 2, "plain,sweep"),
        ("rig plan sweep --st", 3, "plain,--step-deg"),
    ):
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(number))
        assert completed(capsysbinary).split() == [wanted]
