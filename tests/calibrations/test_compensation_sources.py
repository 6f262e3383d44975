"""What is written compiles without a warning and computes what the model says, in C, in Python and out of JSON."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.compensation import document, sources
from calibrations.compensation.document import Origin, header_lines, make_vectors, round_up
from calibrations.compensation.graph import OPERATIONS
from calibrations.compensation.inverse import Compensation, invert_model
from calibrations.table import Array
from tests.calibrations.compiled import COMPILERS, DRIVER, ORIGIN, build, through, written
from tests.calibrations.fitted import LINEAR, PHYSICAL, model
from tests.calibrations.test_compensation import EVERYTHING, everything

MODELS = {"linear": LINEAR, "physical": PHYSICAL, "everything": EVERYTHING}


def rows(made: Compensation, n: int = 20_000) -> tuple[Array, Array]:
    """Inputs all over the range, and its corners; true values that the model made them of."""
    found = make_vectors(made, 1 << (n - 1).bit_length())
    return found.inputs, found.expected


@pytest.fixture
def python() -> Any:
    """Carry out a written Python file; its names."""

    def run(made: Compensation) -> dict[str, Any]:
        (text,) = sources.python_files(made, ORIGIN, make_vectors(made)).values()
        names: dict[str, Any] = {"__name__": "sensor"}
        exec(compile(text, "sensor.py", "exec"), names)  # noqa: S102 it is what we wrote
        return names

    return run


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("values", MODELS.values(), ids=MODELS)
def test_c_agrees_with_python_over_the_whole_range(compiler: str, values: Any, tmp_path: Path, python: Any) -> None:
    made = everything() if values is EVERYTHING else invert_model(model(values))
    sources = written(made, tmp_path)
    (tmp_path / "driver.c").write_text(DRIVER)
    inputs, true = rows(made)
    found = through(build(compiler, [*sources, tmp_path / "driver.c"], tmp_path / "driver"), inputs, true.shape[1])
    assert np.abs(found - true).max() < 1e-9
    compensate = python(made)["compensate"]
    assert np.abs(found[:500] - [compensate(*row) for row in inputs[:500].tolist()]).max() < 1e-9


def test_the_head_names_the_function_for_the_axis_that_is_not_measured() -> None:
    assert "function in_gravity" in "".join(header_lines(invert_model(model(PHYSICAL)), ORIGIN))


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_self_test_passes_and_can_fail(compiler: str, tmp_path: Path) -> None:
    made = invert_model(model(EVERYTHING), precision="float") if compiler == "clang" else everything()
    sources = written(made, tmp_path)
    program = build(compiler, sources, tmp_path / "test", "-DSENSOR_MAIN")
    assert subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout.startswith("0 of 16")
    source = next(path for path in sources if path.name == "sensor.c")
    source.write_text(source.read_text().replace("1.01", "1.02"))  # the scale factor of x
    broken = build(compiler, sources, tmp_path / "broken", "-DSENSOR_MAIN")
    ended = subprocess.run([str(broken)], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.startswith("0 of")) == (1, False)


def test_python_and_json_compute_the_same(python: Any, tmp_path: Path) -> None:
    made = everything()
    names = python(made)
    assert names["self_test"]() == 0
    (text,) = document.files(made, ORIGIN, make_vectors(made)).values()
    read = json.loads(text)
    assert read["schema"] == "rig.compensation/1"
    for inputs, expected in zip(read["self_test"]["inputs"], read["self_test"]["expected"], strict=True):
        values = dict(zip([each["name"] for each in read["inputs"]], inputs, strict=True))
        assert interpreted(read, dict(values)) == pytest.approx(expected, abs=read["self_test"]["tolerance"])
        assert names["compensate"](**values) == pytest.approx(expected, abs=1e-9)


def test_the_self_test_of_a_model_is_the_same_at_every_export() -> None:
    made = invert_model(model(LINEAR))
    first, second = (sources.python_files(made, ORIGIN, make_vectors(made)) for _ in range(2))
    assert first == second


def interpreted(read: dict[str, Any], values: dict[str, float]) -> list[float]:
    """The program of a JSON document, as a stranger would run it."""

    def do(lines: list[Any]) -> None:
        for name, operation, inner in lines:
            values[name] = float(OPERATIONS[operation].apply(*(values.get(x, x) for x in inner)))

    do(read["before"])
    values |= dict.fromkeys(read["outputs"], 0.0)
    for _ in range(read["steps"]):
        do(read["loop"])
        values |= {name: values[x] for name, x in zip(read["outputs"], read["next"], strict=True)}
    return [values[name] for name in read["outputs"]]


def test_gravity_stands_in_for_an_axis_that_is_not_measured(python: Any, tmp_path: Path) -> None:
    made = invert_model(model(PHYSICAL))
    a = np.array([0.6, -0.48, math.sqrt(1 - 0.36 - 0.2304)])
    for side in (1.0, -1.0):
        inputs = dict(zip(made.program.inputs, _outputs(made, a * [1, 1, side]), strict=False))
        found = python(made)["in_gravity"](**{k: v for k, v in inputs.items() if k != "az"}, side=side)
        assert found == pytest.approx(a[:2], abs=1e-5)
    header = next(path for path in written(made, tmp_path) if path.suffix == ".h").read_text()
    assert "sensor_in_gravity(const sensor_input *in, sensor_real side);" in header
    assert "sensor_in_gravity" not in "".join(
        path.read_text() for path in written(invert_model(model(LINEAR)), tmp_path)
    )


def _outputs(made: Compensation, a: Array) -> list[float]:
    from calibrations.compensation.graph import evaluate_nodes

    return [float(v) for v in evaluate_nodes(made.forward.outputs, dict(zip(("ax", "ay", "az"), a, strict=True)))]


def test_the_head_says_what_a_user_must_know() -> None:
    slips = {"hysteresis": {"height": (0.003, 0.002), "reach": (0.1, 0.12), "spread": 0.5, "pressing": 0.0}}
    made = invert_model(model({**PHYSICAL, **slips, "stage-backlash": {"half_play": 0.1}}), without=["hysteresis"])
    head = " ".join(" ".join(header_lines(made, ORIGIN)).split())
    assert f"q <= {round_up(made.bound.q)}, proved over the whole range" in head
    assert float(round_up(made.bound.q)) >= made.bound.q
    assert f"{sum(made.program.operations.values())} a sample" in head
    assert "Effects of the rig, not compensated: stage-backlash." in head
    assert "Left out: hysteresis, because the user asked for it; error" in head
    assert "mg rms and" in head
    assert "bias bias x = 2.5 +- 1e-05 V" in head
    assert ("serial number 17" in head, "SHA-256 " + "0" * 64 in head) == (True, True)


def test_a_name_with_a_comment_mark_does_not_end_the_comment(tmp_path: Path) -> None:
    made = invert_model(model(LINEAR))
    sources = written(made, tmp_path, Origin("sensor", "*/ int x = ; /*\n.yaml", "0", "*/ p", "2026"))
    build("gcc", sources, tmp_path / "test", "-DSENSOR_MAIN")
