"""Wrong units, values that stand for a missing reading, and coarse readings that are equal by chance."""

import numpy as np
import pytest

from calibrations.discovery.input_doubts import doubts
from calibrations.table import Array, Table
from tests.calibrations import synthetic


def with_supply(volts: Array) -> Table:
    columns = synthetic.turns((90, 30, 150), step_deg=20)
    x, y, _ = synthetic.components(columns)
    table = synthetic.poses(columns, 2.5 + x, 2.52 + 0.97 * y)
    return Table.from_columns("poses", {**table.columns, "supply_v": volts})


def supply(decimals: int) -> Array:
    rows = len(synthetic.turns((90, 30, 150), step_deg=20)["beta_deg"])
    return np.round(5.0 + 1e-4 * np.random.default_rng(2).standard_normal(rows), decimals)


def test_a_value_in_place_of_missing_readings_is_doubted() -> None:
    volts = supply(9)
    volts[[3, 40, 77, 100]] = 5.5
    assert "supply_v is exactly 5.5 in 4 of 114 rows" in " ".join(doubts(with_supply(volts)))


def test_coarse_readings_that_meet_by_chance_are_not() -> None:
    volts = supply(6)
    assert np.unique(volts, return_counts=True)[1].max() < 4
    volts[[3, 40, 77, 100]] = volts.max()
    volts[[5, 41, 78]] = volts.min()
    assert not any("supply_v" in doubt for doubt in doubts(with_supply(volts)))


@pytest.mark.parametrize(("unit", "size"), [("nT", 48_000.0), ("mG", 480.0), ("G", 0.48), ("mT", 0.048)])
def test_the_unit_in_which_a_field_is_that_of_the_earth_is_named(unit: str, size: float) -> None:
    directions = np.random.default_rng(4).standard_normal((30, 3))
    field = size * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    table = Table.from_columns("positions", dict(zip(("mx", "my", "mz"), field.T, strict=True)), {"unit": "uT"})
    assert f"the outputs look like {unit}:" in " ".join(doubts(table))
