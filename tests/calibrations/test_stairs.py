"""The stairs of a coarse converter: found in the outputs, and taken off."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

import calibrations as cal
from calibrations.free_forms.saw import SAW_REJECTIONS, find_saw
from calibrations.free_forms.stairs import (
    Stairs,
    _step_of_means,
    before_stairs,
    find_stairs,
    fit_stairs,
    noise_before_rounding,
    noise_of_rounded,
)
from calibrations.table import Array, Table
from tests.calibrations.synthetic import components, turns

POSES = turns(step_deg=7.5)
SAMPLES = 256
NORMAL = norm.ppf((np.arange(2000) + 0.5) / 2000)  # equally likely values of a normal distribution


def before(bend: float = 0.0) -> Array:
    """Outputs before their rounding, (2, n)."""
    x, y, _ = components(POSES)
    return np.stack([2.5 + 0.98 * a + bend * np.abs(a) for a in (x, y)])


def table(values: Array, step: float, noise: float, seed: int = 4) -> Table:
    """Means of samples of such noise, each rounded to a multiple of the step; 0: not rounded."""
    samples = values[..., None] + noise * NORMAL
    means = (step * np.round(samples / step) if step else samples).mean(axis=2)
    means = means + noise / np.sqrt(SAMPLES) * np.random.default_rng(seed).standard_normal(values.shape)
    columns = dict(zip(("vx_v", "vy_v"), means, strict=True))
    columns |= {f"{name}_std_v": np.full(values.shape[1], noise) for name in ("vx", "vy")}
    return Table.from_columns("poses", {**POSES, **columns, "n": np.full(values.shape[1], SAMPLES)}, source="made")


def white(values: Array, noise: float) -> Array:
    return np.full(values.shape, noise / np.sqrt(SAMPLES))


@pytest.mark.parametrize(("step", "noise"), [(0.004, 0.0007), (0.008, 0.0008)])
def test_stairs_are_found_at_their_height_and_place(step: float, noise: float) -> None:
    values = before()
    measured = table(values, step, noise)
    found = find_stairs(measured, values, white(values, noise))
    assert found is not None
    np.testing.assert_allclose(found.step, step, rtol=1e-3)
    sharp = fit_stairs(measured, values, white(values, noise), found)
    assert np.all(np.abs(sharp.offset / step - np.round(sharp.offset / step)) < 0.05)


def test_the_noise_of_samples_that_mostly_are_one_code_is_that_of_the_means() -> None:
    values = before() + np.random.default_rng(1).uniform(-0.02, 0.02, before().shape)  # a regular sweep is no sample
    measured = table(values, 0.02, 0.001)
    columns = {name: np.zeros_like(x) if name.endswith("_std_v") else x for name, x in measured.columns.items()}
    found = find_stairs(replace(measured, columns=columns), values, white(values, 0.001))
    assert found is not None
    assert found.noise == pytest.approx(0.001, rel=0.3)


def few_digits(values: Array, step: float, noise: float) -> Table:
    """Means with such noise of a sample, logged as multiples of the step."""
    measured = table(values, 0.0, noise)
    rounded = {name: step * np.round(measured.column(name) / step) for name in ("vx_v", "vy_v")}
    return replace(measured, columns={**measured.columns, **rounded})


@pytest.mark.parametrize("step", [0.002, 0.01])
def test_means_that_were_logged_with_few_digits_are_stairs(step: float) -> None:
    found = find_stairs(few_digits(before(), step, 0.004), before(), white(before(), 0.004))
    assert found is not None
    assert found.of_means
    np.testing.assert_allclose(found.step, step, rtol=1e-4)


@pytest.mark.parametrize(("steps", "offsets"), [((0.004, 0.004), (0.0, 0.0015)), ((0.004, 0.006), (0.001, 0.002))])
def test_each_output_has_stairs_of_its_own_where_means_were_rounded(
    steps: tuple[float, float], offsets: tuple[float, float]
) -> None:
    measured = table(before(), 0.0, 0.004)
    rounded = {
        name: offset + step * np.round((measured.column(name) - offset) / step)
        for name, step, offset in zip(("vx_v", "vy_v"), steps, offsets, strict=True)
    }
    logged = replace(measured, columns={**measured.columns, **rounded})
    found = find_stairs(logged, before(), white(before(), 0.004))
    assert found is not None
    np.testing.assert_allclose(found.step.ravel(), steps, rtol=1e-4)
    fraction = (found.offset.ravel() - offsets) / steps
    np.testing.assert_allclose(fraction, np.round(fraction), atol=1e-3)


def test_each_output_has_an_offset_of_its_own_where_samples_were_rounded() -> None:
    step, noise, shift = 0.008, 0.0008, np.array([[0.0], [0.003]])  # of the codes
    values = before()
    measured = table(values - shift, step, noise)
    shifted = measured.with_outputs(measured.outputs + shift.T)
    found = find_stairs(shifted, values, white(values, noise))
    assert found is not None
    sharp = fit_stairs(shifted, values, white(values, noise), found)
    np.testing.assert_allclose(sharp.step, step, rtol=1e-3)
    fraction = (sharp.offset - shift) / step
    np.testing.assert_allclose(fraction, np.round(fraction), atol=0.05)


def test_the_digits_of_a_file_are_no_stairs_where_noise_is_larger() -> None:
    assert find_stairs(few_digits(before(), 1e-5, 0.004), before(), white(before(), 0.004)) is None


def test_the_noise_of_rounded_means_is_that_of_draws() -> None:
    stairs = Stairs(np.full((1, 1), 0.01), np.full((1, 1), 0.003), 0.001, of_means=True)
    values = 0.003 + 0.01 * np.linspace(-0.5, 0.5, 11)[None]
    draws = values[..., None] + 0.001 * NORMAL
    drawn = np.std(stairs.offset + stairs.step * np.round((draws - stairs.offset) / stairs.step), axis=2)
    noise = noise_of_rounded(values, np.full(values.shape, 0.001), stairs)
    np.testing.assert_allclose(noise, np.maximum(drawn, 0.001), rtol=0.02)


@pytest.mark.slow
def test_a_tilt_is_found_behind_means_of_few_digits() -> None:
    x, y, z = components(POSES)
    values = np.stack([2.5 + 0.98 * (a + 0.004 * z + 0.002 * b) for a, b in ((x, y), (y, -x))])
    found = cal.discover(few_digits(values, 0.004, 0.004), "linear")
    assert set(found.causes) == {"quantisation", "axis-misalignment"}
    assert found.findings.end.held_out_excess < 1.25
    assert any("logged in steps" in remark for remark in found.findings.remarks)


def test_outputs_that_are_not_rounded_have_no_stairs() -> None:
    for seed in range(5):
        measured = table(before(), 0.0, 0.0008, seed)
        assert find_stairs(measured, before(), white(before(), 0.0008)) is None


def test_a_converter_without_stairs_is_no_quantiser_though_a_regular_sweep_gathers_outputs() -> None:
    found = cal.discover(table(before(0.008), 0.0, 0.0008), "linear")
    assert found.causes == ("scale-factor-asymmetry",)


def random_poses(count: int, seed: int = 5) -> Array:
    """Outputs in random directions, (2, n)."""
    directions = np.random.default_rng(seed).standard_normal((count, 3))
    return 2.5 + 0.98 * (directions / np.linalg.norm(directions, axis=1, keepdims=True))[:, :2].T


def test_the_step_of_few_means_is_found_though_no_two_are_neighbours() -> None:
    step = 1e-3
    means = step * np.round(random_poses(40) / step)
    assert np.diff(np.unique(means[0])).min() > 1.5 * step
    found = [_step_of_means(values) for values in means]
    assert [s and s[0] for s in found] == pytest.approx([step, step], rel=1e-6)


@pytest.mark.parametrize("noise", [0.1, 0.3])
def test_rounded_means_of_unknown_noise_are_stairs_and_tell_this_noise(noise: float) -> None:
    """Noise before the rounding, in steps of 2 mV."""
    step = 2e-3
    values = random_poses(400)
    rounded = step * np.round((values + noise * step * np.random.default_rng(1).standard_normal(values.shape)) / step)
    columns = {**POSES, "vx_v": rounded[0, : len(POSES["t_s"])], "vy_v": rounded[1, : len(POSES["t_s"])]}
    measured = Table.from_columns("poses", {k: v[:400] for k, v in columns.items()}, source="made")
    found = find_stairs(measured, values, None)
    assert found is not None
    assert found.of_means
    np.testing.assert_allclose(found.step, step, rtol=1e-6)
    assert noise_before_rounding(rounded, values, found) == pytest.approx(noise * step, rel=0.25)


def test_the_digits_of_a_file_are_no_stairs_where_the_noise_is_unknown() -> None:
    values = random_poses(400)
    means = np.round(values + 5e-5 * np.random.default_rng(1).standard_normal(values.shape), 6)
    columns = {k: v[:400] for k, v in POSES.items()} | {"vx_v": means[0], "vy_v": means[1]}
    assert find_stairs(Table.from_columns("poses", columns, source="made"), values, None) is None


def test_a_wave_that_the_noise_of_the_samples_would_smooth_is_no_saw() -> None:
    """A regular grid of poses has waves over the output, larger than any converter of that step leaves in a mean."""
    noise = 5e-4
    output = np.random.default_rng(2).uniform(0.0, 1.0, (1, 400))
    data = SimpleNamespace(
        table=SimpleNamespace(left_out=(), axes=("x",)), outputs=output, spread=np.full((1, 400), noise)
    )
    state, white = SimpleNamespace(response=output), np.full(output.shape, 3e-5)
    wave = 4e-5 * np.sin(2 * np.pi * output / (0.7 * noise))
    assert find_saw(data, state, white, wave, (), 8.0) is None
    coarse = find_saw(data, state, white, np.round(output / 2e-3) * 2e-3 - output, (), 8.0)
    assert coarse is not None


@pytest.mark.parametrize("limit", [0.9, 0.6])
def test_outputs_at_a_limit_of_the_sensor_are_no_stairs(limit: float) -> None:
    values = before() + np.random.default_rng(1).uniform(-0.02, 0.02, before().shape)  # a regular sweep is no sample
    limited = np.clip(values, 2.5 - limit, 2.5 + limit)
    assert find_stairs(table(limited, 0.0, 0.0008), values, white(values, 0.0008)) is None
    stairs = find_stairs(table(limited, 0.008, 0.0008), values, white(values, 0.0008))
    assert stairs is not None
    np.testing.assert_allclose(stairs.step, 0.008, rtol=1e-3)


def test_outputs_before_their_rounding_are_within_their_stated_uncertainty() -> None:
    values, step, noise = before(), 0.008, 0.0008
    measured = table(values, step, noise)
    stairs = find_stairs(measured, values, white(values, noise))
    assert stairs is not None
    made = before_stairs(measured, white(values, noise), fit_stairs(measured, values, white(values, noise), stairs))
    std = np.stack([made.column(f"{name.removesuffix('_v')}_std_v_of_mean") for name in made.output_names])
    pull = (made.outputs.T - values) / std
    assert np.sqrt(np.mean(pull**2)) < 1.5
    assert np.max(std) < 0.4 * step
    assert np.quantile(std, 0.1) < 0.05 * step


def test_an_output_between_two_codes_has_a_finite_value_before_the_rounding() -> None:
    """Outputs at the limit of an amplifier gather as codes do, and the others lie anywhere between."""
    measured, noise = table(before(), 0.0, 1e-4), white(before(), 1e-4)
    stairs = Stairs(np.full((2, 1), 0.05), np.full((2, 1), 2.5), 1e-3)
    made = before_stairs(measured, noise, stairs)
    assert np.all(np.isfinite(made.outputs))
    assert np.all(np.abs(made.outputs - measured.outputs) <= 0.05)


@pytest.mark.parametrize("steps", [3.5, 40.0])
def test_a_saw_of_few_steps_or_of_many_is_proposed(steps: float) -> None:
    """Steps of the converter over the range of the output."""
    output = np.random.default_rng(2).uniform(0.0, 1.0, (1, 400))
    data = SimpleNamespace(table=SimpleNamespace(left_out=(), axes=("x",)), outputs=output, spread=None)
    residual = np.round(output * steps) / steps - output
    given = data, SimpleNamespace(response=output), np.full(output.shape, 1e-3), residual
    saw = find_saw(*given, (), 8.0)
    assert saw is not None
    assert saw.shape == (pytest.approx(steps, abs=0.25),)
    other = find_saw(*given, saw.shape * (SAW_REJECTIONS + 1), 8.0)
    assert other is None or abs(other.shape[0] - steps) > 0.5, "a rejected saw comes back"


def test_a_saw_has_an_offset_of_its_own_in_each_output() -> None:
    step, offset = 0.025, np.array([[0.004], [0.012]])
    output = np.random.default_rng(2).uniform(0.0, 1.0, (2, 400))
    data = SimpleNamespace(
        table=SimpleNamespace(left_out=(), axes=("x", "y")), outputs=output, spread=None, channels=2, n=400
    )
    state = SimpleNamespace(response=output, data=data)
    residual = offset + step * np.round((output - offset) / step) - output
    saw = find_saw(data, state, np.full(output.shape, 1e-3), residual, (), 8.0)
    assert saw is not None
    assert saw.columns is not None
    assert saw.starts is not None
    columns = np.concatenate(saw.columns(state))
    coefficients = np.linalg.lstsq(columns, residual.ravel(), rcond=None)[0]
    assert np.std(residual.ravel() - columns @ coefficients) < 0.43 * np.std(residual)  # three harmonics of a saw
    found = {(name, axis): value for name, axis, value in saw.starts(coefficients)}
    for axis, of_code in zip("xy", offset.ravel(), strict=True):
        assert (found["offset", axis] - of_code + step / 2) % step - step / 2 == pytest.approx(0.0, abs=0.05 * step)
        assert found["step", axis] == pytest.approx(step, rel=2e-3)


@pytest.mark.slow
def test_an_effect_before_a_coarse_converter_is_found_beside_it() -> None:
    found = cal.discover(table(before(0.006), 0.008, 0.0008), "linear")
    assert set(found.causes) == {"quantisation", "scale-factor-asymmetry"}
    assert found.end.held_out_excess < 1.25
