"""Which effects of the geometry are causes, beside larger effects of the response and the stages."""

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit
from calibrations.loop import dataset
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic

TURN = synthetic.turns((90, 30, 150, 60, 120), step_deg=10)


def forces(alpha_deg: float = 0.0, beta_deg: Array | float = 0.0, tilt_deg: float = 0.0) -> Array:
    """Specific force, g, (n, 3), at angles that differ from the stages' readings by these; `tilt_deg` about x."""
    alpha, beta = np.radians(TURN["alpha_deg"] + alpha_deg), np.radians(TURN["beta_deg"] + beta_deg)
    tilt = np.radians(tilt_deg)
    x, y, z = np.sin(alpha) * np.cos(tilt), -np.sin(tilt), np.cos(alpha) * np.cos(tilt)
    return np.column_stack([np.cos(beta) * x - np.sin(beta) * y, np.sin(beta) * x + np.cos(beta) * y, z + 0 * beta])


def discover(sensed: Array, added: Array | float = 0.0) -> Discovery[Fit]:
    """The answer on outputs of two axes that sense these forces, (n, 2), and add something, V."""
    outputs = np.array([2.5, 2.52]) + sensed * [1.0, 0.97] + added
    table = synthetic.poses(TURN, outputs[:, 0], outputs[:, 1])
    return dataset(table).discover(read_model("linear"), catalogue())


@pytest.mark.parametrize("beta_deg", [1.0, 5.0])
def test_zeros_of_the_stages_are_no_misalignment_beside_a_large_nonlinearity(beta_deg: float) -> None:
    force = forces(alpha_deg=-0.8 * beta_deg, beta_deg=beta_deg, tilt_deg=0.06)[:, :2]
    found = discover(force, 6e-3 * force**3 + 2e-3 * force**2)
    assert {"stage-zero-offset", "base-tilt"} <= set(found.causes)
    assert "axis-misalignment" not in found.causes
    assert found.end.params["stage-zero-offset.beta"].value == pytest.approx(beta_deg, abs=0.01)


@pytest.mark.release
def test_a_backlash_of_its_own_form_leaves_non_orthogonality_its_name() -> None:
    side = np.where(np.diff(TURN["beta_deg"], prepend=TURN["beta_deg"][0] - 1) >= 0, 1.0, -1.0)
    force = forces(beta_deg=0.3 * side)
    sheared = np.column_stack([force[:, 0], force[:, 1] - np.sin(np.radians(0.13)) * force[:, 0]])
    found = discover(sheared, 5e-3 * force[:, :2] ** 3)
    assert {"stage-backlash", "axis-nonorthogonality", "cubic-nonlinearity"} <= set(found.causes)


def test_one_axis_has_stage_zeros_and_no_angle_to_another_axis() -> None:
    force = forces(alpha_deg=-0.8, tilt_deg=0.3)[:, 0]
    both = synthetic.poses(TURN, 2.5 + force + 5e-3 * force**3, 2.5 + force)
    columns = {name: both.column(name) for name in both.columns if not name.startswith("vy")}
    found = dataset(Table.from_columns("poses", columns)).discover(read_model("linear"), catalogue())
    assert "cubic-nonlinearity" in found.causes
    assert {"stage-zero-offset", "base-tilt"} & set(found.causes)


def test_a_small_misalignment_has_its_name_beside_a_scale_factor_over_the_out_of_plane_force() -> None:
    """Of 2 noise floors each: such a scale factor multiplies the own force, and has no line over the other force."""
    force = forces()
    lean = np.radians(0.013)
    sensed = force[:, :2] + lean * np.column_stack([force[:, 2], -force[:, 2]])
    found = discover(sensed, force[:, :2] * force[:, 2:] ** 2 * [-7e-4, 0.0])
    assert set(found.causes) == {"z-axis-scale", "axis-misalignment"}


def test_a_non_orthogonality_has_its_name_beside_a_smaller_scale_factor_over_the_other_axis() -> None:
    """Such a scale factor multiplies the own force, and has no line over the other force."""
    force = forces()
    leaning = force[:, :2] - np.radians(0.05) * np.column_stack([0 * force[:, 0], force[:, 0]])
    found = discover(leaning, 8e-4 * force[:, :2] * np.tanh(1.2 * force[:, [1, 0]]))
    assert set(found.causes) == {"cross-axis-scale", "axis-nonorthogonality"}


def test_a_non_orthogonality_has_its_name_beside_a_far_smaller_square_of_the_other_axis() -> None:
    """Only about a zero of more than 0.7 g would the square have such a line."""
    force = forces()
    leaning = force[:, :2] - np.radians(0.04) * np.column_stack([0 * force[:, 0], force[:, 0]])
    found = discover(leaning, 4e-4 * force[:, [1, 0]] ** 2)
    assert set(found.causes) == {"cross-axis-bias", "axis-nonorthogonality"}
