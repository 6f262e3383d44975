"""What a table cannot show follows from its poses: fewer inclinations, fewer directions, fewer effects."""

from __future__ import annotations

from collections.abc import Sequence

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.determined import blind_to
from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations.synthetic import components, poses, turns


def table(inclinations_deg: Sequence[float]) -> Table:
    columns = turns(inclinations_deg)
    x, y, _ = components(columns)
    return poses(columns, 2.5 + x, 2.5 + y)


def blind(given: Table) -> set[str]:
    effects = catalogue()
    return set(blind_to(fit(read_model("linear", effects), given), effects))


def test_full_turns_at_several_inclinations_show_every_effect() -> None:
    assert blind(table((90, 30, 150, 60))) == set()


def test_one_inclination_hides_what_depends_on_the_out_of_plane_axis() -> None:
    assert blind(table((90,))) == {"z-axis-bias", "z-axis-scale"}


def test_the_sensing_plane_level_hides_all_but_the_bias() -> None:
    hidden = blind(table((0,)))
    assert {"scale-factor", "axis-misalignment", "hysteresis", "cubic-nonlinearity"} <= hidden
    assert "bias" not in hidden


def test_four_positions_a_turn_hide_odd_powers() -> None:
    columns = turns((90, 0, 180), step_deg=90.0)  # the output is -1, 0 or 1 g: its cube and itself are the same
    x, y, _ = components(columns)
    hidden = blind(poses(columns, 2.5 + x, 2.5 + y))
    assert {"cubic-nonlinearity", "odd-quadratic-nonlinearity"} <= hidden
    assert not {"bias", "scale-factor", "axis-misalignment", "quadratic-nonlinearity"} & hidden


def test_noise_hides_what_is_smaller() -> None:
    columns = turns((90, 30, 150, 60))
    x, y, _ = components(columns)
    hidden = blind(poses(columns, 2.5 + x, 2.5 + y, noise_v=0.5))
    assert {"hysteresis", "cubic-nonlinearity"} <= hidden
    assert not {"bias", "scale-factor"} & hidden


def test_effects_without_their_column_are_another_matter() -> None:
    assert "temperature_c" not in table((90,))
    assert "temperature-bias" not in blind(table((90,)))
