"""A model turned round gives back what it was made of, over the whole range; and says what it cannot."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibrations.compensation.document import Origin, coverage_text, header_lines, summary, uncertainty_text
from calibrations.compensation.forward import INVERTED, LEFT_OUT, NOISE, OF_THE_RIG, steps_of, trace_model
from calibrations.compensation.inverse import Compensation, Range, compensate_residual, invert_model
from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue, read_effect
from calibrations.effects.expression_effect import own_effect
from calibrations.errors import DataError, ModelError
from calibrations.model import Model
from calibrations.model.chain import respond, sensed
from calibrations.model.correlations import Correlations
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations.fitted import LINEAR, PHYSICAL, model
from tests.calibrations.synthetic import components, turns

ORIGIN = Origin("made", "made.yaml", "0" * 64, "inertial-rig", "2026-01-01")
THERMAL = {"temperature-bias": {"slope": (0.001, -0.002)}, "temperature-scale": {"slope": (3e-4, -2e-4)}}
EVERYTHING = {
    **PHYSICAL,
    **THERMAL,
    "cubic-nonlinearity": {"cube": (0.003, -0.002)},
    "scale-factor-asymmetry": {"kink": (0.004, 0.003)},
    "odd-quadratic-nonlinearity": {"square": (0.002, 0.001)},
    "cross-axis-scale": {"slope": (0.004, 0.002)},
    "warm-up-bias": {"amplitude": (0.01, 0.02), "time_constant": 600.0},
    "supply-sensitivity": {"share": (0.9, 1.1)},
}


@cache
def everything() -> Compensation:
    """The inverse of EVERYTHING; its proof takes seconds."""
    return invert_model(model(EVERYTHING))


def test_correlations_decide_how_certain_the_result_is() -> None:
    """Of a = (v - b) / K at a = 1 g: u^2 = (u_b^2 + u_K^2 + 2 r u_b u_K) / K^2, and at -1 g with -r."""
    values = {"bias": {"bias": (2.5, 2.5)}, "scale-factor": {"scale": (1.0, 1.0)}}
    alone = model(values, std=1e-3)
    keys = ["bias.x", "scale-factor.x"]
    for r in (0.0, 0.6, 0.999):
        given = Correlations.of(keys, np.array([[1.0, r], [r, 1.0]]))
        made = invert_model(replace(alone, correlations=given), Range.for_model(alone, 1.0))
        assert made.costs.parameters is not None
        assert made.costs.parameters.most == pytest.approx(1e-3 * np.sqrt(2 + 2 * r), rel=1e-2)
        assert "with their correlations" in uncertainty_text(made)
        head = header_lines(made, ORIGIN)
        assert head[-2:] == ["  bias.x", f"  scale-factor.x: {r:.3f}"]
        assert summary(made, ORIGIN)["correlations"] == {"of": keys, "matrix": [[1.0, r], [r, 1.0]]}
    made = invert_model(alone, Range.for_model(alone, 1.0))
    assert "the model file does not give their correlations" in uncertainty_text(made)
    assert summary(made, ORIGIN)["correlations"] is None


def drawn(made: Compensation, n: int, seed: int) -> tuple[Table, Array]:
    """Rows all over the range, and specific force (n, 3): by the library's own chain, and not by the graph."""
    rng = np.random.default_rng(seed)
    a = made.range.reach * rng.uniform(-1, 1, (n, 3))
    columns = {name: rng.uniform(low, high, n) for name, (low, high) in made.input_limits.items() if name[0] != "a"}
    return Table.from_columns("poses", columns | {k: np.zeros(n) for k in ("alpha_deg", "beta_deg", "vx_v", "vy_v")}), a


def error(made: Compensation, within: Model, n: int = 500, seed: int = 0) -> float:
    """The greatest error of what the program makes of the outputs of `within`, in the unit of what is sensed."""
    table, a = drawn(made, n, seed)
    steps = steps_of(within)
    v = respond(sensed(a, table, steps), table, steps)
    known = {f"v{axis}": v[:, k] for k, axis in enumerate("xyz")} | {
        f"a{axis}": a[:, k] for k, axis in enumerate("xyz")
    }
    found = made.program.run({name: known.get(name, table.columns.get(name)) for name in made.program.inputs})
    return max(float(np.abs(found[f"a{axis}"] - a[:, "xyz".index(axis)]).max()) for axis in made.forward.axes)


@pytest.mark.slow
@pytest.mark.parametrize("values", [LINEAR, PHYSICAL, EVERYTHING], ids=["linear", "physical", "everything"])
def test_it_gives_back_what_the_model_was_given(values: Any) -> None:
    fitted = model(values)
    made = everything() if values is EVERYTHING else invert_model(fitted)
    assert {fate.how for fate in made.forward.fates} == {INVERTED}
    assert error(made, fitted) < 1e-9
    assert made.bound.q**made.bound.steps * 1.5 == pytest.approx(made.bound.within)


@settings(max_examples=8)
@given(
    st.lists(st.floats(-0.02, 0.02), min_size=10, max_size=10),
    st.tuples(*[st.floats(-3, 3)] * 3),
    st.integers(0, 1000),
)
def test_the_inverse_is_exact_for_random_parameters(
    bent: list[float], turned: tuple[float, float, float], seed: int
) -> None:
    shapes = ("quadratic-nonlinearity", "cross-axis-bias", "z-axis-bias", "odd-quadratic-nonlinearity")
    values: dict[str, Any] = {name: {"square": tuple(bent[2 * k : 2 * k + 2])} for k, name in enumerate(shapes)}
    values |= {
        "cubic-nonlinearity": {"cube": tuple(bent[8:])},
        "axis-misalignment": dict(zip("xyz", turned, strict=True)),
    }
    fitted = model({**LINEAR, **values})
    made = invert_model(fitted)
    assert error(made, fitted, 50, seed) < 1e-9


def test_the_inverse_of_three_axes_needs_no_other_input() -> None:
    bias, scale = (0.1, -0.2, 0.3), (1.0, 1.1, 0.9)
    bent = {"axis-nonorthogonality": {"xy": 1.0, "xz": -0.5, "yz": 2.0}, "z-axis-bias": {"square": (0.01, 0.02, 0.01)}}
    fitted = model({"bias": {"bias": bias}, "scale-factor": {"scale": scale}, **bent})
    made = invert_model(fitted)
    assert made.program.inputs == ("vx", "vy", "vz")
    assert error(made, fitted) < 1e-9


def test_the_inverse_of_one_axis_takes_the_other_axes_as_inputs() -> None:
    fitted = model(
        {"bias": {"bias": (2.5,)}, "scale-factor": {"scale": (1.0,)}, "axis-misalignment": {"x": 0, "y": 1, "z": 1}}
    )
    made = invert_model(fitted)
    assert made.program.inputs == ("vx", "ay", "az")
    assert error(made, fitted) < 1e-9


def test_the_inverse_of_one_straight_axis_takes_its_output_alone() -> None:
    fitted = model({"bias": {"bias": (2.5,)}, "scale-factor": {"scale": (1.1,)}})
    made = invert_model(fitted)
    assert made.program.inputs == ("vx",)
    assert error(made, fitted) < 1e-9


def test_an_input_has_the_unit_of_the_sensors_output() -> None:
    digital = invert_model(replace(model(LINEAR), unit="LSB"))
    inputs = {given["name"]: given["unit"] for given in summary(digital, ORIGIN)["inputs"]}
    assert inputs == {"vx": "LSB", "vy": "LSB"}


def test_magnetometers_and_gyroscopes() -> None:
    iron = {
        "hard-iron": {"offset": (10.0, -5.0, 3.0)},
        "soft-iron": {"xx": 0.1, "yy": -0.05, "xy": 0.03, "xz": 0.0, "yz": 0.02},
    }
    magnetometer = model({"field-strength": {"total": 48.0}, **iron})
    turned = {f"turned_{axis}": 1.0 for axis in "xyz"} | {"assumed": 16.0}
    pairs = {"xy": 1.0, "xz": -2.0, "yx": 0.5, "yz": 0.0, "zx": 0.3, "zy": 1.0}
    gyroscope = model(
        {
            "gyro-bias": {"bias": (3.0, -1.0, 2.0)},
            "gyro-scale-factor": {"scale": (16.0, 16.5, 15.5)},
            "gyro-misalignment": pairs,
        },
        constants=turned,
    )
    for fitted, unit, reach in ((magnetometer, "field", 1.5), (gyroscope, "deg/s", 300.0)):
        made = invert_model(fitted)
        assert (made.unit, made.range.reach) == (unit, reach)
        assert error(made, fitted) < 1e-9 * reach


@pytest.mark.parametrize("name", catalogue())
def test_every_effect_is_inverted_or_says_why_not(name: str) -> None:
    effect = catalogue()[name]
    values = {p.name: (0.01, 0.02) if p.per_axis else 0.01 for p in effect.parameters}
    (*_, fate) = fates(model({**LINEAR, name: values} if name not in LINEAR else LINEAR))
    if effect.left_out:
        assert (fate.how, fate.why) == (LEFT_OUT, effect.left_out)
    elif effect.places & {"force", "transduction", "output"}:
        assert fate.how == INVERTED, fate.why
    else:
        assert fate.how == (OF_THE_RIG if "pose" in effect.places else NOISE)


def fates(fitted: Model) -> Any:
    """What becomes of the effects, whether or not there is an inverse."""
    return trace_model(fitted).fates


def test_what_is_left_out_comes_with_its_cost() -> None:
    slips = {"hysteresis": {"height": (0.003, 0.002), "reach": (0.1, 0.12), "spread": 0.5, "pressing": 0.0}}
    fitted = model({**PHYSICAL, **slips, "stage-zero-offset": {"alpha": 0.1, "beta": 0.2}})
    assert invert_model(fitted).forward.left_out == ()
    made = invert_model(fitted, without=["hysteresis"])
    size = made.costs.left_out["hysteresis"]
    assert size is not None
    assert 0.001 < size.rms < size.most < 1.1 * 0.003 / 1.01  # all elements slip: the whole height, in g
    assert made.forward.left_out == ("hysteresis",)


def test_an_axis_found_out_of_gravity_costs_little() -> None:
    size = invert_model(model(PHYSICAL)).costs.out_of_gravity
    assert size is not None
    assert 0 < size.most < 1e-4
    assert invert_model(model(LINEAR)).costs.out_of_gravity is None


def test_the_result_has_the_uncertainty_of_its_parameters() -> None:
    size = invert_model(model(LINEAR, std=1e-3)).costs.parameters
    assert size is not None
    assert size.most == pytest.approx(1e-3 * np.sqrt(2) / 0.98, rel=0.02)  # bias and scale factor, at 1 g
    assert size.largest == pytest.approx(1e-3 * np.sqrt(1 + 1.5**2) / 0.98, rel=0.001)  # at 1.5 g
    assert invert_model(model(LINEAR, std=None)).costs.parameters is None


def test_the_uncertainty_follows_the_slope_of_a_bent_output() -> None:
    """A bias counts most at 0 g, where the slope is the scale factor: with a cube the slope is greater elsewhere."""
    bias, *others = model({**LINEAR, "cubic-nonlinearity": {"cube": (0.1, 0.1)}}, std=1e-9).terms
    uncertain = replace(bias, estimates=tuple(replace(e, std=1e-3) for e in bias.estimates))
    fitted = replace(model(LINEAR), terms=(uncertain, *others))
    size = invert_model(fitted, Range.for_model(fitted, 1.0)).costs.parameters
    assert size is not None
    assert size.largest == pytest.approx(1e-3 / 0.98, rel=0.01)


def test_an_uncertain_temperature_coefficient_tells_the_more_the_further_the_range_goes() -> None:
    """As 3000 sensors scatter whose parameters were drawn: at the reference, and where it is greatest."""
    fitted = model({**LINEAR, "temperature-bias": {"slope": (0.001, -0.002)}}, std=1e-4)
    made = invert_model(fitted)
    size = made.costs.parameters
    assert size is not None
    assert (size.within, size.at) == ({"temperature_c": (25.0, 25.0)}, {"temperature_c": 85.0})
    assert size.largest == pytest.approx(scatter(made, 85.0, 1.5), rel=0.05)
    assert size.most == pytest.approx(scatter(made, 25.0, 1.0), rel=0.05)
    narrow = invert_model(fitted, Range.for_model(fitted, temperature_c=(22.0, 26.0))).costs.parameters
    assert narrow is not None
    assert narrow.largest < size.largest / 10
    assert narrow.at == {"temperature_c": 22.0}


def scatter(made: Compensation, temperature_c: float, a: float) -> float:
    """Standard deviation of what the program makes of sensors whose parameters are drawn, worst axis."""
    rng, n = np.random.default_rng(1), 3000
    bias, scale, slope = (
        np.array([[e.value for e in term.estimates]]) + 1e-4 * rng.standard_normal((n, 2)) for term in made.model.terms
    )
    v = bias + scale * a + slope * (temperature_c - 25.0)
    found = made.program.run({"vx": v[:, 0], "vy": v[:, 1], "temperature_c": np.full(n, temperature_c)})
    return max(float(np.std(found["ax"])), float(np.std(found["ay"])))


def test_what_happens_soon_after_the_power_comes_on_is_not_missed() -> None:
    warming = {"warm-up-bias": {"amplitude": (0.01, 0.02), "time_constant": 600.0}}
    fitted = model({**LINEAR, **warming}, std=1e-4)
    (*others, warm) = fitted.terms
    known = tuple(replace(e, std=60.0 if e.name == "time_constant" else e.std) for e in warm.estimates)
    size = invert_model(replace(fitted, terms=(*others, replace(warm, estimates=known)))).costs.parameters
    assert size is not None
    assert 200 < size.at["t_s"] < 1800  # t exp(-t/600 s) is greatest at 600 s


def test_what_the_calibration_covered_is_where_its_uncertainty_is_told() -> None:
    fitted = replace(model({**LINEAR, **THERMAL}), covered={"temperature_c": (10.0, 99.0), "supply_v": (5.0, 5.0)})
    made = invert_model(fitted)
    size = made.costs.parameters
    assert size is not None
    assert size.within == {"temperature_c": (10.0, 85.0)}
    assert "temperature_c 10 to 99 C, supply_v 5 V; beyond, the model is extrapolated" in coverage_text(made)
    assert "goes beyond in temperature_c." in coverage_text(made)
    assert "does not give" in coverage_text(invert_model(model(LINEAR)))
    assert "temperature_c 10 to 85 C;" in uncertainty_text(made)


def test_the_supply_may_differ_by_5_percent_from_its_reference() -> None:
    fitted = model({**LINEAR, "supply-sensitivity": {"share": (0.9, 1.1)}})
    assert Range.for_model(fitted).input_limits["supply_v"] == pytest.approx((4.75, 5.25))


def test_a_wrong_bias_is_the_residual_of_a_compensation() -> None:
    """The sensor has 2.5 V at 0 g, the model of x 2.501 V: 1 mg, which is 9.80665 mm/s^2."""
    columns = turns(step_deg=30.0)
    x, y, z = components(columns)
    wrong = invert_model(model({"bias": {"bias": (2.501, 2.5)}, "scale-factor": {"scale": (1.0, 1.0)}}))
    measured = Table.from_columns("poses", {**columns, "vx_v": 2.5 + x, "vy_v": 2.5 + y})
    residual = compensate_residual(wrong, measured)
    assert residual.compensated[:, 0] == pytest.approx(np.full(len(x), -9.80665), rel=1e-4)
    assert residual.linear == pytest.approx(np.zeros((len(x), 2)), abs=1e-6)
    without_stages = Table.from_columns("positions", {"ax": x, "ay": y, "az": z})
    with pytest.raises(DataError, match="is compared with poses of an accelerometer"):
        compensate_residual(wrong, without_stages)


def test_an_effect_left_out_costs_what_it_does_over_the_stated_range() -> None:
    fitted = model({**LINEAR, "temperature-bias": {"slope": (0.001, -0.002)}})
    size = invert_model(fitted, without=["temperature-bias"]).costs.left_out["temperature-bias"]
    assert size is not None
    assert size.most == pytest.approx(0.002 * 60 / 0.98, rel=0.01)


def test_what_is_not_contractive_is_refused_with_the_way_out() -> None:
    fitted = model({**LINEAR, "dead-zone": {"width": (0.01, 0.02)}})
    with pytest.raises(ModelError, match=r"not converge for certain within \+-1.5 g.*--leave-out dead-zone"):
        invert_model(fitted)
    size = invert_model(fitted, without=["dead-zone"]).costs.left_out["dead-zone"]
    assert size is not None
    assert size.most == pytest.approx(0.02)
    bent = model({**LINEAR, "cubic-nonlinearity": {"cube": (-0.4, 0.0)}})  # falls from 0.92 g on
    with pytest.raises(ModelError, match="not converge"):
        invert_model(bent)
    assert error(made := invert_model(bent, Range.for_model(bent, 0.5)), bent) < 1e-9
    assert made.bound.q > 0.2


def test_a_scale_factor_that_vanishes_beside_the_bias_is_refused(golden) -> None:
    tiny = model({"bias": {"bias": (1e12, 1e12)}, "scale-factor": {"scale": (1e-6, 1e-6)}}, std=1.0)
    with golden.refused(ModelError):
        invert_model(tiny)


def test_part_of_a_saturation_is_inverted() -> None:
    fitted = model({**LINEAR, "saturation": {"high": (3.2, 3.2), "low": (1.7, 1.7), "loss": 0.2}})
    assert error(invert_model(fitted), fitted) < 1e-9


def test_own_expressions_are_inverted_where_a_product_knows_their_variables() -> None:
    texts = {
        "own-bend": "v += a*ax*ay + b*exp(-t/600) + c*max(ax, 0)**2 + d*tanh(4*ay)",
        "own-wet": "vx += k*humidity_pct*(1 + step(temperature - 30))",
        "own-gear": "beta_deg += a*sin(5*beta)",
        "own-angle": "vy += a*sin(5*alpha)",
    }
    own = {name: own_effect(name, text, ("humidity_pct",) if "pct" in text else ()) for name, text in texts.items()}
    values = {
        "own-bend": {"a": (0.01, 0.0), "b": (0.01, 0.02), "c": (0.0, 0.01), "d": (1e-3, 0.0)},
        "own-wet": {"k": 1e-4},
    }
    fitted = model({**LINEAR, **values, "own-gear": {"a": 0.1}, "own-angle": {"a": 0.001}}, own)
    with pytest.raises(ModelError, match="--input humidity_pct=LOW:HIGH"):
        invert_model(fitted)
    made = invert_model(fitted, Range.for_model(fitted, humidity_pct=(0.0, 100.0)))
    how = {fate.effect: (fate.how, fate.why) for fate in made.forward.fates}
    assert how["own-gear"] == (OF_THE_RIG, "")
    assert how["own-angle"] == (LEFT_OUT, "it needs alpha_deg, which is not known at run time")
    assert how["own-bend"] == how["own-wet"] == (INVERTED, "")
    assert error(made, model({**LINEAR, **values}, own)) < 1e-9


def test_a_column_whose_name_no_source_can_have_is_left_out() -> None:
    for column in ("double", "t7", "lambda"):
        text = f"v += k*{column}" if column != "lambda" else "v += k*humidity_pct"
        wet = copy(own_effect("own-wet", text, (text[7:],)))
        wet.needs = (column,)
        own = {"own-wet": wet}
        ((*_, fate),) = (trace_model(model({**LINEAR, "own-wet": {"k": (0.1, 0.2)}}, own)).fates,)
        assert fate.how == LEFT_OUT
        assert "which is not known at run time" in fate.why


def test_an_effect_of_the_users_own_file(tmp_path: Path) -> None:
    head = "import numpy as np\nfrom calibrations.effects import Effect, Parameter\n"
    body = '    """own: x.\n\n    V += k\n\n    Symptom   s.\n    """\n    k = Parameter("{out}", typical=0.01)\n'
    made = {}
    for name, formula in (("good", "np.sin(a) ** 2 * p.k"), ("bad", "np.round(a) * p.k")):
        method = f"    def transduction(self, a, table, p):\n        return {formula}\n"
        (tmp_path / f"{name}.py").write_text(f"{head}class {name.title()}(Effect):\n{body}{method}")
        own: dict[str, Effect] = {name: read_effect(tmp_path / f"{name}.py")}
        fitted = model({**LINEAR, name: {"k": (0.02, 0.01)}}, own)
        made[name] = invert_model(fitted)
        if name == "good":
            assert error(made[name], fitted) < 1e-9
    assert made["bad"].forward.fates[-1].why == "its function uses np.round"


def test_a_model_of_noise_alone_has_no_inverse(golden) -> None:
    with golden.refused(ModelError):
        invert_model(model({"white-noise": {p.name: 0.1 for p in catalogue()["white-noise"].parameters}}))


def test_a_model_without_values_is_refused(golden) -> None:
    with golden.refused(ModelError):
        invert_model(read_model("linear"))
    with golden.refused(ModelError):
        invert_model(model(LINEAR), without=["colour"])
