"""From stage angles to specific force, against explicit matrices; and back from the output."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calibrations.effects import Values
from calibrations.effects.catalogue import catalogue
from calibrations.geometry.orientation import Pose, nominal_pose, other_in_plane, out_of_plane, rotation, specific_force
from calibrations.model.chain import Step, backward, force, respond, sensed
from calibrations.table import Array, Table
from tests.calibrations import synthetic

angles = st.floats(-720.0, 720.0)
small = st.floats(-10.0, 10.0)


def about(axis: str, angle_deg: float) -> Array:
    return Rotation.from_euler(axis, angle_deg, degrees=True).as_matrix()


def step(name: str, **values: float | list[float]) -> Step:
    return catalogue()[name], Values.of(values)


@given(angles, angles, angles, st.booleans(), small, small)
def test_the_specific_force_is_that_of_explicit_rotations(
    alpha: float, beta: float, mount: float, flip: bool, lean_x: float, lean_y: float
) -> None:
    up = about("x", lean_x) @ about("y", lean_y) @ [0.0, 0.0, 1.0]
    F = np.diag([1.0, -1.0, -1.0]) if flip else np.eye(3)
    explicit = F @ about("z", mount) @ about("z", beta) @ about("y", alpha) @ up
    stages = (np.radians([angle]) for angle in (alpha, beta, mount))
    pose = Pose(next(stages), next(stages), next(stages), np.array([float(flip)]), up)
    a = specific_force(pose)
    np.testing.assert_allclose(a[0], explicit, atol=1e-13)
    assert np.linalg.norm(a) == pytest.approx(1.0, abs=1e-14)


def test_the_specific_force_has_the_components_of_the_paper() -> None:
    columns = synthetic.turns()
    table = synthetic.poses(columns, columns["beta_deg"], columns["beta_deg"])
    a = specific_force(nominal_pose(table))
    np.testing.assert_allclose(a, np.column_stack(synthetic.components(columns)), atol=1e-14)


@given(small, small, small)
def test_misalignment_turns_the_axes(x: float, y: float, z: float) -> None:
    columns = synthetic.turns((90, 30), step_deg=30)
    table = synthetic.poses(columns, columns["beta_deg"], columns["beta_deg"])
    turned = Rotation.from_rotvec([x, y, z], degrees=True).as_matrix()
    explicit = np.column_stack(synthetic.components(columns)) @ turned  # rows times R are R^T a
    np.testing.assert_allclose(force(table, [step("axis-misalignment", x=x, y=y, z=z)]), explicit, atol=1e-13)
    np.testing.assert_allclose(rotation(np.radians([x, y, z])), turned, atol=1e-13)


@given(small, small, small)
def test_nonorthogonality_leans_the_axes(xy: float, xz: float, yz: float) -> None:
    a = Rotation.random(10, rng=np.random.default_rng(0)).as_matrix()[:, 0]
    table = Table.from_columns("positions", dict(zip(("ax", "ay", "az"), a.T, strict=True)))
    s = np.sin(np.radians([xy, xz, yz]))
    axes = [[1, 0, 0], [s[0], np.sqrt(1 - s[0] ** 2), 0], [s[1], s[2], np.sqrt(1 - s[1] ** 2 - s[2] ** 2)]]
    felt = sensed(a, table, [step("axis-nonorthogonality", xy=xy, xz=xz, yz=yz)])
    np.testing.assert_allclose(felt, a @ np.transpose(axes), atol=1e-14)


@given(st.integers(0, 1000), st.floats(0.5, 2000.0))
def test_backward_undoes_forward(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    a = Rotation.random(20, rng=rng).as_matrix()[:, 0]
    steps = [
        step("bias", bias=rng.uniform(-3, 3, 3) * scale),
        step("scale-factor", scale=scale * rng.uniform(0.9, 1.1, 3)),
        step("quadratic-nonlinearity", square=scale * rng.uniform(-0.03, 0.03, 3)),
        step("cross-axis-bias", square=scale * rng.uniform(-0.03, 0.03, 3)),
        step("axis-nonorthogonality", xy=rng.uniform(-3, 3), xz=rng.uniform(-3, 3), yz=rng.uniform(-3, 3)),
    ]
    blank = Table.from_columns("positions", dict.fromkeys(("ax", "ay", "az"), np.zeros(20)))
    v = respond(sensed(a, blank, steps), blank, steps)
    table = Table.from_columns("positions", dict(zip(("ax", "ay", "az"), v.T, strict=True)))
    np.testing.assert_allclose(backward(table, steps), a, atol=1e-10)


def test_each_axis_has_its_in_plane_and_out_of_plane_axis() -> None:
    a = np.array([[1.0, 2.0, 3.0]])
    assert other_in_plane(a).tolist() == [[2.0, 1.0, 1.0]]
    assert out_of_plane(a).tolist() == [[3.0, 3.0, 2.0]]


def test_outputs_that_no_force_explains_are_solved_as_far_as_they_show_one() -> None:
    """A sensor whose axis z is dead: what it would sense along z stays at none."""
    table = Table.from_columns("positions", {"ax": [0.5], "ay": [-0.2], "az": [0.1]}, {"unit": "m/s2"})
    dead = [(catalogue()["scale-factor"], Values(scale=np.array([1.0, 1.0, 0.0])))]
    np.testing.assert_allclose(backward(table, dead), [[0.5, -0.2, 0.0]], atol=1e-9)
