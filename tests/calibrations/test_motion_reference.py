"""Reference acceleration: the smoother is a Kalman smoother, and each filter's bias is what it says."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.motion.reference import reference_acceleration, reference_biases, second_derivative, smooth
from calibrations.motion.spectrum import apply_response, butterworth, correct_at, delay, first_order
from calibrations.table import Array

RATE = 1000.0
T = np.arange(8000) / RATE
INNER = slice(1000, -1000)
TURN = 2 * np.pi * 10.0
TRUE = -30e-6 * TURN**2 * np.sin(TURN * T)


def rauch_tung_striebel(x: Array, q: float, r: float) -> Array:
    """Forward and backward passes for s_k = 3 s_k-1 - 3 s_k-2 + s_k-3 + w, from the first three values on."""
    F = np.array([[3.0, -3.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    Q, H = np.diag([q, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    m, P = x[2::-1].copy(), r * np.eye(3)
    filtered = [(m, P, m, P)]
    for value in x[3:]:
        ahead, spread = F @ m, F @ P @ F.T + Q
        gain = spread @ H / (H @ spread @ H + r)
        m, P = ahead + gain * (value - H @ ahead), spread - np.outer(gain, H @ spread)
        filtered.append((m, P, ahead, spread))
    found = [filtered[-1][0]]
    for (m, P, _, _), (_, _, ahead, spread) in zip(filtered[-2::-1], filtered[:0:-1], strict=True):
        found.append(m + P @ F.T @ np.linalg.solve(spread, found[-1] - ahead))
    return np.array([*found[-1][:0:-1], *[m[0] for m in found[::-1]]])


def walk(n: int = 300) -> Array:
    rng = np.random.default_rng(3)
    return np.cumsum(np.cumsum(np.cumsum(0.02 * rng.standard_normal(n)))) + rng.standard_normal(n)


def test_smoother_is_that_of_rauch_tung_and_striebel() -> None:
    x = walk()
    found = smooth(x)
    passes = rauch_tung_striebel(x, found.noise_std**2 / found.ratio, found.noise_std**2)
    np.testing.assert_allclose(found.values, passes, rtol=0, atol=1e-5 * np.ptp(x))


def test_smoother_finds_the_noise_and_the_process() -> None:
    found = [smooth(np.cumsum(np.cumsum(np.cumsum(0.02 * w))) + e) for w, e in _drawn(20)]
    assert np.mean([f.noise_std for f in found]) == pytest.approx(1.0, abs=0.05)
    assert np.median([f.ratio for f in found]) == pytest.approx(2500, rel=0.5)


def _drawn(count: int) -> Array:
    return np.random.default_rng(5).standard_normal((count, 2, 400))


def test_sines_and_smoother_differentiate_without_bias() -> None:
    x = 30e-6 * np.sin(TURN * T) + 0.3e-6 * np.random.default_rng(0).standard_normal(len(T))
    found = reference_acceleration(T, x, RATE)
    assert abs(found.acceleration_m_s2 - TRUE)[INNER].max() < 3e-3 * abs(TRUE).max()
    amplitude, std = found.amplitude
    assert abs(amplitude - 30e-6 * TURN**2) < 3 * std < 1e-3 * amplitude


def test_smoother_follows_a_motion_that_begins_in_the_record() -> None:
    on = np.clip((T - 3.0) / 0.5, 0, 1)
    x = 30e-6 * on**3 * (10 - 15 * on + 6 * on**2) * np.sin(TURN * T)
    true = np.gradient(np.gradient(x, T), T)
    found = reference_acceleration(T, x + 0.1e-6 * np.random.default_rng(0).standard_normal(len(T)), RATE)
    error = (found.acceleration_m_s2 - true)[INNER]
    assert np.sqrt(np.mean(error**2)) < 0.06 * np.sqrt(np.mean(true**2))


def paper_reference(displacement_m: Array, rate_hz: float, frequency_hz: float) -> Array:
    """The acceleration as in Ang V, m/s^2, shape (n,)."""
    low_passed = apply_response(displacement_m, rate_hz, correct_at(butterworth(rate_hz), frequency_hz))
    return second_derivative(low_passed, rate_hz, np.array([1.0, -2.0, 1.0]))


def test_each_filter_does_what_its_bias_says() -> None:
    x = 30e-6 * np.sin(TURN * T)
    paper, sine, smoother = reference_biases(
        reference_acceleration(T, x + 0.3e-6 * np.random.default_rng(0).standard_normal(len(T)), RATE)
    )
    made = paper_reference(x, RATE, 10.0)
    assert np.ptp(made[INNER]) / np.ptp(TRUE[INNER]) - 1 == pytest.approx(paper.amplitude, abs=2e-5)
    assert paper.amplitude == pytest.approx(-((TURN / RATE) ** 2) / 12, rel=1e-2)
    assert abs(paper.phase_rad) < 1e-9
    assert 0 < sine.amplitude < 1e-7
    assert smoother.amplitude == pytest.approx(-(0.25**6), rel=0.1)
    assert "Kalman smoother of the rest: at" in smoother.text


def test_paper_reference_is_right_at_one_frequency_only() -> None:
    def size(f: float) -> float:
        made = paper_reference(np.sin(2 * np.pi * f * T), RATE, 10.0)[INNER]
        return float(np.ptp(made) / 2 / (2 * np.pi * f) ** 2)

    assert size(10.0) == pytest.approx(1, abs=1e-3)
    assert size(15.0) < 0.95
    assert reference_biases(reference_acceleration(T, np.sin(TURN * T), RATE))[0].band_hz == pytest.approx(
        (8.97, 10.75), abs=0.1
    )


@pytest.mark.parametrize(
    ("response", "gain", "late_s"),
    [
        (first_order(15.07), 1 / np.hypot(1, 10 / 15.07), np.arctan(10 / 15.07) / TURN),
        (delay(3.3e-4), 1.0, 3.3e-4),
        (correct_at(butterworth(RATE), 10.0), 1.0, 0.0),
    ],
    ids=["R-C", "delay", "corrected"],
)
def test_a_sine_goes_through_a_filter_exactly(response: object, gain: float, late_s: float) -> None:
    out = apply_response(5.0 + np.sin(TURN * T), RATE, response)
    np.testing.assert_allclose(out[INNER], 5 + gain * np.sin(TURN * (T - late_s))[INNER], atol=2e-5)
