"""Procedures are found by their files, and their settings read from text."""

from pathlib import Path

import pytest

from procedures.catalogue import find, paths, summary
from procedures.errors import ProcedureError, SettingError, UnknownProcedure
from procedures.settings import parse

MINE = '''"""noise-floor: a still record.

Excites   nothing.
"""

from typing import Literal

Side = Literal["up", "down"]

def noise_floor(rig, *, dwell_s: float = 5.0, repeats: int = 3, warm: bool = False, side: Side = "up",
                angles_deg: tuple[float, ...] = (0.0,), remark: str = ""):
    """Record."""
'''


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "noise_floor.py").write_text(MINE)
    (tmp_path / "helper.py").write_text("def something_else(): ...")
    (tmp_path / "broken.py").write_text("def broken(:")
    return tmp_path


def test_a_file_with_a_function_of_its_name_is_a_procedure(folder: Path) -> None:
    assert set(paths(folder)) == {"noise-floor", *paths()}
    assert paths(folder)["noise-floor"].parent == folder
    assert list(paths()) == sorted(paths())
    assert not {"session", "settings", "questions", "catalogue"} & set(paths())
    assert summary(folder / "noise_floor.py") == "a still record"


@pytest.mark.parametrize("content", [b"def spoilt(rig): ...\0", b"\xff", b"x = " + b"-" * 100_000 + b"1"])
def test_a_spoilt_file_hides_no_other_procedure(folder: Path, content: bytes) -> None:
    (folder / "spoilt.py").write_bytes(content)
    assert set(paths(folder)) == {"noise-floor", *paths()}


def test_a_procedure_is_loaded_at_its_first_use(folder: Path) -> None:
    procedure = find("noise-floor", folder)
    assert find("noise_floor", folder).path == procedure.path == folder / "noise_floor.py"
    assert procedure.doc.startswith("noise-floor: a still record.")
    assert procedure.defaults["repeats"] == 3


def test_a_users_file_takes_precedence_over_the_shipped_one(tmp_path: Path) -> None:
    (tmp_path / "sweep.py").write_text('"""sweep: mine."""\ndef sweep(rig): ...')
    assert find("sweep", tmp_path).summary == "mine"


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownProcedure, match="Did you mean 'sweep'"):
        find("swep")
    with pytest.raises(UnknownProcedure, match="There are: "):
        find("x")


def test_a_procedure_file_that_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text("import nonsense_that_is_not_there\ndef bad(rig): ...")
    with pytest.raises(ProcedureError, match=r"bad.py: cannot load it: ModuleNotFoundError"):
        find("bad", tmp_path)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("1 / 0", r"mine\.py, line 3: ZeroDivisionError: division by zero; correct the procedure"),
        ("np.zeros(2) @ np.zeros(3)", r"mine\.py, line 3: ValueError: matmul.*; correct the procedure"),
        ("np.linalg.inv(np.zeros((2, 2)))", r"mine\.py, line 3: LinAlgError: Singular matrix; correct the procedure"),
        ("raise SafetyLimit('too hot')", "^too hot$"),
    ],
)
def test_a_fault_in_a_users_procedure_names_the_file_and_the_line(tmp_path: Path, body: str, message: str) -> None:
    imports = "import numpy as np; from procedures.errors import SafetyLimit"
    (tmp_path / "mine.py").write_text(f"{imports}\ndef mine(rig):\n    {body}\n")
    with pytest.raises(ProcedureError, match=message):
        find("mine", tmp_path).function(None)


def test_an_error_of_the_program_in_a_users_procedure_passes_unchanged(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("from procedures.settings import parse\ndef mine(rig):\n    parse(1, 2)\n")
    with pytest.raises(AttributeError):
        find("mine", tmp_path).function(None)


def test_settings_are_read_by_their_types(folder: Path) -> None:
    procedure = find("noise-floor", folder)
    texts = {"dwell_s": "2.5", "repeats": "4", "warm": "yes", "side": "down", "angles_deg": "-90,30", "remark": "x"}
    assert parse(procedure, texts) == {
        "dwell_s": 2.5,
        "repeats": 4,
        "warm": True,
        "side": "down",
        "angles_deg": (-90.0, 30.0),
        "remark": "x",
    }
    assert parse(procedure, {}) == procedure.defaults
    assert parse(procedure, {"angles_deg": [1, 2]})["angles_deg"] == (1.0, 2.0)


@pytest.mark.parametrize(
    ("name", "text", "wanted"),
    [
        ("dwell_s", "long", "a number"),
        ("dwell_s", "nan", "a number"),
        ("repeats", "2.5", "a whole number"),
        ("warm", "maybe", "true or false"),
        ("side", "left", "one of up, down"),
        ("angles_deg", "90;30", "numbers such as 90,30"),
    ],
)
def test_a_value_of_the_wrong_type_is_refused(folder: Path, name: str, text: str, wanted: str) -> None:
    with pytest.raises(SettingError, match=f"noise-floor: the setting {name} is '{text}'; give {wanted}"):
        parse(find("noise-floor", folder), {name: text})


def test_an_unknown_setting_is_answered_with_the_nearest(folder: Path) -> None:
    with pytest.raises(SettingError, match=r"noise-floor has no setting 'dwell'\. Did you mean 'dwell_s'"):
        parse(find("noise-floor", folder), {"dwell": "1"})
