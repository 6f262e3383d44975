"""The general calibration of three axes: what it makes of raw outputs is what the model's effects make of them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.fitting.matrices import CalibrationMatrices, calibration_matrices
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from rig.cli.commands import fit as command
from tests.calibrations import synthetic, turned

AXES = np.array([[1.0, 0.0, 0.0], [0.02, 1.0, 0.0], [-0.01, 0.03, 1.0]])
AXES = AXES / np.linalg.norm(AXES, axis=1, keepdims=True)
SCALE, BIAS = np.array([2050.0, 2040.0, 2106.0]), np.array([-6.0, -48.0, -29.0])


def made(found: object) -> CalibrationMatrices:
    assert isinstance(found, CalibrationMatrices)
    return found


def positions(seed: int, noise: float = 1.0, n: int = 40) -> tuple[Table, Array]:
    """A triad of accelerometers put down by hand, and the specific forces."""
    rng = np.random.default_rng(seed)
    a = Rotation.random(n, rng=rng).as_matrix()[:, 2]
    outputs = (a @ AXES.T) * SCALE + BIAS + noise * rng.standard_normal((n, 3))
    columns = dict(zip(("ax", "ay", "az"), outputs.T, strict=True)) | {"n": np.ones(n)}
    return Table.from_columns("positions", columns | {f"a{k}_std": np.full(n, noise) for k in "xyz"}), a


def test_positions_give_the_matrices() -> None:
    table, a = positions(0)
    model = read_model("linear").with_effect(catalogue()["axis-nonorthogonality"])
    found = made(calibration_matrices(fit(model, table)))
    assert found(table.outputs) == pytest.approx(a, abs=4e-3)
    assert pytest.approx(np.linalg.inv(AXES), abs=2e-3) == found.M
    assert pytest.approx(1 / SCALE, rel=1e-3) == found.S
    assert found.b == pytest.approx(-BIAS / SCALE, abs=1e-3)
    assert (found.unit, found.beyond) == ("g", ())


def test_uncertainties_of_the_matrices_cover_them() -> None:
    model = read_model("linear").with_effect(catalogue()["axis-nonorthogonality"])
    errors: list[float] = []
    for seed in range(16):
        found = made(calibration_matrices(fit(model, positions(seed)[0])))
        off = (found.M - np.linalg.inv(AXES)) / np.where(found.M_std > 0, found.M_std, 1.0)
        errors += [off[1, 0], off[2, 0], off[2, 1], (found.S[0] - 1 / SCALE[0]) / found.S_std[0]]
        errors.append((found.b[2] + BIAS[2] / SCALE[2]) / found.b_std[2])
    assert 0.8 < np.std(errors) < 1.25


def test_poses_give_them_with_the_turn_of_the_whole_sensor() -> None:
    columns = synthetic.turns()
    a = np.column_stack(synthetic.components(columns))
    turn = Rotation.from_rotvec([0.3, -0.7, 0.5], degrees=True).as_matrix()
    v = a @ turn * np.array([1.02, 0.98, 1.01]) + np.array([2.51, 2.48, 2.5])
    outputs = dict(zip(("vx_v", "vy_v", "vz_v"), v.T, strict=True))
    outputs["vx_v"] = outputs["vx_v"] + 0.004 * a[:, 0] ** 2
    std = {f"v{k}_std_v": np.full(len(v), 1e-4) for k in "xyz"} | {"n": np.ones(len(v))}
    table = Table.from_columns("poses", columns | outputs | std)
    model = read_model("linear").with_effect(catalogue()["axis-misalignment"])
    found = made(calibration_matrices(fit(model.with_effect(catalogue()["quadratic-nonlinearity"]), table)))
    assert pytest.approx(turn, abs=1e-5) == found.M
    assert pytest.approx([1 / 1.02, 1 / 0.98, 1 / 1.01], rel=1e-4) == found.S
    assert found.beyond == ("quadratic-nonlinearity",)


def test_a_magnetometer_and_a_gyroscope_have_one_each() -> None:
    table = turned.magnetometer(turned.in_iron(60, seed=1))
    magnetic = made(calibration_matrices(fit(read_model("magnetometer"), table)))
    assert np.linalg.norm(magnetic(table.outputs), axis=1) == pytest.approx(1.0, abs=5e-3)
    gyro = turned.gyroscope(seed=1, lean_deg=0.4)
    found = made(calibration_matrices(fit(read_model("gyroscope").with_effect(catalogue()["gyro-misalignment"]), gyro)))
    rate = gyro.column("rate_deg_s")[:, None] * np.column_stack([gyro.column(f"a{k}") for k in "xyz"])
    assert found(gyro.outputs) == pytest.approx(rate, abs=0.01)
    assert (magnetic.unit, found.unit) == ("field", "deg/s")


def test_two_axes_have_no_calibration_matrices() -> None:
    columns = synthetic.turns((90,))
    x, y, _ = synthetic.components(columns)
    assert calibration_matrices(fit(read_model("linear"), synthetic.poses(columns, x + 2.5, y + 2.5))) is None


def test_a_fit_tells_it_in_words_and_as_json() -> None:
    found = fit(read_model("magnetometer"), turned.sap6("HC"))
    text = "\n".join(command.calibration_lines(found))
    assert "General calibration, G_c = M (S G_r + b), from uT to field (Book 17.3)" in text
    assert "Method of the Book, from the extremes: hard iron -0.1625, -2.0938, -12.31" in text
    whole = json.loads(json.dumps(command.calibration_document(found), allow_nan=False))
    assert whole["by_hand"]["hard_iron"] == pytest.approx([-0.1625, -2.09375, -12.3125])
    document = whole["calibration"]
    assert np.array(document["M"]["value"]) == pytest.approx(made(calibration_matrices(found)).M)
    assert document["S"]["std"][0][0] > 0
    assert document["unit"] == {"from": "uT", "to": "field"}
