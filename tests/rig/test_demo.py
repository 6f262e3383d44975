"""`rig demo`: the faults that the bench file hides are those that the analysis finds; and the progress of long work."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from drivers.world.config import ADXL203, WorldConfig
from drivers.world.world import World
from procedures.sweep import grid
from rig.bench import read_bench
from rig.bench.file import DEMO
from rig.services.hidden_faults import MATERIAL, MECHANISMS, Faults, Group, OutputChange, group_steps, hidden_faults
from tests.rig.conftest import Rig

SAME = {
    "unequal or uneven plates": "quadratic-nonlinearity",
    "package bends as it warms": "temperature-bias",
    "sensor soldered at an angle": "axis-misalignment",
}


def swept() -> Table:
    """The demonstration's poses in its world."""
    bench = read_bench(DEMO)
    poses = list(grid((90.0, 30.0, 150.0, 60.0), 30.0))
    angles = [p.alpha_deg for p in poses], [p.beta_deg for p in poses]
    world = World(WorldConfig.from_mapping(bench.world), bench.seed)
    columns = world.dwell_mean(*angles, direction=[p.direction for p in poses], dwell_s=1.0, interval_s=0.01)
    return Table.from_columns("poses", {name: np.asarray(v, float) for name, v in columns.items()})


def test_each_hidden_fault_of_the_demonstration_is_found_at_its_size() -> None:
    table, linear = swept(), read_model("linear")
    model = linear
    for name in SAME.values():
        model = model.with_effect(catalogue()[name])
    found = hidden_faults(read_bench(DEMO), fit(model, table), fit(linear, table))
    assert {g.faults[0].name: g.effects[0].name for g in found.material if g.effects} == SAME
    for group in found.material:
        assert len(group.faults) == len(group.effects) == 1
        assert group.found is not None
        assert group.std is not None
        assert 0 < group.std < 0.2 * group.hidden
        assert abs(group.found - group.hidden) < 4 * group.std


def effect(name: str, curve: Array, *span: Array) -> OutputChange:
    return OutputChange(name, curve, np.stack([curve, *span], axis=2))


def test_a_fault_that_no_effect_follows_is_not_found() -> None:
    curves = np.eye(4)[:, :, None]
    hidden, other = OutputChange("friction", curves[0]), effect("own", curves[1])
    groups, extra = group_steps([hidden], [other], 0.01)
    assert [g.effects for g in groups] == [()]
    assert extra == (other,)
    assert "not found" in Faults(groups, extra, 0.01, "V").text()


def test_faults_that_share_an_effect_are_one_group_if_they_agree_together() -> None:
    x, y, z = np.eye(8)[:3, :, None]
    hidden = [OutputChange("tilt", 2 * x), OutputChange("turn", x + y), OutputChange("friction", z)]
    angle, zero = effect("angle", 2.9 * x, y), effect("zero", y)
    groups, extra = group_steps(hidden, [angle, zero], 0.01)
    assert [[f.name for f in g.faults] for g in groups if g.effects] == [["tilt", "turn"]]
    assert [e.name for g in groups for e in g.effects] == ["angle"]
    assert extra == (zero,)
    opposite = effect("angle", -2.9 * x, y)
    assert not any(g.effects for g in group_steps(hidden, [opposite, zero], 0.01)[0])


def test_many_effects_of_a_group_are_wrapped_over_several_lines() -> None:
    fault = OutputChange("tilt", np.ones((4, 1)))
    effects = tuple(effect(f"effect-of-the-stage-{k}", np.ones((4, 1)), np.ones((4, 1))) for k in range(5))
    lines = Faults((Group((fault,), effects, 1.0),), (), 0.01, "V").text().splitlines()
    assert max(map(len, lines)) < 100
    assert [len(line.split()) > 3 for line in lines[1:]] == [True, False, False]


def test_every_fault_of_the_default_rig_has_a_name() -> None:
    named = {path for paths in MECHANISMS.values() for path in paths}
    other = ("magnetometer", "gyroscope", "noise", "converter", "level", "sensor.x.friction", "sensor.y.friction")
    other += ("sensor.z.",)  # a third axis, which the default bench does not read
    unnamed = [p for p in leaves(ADXL203) if p not in named and not p.startswith(other)]
    assert [p for p in unnamed if not p.endswith("wobble_phase_deg") and not p.startswith("heat.")] == []
    assert all(dataclasses.is_dataclass(WorldConfig()) and _exists(path) for path in named)


def leaves(settings: dict[str, Any], path: str = "") -> list[str]:
    """The paths of all numbers in nested settings."""
    found = []
    for name, value in settings.items():
        found += leaves(value, f"{path}{name}.") if isinstance(value, dict) else [f"{path}{name}"]
    return found


def _exists(path: str) -> bool:
    value: Any = WorldConfig.ideal()
    for name in path.split("."):
        value = getattr(value, name)
    return isinstance(value, float)


@pytest.mark.slow
def test_the_demonstration_finds_the_hidden_faults(rig: Rig, tmp_path: Path) -> None:
    document = rig("demo", "--folder", str(tmp_path / "demo"), "--json").document
    assert {row["fault"]: row["effect"] for row in document["hidden_faults"]} == SAME
    assert all(abs(row["found"] - row["size"]) < 4 * row["std"] for row in document["hidden_faults"])
    assert document["verdict"] == "adequate"
    assert document["steps"][0]["excess_before"] > 10
    assert document["steps"][-1]["held_out_after"] < 1.15
    assert "<html" in Path(document["report"]).read_text(encoding="utf-8")


@pytest.mark.release
def test_the_realistic_demonstration_names_the_faults_that_it_did_not_find(rig: Rig, tmp_path: Path) -> None:
    document = rig("demo", "--realistic", "--folder", str(tmp_path / "demo"), "--json").document
    rows = document["hidden_faults"]
    large = [row for row in rows if row["size_over_floor"] >= MATERIAL]
    assert len(large) > 12
    assert document["steps"][-1]["held_out_after"] < 1.4
    assert sum(bool(row["effects"]) for row in large) >= len(large) - 3
    named = {"hysteresis", "z-axis-scale", "axis-misalignment", "base-tilt"}
    assert (
        named
        <= set(document["causes"])
        <= named
        | {"z-axis-bias", "cross-axis-bias", "quadratic-nonlinearity", "axis-nonorthogonality"}
        | {"stage-eccentricity", "supply-sensitivity"}  # wobble of the stages, wandering supply: 2 and 3 noise floors
    )
    assert document["places"]
