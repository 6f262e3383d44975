"""Two runs beside each other: what differs, and whether beyond doubt."""

from __future__ import annotations

from dataclasses import replace

import pytest

from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.table import Table
from rig.record import Record, Run
from rig.services.two_runs import Pair, parameters_of, results_of
from tests.hidden.rigs import clean_rig


def run(**results: tuple[float, float | None, str]) -> Run:
    with Record() as record:
        name = record.begin("sweep", {}, bench={}, identities={}, configuration="", constants={}, source="")
        made = {key.replace("_", "-"): {"value": v, "std": s, "unit": u} for key, (v, s, u) in results.items()}
        return replace(record.run(name), results=made)


def test_results_that_both_have_in_one_unit() -> None:
    first = run(bias_x=(2.5, 3e-5, "V"), drift=(1.0, None, "h"), only=(1.0, 1.0, "V"))
    second = run(bias_x=(2.5005, 4e-5, "V"), drift=(60.0, None, "min"))
    (pair,) = results_of(first, second)
    assert (pair.name, pair.difference, pair.std) == ("bias-x", pytest.approx(5e-4), pytest.approx(5e-5))
    assert pair.deviations == pytest.approx(10)


def test_sensors_of_a_batch_are_compared_by_their_own_names() -> None:
    each = {"a": 1, "b": 2}
    both = replace(run(), results={f"{s}/noise": {"value": v, "std": 0.1, "unit": "V"} for s, v in each.items()})
    (pair,) = results_of(both, both, ("a", "b"))
    assert (pair.name, pair.first, pair.second) == ("noise", 1, 2)


def test_a_pair_without_uncertainties_has_no_deviation() -> None:
    assert Pair("x", "V", 1.0, 2.0, None, None).deviations is None


def test_the_same_sensor_has_the_same_parameters() -> None:
    found = fit(read_model("linear"), Table.from_columns("poses", clean_rig(3), {}, "a rig"))
    pairs = parameters_of(found, found)
    assert [pair.name for pair in pairs] == ["bias x", "bias y", "scale-factor scale x", "scale-factor scale y"]
    assert all(pair.deviations == 0 for pair in pairs)
