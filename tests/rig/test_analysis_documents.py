"""What the analysis commands print with --json, against the documents that other people's programs read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.importing.foreign import write_csv
from calibrations.table import Table
from rig.record import Record
from tests.calibrations.synthetic import components, poses, turns
from tests.rig.conftest import Rig

NUMBER, BOTH = (int, float), {"x": float, "y": float}
CANDIDATE = {
    "effect": str,
    "axes": [str],
    "excess_before": float,
    "excess_after": float,
    "held_out_before": float,
    "held_out_after": float,
    "p_value": float,
    "probability": float,
    "indistinguishable_from": [str],
    "why": str,
}
TOLD = {"deviations": float, "probability": float}
EXPERIMENT = {"procedure": str, "settings": dict, "separates": [[str]], "why": str, "command": str}
EXPERIMENT |= {"duration_s": float, "expected": TOLD | {"alone": TOLD}}
STEP = {
    "added": str,
    "share": (float, type(None)),
    **dict.fromkeys(("excess_before", "excess_after", "held_out_before", "held_out_after"), float),
}
PARAMETER = {
    "effect": str,
    "axis": (str, type(None)),
    "name": str,
    "value": float,
    "std": (float, type(None)),
    "unit": str,
    "identified": bool,
    "why": (str, type(None)),
}


def table(missing: float = 0.0) -> Table:
    """Poses of a linear sensor, plus so many V/g^2 of the out-of-plane axis's square."""
    columns = turns(step_deg=30.0)
    x, y, z = components(columns)
    return poses(columns, 2.5 + x + missing * z**2, 2.5 + y + missing * z**2)


@pytest.fixture
def clean(tmp_path: Path) -> str:
    write_csv(table(), tmp_path / "clean.csv")
    return str(tmp_path / "clean.csv")


@pytest.fixture
def bent(tmp_path: Path) -> str:
    write_csv(table(0.002), tmp_path / "bent.csv")
    return str(tmp_path / "bent.csv")


def document(ended: Any, schema: str, status: int = 0) -> dict[str, Any]:
    """The one document on standard output, in which every number is one."""
    assert ended.status == status, ended.err
    assert ended.out.count("\n") == 1
    found: dict[str, Any] = json.loads(ended.out, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))
    assert found["schema"] == schema
    return found


def check(value: Any, kind: Any, where: str = "document") -> None:
    """`value` is of `kind`: a type, a list of one kind, or a mapping with exactly these keys."""
    if isinstance(kind, Mapping):
        assert set(value) == set(kind), where
        for key, inner in kind.items():
            check(value[key], inner, f"{where}.{key}")
    elif isinstance(kind, list):
        assert isinstance(value, list), where
        for inner in value:
            check(inner, kind[0], f"{where}[]")
    else:
        assert isinstance(value, kind), f"{where} is {value!r}"
        assert not isinstance(value, float) or math.isfinite(value)


def test_the_document_of_a_fit_has_its_keys(rig: Rig, clean: str, tmp_path: Path) -> None:
    out = tmp_path / "fitted.yaml"
    found = document(rig("fit", clean, "--model", "linear", "--out", str(out), "--json"), "rig.fit/1")
    check(found["parameters"], [PARAMETER])
    for key in ("rmse", "noise_floor", "slow_noise"):
        check(found[key], BOTH)
    assert found["model"] == str(out)
    bias, scale = (next(p for p in found["parameters"] if p["effect"] == e) for e in ("bias", "scale-factor"))
    assert bias["value"] == pytest.approx(2.5, abs=5 * bias["std"])
    assert scale["value"] == pytest.approx(1.0, abs=5 * scale["std"])
    assert (bias["unit"], scale["unit"], bias["axis"]) == ("V", "V/g", "x")
    assert found["noise_floor"]["x"] == pytest.approx(50e-6)


def test_a_parameter_that_the_data_does_not_determine_has_no_uncertainty(rig: Rig, tmp_path: Path) -> None:
    columns = {"alpha_deg": np.full(12, 90.0), "beta_deg": np.zeros(12)}
    write_csv(poses(columns, np.full(12, 3.5), np.full(12, 2.5)), tmp_path / "one.csv")
    found = document(rig("fit", str(tmp_path / "one.csv"), "--model", "linear", "--json"), "rig.fit/1")
    check(found["parameters"], [PARAMETER])
    doubtful = [p for p in found["parameters"] if not p["identified"]]
    assert {p["axis"] for p in doubtful} >= {"x"}
    assert all(p["std"] is None and p["why"] for p in doubtful)
    assert found["model"] is None


def test_the_document_of_a_comparison_has_its_keys(rig: Rig, clean: str, bent: str) -> None:
    found = document(rig("compare", bent, "--model", "linear", "--json"), "rig.comparison/1")
    place = {"where": str, "from": NUMBER, "to": NUMBER, "axis": str, "excess": float, "text": str}
    both = dict.fromkeys(("rmse", "noise_floor", "slow_noise", "excess"), BOTH)
    none = dict.fromkeys(("verdict", "residual_structure", "missing"), type(None))
    check(
        found, {"schema": str, "data": str, "model": str, "n": int, **both, "fails": [place], "missing": [str], **none}
    )
    assert (found["data"], found["model"], found["n"]) == (bent, "linear", 130)
    excesses = [place["excess"] for place in found["fails"]]
    assert excesses
    assert excesses == sorted(excesses, reverse=True)
    for axis in "xy":
        assert found["excess"][axis] == pytest.approx(found["rmse"][axis] / found["noise_floor"][axis])
    assert document(rig("compare", clean, "--model", "linear", "--json"), "rig.comparison/1")["fails"] == []


def test_positions_have_one_residual(rig: Rig, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    a = rng.standard_normal((24, 3))
    a = 1000 * a / np.linalg.norm(a, axis=1)[:, None] + [40, -30, 20] + 0.1 * rng.standard_normal((24, 3))
    rows = "\n".join(",".join(map(repr, row)) for row in a.tolist())
    (tmp_path / "positions.csv").write_text(f"# unit: count\nax,ay,az\n{rows}\n")
    found = document(rig("compare", str(tmp_path / "positions.csv"), "--json"), "rig.comparison/1")
    assert all(set(found[key]) == {"norm"} for key in ("rmse", "noise_floor", "slow_noise", "excess"))
    assert found["model"] == "common-scale"


def test_the_document_of_a_diagnosis_has_its_keys(rig: Rig, clean: str, bent: str) -> None:
    kinds = {"schema": str, "data": str, "model": str, "verdict": str, "candidates": [CANDIDATE]}
    kinds |= dict.fromkeys(("next_experiment", "own_effect"), (dict, type(None))) | {
        "residual_structure": (str, type(None)),
        "outliers": [int],
        "places": [dict],
        "left_out": [str],
        "text": str,
        "missing": [str],
        "provisional": bool,
        "alternatives": dict,
        "reason": (str, type(None)),
        "disturbances": [dict],
    }
    for data, verdict in ((bent, "effect-missing"), (clean, "adequate")):
        found = document(rig("diagnose", data, "--model", "linear", "--json"), "rig.diagnosis/1")
        check(found, kinds)
        assert found["verdict"] == verdict
        assert found["residual_structure"] is None
        assert found["next_experiment"] is None
    found = document(rig("diagnose", bent, "--model", "linear", "--json"), "rig.diagnosis/1")
    best = found["candidates"][0]
    assert (best["effect"], best["axes"]) == ("z-axis-bias", ["x", "y"])
    assert best["held_out_after"] < 1.15 < best["held_out_before"]
    assert sum(c["probability"] for c in found["candidates"]) <= 1 + 1e-9


def test_rivals_come_with_the_experiment_that_separates_them(rig: Rig, tmp_path: Path) -> None:
    columns = turns((90,), step_deg=5.0)
    x, y, _ = components(columns)
    write_csv(poses(columns, 2.5 + x + 0.002 * x**2, 2.5 + y - 0.002 * y**2), tmp_path / "square.csv")
    found = document(rig("diagnose", str(tmp_path / "square.csv"), "--model", "linear", "--json"), "rig.diagnosis/1")
    assert found["verdict"] == "ambiguous"
    check(found["next_experiment"], EXPERIMENT)
    best = found["candidates"][0]
    assert found["next_experiment"]["separates"] == [[best["effect"], r] for r in best["indistinguishable_from"]]


@pytest.mark.parametrize("command", ["add", "discover"])
def test_the_documents_of_add_and_discover_have_their_keys(rig: Rig, bent: str, tmp_path: Path, command: str) -> None:
    out = tmp_path / "model.yaml"
    ways = {
        "add": ("add", "z-axis-bias", "--data", bent, "--model", "linear"),
        "discover": ("discover", bent, "--model", "linear"),
    }
    found = document(rig(*ways[command], "--out", str(out), "--json"), "rig.discovery/1")
    check(found["steps"], [STEP])
    (step,) = found["steps"]
    assert step["added"] == "z-axis-bias"
    assert step["held_out_after"] < 1.15 < step["held_out_before"]
    said = {key: found[key] for key in ("data", "verdict", "causes", "refinements", "alternatives", "model")}
    assert said == {
        "data": bent,
        "verdict": "adequate",
        "causes": ["z-axis-bias"],
        "refinements": [],
        "alternatives": {},
        "model": str(out),
    }
    assert found["next_experiment"] is None


def test_import_and_the_run_as_data(rig: Rig, bent: str) -> None:
    imported = document(rig("import", bent, "--json"), "rig.import/1")
    check(imported, {"schema": str, "run": str, "kind": str, "rows": int, "columns": [str]})
    assert (imported["kind"], imported["rows"]) == ("poses", 130)
    from_file = document(rig("compare", bent, "--model", "linear", "--json"), "rig.comparison/1")
    from_run = document(rig("compare", imported["run"], "--model", "linear", "--json"), "rig.comparison/1")
    assert from_run | {"data": bent} == from_file
    assert from_run["data"] == imported["run"]


def test_the_documents_of_effects_and_models_have_their_keys(rig: Rig) -> None:
    effects = document(rig("effects", "--json"), "rig.effects/1")["effects"]
    assert {"bias", "hysteresis", "temperature-bias", "axis-misalignment"} <= {e["effect"] for e in effects}
    assert all(e["summary"] and e["symptom"] and e["parameters"] for e in effects)
    (one,) = document(rig("effects", "hysteresis", "--json"), "rig.effects/1")["effects"]
    assert one in effects
    models = document(rig("models", "--json"), "rig.models/1")["models"]
    by_name = {model["model"]: model["effects"] for model in models}
    assert by_name["linear"] == by_name["common-scale"] == ["bias", "scale-factor"]
    assert set(by_name["linear"]) < set(by_name["physical"])


@pytest.mark.parametrize("command", ["fit", "compare", "diagnose", "discover"])
def test_the_exit_status_is_0_whatever_the_verdict_and_1_with_check(
    rig: Rig, clean: str, bent: str, command: str
) -> None:
    for check_asked, data, status in (((), bent, 0), (("--check",), clean, 0)):
        assert rig(command, data, "--model", "linear", *check_asked).status == status
    failing = bent
    if command == "discover":  # which finds what is missing, unless nothing in the catalogue is
        path = Path(bent).with_name("step.csv")
        columns = turns((90, 30, 150), 60.0)
        x, y, _ = components(columns)
        write_csv(poses(columns, 2.5 + x + 0.005 * (columns["t_s"] > np.median(columns["t_s"])), 2.5 + y), path)
        failing = str(path)
    ended = rig(command, failing, "--model", "linear", "--check", "--json")
    assert ended.status == 1
    assert ended.document


def test_an_analysis_stores_nothing_in_the_record(rig: Rig, bent: str, tmp_path: Path) -> None:
    before = sorted(tmp_path.iterdir())
    for command in ("fit", "compare", "diagnose", "discover"):
        rig(command, bent, "--model", "linear")
    assert sorted(tmp_path.iterdir()) == before
    with Record() as record:
        assert record.runs() == []
