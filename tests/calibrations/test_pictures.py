"""Charts show the numbers that they are made of, with labels and units; both renderers draw all of it."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calibrations.analyses.hand_turns import fit_turns
from calibrations.discovery.findings import Step
from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit, pool_in_milli
from calibrations.loop import discover
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.noise.comparison import DeviationComparison
from calibrations.presentation.chart import Chart, Line, Panel, Points, Second, single_chart
from calibrations.presentation.charts import contribution
from calibrations.presentation.charts import fit as charts
from calibrations.presentation.charts.discovery import (
    effect_chart,
    steps_album,
)
from calibrations.presentation.charts.noise import ratio
from calibrations.presentation.interactive import figure
from calibrations.presentation.residual import ChannelResidual, choices, first_choices, select_telling_columns
from calibrations.presentation.static import draw, png
from calibrations.table import Array, Table
from tests.calibrations import test_turns
from tests.calibrations.synthetic import components, poses, turns

EFFECTS = {name: catalogue()[name] for name in ("temperature-bias", "quadratic-nonlinearity", "z-axis-bias")}


def warm_table(size_v_k: float = 2e-4) -> Table:
    """Two axes, 250 poses, whose bias follows a temperature that comes and goes."""
    columns = turns()
    x, y, _ = components(columns)
    kelvin = 2.5 * np.sin(columns["t_s"] / 300)
    table = poses(columns, 2.5 + x + size_v_k * kelvin, 2.48 + 0.99 * y - size_v_k * kelvin)
    return Table.from_columns("poses", {**table.columns, "temperature_c": 22 + kelvin}, source="made")


def hand_table() -> Table:
    """60 positions of three axes with a scale error, in counts."""
    a = np.random.default_rng(1).standard_normal((60, 3))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    out = 30000 + 400 * a * [1.0, 1.01, 0.99] + 0.01 * np.random.default_rng(2).standard_normal((60, 3))
    columns: dict[str, Array] = dict(zip(("ax", "ay", "az"), out.T, strict=True))
    columns |= {name: np.full(60, 0.1) for name in ("ax_std", "ay_std", "az_std")} | {"n": np.full(60, 100.0)}
    return Table.from_columns("positions", columns, source="by hand")


def one_axis() -> Table:
    table = warm_table()
    return Table.from_columns("poses", {n: v for n, v in table.columns.items() if not n.startswith("vy")}, source="x")


def three_axes() -> Table:
    """A third axis too, no direction, no time, one inclination less than a map needs."""
    columns = {name: values for name, values in turns((90,)).items() if name.endswith("deg")}
    x, y, z = components(columns)
    table = poses(columns, 2.5 + x, 2.5 + y)
    more = {"vz_v": 2.5 + z + 1e-4 * x**2, "vz_std_v": table.column("vx_std_v")}
    return Table.from_columns("poses", {**table.columns, **more}, source="xyz")


@cache
def warm() -> Discovery:
    return discover(warm_table(), read_model("linear"), EFFECTS)


@cache
def by_hand() -> Discovery:
    return discover(hand_table(), read_model("common-scale"), {"scale-factor": catalogue()["scale-factor"]})


def fits() -> dict[str, Fit]:
    linear = read_model("linear")
    return {
        "two axes": warm().start,
        "one axis": fit(linear, one_axis()),
        "three axes": fit(linear, three_axes()),
        "positions": by_hand().start,
    }


def panels(chart: Chart) -> list[Panel]:
    return [panel for row in chart.panels for panel in row]


def dots(panel: Panel) -> Points:
    return next(series for series in panel.series if isinstance(series, Points))


def drawn(panel: Panel) -> set[tuple[float, float]]:
    """Every marker of a panel."""
    return points(dots(panel).x, dots(panel).y)


def points(x: Array, y: Array) -> set[tuple[float, float]]:
    return set(zip(x.tolist(), y.tolist(), strict=True))


@pytest.mark.parametrize("name", ["two axes", "one axis", "three axes", "positions"])
@pytest.mark.parametrize("make", [charts.measurement_chart, charts.residual_chart, charts.failure_chart])
def test_every_axis_has_a_unit_and_both_renderers_draw_every_point(name: str, make: Callable[[Fit], Chart]) -> None:
    chart = make(fits()[name])
    assert all("(" in panel.y.label for panel in panels(chart))
    assert all("(" in panel.x.label for panel in panels(chart))
    assert png(chart).startswith(b"\x89PNG")
    traces = [trace for trace in figure(chart, "k")["data"] if trace["mode"] == "markers"]
    assert [trace["x"] for trace in traces] == [dots(panel).x.tolist() for panel in panels(chart)]
    for ax, panel in zip(draw(chart).axes, panels(chart), strict=False):
        shown = np.concatenate([np.asarray(found.get_offsets()) for found in ax.collections]).reshape(-1, 2)
        assert {(float(x), float(y)) for x, y in shown} >= drawn(panel)


def test_measurement_is_dots_and_the_model_lines() -> None:
    found = warm().start
    beta, v = found.table.column("beta_deg"), found.table.outputs.T
    for c, panel in enumerate(panels(charts.measurement_chart(found))):
        assert drawn(panel) == points(beta, v[c])
        (line,) = [series for series in panel.series if isinstance(series, Line)]
        lines = line.y[np.isfinite(line.y)]
        np.testing.assert_allclose(np.sort(lines), np.sort(v[c] - found.residual[c]), rtol=0, atol=1e-15)


def test_measurement_of_positions_is_their_magnitude() -> None:
    found = by_hand().start
    (panel,) = panels(charts.measurement_chart(found))
    assert drawn(panel) == points(np.arange(1.0, 61), 1 + found.residual[0])
    assert panel.y.label == "|a| by the model (g)"


def test_residual_is_in_millivolts_over_angle_time_and_temperature() -> None:
    found = warm().start
    rows = charts.residual_chart(found).panels
    columns = [found.table.column("beta_deg"), found.table.time_s / 60, found.table.column("temperature_c")]
    for c in range(2):
        for panel, x in zip(rows[c], columns, strict=True):
            assert drawn(panel) == points(x, 1e3 * found.residual[c])
    assert [panel.x.label for panel in rows[1]] == ["β (deg)", "time (min)", "temperature (°C)"]
    assert rows[0][0].y.label == "residual of x (mV)"
    assert rows[0][2].second is not None
    assert rows[0][2].second.label == "mg"


def test_the_right_axis_is_the_left_over_the_scale_factor() -> None:
    second = charts.residual_chart(warm().start).panels[1][2].second
    assert second == Second(pytest.approx(0.99, rel=1e-3), 0.0, "mg")
    drawing = draw(charts.residual_chart(warm().start))
    drawing.draw_without_rendering()
    left, right = drawing.axes[5].get_ylim(), drawing.axes[5].child_axes[0].get_ylim()
    np.testing.assert_allclose(np.array(left) / 0.99, right, rtol=1e-3)


def test_turns_have_one_axis_as_their_residual_is_in_the_sensed_unit() -> None:
    fitted = fit_turns(test_turns.table(test_turns.samples(noise=0.02)))
    panels = [panel for row in charts.residual_chart(fitted).panels for panel in row]
    assert len(panels) >= 5
    assert all(panel.second is None for panel in panels)


def test_colours_are_inclinations_and_open_markers_anticlockwise() -> None:
    found = warm().start
    shown = dots(charts.residual_chart(found).panels[0][0])
    assert shown.values is not None
    np.testing.assert_array_equal(shown.values, found.table.column("alpha_deg"))
    hollow = [str(symbol).endswith("-open") for symbol in shown.symbol]
    np.testing.assert_array_equal(hollow, found.table.column("direction") < 0)


def test_the_map_holds_the_residual_over_the_floor_at_each_pose() -> None:
    found = warm().start
    for c, panel in enumerate(panels(charts.failure_chart(found))):
        shown = dots(panel)
        np.testing.assert_allclose(shown.values, found.residual[c] / found.noise.floor[c])
        np.testing.assert_array_equal(shown.x, found.table.column("beta_deg"))
        side = found.table.column("direction")
        inclination = [float(panel.y.names[k]) for k in np.rint(shown.y).astype(int)]  # the name of its row is true
        np.testing.assert_array_equal(inclination, found.table.column("alpha_deg"))
        np.testing.assert_array_equal(np.sign(shown.y - np.rint(shown.y)), side)
        assert [symbol == "triangle-up" for symbol in shown.symbol] == (side > 0).tolist()


def test_an_effect_is_a_line_only_over_a_column_that_it_is_a_function_of() -> None:
    step, table = warm().steps[0], warm().start.table
    found = choices(warm().start)
    for name, wanted in (("temperature_c", Line), ("beta", Points)):
        series = charts.residual(ChannelResidual(warm().start, 0, False), found[name], found["alpha_deg"], step).series
        assert isinstance(series[-1], wanted)
    change = contribution.change_of(step)[0]
    np.testing.assert_allclose(series[-1].y, 1e3 * change)  # type: ignore[union-attr] # a cross at the change of each row
    assert len(change) == table.n


def soaked() -> Fit:
    """Four poses, visited 20 times each, of a sensor whose bias drifts."""
    beta = np.tile([0.0, 90.0, 180.0, 270.0], 20)
    soak = {"alpha_deg": np.full(80, 90.0), "beta_deg": beta, "direction": np.ones(80), "t_s": 60.0 * np.arange(80)}
    x, y, _ = components(soak)
    return fit(read_model("linear"), poses(soak, 2.5 + x + 1e-5 * soak["t_s"], 2.5 + y))


def test_poses_that_are_held_again_and_again_are_drawn_over_time() -> None:
    warming = soaked()
    assert first_choices(list(choices(warming)), warming.table) == ("time", "beta")
    once = fits()["two axes"]
    assert first_choices(list(choices(once)), once.table) == ("beta", "alpha_deg")


def test_over_time_the_model_is_a_thin_line_for_each_pose_and_the_pattern_has_a_row_for_each() -> None:
    found = soaked()
    panel = panels(charts.measurement_chart(found))[0]
    line, marks = panel.series
    assert isinstance(line, Line)
    assert isinstance(marks, Points)
    assert np.count_nonzero(np.isnan(line.x)) == 4
    (pattern,) = panels(charts.failure_chart(found))[:1]
    assert pattern.y.names == ("90, 0 ▲", "90, 90 ▲", "90, 180 ▲", "90, 270 ▲")
    assert pattern.x.label == "time (min); ▲ turning clockwise, ▼ anticlockwise"
    np.testing.assert_array_equal(dots(pattern).y, np.tile([0.0, 1.0, 2.0, 3.0], 20))
    assert len(np.unique(dots(pattern).x)) == 80


def test_the_line_of_the_model_is_broken_where_poses_are_excluded() -> None:
    table = warm().start.table
    excluded = (
        (table.column("alpha_deg") == 90.0) & (table.column("direction") > 0) & (table.column("beta_deg") == 90.0)
    )
    assert np.count_nonzero(excluded) == 1
    for rows, breaks in ((np.ones(table.n, dtype=bool), 0), (~excluded, 1)):
        kept = fit(read_model("linear"), table.rows(rows))
        line = next(series for series in panels(charts.measurement_chart(kept))[0].series if isinstance(series, Line))
        stretches = len({*zip(kept.table.column("alpha_deg"), kept.table.column("direction"), strict=True)})
        assert np.count_nonzero(np.isnan(line.x)) == stretches + breaks


def test_the_map_of_positions_is_of_equal_area() -> None:
    (panel,) = panels(charts.failure_chart(by_hand().start))
    shown = dots(panel)
    assert len(shown.x) == 60
    right = np.where(shown.x > 1.1, charts.HALF_SPHERES, 0.0)
    assert np.all(np.hypot(shown.x - right, shown.y) <= 1.001)


def test_an_effect_is_drawn_over_what_it_follows() -> None:
    (step,) = warm().steps
    assert step.name == "temperature-bias"
    assert contribution.select_telling_column(step).name == "temperature_c"
    left, right, *_ = panels(effect_chart(step))
    kelvin = step.before.table.column("temperature_c")
    assert drawn(left) == points(kelvin, 1e3 * step.before.residual[0])
    assert drawn(right) == points(kelvin, 1e3 * step.after.residual[0])
    curve = left.series[-1]
    assert isinstance(curve, Line)
    assert np.polyfit(curve.x, curve.y, 1)[0] == pytest.approx(0.2, rel=0.02)  # mV/K


def test_outputs_that_an_effect_does_not_change_are_not_drawn() -> None:
    (step,) = warm().steps
    assert len(effect_chart(step).panels) == 2
    unchanged = step.after.residual.copy()
    unchanged[1] = step.before.residual[1] + 1e-9 * step.after.noise.floor[1]  # rounding
    of_x = replace(step, after=replace(step.after, residual=unchanged))
    assert len(effect_chart(of_x).panels) == 1
    caption = next(picture.caption for picture in steps_album(warm()) if picture.name.startswith("effect-"))
    assert "left out" not in caption


def test_a_quadratic_is_drawn_over_the_axis_itself() -> None:
    columns = turns()
    x, y, _ = components(columns)
    table = poses(columns, 2.5 + x + 2e-3 * x**2, 2.5 + y + 1e-3 * y**2)
    before = fit(read_model("linear"), table)
    step = Step("quadratic-nonlinearity", before, fit(with_(before.model, "quadratic-nonlinearity"), table))
    column = contribution.select_telling_column(step)
    assert column.labels == ("specific force along x (g)", "specific force along y (g)")
    np.testing.assert_allclose(column.values[0], x[step.before.table.order], atol=1e-12)


def test_where_no_column_tells_the_change_itself_is_drawn() -> None:
    columns = turns()
    x, y, z = components(columns)
    table = poses(columns, 2.5 + x + 5e-3 * x * z, 2.5 + y - 5e-3 * y * z)
    before = fit(read_model("linear"), table)
    step = Step("z-axis-scale", before, fit(with_(before.model, "z-axis-scale"), table))
    column = contribution.select_telling_column(step)
    assert column.name == "change"
    ((_, along, curve),) = contribution.curves(step, column, 0)
    np.testing.assert_allclose(along, 1e3 * curve)  # the diagonal


def test_an_effect_is_drawn_over_what_it_needs() -> None:
    effect = copy(catalogue()["bias"])
    effect.needs = ("t_s", "temperature_c", "direction")
    labels = [column.labels[1] for column in select_telling_columns(warm().start, effect)]
    forces = [f"specific force along {axis} (g)" for axis in "yxz"]
    assert labels == [*forces, "β (deg)", "time (min)", "temperature (°C)"]


def with_(model: Model, effect: str) -> Model:
    return model.with_effect(catalogue()[effect])


def test_a_function_of_a_column_is_explained_by_it_and_noise_is_not() -> None:
    x = np.linspace(0, 10, 500)[None]
    noise = np.random.default_rng(0).standard_normal((1, 500))
    sides = np.where(np.arange(500) % 2, 1.0, -1.0)
    assert contribution.explained_share(np.sin(x) * sides, x, sides) > 0.95
    assert contribution.explained_share(noise, x, sides) < 0.3
    assert contribution.explained_share(0 * x, x, sides) == 0


def test_the_ratio_of_deviations_has_marks_on_both_sides_of_1() -> None:
    times, ones = np.array([1.0, 10.0, 100.0]), np.ones(3)
    curve = DeviationComparison(times, 1.1 * ones, 0.9 * ones, 1.4 * ones, ones, 10 * ones, ones)
    marks = figure(single_chart(ratio(curve)), "ratio")["layout"]["yaxis"]["tickvals"]
    assert min(marks) < 1 < max(marks)


def test_rms_in_mg_is_that_of_the_residual() -> None:
    found = by_hand().start
    error, floor = pool_in_milli(found)
    assert error == pytest.approx(1e3 * np.sqrt(np.mean(found.residual**2)))
    assert error / floor == pytest.approx(found.pooled_excess)
