"""Compensations that remember: effects of a history are followed sample after sample, in every language alike."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.compensation import sources
from calibrations.compensation.cost import memory_at
from calibrations.compensation.document import header_lines, make_vectors
from calibrations.compensation.forward import FORCES, steps_of
from calibrations.compensation.graph import evaluate_nodes
from calibrations.compensation.inverse import Compensation, invert_model
from calibrations.effects.kernels import slip
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.model.chain import respond
from calibrations.table import Table
from tests.calibrations.compiled import COMPILERS, FOLLOWING, ORIGIN, build, through, written
from tests.calibrations.fitted import LINEAR, PHYSICAL, model

SLIPS = {
    "hysteresis": {
        "height": (0.003, 0.002),
        "reach": (0.1, 0.14),
        "spread": 0.5,
        "pressing": 0.4,
        "pressing_square": 0.2,
    }
}
LAGS = {"temperature-hysteresis": {"slope": (0.001, -0.002), "play": 0.6}}
BOTH = {**PHYSICAL, **SLIPS, **LAGS}


@cache
def both() -> Compensation:
    return invert_model(model(BOTH))


def test_what_an_effect_remembers_is_what_its_kernel_does() -> None:
    ((effect, p),) = steps_of(model(SLIPS))
    assert effect.memory == 6
    a = np.cumsum(np.random.default_rng(3).normal(0, 0.05, (500, 3)), axis=0)
    table: Any = None  # hysteresis asks nothing of it
    held: Any = [np.zeros((1, 3))] * effect.memory
    found = []
    for row in a:
        part, held = effect.follow(row[None], table, p, held)
        found.append(part[0])
    limits = np.array([0.1, 0.14, 0.1]) * (1 + p["spread"] * ((np.arange(6) + 0.5 - 3) / 3)[:, None])
    load = np.abs(a[:, [1, 0, 0]])
    pressed = 1 + p["pressing"] * load + p["pressing_square"] * load**2
    direct = slip(a, np.empty((len(a), 0, 3)), pressed, limits, np.zeros(3)) * p["height"]
    assert np.abs(np.array(found) - direct).max() < 1e-15


def test_on_the_way_of_the_stages_it_remembers_what_the_model_has() -> None:
    """So the model's own outputs at poses are undone, though a product sees more than the poses."""
    beta = np.concatenate([np.arange(0.0, 361.0, 20.0), np.arange(360.0, -1.0, -20.0)])
    t_s = 7.0 * np.arange(len(beta))
    columns = {"alpha_deg": np.full(len(beta), 90.0), "beta_deg": beta, "t_s": t_s, "vx_v": 0 * beta, "vy_v": 0 * beta}
    columns |= {"direction": np.repeat([1.0, -1.0], len(beta) // 2), "temperature_c": 25 + 2 * np.sin(t_s / 60)}
    table = Table.from_columns("poses", columns)
    made = invert_model(
        model({**LINEAR, **LAGS, "hysteresis": {**SLIPS["hysteresis"], "pressing": 0.0, "pressing_square": 0.0}})
    )
    a = specific_force(nominal_pose(table))
    v = respond(a, table, steps_of(made.model))
    inputs = {"vx": v[:, 0], "vy": v[:, 1], "temperature_c": table.column("temperature_c")}
    settled = slice(20, None)  # the play begins at the mean temperature, the table at its first
    found = made.program.run(inputs | memory_at(table, a, made.forward))
    assert np.abs(found["ax"] - a[:, 0])[settled].max() < 1e-9
    forgetful = made.program.run(inputs)
    assert np.abs(forgetful["ax"] - a[:, 0])[settled].max() > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_language_follows_the_same_samples(compiler: str, tmp_path: Path) -> None:
    made = both()
    paths = written(made, tmp_path)
    (tmp_path / "driver.c").write_text(FOLLOWING)
    checks = make_vectors(made, 512)
    found = through(build(compiler, [*paths, tmp_path / "driver.c"], tmp_path / "driver"), checks.inputs, 2)
    assert np.abs(found - checks.expected).max() < 1e-9
    (text,) = sources.python_files(made, ORIGIN, make_vectors(made)).values()
    names: dict[str, Any] = {"__name__": "sensor"}
    exec(compile(text, "sensor.py", "exec"), names)  # noqa: S102 it is what we wrote
    memory = names["begin"]()
    by_python = [names["compensate"](*row, memory) for row in checks.inputs.tolist()]
    assert np.abs(by_python - found).max() < 1e-9
    assert names["self_test"]() == 0
    program = build(compiler, paths, tmp_path / "test", "-DSENSOR_MAIN")
    assert subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout.startswith("0 of 16")


def test_the_proof_holds_whatever_is_remembered() -> None:
    made = both()
    random = np.random.default_rng(8)
    n = 4000
    at = {name: random.uniform(-1.5, 1.5, n) for name in FORCES}
    at |= {"temperature_c": random.uniform(-20, 85, n)}
    memory = {name: random.normal(0, 3, n) for name in made.forward.memory}
    outputs = evaluate_nodes(made.forward.outputs, at | memory)
    inputs = at | memory | dict(zip(("vx", "vy"), outputs, strict=True))
    found = made.program.run({name: inputs[name] for name in (*made.program.inputs, *memory)})
    worst = max(np.abs(found[name] - at[name]).max() for name in ("ax", "ay"))
    assert worst < made.bound.within + 1e-14
    half_held = invert_model(
        model({**LINEAR, **SLIPS})
    ).bound.C  # friction may hold, 0.03 and 0.014 V/g, or slip, whatever was before
    assert np.diag(half_held) == pytest.approx([1 / (1.01 + 0.03 / 2), 1 / (0.98 + 0.002 / 0.14 / 2)])


def test_gravity_gives_a_missing_axis_and_the_memory_is_stored_once() -> None:
    made = invert_model(model({**PHYSICAL, **SLIPS}))
    (text,) = sources.python_files(made, ORIGIN, make_vectors(made)).values()
    names: dict[str, Any] = {"__name__": "sensor"}
    exec(compile(text, "sensor.py", "exec"), names)  # noqa: S102
    angle = np.linspace(0, 4 * np.pi, 200)
    a = np.column_stack([0.8 * np.cos(angle), 0.5 * np.sin(angle), np.zeros(200)])
    a[:, 2] = np.sqrt(1 - a[:, 0] ** 2 - a[:, 1] ** 2)
    memory, remembered = names["begin"](), dict.fromkeys(made.forward.memory, 0.0)
    for row in a:
        at = dict(zip(FORCES, row, strict=True)) | remembered
        vx, vy, *after = evaluate_nodes((*made.forward.outputs, *made.forward.memory.values()), at)
        remembered = dict(zip(made.forward.memory, map(float, after), strict=True))
        found = names["in_gravity"](float(vx), float(vy), 1.0, memory)
        assert found == pytest.approx(row[:2], abs=3e-5)


def test_the_head_says_that_samples_come_in_order() -> None:
    head = " ".join(" ".join(header_lines(both(), ORIGIN)).split())
    assert "With a history: hysteresis, temperature-hysteresis. Give every sample, in order: 14 numbers" in head


@pytest.mark.parametrize("compiler", COMPILERS)
def test_an_axis_that_nothing_remembers_is_no_warning(compiler: str, tmp_path: Path) -> None:
    slips = {"height": (0.003, 0.0), "reach": (0.1, 0.1), "spread": 0.5, "pressing": 0.0}
    made = invert_model(model({**LINEAR, "hysteresis": slips}))
    assert not any("ay" in line.inner for line in made.program.after)
    assert build(compiler, written(made, tmp_path), tmp_path / "test", "-DSENSOR_MAIN").exists()
