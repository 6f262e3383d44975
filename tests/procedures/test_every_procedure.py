"""What holds for every procedure in the folder, whoever adds it."""

from __future__ import annotations

import json
from typing import Literal, get_origin, get_type_hints

import pytest

from procedures.catalogue import find, paths
from procedures.settings import parse
from rig.bench import read_bench
from rig.bench.file import HAND
from rig.planning.plan import plan

NAMES = list(paths())


@pytest.mark.parametrize("name", NAMES)
def test_each_procedure_names_the_effects_that_it_excites_and_does_not_excite(name: str) -> None:
    procedure = find(name)
    assert procedure.doc.startswith(f"{name}: ")
    assert len(procedure.summary) < 80
    assert all(f"\n{part} " in procedure.doc for part in ("Excites", "Blind to", "Source"))


@pytest.mark.parametrize("name", NAMES)
def test_its_settings_have_types_units_and_defaults(name: str) -> None:
    procedure = find(name)
    types = get_type_hints(procedure.function)
    for setting, default in procedure.defaults.items():
        kind = types[setting]
        assert kind in (float, int, bool, str) or get_origin(kind) in (tuple, Literal)
        assert parse(procedure, {setting: json.loads(json.dumps(default))})[setting] == default
        if kind is float:
            assert setting.rpartition("_")[2] in ("deg", "s", "c", "hz", "v", "um", "g", "percent")


@pytest.mark.parametrize("name", NAMES)
def test_it_can_be_planned_on_the_simulated_rig(name: str) -> None:
    procedure = find(name)
    bench = read_bench(HAND if name.startswith("hand-") else None)
    assert plan(bench, procedure, parse(procedure, {})).duration_s > 0
