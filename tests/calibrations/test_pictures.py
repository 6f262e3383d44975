"""Pictures show the numbers that they are made of, with labels and units, and are the same bytes each time."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibrations.compare import compare
from calibrations.discover import Added, Discovery, discover
from calibrations.effect import catalogue
from calibrations.fit import Fit, fit
from calibrations.model import Model
from calibrations.model_file import read_model
from calibrations.pictures import candidate, failure, measurement, residual, waterfall
from calibrations.pictures.album import MOST_CURVES, album, tried
from calibrations.pictures.columns import telling_columns
from calibrations.pictures.compact import compact
from calibrations.pictures.inline import inline
from calibrations.pictures.save import PictureError, png, save, save_all, svg
from calibrations.pictures.view import groups
from calibrations.table import Array, Table
from calibrations.units import pooled_mg
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


def panels(figure: Figure) -> list[Axes]:
    return [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]


def drawn(ax: Axes) -> set[tuple[float, float]]:
    """Every point of every marker of a panel."""
    lines = [line for line in ax.lines if line.get_marker() == "o"]
    return {(float(x), float(y)) for line in lines for x, y in np.column_stack(line.get_data()).astype(float)}


def points(x: Array, y: Array) -> set[tuple[float, float]]:
    return set(zip(x.tolist(), y.tolist(), strict=True))


@pytest.mark.parametrize("name", ["two axes", "one axis", "three axes", "positions"])
@pytest.mark.parametrize("make", [measurement.picture, residual.picture, failure.picture])
def test_every_panel_has_a_label_with_a_unit(name: str, make: object) -> None:
    figure = make(fits()[name])  # type: ignore[operator]
    assert all("(" in ax.get_xlabel() or not ax.get_subplotspec().is_last_row() for ax in panels(figure))
    first = [ax for ax in panels(figure) if ax.get_subplotspec().is_first_col()]
    assert all("(" in ax.get_ylabel() for ax in first)
    assert png(figure).startswith(b"\x89PNG")


def test_measurement_is_dots_and_the_model_lines() -> None:
    found = warm().start
    beta, v = found.table.column("beta_deg"), found.table.outputs.T
    for c, ax in enumerate(panels(measurement.picture(found))):
        assert drawn(ax) == points(beta, v[c])
        lines = np.concatenate([line.get_ydata() for line in ax.lines if line.get_marker() != "o"])
        np.testing.assert_allclose(np.sort(lines), np.sort(v[c] - found.residual[c]), rtol=0, atol=1e-15)


def test_measurement_of_positions_is_their_magnitude() -> None:
    found = by_hand().start
    (ax,) = panels(measurement.picture(found))
    assert drawn(ax) == points(np.arange(1.0, 61), 1 + found.residual[0])
    assert ax.get_ylabel() == "|a| (g)"


def test_residual_is_in_millivolts_over_angle_time_and_temperature() -> None:
    found = warm().start
    axes = np.reshape(np.array(panels(residual.picture(found))), (2, 3))
    columns = [found.table.column("beta_deg"), found.table.time_s / 60, found.table.column("temperature_c")]
    for c in range(2):
        for ax, x in zip(axes[c], columns, strict=True):
            assert drawn(ax) == points(x, 1e3 * found.residual[c])
    assert [ax.get_xlabel() for ax in axes[1]] == ["β (deg)", "time (min)", "temperature (°C)"]
    assert axes[0, 0].get_ylabel() == "residual of x (mV)"
    assert axes[0, 2].child_axes[0].get_ylabel() == "mg"


def test_the_right_axis_is_the_left_over_the_scale_factor() -> None:
    figure = residual.picture(warm().start)
    svg(figure)  # lays it out
    left, right = panels(figure)[5].get_ylim(), panels(figure)[5].child_axes[0].get_ylim()
    np.testing.assert_allclose(np.array(left) / 0.99, right, rtol=1e-3)


def test_colours_are_inclinations_and_open_markers_anticlockwise() -> None:
    found = warm().start
    ax = panels(residual.picture(found))[0]
    lines = [line for line in ax.lines if line.get_marker() == "o"]
    assert len({line.get_markeredgecolor() for line in lines}) == 5
    for line, group in zip(lines, groups(found), strict=True):
        assert line.get_markerfacecolor() == (group.colour if group.side > 0 else "none")
        assert set(found.table.column("direction")[group.rows]) == {group.side}


def test_the_map_holds_the_mean_residual_over_the_floor() -> None:
    found = warm().start
    alpha, beta = found.table.column("alpha_deg"), found.table.column("beta_deg")
    rows = np.flatnonzero(found.table.column("direction") > 0)
    edges, cells = failure.mean_cells(found, 1, rows, np.unique(alpha))
    assert cells.shape == (5, 25)
    chosen = rows[(alpha[rows] == 60) & (beta[rows] == 45)]
    assert cells[1, 3] == pytest.approx(np.mean(found.residual[1, chosen]) / found.noise.floor[1])
    assert edges[3] < 45 < edges[4]
    figure = failure.picture(found)
    np.testing.assert_array_equal(panels(figure)[2].collections[0].get_array(), cells)
    assert [ax.get_title(loc="left") for ax in panels(figure)[:2]] == ["axis x, clockwise", "axis x, anticlockwise"]


def test_the_map_of_a_column_that_was_not_measured_is_empty() -> None:
    found = warm().start
    rows = np.flatnonzero(found.table.column("alpha_deg") == 90)
    _, cells = failure.mean_cells(found, 0, rows, np.unique(found.table.column("alpha_deg")))
    assert np.isfinite(cells).all(axis=1).tolist() == [False, False, True, False, False]


def test_the_map_of_positions_is_of_equal_area() -> None:
    figure = failure.picture(by_hand().start)
    shown = np.concatenate([np.asarray(ax.collections[0].get_offsets()) for ax in panels(figure)])
    assert len(shown) == 60
    assert np.all(np.hypot(*shown.T) <= 1.001)


def test_an_effect_is_drawn_over_what_it_follows() -> None:
    (step,) = warm().steps
    assert step.name == "temperature-bias"
    assert candidate.most_telling(step).name == "temperature_c"
    left, right, *_ = panels(candidate.picture(step))
    kelvin = step.before.table.column("temperature_c")
    assert drawn(left) == points(kelvin, 1e3 * step.before.residual[0])
    assert drawn(right) == points(kelvin, 1e3 * step.after.residual[0])
    curve = left.lines[-1]
    slope = np.polyfit(*curve.get_data(), 1)[0]
    assert slope == pytest.approx(0.2, rel=0.02)  # mV/K


def test_a_quadratic_is_drawn_over_the_axis_itself() -> None:
    columns = turns()
    x, y, _ = components(columns)
    table = poses(columns, 2.5 + x + 2e-3 * x**2, 2.5 + y + 1e-3 * y**2)
    before = fit(read_model("linear"), table)
    step = Added("quadratic-nonlinearity", before, fit(with_(before.model, "quadratic-nonlinearity"), table))
    column = candidate.most_telling(step)
    assert column.labels == ("specific force along x (g)", "specific force along y (g)")
    np.testing.assert_allclose(column.values[0], x[step.before.table.order], atol=1e-12)


def test_where_no_column_tells_the_change_itself_is_drawn() -> None:
    columns = turns()
    x, y, z = components(columns)
    table = poses(columns, 2.5 + x + 5e-3 * x * z, 2.5 + y - 5e-3 * y * z)
    before = fit(read_model("linear"), table)
    step = Added("z-axis-scale", before, fit(with_(before.model, "z-axis-scale"), table))
    column = candidate.most_telling(step)
    assert column.name == "change"
    ((_, along, curve),) = candidate.curves(step, column, 0)
    np.testing.assert_allclose(along, 1e3 * curve)  # the diagonal


def test_an_effect_is_drawn_over_what_it_needs() -> None:
    effect = replace(catalogue()["bias"], needs=("t_s", "temperature_c", "direction"))
    labels = [column.labels[1] for column in telling_columns(warm().start, effect)]
    forces = [f"specific force along {axis} (g)" for axis in "yxz"]
    assert labels == [*forces, "β (deg)", "time (min)", "temperature (°C)"]


def with_(model: Model, effect: str) -> Model:
    return model.with_effect(catalogue()[effect])


def test_a_function_of_a_column_is_explained_by_it_and_noise_is_not() -> None:
    x = np.linspace(0, 10, 500)[None]
    noise = np.random.default_rng(0).standard_normal((1, 500))
    sides = np.where(np.arange(500) % 2, 1.0, -1.0)
    assert candidate.explained(np.sin(x) * sides, x, sides) > 0.95
    assert candidate.explained(noise, x, sides) < 0.3
    assert candidate.explained(0 * x, x, sides) == 0


def test_the_waterfall_falls_from_level_to_level() -> None:
    found = warm()
    (ax,) = panels(waterfall.picture(found))
    first, fall, last = ax.patches[1:4]  # the first is the band
    before, after = found.start.pooled_excess, found.end.pooled_excess
    assert [first.get_y() + first.get_height(), fall.get_y(), fall.get_height()] == pytest.approx(  # type: ignore[attr-defined]
        [before, after, before - after]
    )
    assert last.get_y() + last.get_height() == pytest.approx(after)  # type: ignore[attr-defined]
    diamonds = next(line for line in ax.lines if line.get_marker() == "D")
    assert diamonds.get_ydata() == pytest.approx([waterfall.levels(found)[0].unseen, found.steps[0].held_out_after])
    words = [text.get_text() for text in ax.texts]
    assert f"noise floor\n{pooled_mg(found.start)[1]:.3f} mg" in words
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["linear", "+ temperature-\nbias", "left"]


def test_a_large_fall_is_logarithmic_and_a_small_one_is_not() -> None:
    assert panels(waterfall.picture(by_hand()))[0].get_yscale() == "log"
    small = discover(warm_table(3e-5), read_model("linear"), EFFECTS)
    assert panels(waterfall.picture(small))[0].get_yscale() == "linear"


def test_rms_in_mg_is_that_of_the_residual() -> None:
    found = by_hand().start
    error, floor = pooled_mg(found)
    assert error == pytest.approx(1e3 * np.sqrt(np.mean(found.residual**2)))
    assert error / floor == pytest.approx(found.pooled_excess)


def test_the_album_holds_every_picture_once() -> None:
    pictures = album(warm(), compare(warm_table(), read_model("linear")))
    names = [picture.name for picture in pictures]
    assert names == ["waterfall", "measurement", "residual", "failure", "effect-temperature-bias"]
    assert all(picture.title and picture.caption.endswith(".") for picture in pictures)


def test_only_the_greatest_falls_are_drawn() -> None:
    (step,) = warm().steps
    idle = [Added(f"e{k}", step.after, step.after) for k in range(MOST_CURVES)]
    found = replace(warm(), steps=(*idle[:2], step, *idle[2:]))
    shown = tried(found)
    assert step in shown


@pytest.mark.parametrize("make", [svg, png])
def test_the_same_figure_gives_the_same_bytes(make: object) -> None:
    first, second = (make(residual.picture(warm().start)) for _ in range(2))  # type: ignore[operator]
    assert first == second
    assert b"20" + b"2" not in first.split(b"<defs>")[0] if make is svg else True  # no date


def test_compact_cuts_digits_of_places_and_none_of_words() -> None:
    text = (
        '<g clip-path="url(#p)">\n  <use href="#m" x="1.23456" y="2.5" style="fill: red"/>\n'
        '  <use href="#m" x="3.99999" y="4" style="fill: red"/>\n</g><text x="0.123456">0.00025</text>'
    )
    small = compact(text)
    assert '<g clip-path="url(#p)" style="fill: red">' in small
    assert small.count("style=") == 1
    assert 'x="1.23"' in small
    assert ">0.00025</text>" in small


def test_words_of_users_are_not_taken_for_formulas() -> None:
    model = Model("a$b$ & <c>", warm().start.model.terms)
    found = replace(warm(), start=fit(model, warm_table()))
    assert b"a$b$ &amp; &lt;c&gt;" in svg(waterfall.picture(found))


def test_an_inline_picture_reaches_nowhere_and_owns_its_names() -> None:
    text = inline(failure.picture(warm().start), "map", 'where "it" fails')
    assert text.startswith('<svg role="img" aria-label="where &quot;it&quot; fails"')
    assert "http" not in text
    assert "<style" not in text
    names = {part.split('"')[0] for part in text.split('id="')[1:]}
    assert all(name.startswith("map-") for name in names)
    used = {part.split(")")[0] for part in text.split("url(#")[1:]}
    used |= {part.split('"')[0] for part in text.split('href="#')[1:]}
    assert used <= names


def test_save_writes_whole_files(tmp_path: Path) -> None:
    figure = waterfall.picture(warm())
    save(figure, tmp_path / "a.svg")
    save(figure, tmp_path / "b.PNG")
    assert (tmp_path / "a.svg").read_bytes() == svg(figure)
    assert (tmp_path / "b.PNG").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_file()) == ["a.svg", "b.PNG"]


def test_save_says_what_is_wrong(tmp_path: Path) -> None:
    figure = Figure()
    with pytest.raises(PictureError, match=r'a\.pdf: pictures end in \.png or \.svg, not in "\.pdf"'):
        save(figure, tmp_path / "a.pdf")
    with pytest.raises(PictureError, match=r"cannot be written: No such file or directory"):
        save(figure, tmp_path / "no" / "a.svg")
    (tmp_path / "file").touch()
    with pytest.raises(PictureError, match="the folder cannot be made"):
        save_all({"a": figure}, tmp_path / "file", "svg")
