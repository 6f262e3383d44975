"""Still intervals of synthetic logs: found, trimmed, averaged with the noise that their samples show."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.signal import lfilter

from calibrations.errors import DataError
from calibrations.importing.raw_logs import average_still_positions, is_raw_log, still_intervals
from calibrations.table import Array, Table
from tests.calibrations.synthetic import directions

RATE_HZ = 100.0
NOISE = 2e-3  # g, of a sample
STILL_S, MOVING_S = 4.0, 1.5


def held(n: int = 8, seed: int = 0, sway: float = 0.0) -> tuple[Array, list[tuple[int, int]]]:
    """Samples of a sensor held still in `n` directions and shaken between, and where it lies still.

    `sway`: how far a hand turns it slowly to and fro meanwhile, rad.
    """
    rng = np.random.default_rng(seed)
    still, moving = round(STILL_S * RATE_HZ), round(MOVING_S * RATE_HZ)
    pieces, bounds, at = [], [], 0
    for a in directions(n):
        angle = sway * np.sin(2 * np.pi * np.arange(still) / still)
        side = np.cross(a, [0.6, -0.48, 0.64])
        pieces.append(np.outer(np.cos(angle), a) + np.outer(np.sin(angle), side / np.linalg.norm(side)))
        pieces.append(a + 0.5 * rng.standard_normal((moving, 3)))
        bounds.append((at, at + still))
        at += still + moving
    samples = np.concatenate(pieces)
    return samples + NOISE * rng.standard_normal(samples.shape), bounds


def log(samples: Array, **more: Array) -> Table:
    return Table.from_columns("positions", dict(zip(("ax", "ay", "az"), samples.T, strict=True)) | more, source="log")


def ar1(phi: float, n: int, rng: np.random.Generator) -> Array:
    """First-order autoregressive noise of unit standard deviation: x_k = phi x_{k-1} + e_k."""
    drive = np.sqrt(1 - phi**2) * rng.standard_normal(n + 500)
    return np.asarray(lfilter([1.0], [1.0, -phi], drive)[500:])


def test_every_still_interval_is_found_and_trimmed() -> None:
    samples, bounds = held()
    found = still_intervals(samples, RATE_HZ)
    assert len(found) == len(bounds)
    for (first, last), (start, end) in zip(found, bounds, strict=True):
        assert start + 10 <= first <= start + 25  # 0.2 s off each end, where the hand is near
        assert end - 25 <= last <= end - 10


@pytest.mark.parametrize("scale", [1.0, 4096.0])
def test_unit_offset_and_order_of_the_axes_do_not_matter(scale: float) -> None:
    samples, _ = held()
    assert still_intervals(scale * samples[:, ::-1] + 33_000, RATE_HZ) == still_intervals(samples, RATE_HZ)


def test_a_rest_shorter_than_a_second_is_none() -> None:
    samples, _ = held()
    rng = np.random.default_rng(1)
    samples[500:900] += 0.5 * rng.standard_normal((400, 3))  # the second rest is shaken
    samples[650:725] = samples[700] + NOISE * rng.standard_normal((75, 3))  # but for 0.75 s
    assert len(still_intervals(samples, RATE_HZ)) == 7


def test_means_lie_on_the_directions_and_other_columns_are_averaged() -> None:
    samples, bounds = held()
    warm = 20 + np.arange(len(samples)) / RATE_HZ
    table = average_still_positions(log(samples, temperature_c=warm), RATE_HZ)
    assert table.n == 8
    assert table.outputs == pytest.approx(directions(8), abs=5 * NOISE / np.sqrt(340))
    middle_s = [(first + last) / 2 / RATE_HZ for first, last in bounds]
    assert table.column("t_s") == pytest.approx(middle_s, abs=0.1)
    assert table.column("temperature_c") == pytest.approx(20 + np.array(middle_s), abs=0.1)
    assert table.column("n") == pytest.approx(np.full(8, 360), abs=30)


def test_white_samples_keep_their_own_standard_deviation() -> None:
    table = average_still_positions(log(held(n=20)[0]), RATE_HZ)
    for name in ("ax_std", "ay_std", "az_std", "norm_std"):
        assert np.sqrt(np.mean(table.column(name) ** 2)) == pytest.approx(NOISE, rel=0.15)


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_the_effective_std_of_correlated_samples_is_that_of_their_mean(phi: float) -> None:
    rng = np.random.default_rng(5)
    stds = []
    for _ in range(6):  # logs, of 20 intervals each
        samples, _ = held(n=20)
        samples += np.column_stack([20 * NOISE * ar1(phi, len(samples), rng) for _ in range(3)])
        stds.append(average_still_positions(log(samples), RATE_HZ).column("ax_std"))
    expected = 20 * NOISE * np.sqrt((1 + phi) / (1 - phi))  # std of a mean x sqrt(n), for n long beside 1 / (1 - phi)
    assert np.sqrt(np.mean(np.concatenate(stds) ** 2)) == pytest.approx(expected, rel=0.15)


def test_a_hand_that_sways_leaves_the_magnitude_alone() -> None:
    table = average_still_positions(log(held(n=12, sway=0.003)[0]), RATE_HZ)
    assert table.n == 12
    sides = np.column_stack([table.column(f"{axis}_std") for axis in ("ax", "ay", "az")])
    assert np.median(sides.max(axis=1)) > 3 * NOISE
    assert np.median(table.column("norm_std")) == pytest.approx(NOISE, rel=0.25)


def test_an_offset_does_not_turn_sway_into_noise() -> None:
    table = average_still_positions(log(held(n=12, sway=0.003)[0] + [0.4, -0.3, 0.2]), RATE_HZ)
    assert np.median(table.column("norm_std")) == pytest.approx(NOISE, rel=0.25)


@pytest.mark.parametrize("motion", ["walk", "swing", "rest"])
def test_a_log_that_never_rests_or_only_rests_is_refused(golden, motion: str) -> None:
    rng = np.random.default_rng(0)
    t_s = np.arange(4000) / RATE_HZ
    swing = np.column_stack([np.sin(rate * t_s) for rate in (0.6, 1.9, 3.1)])
    noise = NOISE * rng.standard_normal((4000, 3))
    samples = {"walk": np.cumsum(noise, axis=0), "swing": swing + noise, "rest": noise}[motion]
    with golden.refused(DataError):
        average_still_positions(log(samples), RATE_HZ)


def test_a_log_is_raw_where_its_rows_are_samples() -> None:
    samples, _ = held()
    assert is_raw_log(log(samples))
    assert not is_raw_log(log(samples[:100]))
    assert not is_raw_log(log(samples, n=np.full(len(samples), 50.0)))
    assert not is_raw_log(average_still_positions(log(samples), RATE_HZ))


def test_the_memory_of_the_search_is_that_of_few_columns() -> None:
    samples = np.random.default_rng(5).standard_normal((200_000, 3))
    tracemalloc.start()
    try:
        still_intervals(samples, 100.0)
        assert tracemalloc.get_traced_memory()[1] < 3 * samples.nbytes
    finally:
        tracemalloc.stop()
