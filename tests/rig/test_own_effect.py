"""An effect of one's own in one command: from what is left to a model without it."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import yaml

from calibrations.importing.foreign import write_csv
from tests.calibrations.synthetic import NOISE_V, components, poses, turns
from tests.rig.conftest import Rig

SCREW = "beta_deg += a*sin(5*beta) + b*cos(5*beta)"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def data(here: Path) -> str:
    """A small table: five waves in a turn of beta on x, and humidity."""
    columns = turns((90, 30), step_deg=40.0)
    columns["humidity"] = np.random.default_rng(5).uniform(30, 60, len(columns["t_s"]))
    x, y, _ = components(columns)
    wave = 10 * NOISE_V * np.sin(5 * np.radians(columns["beta_deg"]))
    write_csv(poses(columns, 2.5 + x + wave, 2.5 + y), here / "waves.csv")
    return "waves.csv"


@pytest.mark.slow
def test_the_printed_command_adds_the_remaining_pattern_as_an_effect(rig: Rig, here: Path) -> None:
    """The stage's gear errs five times a turn, which no effect of the catalogue does."""
    columns = turns((90, 30, 150, 60), step_deg=15.0)
    x, y, _ = components(columns)
    turn = np.radians(0.05) * np.sin(5 * np.radians(columns["beta_deg"]))
    write_csv(poses(columns, 2.5 + x - y * turn, 2.5 + y + x * turn), here / "worm.csv")
    asked = rig("diagnose", "worm.csv", "--model", "linear", "--json")
    found = asked.document
    own = found["own_effect"]
    assert (found["verdict"], found["residual_structure"]) == ("unexplained", "5th harmonic of the stage angle beta")
    assert (own["expression"], own["name"]) == (SCREW, "5th-harmonic-stage-angle-beta")
    words = shlex.split(own["command"])
    added = rig(*words[1:], "--json")
    step = added.document["steps"][0]
    assert words[0] == "rig"
    assert step["excess_before"] > 4
    assert step["excess_after"] < 1.1
    assert step["held_out_after"] < 1.15
    model = words[words.index("--out") + 1]
    beside = rig("compare", "worm.csv", "--model", model, "--json").document
    assert beside["fails"] == []
    page = here / "page.html"
    assert rig("report", "worm.csv", "--model", model, "--out", str(page)).status == 0
    assert "5th-harmonic-stage-angle-beta" in page.read_text()


def test_text_and_document_have_the_same_command(rig: Rig, data: str) -> None:
    for command in ("diagnose", "discover"):
        shown = rig(command, data, "--model", "linear").out
        line = next(line for line in shown.splitlines() if line.startswith("    rig add"))
        assert "5th harmonic of beta" in shown
        assert "'a*sin(5*beta) + b*cos(5*beta)' --name 5th-harmonic-beta --model linear --data waves.csv" in line
    assert rig("discover", data, "--model", "linear", "--json").document["own_effect"]["command"] == line.strip()


def test_the_model_file_holds_the_effect(rig: Rig, data: str, here: Path) -> None:
    text = "v += a*sin(5*beta) + c*(humidity - 45)"
    told = rig("add", text, "--name", "waves", "--model", "linear", "--data", data, "--out", "m2.yaml")
    assert told.status == 0, told.err
    assert re.search(r"waves +a +x +0\.0005\d*\(\d+\)", told.out)
    written = yaml.safe_load((here / "m2.yaml").read_text())["effects"][-1]
    assert (written["effect"], written["expression"], written["columns"]) == ("waves", text, ["humidity"])
    for command in (["fit", data], ["compare", data], ["diagnose", data]):
        options = ["--out", "again.yaml"] if command[0] == "fit" else ["--check"]
        assert rig(*command, "--model", "m2.yaml", *options).status == 0


REFUSED = [
    (["a*sn(beta)", "--name", "own"], r'column 3: there is no function "sn"; did you mean "sin"\?\n .*\n +\^'),
    (["a*ax", "--name", "own-scale"], "own-scale changes nothing that linear cannot already describe"),
    (["a*sin(5*beta)", "--name", "hysteresis"], "hysteresis is already in the catalogue"),
    (["a*sin(5*beta)", "--name", "My Effect"], "cannot name an effect"),
    (["a*sin(5*beta)"], "if this is an expression, give it a name"),
    (["histeresis"], 'unknown effect "histeresis"; did you mean "hysteresis"'),
    (["nowhere.py"], "there is no such file"),
]


@pytest.mark.parametrize(("words", "says"), REFUSED)
def test_an_effect_that_cannot_be_added_is_refused_and_nothing_is_written(
    rig: Rig, data: str, here: Path, words: list[str], says: str
) -> None:
    # y has nothing of a force that is x's own, so that an expression in ax is the linear model's on x alone
    words = ["vx += a*ax", *words[1:]] if words[0] == "a*ax" else words
    ended = rig("add", *words, "--model", "linear", "--data", data, "--out", "m2.yaml")
    assert ended.status == 2
    assert re.search(says, ended.err), ended.err
    assert not (here / "m2.yaml").exists()


PYTHON = '''import numpy as np

from calibrations.effects import Effect, Parameter


class FiveWaves(Effect):
    """five-waves: five waves in a turn of beta.

        V += c sin(5 beta)      c in {out}, per axis

    Symptom   five waves.
    """

    wave = Parameter("{out}", typical=0.01)

    def transduction(self, a, table, p):
        return np.outer(np.sin(5 * np.radians(table.column("beta_deg"))), p.wave)
'''


def test_a_python_file_is_an_effect_too(rig: Rig, data: str, here: Path) -> None:
    (here / "five_waves.py").write_text(PYTHON)
    told = rig("add", "five_waves.py", "--model", "linear", "--data", data, "--out", "m2.yaml", "--json")
    assert told.done().document["steps"][0]["excess_after"] < 1.15
    assert "keep five_waves.py in the effects folder" in told.err
    refused = rig("compare", data, "--model", "m2.yaml")  # a model file runs nothing: the folder has to be named
    assert refused.status == 2
    assert 'unknown effect "five-waves"' in refused.err
