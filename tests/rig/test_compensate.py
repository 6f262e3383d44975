"""rig compensate, as a shell sees it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from calibrations.model.file import dump_model
from tests.calibrations.fitted import PHYSICAL, model
from tests.rig.conftest import Rig


@pytest.fixture
def physical(work: Path) -> Path:
    (work / "ADXL203 no. 17.yaml").write_text(dump_model(model(PHYSICAL)))
    return work / "ADXL203 no. 17.yaml"


def test_each_language_has_its_files(rig: Rig, physical: Path) -> None:
    for language, names in (
        ("c", ["adxl203_no_17.h", "adxl203_no_17.c", "adxl203_no_17_self_test.c"]),
        ("python", ["adxl203_no_17.py"]),
        ("json", ["adxl203_no_17.json"]),
    ):
        ended = rig("compensate", str(physical), "--language", language, "--out", language)
        assert ended.status == 0, ended.err
        assert [line.partition("/")[2] for line in ended.out.splitlines() if line.startswith("written")] == names
        assert "az is not measured" in ended.out
    done = subprocess.run([sys.executable, "python/adxl203_no_17.py"], capture_output=True, text=True, check=True)
    assert done.stdout == "0 of 16 reference vectors fail\n"


def test_the_document_of_a_compensation_has_its_facts(rig: Rig, physical: Path) -> None:
    said = json.loads(
        rig("compensate", str(physical), "--language", "c", "--out", "c", "--precision", "float", "--json").out
    )
    assert said["schema"] == "rig.compensation/1"
    assert (said["precision"], said["outputs"], said["residual"]) == ("float", ["ax", "ay"], None)
    assert said["bound"]["q"] < 0.1
    assert [Path(path).name for path in said["files"]] == [
        "adxl203_no_17.h",
        "adxl203_no_17.c",
        "adxl203_no_17_self_test.c",
    ]


def test_the_error_on_unseen_poses_is_shown(rig: Rig, work: Path) -> None:
    (work / "fitted.yaml").write_text(
        dump_model(model({"bias": {"bias": (2.5, 2.5)}, "scale-factor": {"scale": (1.0, 1.0)}}))
    )
    words = ("--language", "json", "--out", "made", "--data", "good.csv", "--picture", "left.svg")
    ended = rig("compensate", "fitted.yaml", *words)
    assert "x: rms error" in ended.out
    assert "compensated" in (work / "left.svg").read_text()
