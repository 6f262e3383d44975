"""What `import calibrations as cal` gives."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import calibrations as cal
from calibrations.effects import Values
from calibrations.errors import DataError, MissingColumn, ModelError
from calibrations.table import Array, Table
from tests.calibrations import synthetic


def force_and_table() -> tuple[Array, Table]:
    columns = synthetic.turns(step_deg=30)
    x, y, _ = synthetic.components(columns)
    measured = synthetic.poses(columns, 2.5 + x, 2.5 + 1.1 * y)
    return np.column_stack([x, y]), cal.table(dict(measured.columns), "poses", measured.constants)


def test_a_fit_is_compensated_back_to_the_specific_force() -> None:
    a, data = force_and_table()
    found = cal.fit(data, "linear")
    assert found.params["scale-factor.y"].value == pytest.approx(1.1, abs=1e-4)
    assert np.abs(cal.compensate(found.model, data.outputs) - a).max() < 5e-4
    with pytest.raises(DataError, match="the model has the axes x, y"):
        cal.compensate(found.model, data.outputs[:, :1])


def test_the_functions_stay_where_submodules_have_their_names() -> None:
    import calibrations.fitting.fit
    import calibrations.noise.record
    import calibrations.table  # noqa: F401

    assert all(callable(getattr(cal, name)) for name in cal.__all__)


def test_importing_the_package_loads_no_analysis() -> None:
    code = "import sys, calibrations; print([m for m in ('scipy', 'numba', 'yaml') if m in sys.modules])"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["[]"]


def test_a_fit_compensates_columns_by_name_and_refuses_what_does_not_fit() -> None:
    a, data = force_and_table()
    found = cal.fit(data, "linear")
    for given in (data, dict(data.columns), data.outputs):
        assert np.abs(cal.compensate(found, given) - a).max() < 5e-4
    three = np.column_stack([data.outputs, data.outputs[:, 0]])
    with pytest.raises(DataError, match=r"shape \(\d+, 3\); the model has the axes x, y.*outputs\[:, \[0, 1\]\]"):
        cal.compensate(found, three)
    with pytest.raises(DataError, match=r"outputs\.T"):
        cal.compensate(found, data.outputs.T)
    with pytest.raises(MissingColumn, match=r'the column "vy_v" is missing: .* or ax, ay; did you mean "vx_v"\?$'):
        cal.compensate(found, {"vx_v": data.column("vx_v")})
    with pytest.raises(ModelError, match="its fit is in its member `fit`"):
        cal.compensate(cal.compare(data, "linear"), data)


def test_an_effect_of_ones_own_is_refused_by_its_name(golden) -> None:
    class Bias(cal.Effect):
        shift = cal.Parameter("{out}", typical=0.1)

        def transduction(self, a: Array, table: Table, p: Values) -> Array:
            return np.zeros((2, 2))

    with golden.refused(ModelError):
        cal.add("linear", Bias)
    with golden.refused(ModelError):
        cal.fit(force_and_table()[1], cal.add("linear", type("Wrong", (Bias,), {})))


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"ax": ["one"], "ay": [0.0], "az": [1.0]}, 'the column "ax" is not a column of numbers'),
        ({"ax": np.zeros((3, 2)), "ay": np.zeros(3), "az": np.zeros(3)}, r'the column "ax" has the shape \(3, 2\)'),
        (np.zeros((3, 3)), r'columns with names are needed, not a ndarray.*\{"ax": a\[:, 0\]'),
    ],
)
def test_columns_that_are_no_numbers_are_named(columns: Any, said: str) -> None:
    with pytest.raises(DataError, match=said):
        cal.table(columns, kind="positions")


@pytest.mark.parametrize("call", [cal.fit, cal.compare, cal.diagnose, cal.discover])
@pytest.mark.parametrize(("data", "said"), [("sweep.csv", r"cal\.read"), ({"ax": [1.0]}, r"a dict.*cal\.table")])
def test_data_that_are_no_table_are_refused_with_the_way_to_make_one(call: Any, data: Any, said: str) -> None:
    with pytest.raises(DataError, match=said):
        call(data, "linear")


def test_noise_takes_samples_as_a_series_as_columns_or_as_an_array_of_axes() -> None:
    pandas = pytest.importorskip("pandas")
    samples = np.random.default_rng(5).normal(0.0, [1e-3, 2e-3, 3e-3], (2000, 3))
    expected = {axis: cal.noise(column, 100.0).channels["x"] for axis, column in zip("xyz", samples.T, strict=True)}
    frame = pandas.DataFrame({"t_s": np.arange(2000) / 100} | dict(zip(("ax", "ay", "az"), samples.T, strict=True)))
    for found in (cal.noise(samples, 100.0), cal.noise(frame), cal.noise(dict(frame.items()))):
        for axis, channel in expected.items():
            same = found.channels[axis].coefficients["white-noise"].value
            assert same == pytest.approx(channel.coefficients["white-noise"].value, rel=1e-6)
    assert list(cal.noise(pandas.Series(samples[:, 0]), 100.0).channels) == ["x"]
    with pytest.raises(DataError, match=r"\(3, 2000\); \(n,\) or \(n, axes\) is needed: .*data\.T"):
        cal.noise(samples.T, 100.0)
    with pytest.raises(DataError, match="name the columns"):
        cal.noise(np.zeros((2000, 4)), 100.0)


@pytest.mark.parametrize(("square", "larger"), [(0.004, "wave"), (0.06, "quadratic-nonlinearity")])
def test_an_effect_of_ones_own_is_found_beside_one_of_the_catalogue(square: float, larger: str) -> None:
    class Wave(cal.Effect):
        """wave: five waves in a turn of beta."""

        height = cal.Parameter("{out}", typical=0.01)

        def transduction(self, a: Array, table: Table, p: Values) -> Array:
            return np.asarray(np.cos(5 * np.radians(table.column("beta_deg")))[:, None] * p.height)

    columns = synthetic.turns((90, 30, 150, 60), step_deg=20)
    x, y, _ = synthetic.components(columns)
    wave = 0.01 * np.cos(5 * np.radians(columns["beta_deg"]))
    data = synthetic.poses(columns, 2.5 + x + square * x**2 + wave, 2.5 + 1.02 * y)
    found = cal.discover(data, "linear", effects=[Wave])
    assert found.causes == (larger, *({"wave", "quadratic-nonlinearity"} - {larger}))
    assert found.verdict.value == "adequate"
    assert found.model["wave.x"].value == pytest.approx(0.01, abs=1e-4)
    assert found.model["quadratic-nonlinearity.x"].value == pytest.approx(square, abs=2e-4)
