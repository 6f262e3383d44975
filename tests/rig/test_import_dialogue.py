"""At a terminal `rig import` proposes what each column is; a person confirms, corrects, or gives up."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import numpy as np
import pexpect
import pytest

from calibrations.importing.plausible import find_time_doubt
from calibrations.importing.units import ColumnMapping
from rig.record import Record
from rig.services.importing import column_words, doubt_of_time, open_file, proposal
from tests.rig.conftest import Rig

THEIRS = "Takt;inclination;table;Ux\n" + "".join(f"{k};90;{30 * k};{2500 + k}\n" for k in range(12))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "theirs.csv"
    path.write_text(THEIRS)
    return path


def at_terminal(file: Path) -> pexpect.spawn[str]:
    words = ["-m", "rig", "import", str(file)]
    return pexpect.spawn(sys.executable, words, encoding="utf-8", timeout=30, dimensions=(40, 200))


def test_a_mapping_is_confirmed_corrected_and_can_be_repeated(file: Path, rig: Rig) -> None:
    with at_terminal(file) as terminal:
        for question, answer in (
            (r"\[poses\]: ", ""),
            (r"Takt .*\[-\]: ", "times"),
            (r'"times" is not a column name.*Takt .*\[-\]: ', "t_s:min"),
            (r"inclination +90 \.\. 90 +\[alpha_deg\]: ", ""),
            (r"table .*\[beta_deg\]: ", "V"),
            (r'in deg; "table" in V cannot be converted to it.*table .*\[beta_deg\]: ', "alpha_deg"),
            (r"alpha_deg is already the name.*table .*\[beta_deg\]: ", ""),
            (r"Ux .*\[vx_v:mV\]: ", "uV"),
            (r"To repeat this import without questions:\s+rig ([^\r\n]*)", None),
        ):
            terminal.expect(question)
            if answer is not None:
                terminal.sendline(answer)
        repeated = shlex.split(terminal.match.group(1))
        terminal.expect("12 rows of poses")
        terminal.expect(pexpect.EOF)
    assert terminal.exitstatus == 0
    assert rig(*repeated).status == 0
    with Record() as record:
        first, again = (record.columns(run.run)[0] for run in record.runs())
    assert {name: values.tolist() for name, values in first.items()} == {
        name: values.tolist() for name, values in again.items()
    }
    assert first["t_s"][1] == 60.0
    assert first["vx_v"][0] == pytest.approx(2500e-6)


def press_ctrl_c(terminal: pexpect.spawn[str]) -> None:
    """Until it is heard, as a person would: Python's `input` overlooks a key between its prompt and its waiting."""
    for _ in range(5):
        terminal.sendintr()
        if terminal.expect(["stopped", pexpect.TIMEOUT], timeout=5) == 0:
            return
    raise AssertionError("Ctrl-C was not heard")


def test_an_aborted_import_stores_nothing(file: Path) -> None:
    with at_terminal(file) as terminal:
        terminal.expect(r"\[poses\]: ")
        press_ctrl_c(terminal)
        terminal.expect(pexpect.EOF)
    assert terminal.exitstatus == 4
    with Record() as record:
        assert record.runs() == []


def test_a_time_that_no_stage_can_follow_is_proposed_in_minutes(tmp_path: Path) -> None:
    rows = [f"{0.1 * k:.1f};{90 - 30 * (k // 12)};{30 * (k % 12)};{2500 + k}" for k in range(36)]
    text = "time;inclination;table;Ux\n" + "\n".join(rows)
    (path := tmp_path / "minutes.csv").write_text(text)
    columns = proposal(sheet := open_file(path)).columns
    assert columns["time"] == ColumnMapping("t_s", "time", "min")
    named = [m for m in columns.values() if m is not None]
    assert doubt_of_time(sheet, named) == ("runs from 0 to 3.5; in s this is 0.1 s from one pose to the next", "min")
    path.write_text(text.replace("time;", "time (s);"))  # who states the unit is not asked
    stated = proposal(sheet := open_file(path)).columns
    assert doubt_of_time(sheet, [m for m in stated.values() if m is not None]) is None


def test_a_log_of_samples_and_slow_poses_have_no_doubt() -> None:
    turned = np.column_stack([np.arange(30.0)])
    assert find_time_doubt(0.01 * np.arange(30.0), turned // 10) is None
    assert find_time_doubt(6.5 * np.arange(30.0), turned) is None
    assert find_time_doubt(6500.0 * np.arange(30.0), turned) == (
        "runs from 0 to 188500; in s this is 6.5e+03 s from one pose to the next",
        "ms",
    )


POSES = "alpha_deg,beta_deg,vx_v,vy_v,time,pressure\n" + "\n".join(
    f"{90 - 30 * (k // 12)},{30 * (k % 12)},{2.5 + 0.01 * k},{2.5 - 0.01 * k},{{times[{k}]}},{1000 + k % 3}"
    for k in range(36)
)


def test_the_terminal_uses_the_proposals_of_the_page_for_further_columns(tmp_path: Path, rig: Rig) -> None:
    (path := tmp_path / "poses.csv").write_text(POSES.format(times=[10 * k for k in range(36)]))
    page = {m.file_column: m.name for m in proposal(open_file(path)).columns.values() if m is not None}
    assert page["time"] == "t_s"
    imported = rig("import", str(path))
    assert imported.status == 0
    assert "t_s" in imported.out
    assert "time" not in imported.out.splitlines()[0]
    assert 'The column "time" is taken as t_s in s. Another meaning or unit: --column NAME=time:UNIT' in imported.err
    assert "pressure" in imported.out
    assert '"pressure"' not in imported.err
    kept = rig("import", str(path), "--column", "time=time")
    assert "time" in kept.out.splitlines()[0]
    assert "is taken" not in kept.err
    stated = rig("import", str(path), "--column", "t_s=time:min")
    assert "is taken" not in stated.err


def test_a_time_without_a_likely_unit_is_not_taken_before_its_unit_is_stated(tmp_path: Path, rig: Rig) -> None:
    (path := tmp_path / "poses.csv").write_text(POSES.format(times=[10_000 * k for k in range(36)]))
    refused = rig("import", str(path))
    assert refused.status == 2
    assert refused.err.endswith(
        'the time "time" runs from 0 to 350000; in s this is 1e+04 s from one pose to the next; '
        "state its unit, as in --column t_s=time:ms\n"
    )
    with Record() as record:
        assert record.runs() == []
    assert rig("import", str(path), "--column", "t_s=time:ms").status == 0


def test_a_missing_column_is_named_by_its_quantity() -> None:
    assert [column_words(name) for name in ("alpha_deg", "vx_v", "az", "mx")] == [
        "the column of the angle alpha (alpha_deg)",
        "the column of the output along x (vx_v)",
        "the column of the specific force along z (az)",
        "the column of the magnetic field along x (mx)",
    ]
