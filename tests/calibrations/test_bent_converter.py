"""A converter that is bent or has bits of wrong weight, beside other causes: the causes named, and their rivals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from calibrations.discovery.structural import structure
from calibrations.discovery.verdict import Verdict
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.free_forms.bases import Steps
from calibrations.free_forms.chain import ModelEffects
from calibrations.free_forms.effect import FreeForm
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.rivals import gain_and_rivals
from calibrations.free_forms.search_result import Setting
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic
from tests.calibrations.synthetic import NOISE_V
from tests.calibrations.test_free_forms import discover, forces_of_sweep, poses

VIBRATION = "column:std/vibration-rectification"


def bent_converter(vibration: float, bow: float, bend: float) -> Table:
    """An unknown response of its own and rectified vibration of size `vibration`, V, before a bent converter."""
    forces = forces_of_sweep()
    n = len(forces)
    level = 1 + 2 * np.abs(np.sin(0.37 * np.arange(n))) * np.random.default_rng(7).uniform(size=n)
    added = 2e-3 * np.sin(4 * forces[:, :2]) + vibration * level[:, None] ** 2
    v = np.array([2.5, 2.52]) + np.array([1.0, 0.97]) * forces[:, :2] + added
    u = 2 * (v - (v.max() + v.min()) / 2) / np.ptp(v)
    made = poses(added + bow * u**2 + bend * u**3)
    return replace(made, columns={**made.columns, "vx_std_v": 8e-4 * level, "vy_std_v": 8e-4 * level})


@pytest.mark.slow
def test_an_unknown_response_before_a_bent_converter_gets_no_names_of_four_effects() -> None:
    found = discover(bent_converter(vibration=3e-4, bow=7e-3, bend=-5e-3))
    assert found.causes == ("vibration-rectification",)  # no saturation, dead zone or polynomial beside it
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.findings.places[0].name == "own-response"


@pytest.mark.slow
def test_a_curve_over_the_output_does_not_explain_a_vibration_that_the_output_holds() -> None:
    data = bent_converter(vibration=8e-4, bow=8e-3, bend=-5.6e-3)
    result = structure(fit(read_model("linear"), data), catalogue()).result
    assert {VIBRATION, "output/adc-nonlinearity", "own-response/curve"} <= set(result.active)
    assert "output/curve" not in result.active
    gain, rivals = gain_and_rivals(result, [VIBRATION], {"output", "own-response"})
    assert gain > 1e4
    assert rivals == ()


WEIGHTS = (0.0011, -0.0007, 0.0005, -0.0004)  # errors of the four highest bits, V
NORMAL = norm.ppf((np.arange(500) + 0.5) / 500)  # equally likely values of a normal distribution
POSES = synthetic.turns((82, 23, 151, 47, 128, 65, 104), step_deg=7)
SAMPLE_NOISE_V = NOISE_V * np.sqrt(5000.0)


def converted(added: Callable[[Array], Array], seed: int = 0) -> Table:
    """Poses of a sensor that adds V to its response to forces (2, n), behind a converter of 0 to 5 V with such bits."""
    forces = np.stack(synthetic.components(POSES)[:2])
    v = np.array([[2.5], [2.52]]) + np.array([[1.0], [0.97]]) * forces + added(forces)
    codes = np.floor((v[..., None] + SAMPLE_NOISE_V * NORMAL) / 5 * 16).astype(int)
    bits = sum(error * ((codes >> (3 - k)) & 1) for k, error in enumerate(WEIGHTS))
    return synthetic.poses(POSES, *(v + np.mean(bits, axis=-1)), seed=seed)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_bits_of_wrong_weight_are_named_and_nothing_else(seed: int) -> None:
    found = discover(converted(np.zeros_like, seed))
    assert found.causes == ("adc-nonlinearity",)
    assert found.findings.end.held_out_excess < 1.25


@pytest.mark.slow
def test_bits_of_wrong_weight_hide_no_other_cause() -> None:
    found = discover(converted(lambda force: 3e-3 * force**3))
    assert set(found.causes) == {"adc-nonlinearity", "cubic-nonlinearity"}
    assert found.findings.end.held_out_excess < 1.25


@pytest.mark.slow
def test_the_model_jumps_where_a_bit_changes() -> None:
    found = discover(converted(np.zeros_like))
    effects = [term.effect for term in found.findings.end.model.terms if isinstance(term.effect, FreeForm)]
    (steps,) = (form for effect in effects for form in effect.forms if form.name == "steps")
    basis = steps.basis(0)
    assert isinstance(basis, Steps)
    away = [abs(position - 5 / 16 * round(position / 5 * 16)) for position in basis.positions]
    assert len(away) >= 5  # of the 6 changes within the range
    assert max(away) < 2 * SAMPLE_NOISE_V


def test_a_smooth_response_has_no_jumps() -> None:
    for seed in range(5):
        forces = forces_of_sweep()[:, :2]
        data = poses(4e-3 * np.sin(5 * forces) + 2e-3 * forces**2, seed)
        rows = PoseData.of(data)
        setting = Setting(rows, fit(read_model("linear"), data).problem.white, ModelEffects.without_effects(rows))
        assert setting.first_jumps is None
