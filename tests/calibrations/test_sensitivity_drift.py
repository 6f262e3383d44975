"""Changes of the scale factor, over other forces and over time, multiply all that the sensor makes of the force."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.effects import Values
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.problem_kinds import make_problem
from calibrations.model.chain import forward
from calibrations.model.file import read_model
from tests.calibrations import synthetic

COLUMNS = synthetic.turns(inclinations_deg=(90, 30))
AX, AY, AZ = synthetic.components(COLUMNS)
WARMER = np.sin(0.01 * COLUMNS["t_s"])
TABLE = synthetic.poses(COLUMNS | {"temperature_c": 25 + WARMER}, 2.5 + AX, 2.5 + AY)
DRIFT = ("temperature-scale", {"slope": [0.01, 0.02, 0.0], "lead_s": 0.0, "level": 0.0, "reference_c": 25.0})
LINEAR = (("bias", {"bias": [2.5, 2.4, 0.0]}), ("scale-factor", {"scale": [1.1, 0.9, 1.0]}))


def output(*steps: tuple[str, dict[str, object]]) -> np.ndarray:
    return forward(TABLE, [(catalogue()[name], Values.of(values)) for name, values in (*LINEAR, *steps)])


def test_a_drift_multiplies_what_a_nonlinearity_adds() -> None:
    cubic = ("cubic-nonlinearity", {"cube": [0.03, -0.02, 0.0]})
    straight, alone = output() - [2.5, 2.4], output(cubic) - output()
    drifting = 1 + np.outer(WARMER, [0.01 / 1.1, 0.02 / 0.9])
    np.testing.assert_allclose(output(cubic, DRIFT), [2.5, 2.4] + drifting * (straight + alone), rtol=0, atol=1e-14)


OVER_Z = ("z-axis-scale", {"slope": [0.02, -0.01, 0.0], "square": [0.0, 0.03, 0.0]})
OVER_CROSS = ("cross-axis-scale", {"slope": [0.01, 0.04, 0.0]})


def test_a_scale_over_other_forces_multiplies_what_a_nonlinearity_adds_and_a_drift_multiplies_both() -> None:
    """The other forces are those along the axes, and not what the sensor makes of them."""
    cubic = ("cubic-nonlinearity", {"cube": [0.03, -0.02, 0.0]})
    response = output(cubic) - [2.5, 2.4]
    over_z = np.column_stack([0.02 * AZ / 1.1, (-0.01 * AZ + 0.03 * AZ**2) / 0.9])
    over_cross = np.column_stack([0.01 * AY / 1.1, 0.04 * AX / 0.9])
    expected = [2.5, 2.4] + (1 + over_z + over_cross) * response
    np.testing.assert_allclose(output(cubic, OVER_Z, OVER_CROSS), expected, rtol=0, atol=1e-14)
    drifting = 1 + np.outer(WARMER, [0.01 / 1.1, 0.02 / 0.9])
    expected = [2.5, 2.4] + drifting * (1 + over_z + over_cross) * response
    np.testing.assert_allclose(output(DRIFT, cubic, OVER_CROSS, OVER_Z), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", ["temperature-bias", "bias-drift"])
def test_a_drift_does_not_multiply_an_offset(name: str) -> None:
    problem = make_problem(read_model("linear").with_effect(catalogue()[name]), TABLE)
    offset = (name, dict(problem.layout.steps(problem.layout.typical)[-1][1]))
    np.testing.assert_allclose(output(offset, DRIFT) - output(DRIFT), output(offset) - output(), rtol=0, atol=1e-14)


def test_derivatives_are_those_of_the_whole_chain() -> None:
    model = read_model("linear")
    for name in ("temperature-scale", "hysteresis", "quadratic-nonlinearity", "temperature-bias", "dead-zone"):
        model = model.with_effect(catalogue()[name])
    problem = make_problem(model, TABLE)
    layout = problem.layout
    theta = layout.starts()[0] + layout.typical / 3
    found = problem.jacobian(theta)
    for k, typical in enumerate(layout.typical):
        if layout.of_effect("dead-zone")[k]:
            continue  # it has a corner
        step = 1e-4 * typical * np.eye(len(theta))[k]
        other = (problem.residual(theta + step) - problem.residual(theta - step)) / (2e-4 * typical)
        size = np.max(np.abs(other))
        assert np.max(np.abs(found[:, :, k] - other)) <= (0.05 if layout.of_effect("scale-factor")[k] else 1e-4) * size
