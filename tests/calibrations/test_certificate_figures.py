"""Figures of a certificate: true, uncertain by as much as they scatter, judged as the standards say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError, ModelError
from calibrations.fitting.budget import Budget, BudgetRow, make_budget, parameter_correlation
from calibrations.fitting.fit import fit
from calibrations.fitting.inputs import input_contributions
from calibrations.geometry.earth import normal_gravity
from calibrations.model.file import read_model
from calibrations.presentation.certificate.content import decide
from calibrations.presentation.certificate.results import _explain_wider_interval, figures, interval, simulate, verdict
from calibrations.presentation.certificate.terms import in_si, name, names, term
from tests.calibrations import turned
from tests.calibrations.certified import LIMITS, before, certificate, fitted, table

BY_NAME = {o.name: o for o in certificate().figures.outcomes}


def test_results_are_the_truth_within_their_uncertainty() -> None:
    for key, true in (("bias-x", 2.5), ("bias-y", 2.45), ("scale-factor-x", 1.001), ("scale-factor-y", 0.98)):
        assert abs(BY_NAME[key].value - true) < BY_NAME[key].expanded
    assert BY_NAME["bias-x"].term == "bias K0 (zero-g offset)"
    assert all(o.coverage >= 2 for o in BY_NAME.values())


def test_contributions_of_a_budget_add_up_to_the_standard_uncertainty() -> None:
    for o in BY_NAME.values():
        assert np.sqrt(sum(s.contribution**2 for s in o.sources)) == pytest.approx(o.std)
        gain = next(s for s in o.sources if s.name == "gain of the converter")
        assert (gain.kind, gain.std) == ("B", 1e-4)
        assert gain.contribution == pytest.approx(1e-4 * abs(o.value), rel=1e-3)  # all outputs larger by 1e-4
    assert "thermometer" in certificate().figures.not_given


def test_correlations_are_those_of_the_propagation_of_distributions() -> None:
    """Of what the gain does to all results, and of what noise does to each; 6000 trials scatter by 0.013 at most."""
    trials = 6000
    for given in (1e-4, 2e-6, 0.0):
        found = fit(read_model("linear"), table(gain_std=given, tilt_std_deg=0.02))
        inputs = input_contributions(found.table)
        drawn = parameter_correlation(found, make_budget(found, inputs), inputs)
        simulated = np.corrcoef(simulate(found, inputs, trials).T)
        assert np.abs(drawn - simulated).max() < 4 / np.sqrt(trials)
        assert np.diag(drawn) == pytest.approx(1)
    assert np.array(certificate().figures.correlations) == pytest.approx(
        parameter_correlation(
            fitted(), make_budget(fitted(), input_contributions(fitted().table)), input_contributions(fitted().table)
        )
    )


def test_what_follows_from_two_results_is_as_certain_as_their_correlation_says() -> None:
    """Zero-g offset, bias over scale factor: the gain, which both follow alike, does nothing to it (GUM 5.2.2)."""
    found, (a, b) = fitted(), (BY_NAME["bias-x"], BY_NAME["scale-factor-x"])
    i, k = (list(BY_NAME).index(o.name) for o in (a, b))
    r = certificate().figures.correlations[i][k]
    slopes = np.array([1 / b.value, -a.value / b.value**2]) * [a.std, b.std]
    std = np.sqrt(slopes @ np.array([[1, r], [r, 1]]) @ slopes)
    trial = simulate(found, input_contributions(found.table), 4000)
    assert std == pytest.approx(np.std(trial[:, i] / trial[:, k]), rel=0.15)
    assert std < 0.2 * np.linalg.norm(slopes)


def test_a_gyroscope_is_certified_with_the_speed_of_its_stage() -> None:
    turns = turned.gyroscope(4, noise=0.5)
    turns = replace(turns, constants={"rate_std": 1e-3, "mount_std_deg": 0.1, "unit": "V"})
    made = {o.name: o for o in figures(fit(read_model("gyroscope"), turns), None, {"gyro-bias-x": (2.0, 4.0)}).outcomes}
    scale, bias = made["gyro-scale-factor-x"], made["gyro-bias-x"]
    assert abs(scale.value - 16.0) < scale.expanded
    assert next(s for s in scale.sources if s.name == "speed of the stage").contribution == pytest.approx(
        0.016, rel=1e-3
    )
    assert next(s for s in bias.sources if s.name == "speed of the stage").contribution < 1e-3 * bias.std
    assert (scale.term, bias.decision and bias.decision.statement) == ("scale factor (sensitivity)", "pass")


def test_the_simulation_agrees_with_the_budget_where_the_model_is_straight() -> None:
    for o in BY_NAME.values():
        assert o.simulated.std == pytest.approx(o.std, rel=0.15)
        assert o.simulated.low < o.value < o.simulated.high


def test_the_simulation_scatters_as_repeated_calibrations_do() -> None:
    found = fit(read_model("linear"), table())
    trials = simulate(found, input_contributions(found.table), 400)
    again = np.array([fit(read_model("linear"), table(seed=100 + k)).theta for k in range(24)])
    assert np.allclose(trials.std(axis=0), again.std(axis=0), rtol=0.55)
    low, high = interval(trials)
    assert np.all((low < found.theta) & (found.theta < high))


def test_agreement_is_within_half_a_unit_of_the_first_digit() -> None:
    assert verdict(1.0, 0.02, 0.01, 0.9751, 1.02) == "confirmed"
    assert verdict(1.0, 0.02, 0.01, 0.974, 1.02) == "widened"
    assert verdict(1.0, 0.02, 0.01, 0.98, 1.026) == "widened"
    assert verdict(1.0, 0.02, 0.01, 0.986, 1.02) == "conservative"
    assert verdict(1.0, 0.05, 0.01, 0.98, 1.02) == "conservative"


def test_a_budget_that_reaches_further_says_why() -> None:
    """Slow noise of which the rows say little: u allows for more of it than was found."""
    drawn = Budget((BudgetRow("white noise", "A", "", None, None, np.array([1.0]), 50.0),
                    BudgetRow("slow noise", "A", "", None, None, np.array([2.0]), 5.0)))  # fmt: skip
    assert _explain_wider_interval(0, 2.36, 2.24, 1.0, drawn) == "slow noise is not well known, few degrees of freedom"
    assert _explain_wider_interval(0, 2.36, 0.9, 0.9, drawn) == "few degrees of freedom"
    assert _explain_wider_interval(0, 2.0, 2.24, 1.0, Budget(drawn.lines[:1])) == ""


def test_what_the_simulation_finds_wider_is_wider() -> None:
    found = fitted()
    tight = figures(found, None, {}, trials=8)  # so few trials that intervals are off by chance
    for o in tight.outcomes:
        reach = max(o.value - o.simulated.low, o.simulated.high - o.value)
        assert o.simulated.verdict != "widened" or o.expanded == pytest.approx(reach)


@pytest.mark.parametrize(
    ("value", "statement", "probability"),
    [(0.5, "pass", 1.0), (0.95, "conditionalPass", 0.8413), (1.05, "conditionalFail", 0.1587), (1.2, "fail", 3.2e-5)],
)
def test_conformity_is_decided_by_guarded_acceptance(value: float, statement: str, probability: float) -> None:
    found = decide(value, 0.05, 0.1, 1.0)
    assert (found.low, found.high, found.statement) == (-1.0, 1.0, statement)
    assert found.probability == pytest.approx(probability, rel=0.02)
    assert decide(value + 3, 0.05, 0.1, (2.0, 4.0)).statement == statement


def test_limits_are_found_by_the_name_of_a_result() -> None:
    stated = {key: o.decision.statement for key, o in BY_NAME.items() if o.decision is not None}
    assert stated == {"bias-x": "pass", "scale-factor-x": "pass", "scale-factor-y": "fail"}
    assert set(stated) == set(LIMITS)
    effects = catalogue()
    assert name(effects["z-axis-scale"], "slope", "x") == "z-axis-scale-slope-x"
    assert name(effects["axis-misalignment"], "z", "") == "axis-misalignment-z"
    assert "bias-y" in names(effects["bias"])
    assert term(effects["z-axis-scale"], effects["z-axis-scale"].parameters[0]).endswith("K_io K1, slope")


def test_as_found_is_what_the_model_before_says() -> None:
    bias = BY_NAME["bias-x"]
    assert bias.found is not None
    assert bias.value - bias.found[0] == pytest.approx(0.002, abs=1e-4)
    (error, _) = certificate().figures.errors
    assert error.found is not None
    assert error.found[0] == pytest.approx(2.0, rel=0.05)  # mg
    assert error.left[0] < 0.1
    assert figures(fitted(), None, {}, trials=8).errors[0].found is None
    assert before().terms[0].estimates[0].std is not None


def test_every_result_names_the_rows_behind_it() -> None:
    for o in BY_NAME.values():
        assert sum(share for _, share in o.weights) == pytest.approx(1.0)
        assert sorted(number for number, _ in o.weights) == list(range(fitted().table.n))
    heaviest = fitted().table.column("beta_deg")[BY_NAME["scale-factor-x"].weights[0][0]]
    assert heaviest % 180 == 0  # where x is vertical


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [("V", 1.0, r"\volt"), ("V/g", 1 / 9.81, r"\volt\metre\tothe{-1}\second\tothe{2}"),
     ("V/g^2", 9.81**-2, r"\volt\metre\tothe{-2}\second\tothe{4}"), ("V/K", 1.0, r"\volt\kelvin\tothe{-1}"),
     ("V/h", 1 / 3600, r"\volt\second\tothe{-1}"), ("1", 1.0, r"\one"), ("deg", 1.0, r"\degree"), ("", 1.0, r"\one"),
     ("V/(deg/s)", 1.0, r"\volt\degree\tothe{-1}\second")],
)  # fmt: skip
def test_units_are_converted_to_si(unit: str, factor: float, si: str) -> None:
    assert in_si(unit, 9.81) == (pytest.approx(factor), si)


def test_what_cannot_be_certified_is_refused(golden) -> None:
    with golden.refused(DataError):
        in_si("furlong", 9.81)
    shaken = fit(read_model("linear"), table())
    object.__setattr__(shaken.problem.table, "kind", "motion")
    with golden.refused(ModelError):
        figures(shaken, None, {})


def test_a_magnetometer_is_certified_in_its_own_unit() -> None:
    """Offset 12 uT: 1.2e-5 T; no scale factor, because nothing gives the strength of the field."""
    found = fit(read_model("magnetometer"), turned.magnetometer(turned.in_iron(60, seed=1)))
    made = figures(found, None, {}, trials=200)
    offset = next(o for o in made.outcomes if o.name == "hard-iron-x")
    assert abs(offset.value - 12.0) < offset.expanded
    assert in_si(offset.unit, 9.81) == (1e-6, "\\tesla")
    assert any("no scale factor is certified" in remark for remark in made.remarks)


def test_the_bias_of_a_gyroscope_without_a_latitude_holds_the_earth() -> None:
    found = fit(read_model("gyroscope"), turned.gyroscope(3))
    assert any("0.0042 deg/s" in remark for remark in figures(found, None, {}, trials=100).remarks)
    assert in_si("deg/s/(deg/s)", 9.81)[1] == "\\one"


def test_normal_gravity_is_that_of_the_reference_system() -> None:
    """Moritz: 9.7803267715 at the equator, 9.8321863685 at the pole, 9.806199203 at 45 deg; less 3.086 um/s^2 a m."""
    assert normal_gravity(0) == pytest.approx(9.7803267715, abs=1e-9)
    assert normal_gravity(90) == pytest.approx(9.8321863685, abs=1e-7)
    assert normal_gravity(-45) == pytest.approx(9.806199203, abs=1e-7)
    assert normal_gravity(45) - normal_gravity(45, 100) == pytest.approx(3.086e-4, rel=1e-3)


def test_a_doubt_about_the_stated_noise_is_remarked() -> None:
    """In the same words as of the comparison."""
    rows = table()
    columns = {name: values * (40.0 if "_std" in name else 1.0) for name, values in rows.columns.items()}
    remarks = figures(fit(read_model("linear"), replace(rows, columns=columns)), None, {}, trials=200).remarks
    assert any(remark.startswith("Check: the error of x, y is only") for remark in remarks)
    assert not any("noise floor" in remark for remark in certificate().figures.remarks)
