"""Each result of each procedure has a meaning in words."""

from __future__ import annotations

import importlib

import pytest

from rig.results.evaluate import MODULES
from rig.results.result import EVALUATIONS
from rig.services.result_meaning import meaning

NOTHING_MORE = "a1/my-own-result"


@pytest.mark.parametrize("procedure", MODULES)
def test_each_result_of_a_procedure_has_a_meaning(procedure: str) -> None:
    importlib.import_module(f"rig.results.{MODULES[procedure]}")
    names = [name.replace("{axis}", "x") for name in EVALUATIONS[procedure].names]
    assert names
    for name in names:
        assert meaning(name).endswith("."), name
        assert meaning(f"a1/{name}") == meaning(name)


def test_a_meaning_names_the_axes() -> None:
    assert meaning("theta-xz") == "Component of sensing axis x along reference axis z."
    assert meaning("bias-x") != meaning("bias-drift-x")


def test_a_result_of_a_users_procedure_has_none() -> None:
    assert meaning(NOTHING_MORE) == ""
