"""Imports that cannot be: one message; status 2; no run in the record."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.rig.conftest import Rig


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("nowhere.csv",), "Path 'nowhere.csv' does not exist"),
        (("good.csv", "--kind", "pose"), "'pose' is not one of 'poses', 'positions'"),
        (
            ("good.csv", "--column", "vx_v"),
            '"vx_v": write a column as NAME=THEIRS or NAME=THEIRS:UNIT, such as vx_v=Vout:mV',
        ),
        (("good.csv", "--column", "vx_v=Vot"), 'good.csv: there is no column "Vot"'),
        (("good.csv", "--column", "vx_v=vx_v:mvolt"), 'good.csv: unknown unit "mvolt" of the column "vx_v"'),
        (
            ("good.csv", "--column", "vx_v=vx_v:rad"),
            'good.csv: the column "vx_v" is in V; "vx_v" in rad cannot be converted to it',
        ),
        (("good.csv", "--kind", "positions"), 'good.csv: a table of positions needs the column "ax"'),
        (
            ("good.csv", "--constant", "gravity"),
            '"gravity": write a constant as KEY=VALUE, such as gravity_m_s2=9.81744',
        ),
        (("empty.csv",), "empty.csv: the file is empty"),
        (("cut.csv.gz",), "cut.csv.gz: cannot be read as text"),
        (
            ("log.csv",),
            "log.csv: a raw log needs the column t_s, or a line such as `# sample_rate_hz: 100` above its header",
        ),
        (("log.csv", "--constant", "sample_rate_hz=0"), 'constant "sample_rate_hz" is 0.0; it must be above 0'),
        (("log.csv", "--constant", "sample_rate_hz=fast"), "the constant \"sample_rate_hz\" is 'fast', not a number"),
        (
            ("log.csv", "--constant", "sample_rate_hz=100"),
            "log.csv: found no still intervals in 15 s at 100 samples a second; if the log is longer, correct its time",
        ),
        (
            ("gyro.csv", "--constant", "sample_rate_hz=100"),
            "gyro.csv: ax, ay, az are the same in all 5 still intervals within the noise",
        ),
    ],
)
def test_files_that_cannot_be_imported_are_refused(
    refused: Callable[..., str], work: Path, text: str, arguments: tuple[str, ...], says: str
) -> None:
    (work / "empty.csv").write_text("")
    (work / "cut.csv.gz").write_bytes(gzip.compress(text.encode())[:100])
    noise = np.random.default_rng(0).standard_normal((1500, 3)).round(4).tolist()
    (work / "log.csv").write_text("ax,ay,az\n" + "".join(f"{x},{y},{z}\n" for x, y, z in noise))
    turned = [[30 * v for v in row] if k % 300 > 200 else row for k, row in enumerate(noise)]
    (work / "gyro.csv").write_text("ax,ay,az\n" + "".join(f"{x},{y},{z}\n" for x, y, z in turned))
    assert says in refused("import", *arguments)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("root:x:0:0:root:/root:/bin/sh\ndaemon:x:1:1:daemon:/:/bin/false\n", "has no numbers in its first rows"),
        ("key = s3cret\nother = 7\n", "line 1: a header line with column names is missing"),
        ("Its s3cret: a, b\n1\n2\n3,4\n5,6\n", "line 1: a header line with column names is missing"),
        ("daemon\t\t7/s3cret\nx\ty\t8\n", "line 1: a column has no name"),
    ],
)
def test_the_message_about_a_file_without_a_table_does_not_quote_it(
    refused: Callable[..., str], work: Path, content: str, said: str
) -> None:
    (work / "private.txt").write_text(content)
    for command in ("import", "fit"):
        told = refused(command, "private.txt")
        assert said in told
        assert not any(word in told for word in ("root:x", "daemon", "s3cret"))


def test_a_damaged_line_of_a_log_is_skipped_or_refused(refused: Callable[..., str], rig: Rig, work: Path) -> None:
    rows = [f"{k / 100:.2f},{0.01 * (k % 7)}" for k in range(500)]
    (work / "still.csv").write_text("\n".join(["t_s,vx_v", *rows[:300], "3.0,,0.1", *rows[300:]]) + "\n")
    arguments = ("import", "still.csv", "--kind", "still")
    assert "still.csv, line 302: 3 values for 2 columns" in refused(*arguments, "--bad-lines", "refuse")
    ended = rig(*arguments)
    assert "500 rows of still" in ended.out
    assert "1 of 501 lines is damaged and was skipped: line 302 (3 values for 2 columns)" in ended.err
