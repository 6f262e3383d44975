"""Tables of one sensor as one."""

from __future__ import annotations

import numpy as np

from calibrations.errors import DataError
from calibrations.joined import has_clock_restart, join_tables
from calibrations.table import Table


def table(t_s: list[float], source: str = "a", constants: dict[str, float] | None = None, **more: list[float]) -> Table:
    n = len(t_s)
    columns = {"alpha_deg": [90.0] * n, "beta_deg": [0.0] * n, "vx_v": np.arange(n), "vy_v": np.arange(n), "t_s": t_s}
    return Table.from_columns("poses", columns | more, constants, source)


def test_a_single_table_is_joined_to_itself() -> None:
    one = table([0.0, 7.0])
    assert join_tables([one]) is one


def test_times_that_go_on_stay_and_others_follow_at_the_usual_distance() -> None:
    on, anew = [table([0.0, 7.0]), table([100.0, 107.0])], [table([5.0, 12.0]), table([5.0, 12.0], "b")]
    assert join_tables(on).time_s.tolist() == [0, 7, 100, 107]
    assert join_tables(anew).time_s.tolist() == [5, 12, 19, 26]
    assert (has_clock_restart(on), has_clock_restart(anew)) == (False, True)
    assert join_tables(anew).source == "a + b"


def test_a_sensor_that_was_never_turned_over_lay_face_up() -> None:
    both = join_tables([table([0.0]), table([9.0], flip=[1.0], temperature_c=[20.0])])
    assert both.column("flip").tolist() == [0, 1]
    assert "temperature_c" not in both


def test_constants_that_differ_are_not_kept_but_noise_that_each_measured_is_averaged() -> None:
    first = table([0.0], constants={"gravity_m_s2": 9.8, "approach_deg": 5.0, "noise_inflation_x": 20.0})
    second = table([9.0], constants={"gravity_m_s2": 9.8, "approach_deg": 3.0, "noise_inflation_x": 22.0})
    assert join_tables([first, second]).constants == {"gravity_m_s2": 9.8, "noise_inflation_x": 21.0}


def test_tables_that_are_not_alike_are_refused(golden) -> None:
    one_axis = Table.from_columns("poses", {"alpha_deg": [90.0], "beta_deg": [0.0], "vx_v": [1.0]}, source="one axis")
    with golden.refused(DataError):
        join_tables([table([0.0]), one_axis])
