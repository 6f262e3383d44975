"""Model files through the commands: written whole with values, uncertainties and provenance; fed back unchanged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.importing.foreign import read_csv, write_csv
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations.synthetic import components, poses, turns
from tests.rig.conftest import Rig

OWN = '''from calibrations.effects import Effect, Parameter


class Sag(Effect):
    """sag: the proof mass sags with the cube of the out-of-plane axis.

        V += c a_o^3      c in {out}/g^3

    Symptom   the residual has opposite signs on both sides of alpha = 90 deg.
    Excited by  inclinations on both sides of alpha = 90 deg.
    Confused with  axis-misalignment, near alpha = 90 deg.
    Source    a test.
    """

    cube = Parameter("{out}/g^3", typical=1e-2, doc="output per cube")

    def transduction(self, a, table, p):
        return p.cube * a[:, 2:] ** 3
'''


def made(path: Path, missing: Callable[[Any], Any], seed: int = 0) -> str:
    """A table of poses whose two outputs have the same of the out-of-plane axis too much; its path."""
    columns = turns(step_deg=30.0)
    x, y, z = components(columns)
    write_csv(poses(columns, 2.5 + x + missing(z), 2.5 + y + missing(z), seed=seed), path)
    return str(path)


@pytest.fixture
def data(tmp_path: Path) -> str:
    return made(tmp_path / "bent.csv", lambda z: 0.002 * z**2)


@pytest.fixture
def own(tmp_path: Path, bench_file: Callable[..., Path]) -> tuple[str, ...]:
    """A folder of one's own effects, as a bench file names it."""
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "sag.py").write_text(OWN)
    return ("--bench", str(bench_file({"folders": {"effects": "effects"}})))


def test_add_writes_a_new_model_and_leaves_the_old_one(rig: Rig, data: str, tmp_path: Path) -> None:
    old, new = tmp_path / "old.yaml", tmp_path / "new.yaml"
    assert rig("fit", data, "--model", "linear", "--out", str(old)).status == 0
    before = old.read_bytes()
    assert rig("add", "z-axis-bias", "--model", str(old), "--data", data, "--out", str(new)).status == 0
    assert old.read_bytes() == before
    written = yaml.safe_load(new.read_text())
    assert written["schema"] == "rig.model/1"
    assert [each["effect"] for each in written["effects"]] == ["bias", "scale-factor", "z-axis-bias"]
    squares = written["effects"][-1]["parameters"]
    assert [(p["name"], p["axis"], p["unit"]) for p in squares] == [("square", "x", "V/g^2"), ("square", "y", "V/g^2")]
    for p in squares:
        assert p["value"] == pytest.approx(0.002, abs=5 * p["std"])
        assert 1e-6 < p["std"] < 1e-4
    said = written["provenance"]
    assert said["data_sha256"] == read_csv(data).digest
    assert said["program"].startswith("inertial-rig 0.")
    assert (said["rows"], said["parent"]) == (130, "linear")
    assert written["covered"] == {"t_s": [read_csv(data).column("t_s").min(), read_csv(data).column("t_s").max()]}
    together = read_model(str(new)).correlations
    found = fit(read_model(str(old)).with_effect(catalogue()["z-axis-bias"]), read_csv(data))
    assert together is not None
    assert list(together.names) == list(found.params)
    assert together.matrix == pytest.approx(found.correlation, abs=1e-3)


def test_a_fitted_model_is_evaluated_as_it_is(rig: Rig, data: str, tmp_path: Path) -> None:
    """On data with another bias it fails, and its file stays as it was."""
    model = tmp_path / "model.yaml"
    rig("discover", data, "--model", "linear", "--out", str(model))
    before = model.read_bytes()
    shifted = made(tmp_path / "shifted.csv", lambda z: 0.002 * z**2 + 0.01, seed=1)
    again = rig("compare", data, "--model", str(model), "--json").document
    other = rig("compare", shifted, "--model", str(model), "--json").document
    assert again["fails"] == []
    assert again["rmse"]["x"] < 60e-6
    assert other["rmse"]["x"] == pytest.approx(0.01, rel=0.02)
    assert other["fails"][0]["excess"] > 100
    assert model.read_bytes() == before


@pytest.mark.slow
def test_data_without_any_noise_has_its_answer(rig: Rig, tmp_path: Path) -> None:
    columns = turns(step_deg=30.0)
    x, y, z = components(columns)
    whole = poses(columns, 2.5 + x + 0.002 * z**2, 2.5 + y, seed=None)
    bare = {name: values for name, values in whole.columns.items() if "std" not in name and name != "n"}
    write_csv(Table.from_columns("poses", bare), tmp_path / "exact.csv")
    ended = rig(
        "discover", str(tmp_path / "exact.csv"), "--model", "linear", "--out", str(tmp_path / "m.yaml"), "--json"
    )
    found = ended.document
    assert (ended.status, found["verdict"], found["causes"]) == (0, "adequate", ["z-axis-bias"])
    values = [e.value for term in read_model(tmp_path / "m.yaml").terms for e in term.estimates]
    assert values == pytest.approx([2.5, 2.5, 1.0, 1.0, 0.002, 0.0], abs=1e-9)


def test_a_model_is_named_or_a_file(rig: Rig, data: str, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("schema: rig.model/1\nname: mine\neffects: [{effect: bias}]\n")
    for model in ("linear", "physical", str(tmp_path / "mine.yaml")):
        found = rig("compare", data, "--model", model, "--json").document
        assert found["model"] == model


def test_one_value_for_all_axes_is_freed(rig: Rig, data: str, tmp_path: Path) -> None:
    out = tmp_path / "free.yaml"
    assert rig("add", "scale-factor", "--model", "common-scale", "--data", data, "--out", str(out)).status == 0
    assert read_model(out).effects == ("bias", "scale-factor")
    assert not any(term.tied for term in read_model(out).terms)


@pytest.mark.slow
def test_an_effect_of_ones_own_is_shown_found_added_and_read_again(
    rig: Rig, own: tuple[str, ...], tmp_path: Path
) -> None:
    data, out = made(tmp_path / "sag.csv", lambda z: 0.003 * z**3), str(tmp_path / "sag.yaml")
    assert "sag: the proof mass sags" in rig("effects", "sag", *own).out
    assert "sag" in {e["effect"] for e in rig("effects", "--json", *own).document["effects"]}
    best = rig("diagnose", data, "--model", "linear", "--json", *own).document["candidates"][0]
    assert best["effect"] == "sag"
    found = rig("discover", data, "--model", "linear", "--out", out, "--json", *own).document
    assert (found["verdict"], found["causes"]) == ("adequate", ["sag"])
    added = str(tmp_path / "added.yaml")
    assert rig("add", "sag", "--model", "linear", "--data", data, "--out", added, *own).status == 0
    assert rig("compare", data, "--model", added, "--json", *own).document["fails"] == []
    ended = rig("compare", data, "--model", out)
    assert ended.status == 2
    assert 'sag.yaml: unknown effect "sag"' in ended.err
    assert "--bench" in ended.err
