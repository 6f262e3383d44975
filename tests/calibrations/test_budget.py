"""The uncertainty budget: its parts add to what the fit says, and to what repeated calibrations would scatter by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.budget import Budget, BudgetRow, make_budget, slow_freedom
from calibrations.fitting.fit import fit
from calibrations.fitting.inputs import input_contributions
from calibrations.geometry.orientation import rotation
from calibrations.means.noise import Noise
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic
from tests.calibrations.test_real_data import mikoff

COLUMNS = synthetic.turns((90, 30, 150), step_deg=30)
N = len(COLUMNS["alpha_deg"])
PLACES = {name: np.unique(COLUMNS[name] % 360, return_inverse=True)[1] for name in ("alpha_deg", "beta_deg")}
ROOM = np.sin(np.arange(N) / 11)  # K
GIVEN = {
    "alpha_std_deg": 0.01,
    "beta_std_deg": 0.02,
    "repeat_std_deg": 0.01,
    "tilt_std_deg": 0.03,
    "mount_std_deg": 0.05,
    "gravity_std_m_s2": 2e-3,
    "gain_std": 2e-4,
    "offset_std_v": 3e-4,
    "temperature_std_c": 0.2,
}


def model() -> Model:
    found = read_model("linear")
    for name in ("axis-misalignment", "axis-nonorthogonality", "temperature-bias"):
        found = found.with_effect(catalogue()[name])
    return found


def errors(rng: np.random.Generator) -> dict[str, Array]:
    """Draws of every input, as far out as GIVEN says."""
    shapes = {"repeat_std_deg": (2, N), "tilt_std_deg": (2,), "mount_std_deg": (3,), "gain_std": (), "offset_std_v": ()}
    shapes |= {"alpha_std_deg": (int(PLACES["alpha_deg"].max()) + 1,), "gravity_std_m_s2": ()}
    shapes |= {"beta_std_deg": (int(PLACES["beta_deg"].max()) + 1,), "temperature_std_c": ()}
    return {name: GIVEN[name] * rng.standard_normal(shape) for name, shape in shapes.items()}


def measured(seed: int | None, erring: Mapping[str, Array] | None = None) -> Table:
    """What a sensor of 1 V/g shows where its inputs err; `seed` of the white noise."""
    by = {"repeat_std_deg": np.zeros((2, N)), "tilt_std_deg": np.zeros(2), "mount_std_deg": np.zeros(3)} | dict(
        erring or {}
    )
    alpha, beta = (
        np.radians(COLUMNS[name] + np.atleast_1d(by.get(f"{name[:-4]}_std_deg", np.zeros(99)))[PLACES[name]] + own)
        for name, own in zip(("alpha_deg", "beta_deg"), by["repeat_std_deg"], strict=True)
    )
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    up = rotation(np.radians(np.append(by["tilt_std_deg"], 0.0)))[:, 2]
    x, y, z = ca * up[0] + sa * up[2], up[1] + 0 * sa, ca * up[2] - sa * up[0]
    a = np.column_stack([cb * x - sb * y, sb * x + cb * y, z]) @ rotation(np.radians(by["mount_std_deg"]))
    a = a * (1 + by.get("gravity_std_m_s2", 0.0) / 9.80665)
    warmth = 0.002 * (ROOM + by.get("temperature_std_c", 0.0))
    vx, vy = ((2.5 + a[:, :2] + warmth[:, None]) * (1 + by.get("gain_std", 0.0)) + by.get("offset_std_v", 0.0)).T
    table = synthetic.poses(COLUMNS, vx, vy, seed=seed)
    return Table.from_columns("poses", {**table.columns, "temperature_c": 24 + ROOM})


def given(table: Table, **std: float) -> Table:
    return replace(table, constants=std)


def test_type_a_adds_to_what_the_fit_says() -> None:
    found = fit(model(), measured(3))
    parts = make_budget(found, ())
    said = np.array([e.std for term in found.model.terms for e in term.estimates])
    np.testing.assert_allclose(parts.combined, said, rtol=1e-9)
    assert "white noise of the dwells" in [line.source for line in parts.lines]


def test_the_budget_is_the_spread_of_simulated_calibrations() -> None:
    """Monte Carlo, JCGM 101: every input drawn anew, every calibration fitted as if it erred by none."""
    tables = [measured(seed, errors(np.random.default_rng([seed, 1]))) for seed in range(60)]
    spread = np.std([fit(model(), table).theta for table in tables], axis=0)
    known = given(tables[0], **GIVEN)
    ratio = spread / make_budget(fit(model(), known), input_contributions(known)).combined
    np.testing.assert_allclose(ratio, 1.0, atol=0.3)  # chance: 1 / sqrt(2 * 60) each
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.1)


COMMON = {
    "level of the base about x": ("tilt_std_deg", [0.03, 0]),
    "level of the base about y": ("tilt_std_deg", [0, 0.03]),
    "mount about x": ("mount_std_deg", [0.05, 0, 0]),
    "mount about z": ("mount_std_deg", [0, 0, 0.05]),
    "gravity at the place": ("gravity_std_m_s2", 2e-3),
    "gain of the converter": ("gain_std", 2e-4),
    "offset of the converter": ("offset_std_v", 3e-4),
    "thermometer": ("temperature_std_c", 0.2),
}
WHITE = "white noise of the dwells"
PART = 0.01  # of an error: so small that it changes no weights


@pytest.mark.parametrize("source", COMMON)
def test_an_error_of_the_whole_table_moves_the_parameters_as_its_line_says(source: str) -> None:
    name, error = COMMON[source]
    table = given(measured(2), **{name: GIVEN[name]})
    found = fit(model(), table)
    said = line_of(make_budget(found, input_contributions(table)), source)
    moved = (fit(model(), measured(2, {name: PART * np.array(error)})).theta - found.theta) / PART
    size = found.problem.layout.typical
    assert np.max(said / size) > 1e-5
    np.testing.assert_allclose(np.abs(moved) / size, said / size, rtol=0.02, atol=2e-6)


def test_what_an_input_shows_of_itself_is_not_counted_twice() -> None:
    """Stages that err by 0.01 deg from pose to pose scatter the residual: known, it is no noise of the sensor."""
    shaky = measured(4, {"repeat_std_deg": errors(np.random.default_rng(4))["repeat_std_deg"]})
    known = given(shaky, repeat_std_deg=GIVEN["repeat_std_deg"])
    silent, told = (make_budget(fit(model(), table), input_contributions(table)) for table in (shaky, known))
    np.testing.assert_allclose(line_of(told, WHITE), line_of(silent, WHITE))
    rest = [sum(line_of(b, line.source) ** 2 for line in b.given if line.kind == "A") for b in (silent, told)]
    white = line_of(silent, WHITE) ** 2
    assert np.all(rest[1] - white < 0.3 * (rest[0] - white))


def line_of(parts: Budget, source: str) -> Array:
    found = next(line.std for line in parts.lines if line.source == source)
    assert found is not None
    return found


def test_repeats_at_one_angle_share_the_error_of_that_angle() -> None:
    """Four sweeps halve the error of coming to a pose, and not that of the angle that is come to."""
    tables = [measured(seed) for seed in range(5, 9)]
    columns = {name: np.concatenate([t.column(name) for t in tables]) for name in tables[0].columns}
    columns["t_s"] = 7.0 * np.arange(4 * N)
    both = [given(tables[0], **GIVEN), Table.from_columns("poses", columns, GIVEN)]
    once, often = (make_budget(fit(model(), table), input_contributions(table)) for table in both)
    for source, factor in (("true angle of beta", 1.0), ("beta from pose to pose", 0.5)):
        np.testing.assert_allclose(line_of(often, source), factor * line_of(once, source), rtol=0.1)


def test_a_converter_that_shows_too_much_has_a_negative_sensitivity() -> None:
    """A converter that is known to show too much leaves less to the sensor."""
    table = given(measured(1), gain_std=1e-4, offset_std_v=1e-4)
    lines = make_budget(fit(read_model("linear"), table), input_contributions(table)).given
    found = {line.source: np.asarray(line.sensitivity, dtype=float) for line in lines if line.kind == "B"}
    np.testing.assert_allclose(found["offset of the converter"], [-1, -1, 0, 0], atol=1e-3)
    np.testing.assert_allclose(found["gain of the converter"], [-2.5, -2.5, -1, -1], rtol=0.01)


def test_what_is_not_given_is_said_and_counts_for_nothing() -> None:
    table = measured(1)
    silent = make_budget(fit(model(), table), input_contributions(table))
    assert "gain of the converter" in silent.not_given
    assert len(silent.not_given) == 13
    zero = given(table, gain_std=0.0)
    assert "gain of the converter" not in make_budget(fit(model(), zero), input_contributions(zero)).not_given


def test_positions_have_no_angles_and_a_parameter_that_is_not_determined_has_no_number() -> None:
    table = replace(mikoff(), constants={**mikoff().constants, "gravity_std_m_s2": 0.01})
    found = fit(read_model("common-scale"), table)
    parts = make_budget(found, input_contributions(table))
    assert parts.not_given == ("gain of the converter",)
    gravity = next(line for line in parts.given if line.source == "gravity at the place")
    assert gravity.std is not None
    assert gravity.std[-1] == pytest.approx(found.theta[-1] * 0.01 / 9.81, rel=1e-3)
    columns = synthetic.turns((90,))
    a_x, a_y, _ = synthetic.components(columns)
    blind = fit(read_model("linear").with_effect(catalogue()["z-axis-bias"]), synthetic.poses(columns, a_x, a_y))
    assert list(np.isnan(make_budget(blind, ()).combined)) == [False, False, False, False, True, True]


def test_welch_and_satterthwaite_as_in_the_guide() -> None:
    """GUM H.1.6: 25, 9.7, 2.9 and 16.6 nm with 18, 25.6, 50 and 2 degrees of freedom have 16.7 together."""
    stds, freedoms = (25.0, 9.7, 2.9, 16.6), (18.0, 25.6, 50.0, 2.0)
    lines = [BudgetRow("", "A", "", None, None, np.array([s]), f) for s, f in zip(stds, freedoms, strict=True)]
    guide = Budget(tuple(lines))
    assert guide.combined[0] == pytest.approx(31.7, abs=0.1)
    assert guide.freedom[0] == pytest.approx(16.7, abs=0.3)
    assert guide.coverage[0] == pytest.approx(2.12, abs=0.005)


def test_slow_noise_is_known_by_as_many_stretches_as_the_record_holds() -> None:
    gap_s = np.full(1000, 1.0)
    slow = Noise(np.ones((1, 1000)), gap_s, np.zeros(1), np.ones(1), ((10.0,),))
    assert slow_freedom(slow) == pytest.approx(100, rel=0.1)
    assert slow_freedom(replace(slow, taus_s=((300.0,),))) < 6
    assert slow_freedom(replace(slow, ratio=np.zeros(1))) == np.inf
