"""Curves of unknown form and the lag of a thermometer in a compensation."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibrations.compensation import document
from calibrations.compensation.document import header_lines, make_vectors
from calibrations.compensation.forward import INVERTED, LEFT_OUT, steps_of, trace_model
from calibrations.compensation.inverse import Range, compensate_residual, invert_model
from calibrations.compensation.tables import CubicTable, spline_table
from calibrations.effects.logged import RATE
from calibrations.free_forms.bases import Basis, Clips, Play, Products, Ramp, Spline, StraightLine, Waves
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.form import Form
from calibrations.model import Estimate, Model, Term
from calibrations.model.chain import respond, sensed
from calibrations.table import Table
from tests.calibrations import synthetic
from tests.calibrations.compiled import COMPILERS, ORIGIN, build, written
from tests.calibrations.fitted import LINEAR, model
from tests.calibrations.test_compensation import error
from tests.calibrations.test_compensation_sources import interpreted

OVER_FORCE, WARM = Spline(-1.06, 1.06, 8), Spline(10.0, 50.0, 6)
FORMS = {
    "own-response": Form("own-response", "curve", "own", (OVER_FORCE,), sizes=(5e-4, 4e-4)),
    "cross-response": Form("cross-response", "line", "cross", (StraightLine(-1.0, 1.0),), sizes=(2e-3, 1e-3)),
    "z-response": Form("z-response", "curve", "out-of-plane", (OVER_FORCE,), sizes=(5e-4, 4e-4), kept=(5, 3)),
    "scale-over-cross": Form("scale-over-cross", "curve", "cross", (OVER_FORCE,), "force", (5e-4, 4e-4)),
    "force": Form("force", "products", "force", (Products(3),), sizes=(1e-3, 1e-3)),
    "axes-cross": Form("temperature-axes", "cross", "temperature", (WARM,), "cross", (2e-4, 1e-4)),
    "axes-z": Form("temperature-axes", "out-of-plane", "temperature", (WARM,), "out-of-plane", (2e-4, 1e-4)),
    "history": Form("history", "friction", "cross", (Ramp(),), "load", (1e-3, 1e-3)),
    "temperature-bias": Form("temperature-bias", "curve", "temperature", (WARM,), sizes=(1e-3, 0.0),
                             kept=(7, 0)),
    "output": Form("output", "curve", "output", (Spline(1.0, 4.0, 10),), sizes=(2e-4,), shared=True),
    "column:supply_v": Form("column:supply_v", "curve", "column:supply_v", (Spline(4.8, 5.2, 4),), sizes=(1e-3, 1e-3)),
}  # fmt: skip

THRESHOLDS = Form("own-response", "thresholds", "own", (Clips((0.01, 0.1)),), sizes=(1e-3, 1e-3))


def with_forms(*forms: Form, seed: int = 1, std: float | None = None) -> Model:
    """The linear model and a free form at each place, with coefficients of random size."""
    rng, linear = np.random.default_rng(seed), model(LINEAR, std=std)
    terms = []
    for form in forms:
        effect = free_form((form,))
        estimates = [
            Estimate(p.name, axis, float(size * rng.uniform(-2, 2)), std, "V")
            for p in effect.parameters
            for axis, size in (p.prior or {}).items()
        ]
        terms.append(Term(effect, estimates=tuple(estimates)))
    return replace(linear, terms=(*linear.terms, *terms))


def table(seed: int, basis: Spline = OVER_FORCE) -> CubicTable:
    return spline_table(basis, np.random.default_rng(seed).uniform(-1, 1, basis.count))


def test_a_table_is_the_spline_itself() -> None:
    x, u = np.linspace(-1.5, 1.5, 1001), np.random.default_rng(3).uniform(-1, 1, OVER_FORCE.count)
    assert spline_table(OVER_FORCE, u)(x) == pytest.approx(OVER_FORCE(x) @ u, abs=1e-10)
    assert spline_table(OVER_FORCE, u[:4])(x) == pytest.approx(OVER_FORCE(x)[:, :4] @ u[:4], abs=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_bounds_of_a_table_hold_every_value_and_slope(seed: int) -> None:
    rng, curve = np.random.default_rng(seed), table(seed)
    low = rng.uniform(-1.6, 1.4, 50)
    high = low + rng.choice([0.0, 1e-3, 0.1, 1.0], 50)
    least, most, flattest, steepest = curve.bounds(low, high)
    x = low + (high - low) * rng.uniform(0, 1, (400, 50))
    value, h = curve(x), 1e-6
    assert np.all((least <= value) & (value <= most))
    inside = (x - h >= low) & (x + h <= high)
    slope = (curve(x + h) - curve(x - h)) / (2 * h)
    assert np.all(~inside | ((flattest - 1e-7 <= slope) & (slope <= steepest + 1e-7)))
    wide = high - low > 0.09
    assert np.median((most - least)[wide]) < 2 * np.median(np.ptp(value, axis=0)[wide])
    measured = np.where(inside, slope, np.median(slope, axis=0))
    assert np.median((steepest - flattest)[wide]) < 2 * np.median(np.ptp(measured, axis=0)[wide])


@pytest.mark.parametrize("form", [*FORMS.values(), THRESHOLDS], ids=lambda form: f"{form.place}/{form.name}")
def test_a_free_form_is_inverted(form: Form) -> None:
    fitted = with_forms(form)
    made = invert_model(fitted)
    assert made.forward.fates[-1].how == INVERTED, made.forward.fates[-1].why
    assert error(made, fitted) < 1e-9


@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_language_has_the_same_tables(compiler: str, tmp_path: Path) -> None:
    made = invert_model(with_forms(*FORMS.values()), precision="float" if compiler == "clang" else "double")
    program = build(compiler, written(made, tmp_path), tmp_path / "test", "-DSENSOR_MAIN")
    assert subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout.startswith("0 of 16")
    read = json.loads(document.files(made, ORIGIN, make_vectors(made))["sensor.json"])
    inputs, expected = read["self_test"]["inputs"][5], read["self_test"]["expected"][5]
    values = dict(zip([each["name"] for each in read["inputs"]], inputs, strict=True))
    tables = {
        name: CubicTable(t["low"], t["step"], tuple(map(tuple, t["pieces"]))) for name, t in read["tables"].items()
    }
    assert len(tables) == len(made.program.tables) > 5
    assert interpreted(read, {**values, **tables}) == pytest.approx(expected, abs=read["self_test"]["tolerance"])
    assert any("Tables: " in line for line in header_lines(made, ORIGIN))


@pytest.mark.parametrize(
    ("place", "driver", "basis", "factor"),
    [
        ("time-bias", "time", Spline(0.0, 1e4, 5), ""),
        ("time-bias", "time", Waves(0.0, 1e4, 5, 2.0), ""),
        ("history", "own", Play((0.1, 0.5)), ""),
        ("own-response", "own", OVER_FORCE, "side"),
        ("column:std", "variance", StraightLine(0.0, 1e-6), ""),
    ],
)
def test_a_form_that_no_product_knows_is_left_out(place: str, driver: str, basis: Basis, factor: str) -> None:
    form = Form(place, "curve", driver, (basis,), factor, (1e-3, 1e-3))
    fate = trace_model(with_forms(form)).fates[-1]
    assert (fate.how, bool(fate.why)) == (LEFT_OUT, True)


def test_a_curve_that_turns_back_has_no_inverse() -> None:
    steep = replace(FORMS["own-response"], sizes=(0.5, 0.5))
    with pytest.raises(Exception, match=r"--leave-out free:own-response"):
        invert_model(with_forms(steep))


def ramp(rate_c_s: float) -> Table:
    """A sweep while the temperature rises."""
    columns = synthetic.turns()
    T = 25.0 + rate_c_s * columns["t_s"]
    nothing = np.zeros(len(T))
    return synthetic.poses({**columns, "temperature_c": T}, nothing, nothing, seed=None)


def test_a_product_is_told_the_rate_of_the_temperature_where_the_thermometer_lags() -> None:
    thermal = {**LINEAR, "temperature-bias": {"slope": (0.001, -0.002)}}
    fitted = model(thermal, constants={"lead_s": 60.0})
    made = invert_model(fitted, Range.for_model(fitted, temperature_c=(0.0, 60.0)))
    assert made.program.inputs == ("vx", "vy", "temperature_c", RATE)
    assert RATE not in invert_model(model(thermal)).program.inputs
    data = ramp(0.005)
    steps = steps_of(fitted)
    a = sensed(np.column_stack(synthetic.components(synthetic.turns())), data, steps)
    v = respond(a, data, steps)
    inside = slice(10, -20)  # the reading 60 s after the last rows is not there
    inputs = {"vx": v[:, 0], "vy": v[:, 1], "temperature_c": data.column("temperature_c")}
    found, without = (made.program.run({**inputs, RATE: np.full(data.n, rate)}) for rate in (0.005, 0.0))
    assert np.abs(found["ax"] - a[:, 0])[inside].max() < 1e-6
    assert np.abs(without["ax"] - a[:, 0])[inside].max() == pytest.approx(60 * 0.005 * 0.001 / 1.01, rel=0.01)
    logged = replace(data, columns={**data.columns, "vx_v": v[:, 0], "vy_v": v[:, 1]})
    residual = compensate_residual(made, logged)
    assert np.abs(residual.compensated)[inside].max() < 0.1  # mm/s^2
