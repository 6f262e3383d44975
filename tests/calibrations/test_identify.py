"""Which parameters a table determines, and what is said of the others."""

from __future__ import annotations

import numpy as np

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.fitting.identifiability import covariance
from calibrations.model import Estimate, Model
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations import synthetic


def linear_with(*names: str) -> Model:
    model = read_model("linear")
    for name in names:
        model = model.with_effect(catalogue()[name])
    return model


def table(*inclinations: float) -> Table:
    columns = synthetic.turns(inclinations)
    a_x, a_y, _ = synthetic.components(columns)
    return synthetic.poses(columns, a_x + 2.5, a_y + 2.5)


def estimates(model: Model, data: Table) -> dict[tuple[str, str], Estimate]:
    return {(t.name, e.axis or e.name): e for t in fit(model, data).model.terms for e in t.estimates}


def test_covariance_is_the_inverse_of_the_information() -> None:
    rng = np.random.default_rng(0)
    J = rng.standard_normal((50, 4)) * [1.0, 1e-6, 1e6, 3.0]
    cov, null = covariance(J, np.array([1.0, 1e6, 1e-6, 1.0]))
    scale = 1 / np.array([1.0, 1e-6, 1e6, 3.0])
    dense = np.linalg.inv((J * scale).T @ (J * scale)) * np.outer(scale, scale)
    np.testing.assert_allclose(cov, dense, rtol=1e-10)
    assert null.shape == (0, 4)


def test_undetermined_direction_of_a_rank_deficient_jacobian() -> None:
    J = np.random.default_rng(1).standard_normal((50, 3))
    J[:, 2] = J[:, 0] + 2 * J[:, 1]
    _, null = covariance(J, np.ones(3))
    np.testing.assert_allclose(np.abs(null @ [1, 2, -1]), np.sqrt(6), rtol=1e-9)
    np.testing.assert_allclose(J @ null.T, 0, atol=1e-12)


def test_bias_and_the_three_squares_are_one_too_many() -> None:
    """a_x^2 + a_y^2 + a_z^2 = 1: each is named with all the others, and the scale factor stays determined."""
    found = estimates(linear_with("quadratic-nonlinearity", "cross-axis-bias", "z-axis-bias"), table(90, 30, 150, 60))
    for name in ("bias", "quadratic-nonlinearity", "cross-axis-bias", "z-axis-bias"):
        e = found[name, "x"]
        assert not e.identified
        assert e.std is None
        assert "on this data it cannot be separated from" in str(e.why)
        others = {"bias x", "quadratic-nonlinearity square x", "cross-axis-bias square x", "z-axis-bias square x"}
        assert sum(other in str(e.why) for other in others) == 3
        assert " y" not in str(e.why)
    assert found["scale-factor", "x"].identified


def test_one_inclination_cannot_tell_two_squares_apart() -> None:
    found = estimates(linear_with("quadratic-nonlinearity", "cross-axis-bias"), table(90))
    assert "cross-axis-bias square y" in str(found["quadratic-nonlinearity", "y"].why)
    both = estimates(linear_with("quadratic-nonlinearity", "cross-axis-bias"), table(90, 30))
    assert all(e.identified for e in both.values())


def test_a_parameter_without_effect_on_the_data_says_so() -> None:
    found = estimates(linear_with("z-axis-bias"), table(90))
    e = found["z-axis-bias", "x"]
    assert (e.identified, e.std, e.why) == (False, None, "it changes nothing in this data")


def test_an_estimate_less_certain_than_a_typical_value_is_not_identified() -> None:
    columns = synthetic.turns((90,), step_deg=60)
    columns["alpha_deg"] = columns["alpha_deg"] - np.linspace(0, 0.5, len(columns["alpha_deg"]))
    a_x, a_y, _ = synthetic.components(columns)
    found = estimates(linear_with("z-axis-bias"), synthetic.poses(columns, a_x + 2.5, a_y + 2.5))
    e = found["z-axis-bias", "x"]
    assert not e.identified
    assert e.std is not None
    assert "not smaller than a typical value" in str(e.why)


def heated(model: Model, temperature_c: np.ndarray) -> dict[tuple[str, str], Estimate]:
    data = table(90, 30)
    return estimates(model, Table.from_columns("poses", {**data.columns, "temperature_c": temperature_c[: data.n]}))


def test_without_a_span_of_temperature_its_coefficient_is_not_known() -> None:
    still, hardly = np.full(500, 22.0), 22 + 1e-3 * np.sin(np.arange(500.0))
    for temperature_c, why in ((still, "it changes nothing"), (hardly, "not smaller than a typical value")):
        found = heated(linear_with("temperature-bias"), temperature_c)
        assert why in str(found["temperature-bias", "x"].why)
        assert found["scale-factor", "x"].identified


def test_a_warm_up_that_outlasts_the_record_has_no_time_constant() -> None:
    columns = synthetic.turns((90, 30, 150))
    a_x, a_y, _ = synthetic.components(columns)
    warmth = 0.01 * np.exp(-columns["t_s"] / 20000)
    found = estimates(linear_with("warm-up-bias"), synthetic.poses(columns, a_x + 2.5 + warmth, a_y + 2.5 + warmth))
    assert not any(found["warm-up-bias", name].identified for name in ("x", "y", "time_constant"))
    assert found["scale-factor", "x"].identified


def test_cross_axis_terms_need_the_other_axis() -> None:
    columns = synthetic.turns((90, 30, 150), step_deg=180)
    a_x, a_y, _ = synthetic.components(columns)
    data = synthetic.poses(columns, a_x + 2.5, a_y + 2.5)
    found = estimates(linear_with("cross-axis-bias", "cross-axis-scale"), data)
    assert not any(found[key].identified for key in (("cross-axis-bias", "x"), ("cross-axis-scale", "x")))
    assert found["scale-factor", "x"].identified


def test_one_axis_at_one_inclination_tells_no_geometry() -> None:
    both = table(90)
    one = Table.from_columns("poses", {k: v for k, v in both.columns.items() if not k.startswith("vy")})
    found = estimates(linear_with("axis-misalignment"), one)
    assert not any(found["axis-misalignment", k].identified for k in "xy")
    assert found["scale-factor", "x"].identified
