"""A person's own file: what import keeps of how it was taken, what is said of raw samples, and every command on it."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from tests.calibrations.synthetic import components, turns
from tests.rig.conftest import Rig

MAPPED = ("--column", "alpha_deg=tilt", "--column", "beta_deg=table", "--column", "vx_v=Ux:mV")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a table of a spreadsheet user: their names, semicolons, decimal commas, mV."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "theirs.csv", "tilt;table;Ux [mV]", factor=1000)
    write(tmp_path / "ours.csv", "alpha_deg (°);beta_deg (°);vx_v (mV)", factor=1000)
    return tmp_path


def write(path: Path, header: str, factor: float = 1.0, samples: int = 1) -> None:
    """A sweep at four inclinations; every pose for so many rows."""
    columns = turns((90, 30, 150, 60), step_deg=30.0)
    noise = np.random.default_rng(0).standard_normal((len(columns["beta_deg"]), samples)) * 1e-4
    x = 2.5 + components(columns)[0][:, None] + noise
    lines = [
        f"{alpha:g};{beta:g};{factor * v:.6f}"
        for alpha, beta, row in zip(columns["alpha_deg"], columns["beta_deg"], x, strict=True)
        for v in row
    ]
    path.write_text("\n".join([header, *lines]).replace(".", ","), encoding="utf-16")


@pytest.mark.usefixtures("folder")
def test_the_mapping_is_kept_with_the_run(rig: Rig) -> None:
    run = rig("import", "theirs.csv", *MAPPED, "--constant", "sensor=A7", "--json").document["run"]
    settings = rig("show", run, "--json").document["settings"]
    assert settings == {
        "file": "theirs.csv",
        "separator": "semicolon",
        "columns": {"alpha_deg": "tilt", "beta_deg": "table", "vx_v": "Ux [mV]:mV"},
        "constants": {"sensor": "A7"},
    }
    assert "columns: vx_v = Ux [mV]:mV\n" in rig("show", run).out


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    "arguments",
    [
        ("fit", "ours.csv"),
        ("compare", "ours.csv"),
        ("diagnose", "ours.csv"),
        ("discover", "ours.csv"),
        ("add", "cubic-nonlinearity", "--model", "linear", "--data", "ours.csv", "--out", "model.yaml"),
        ("export", "ours.csv", "--out", "again.csv"),
    ],
    ids=lambda words: words[0],
)
def test_every_command_takes_a_spreadsheet_with_our_names(rig: Rig, arguments: tuple[str, ...]) -> None:
    ended = rig(*arguments)
    assert ended.status == 0, ended.err


@pytest.mark.parametrize("command", ["fit", "compare", "diagnose", "discover"])
def test_foreign_column_names_are_refused_with_the_import_command(rig: Rig, folder: Path, command: str) -> None:
    ended = rig(command, "theirs.csv")
    assert ended.status == 2
    line = "    rig import theirs.csv --kind poses --column alpha_deg=tilt --column beta_deg=table --column vx_v=Ux:mV"
    assert line in ended.err.splitlines()
    assert sorted(path.name for path in folder.iterdir()) == ["ours.csv", "theirs.csv"]


def test_raw_samples_become_poses_with_a_remark(rig: Rig, folder: Path) -> None:
    write(folder / "raw.csv", "alpha_deg;beta_deg;vx_v", samples=60)
    said = "raw.csv is a log of raw samples: the table has the means of 100 poses, from 6240 samples."
    ended = rig("compare", "raw.csv", "--json")
    assert (ended.status, ended.err.strip()) == (0, said)
    assert ended.document["n"] == 100  # 104 but for four that are the same pose again, without a pause
    ended = rig("import", "raw.csv")
    assert said in ended.err
    assert "100 rows of poses" in ended.out


def test_a_single_inclination_is_reported_with_the_effects_it_cannot_test(rig: Rig, folder: Path) -> None:
    text = (folder / "ours.csv").read_text("utf-16").splitlines()
    (folder / "one.csv").write_text("\n".join([text[0], *(line for line in text if line.startswith("90;"))]))
    for command in ("fit", "diagnose"):
        ended = rig(command, "one.csv", "--model", "linear", "--json")
        assert ended.status == 0
        assert ended.document
        assert (
            "z-axis-scale. The data has only one inclination, alpha = 90 deg; measure at other inclinations."
            in ended.err
        )
    assert "one inclination" not in rig("fit", "ours.csv", "--model", "linear").err


def test_the_proposed_commands_work_for_a_name_with_a_space(rig: Rig, folder: Path) -> None:
    columns = turns((90, 30, 150, 60), step_deg=30.0)
    x = components(columns)[0]
    volts = 2.5 + x + 0.01 * x**2 + np.random.default_rng(0).standard_normal(len(x)) * 1e-4
    rows = zip(columns["alpha_deg"], columns["beta_deg"], volts, strict=True)
    lines = [f"{alpha:g},{beta:g},{v:.6f},{1e-3},100" for alpha, beta, v in rows]
    (folder / "my sweep.csv").write_text("\n".join(["alpha_deg,beta_deg,vx_v,vx_std_v,n", *lines]))
    compared = rig("compare", "my sweep.csv").out
    diagnosed = rig(*shlex.split(compared.partition("missing effect: rig ")[2].splitlines()[0]))
    assert diagnosed.status == 0, diagnosed.err
    added = rig(*shlex.split(diagnosed.out.partition("Add it: rig ")[2].splitlines()[0]))
    assert added.status == 0, added.err
    assert (folder / "model.yaml").is_file()
