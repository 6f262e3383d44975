"""Noise of two to five levels is separated from noise of any level, which has the same spectrum."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from calibrations.documents import diagnosis_document
from calibrations.effects.catalogue import catalogue
from calibrations.loop import diagnose, discover
from calibrations.model.file import read_model
from calibrations.noise.analysis import analyse, noise_document
from calibrations.noise.fit import fit_channel
from calibrations.noise.record import Samples, Still, reduce_record
from calibrations.noise.telegraph import SEVERAL_LEVELS, TWO_LEVELS, Telegraph, telegraph_of
from calibrations.table import Array
from tests.calibrations.hidden_noise import RATE_HZ, levels, relaxing, room, telegraph, traps, walk, white

Random = np.random.Generator
SLOW = ("gauss-markov-noise", "flicker-noise", "rate-random-walk")
N = 10_000


def still(x: Array) -> Still:
    return reduce_record([Samples("x", [x], RATE_HZ, "V")], "made", every_deviation=True)


def told(x: Array, *slow: str) -> Telegraph | None:
    effects = [catalogue()[name] for name in ("white-noise", *slow)]
    return telegraph_of(fit_channel(still(x).channels[0], effects))


OF_ANY_LEVEL: dict[str, tuple[Callable[[Random], Array], str]] = {
    "relaxing": (lambda r: white(r, N) + 0.7 * relaxing(r, N, 200.0), SLOW[0]),
    "relaxing, strong": (lambda r: 0.1 * white(r, N) + relaxing(r, N, 200.0), SLOW[0]),
    "traps": (lambda r: 0.3 * white(r, N) + traps(r, N), SLOW[1]),
    "walk": (lambda r: 0.3 * white(r, N) + 0.02 * walk(r, N), SLOW[2]),
    "a step": (lambda r: white(r, N) + 0.3 * relaxing(r, N, 100.0) + 3.0 * (np.arange(N) > 3000), SLOW[0]),
    "a lone step": (lambda r: white(r, N) + 3.0 * (np.arange(N) > 3000), SLOW[2]),
    "a staircase": (lambda r: white(r, N) + 3.0 * (np.arange(N) // 1500), SLOW[2]),
    "a room's temperature": (lambda r: white(r, N) + 5.0 * room(r, N), SLOW[2]),
    "eight levels, more than are looked for": (
        lambda r: white(r, N) + telegraph(r, N, 200.0) + 2.0 * telegraph(r, N, 200.0) + 4.0 * telegraph(r, N, 200.0),
        SLOW[0],
    ),
}


@pytest.mark.parametrize("name", OF_ANY_LEVEL)
def test_noise_of_any_level_has_no_levels(name: str) -> None:
    make, slow = OF_ANY_LEVEL[name]
    assert not [seed for seed in range(8) if told(make(np.random.default_rng(seed)), slow)]


@pytest.mark.parametrize("seed", [14, 31, 89, 139, 176])
def test_steps_whose_levels_are_near_each_other_by_chance_are_no_levels(seed: int) -> None:
    """Of 200 records with up to 30 steps, these had the least slow noise beside three to five levels."""
    random = np.random.default_rng(seed)
    noise = white(random, 2 * N)
    at = random.integers(0, 2 * N, random.integers(1, 31))
    steps = np.sum([random.normal(0.0, 2.0) * (each < np.arange(2 * N)) for each in at], axis=0)
    assert told(noise + steps, SLOW[2]) is None
    assert not analyse(still(noise + steps)).search.telegraphs


@pytest.mark.parametrize(("apart", "stay"), [(0.7, 1000.0), (2.0, 100.0), (5.0, 30.0)])
def test_two_levels_are_found_with_how_far_they_are_apart_and_how_often_it_goes(apart: float, stay: float) -> None:
    for seed in range(5):
        random = np.random.default_rng(seed)
        trap = telegraph(random, 2 * N, stay)
        found = told(white(random, 2 * N) + apart / 2 * trap, SLOW[0])
        assert found is not None
        times = np.count_nonzero(np.diff(trap))
        lower, upper = found.levels
        assert upper.height == pytest.approx(apart, rel=0.1)
        assert found.jumps == pytest.approx(times, rel=0.3)
        assert upper.dwell_s + lower.dwell_s == pytest.approx(4 * N / RATE_HZ / times, rel=0.5)


def test_two_levels_are_found_beside_flicker() -> None:
    random = np.random.default_rng(1)
    x = white(random, 2 * N) + 1.5 * telegraph(random, 2 * N, 500.0) + 0.3 * traps(random, 2 * N)
    found = told(x, *SLOW[:2])
    assert found is not None
    assert found.levels[1].height == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize(("count", "step", "stay"), [(3, 1.0, 200.0), (4, 2.0, 50.0), (5, 4.0, 100.0)])
def test_levels_are_found_with_their_heights_shares_and_times(count: int, step: float, stay: float) -> None:
    for seed in range(2):
        random = np.random.default_rng(seed)
        path = levels(random, 2 * N, stay, count)
        found = told(white(random, 2 * N) + step * path, SLOW[0])
        assert found is not None
        assert [level.height for level in found.levels] == pytest.approx(step * np.arange(count), abs=0.15)
        shares = np.bincount(path.astype(int)) / len(path)
        assert [level.share for level in found.levels] == pytest.approx(shares, abs=0.05)
        jumps = np.count_nonzero(np.diff(path))
        assert found.jumps == pytest.approx(jumps, rel=0.25)
        mean_s = sum(level.share * level.dwell_s for level in found.levels)
        assert mean_s == pytest.approx(2 * N / RATE_HZ / jumps, rel=0.35)


def test_levels_of_unequal_distance_and_a_rare_one_are_found() -> None:
    random = np.random.default_rng(3)
    heights = np.array([0.0, 1.0, 5.0, 6.0, 12.0])[levels(random, 2 * N, 100.0, 5).astype(int)]
    rare = 8.0 * (np.convolve(random.random(2 * N) < 1 / 500, np.ones(10), "same") > 0)
    unequal = told(white(random, 2 * N) + heights, SLOW[0])
    with_rare = told(white(random, 2 * N) + telegraph(random, 2 * N, 300.0) + rare * 1.0, SLOW[0])
    assert unequal is not None
    assert [level.height for level in unequal.levels] == pytest.approx([0, 1, 5, 6, 12], abs=0.1)
    assert with_rare is not None
    assert [level.height for level in with_rare.levels] == pytest.approx([0, 2, 8, 10], abs=0.5)


def test_two_independent_traps_are_named_as_such_and_four_levels_of_one_trap_are_not() -> None:
    random = np.random.default_rng(5)
    pair = told(white(random, 2 * N) + 2.0 * telegraph(random, 2 * N, 300.0) + 0.75 * telegraph(random, 2 * N), SLOW[0])
    one = told(white(random, 2 * N) + 2.0 * levels(random, 2 * N, 200.0, 4), SLOW[0])
    assert pair is not None
    assert pair.traps == pytest.approx([1.5, 4.0], abs=0.05)
    assert "Two independent traps of 1.48 and 3.97 V make such levels" in pair.text
    assert one is not None
    assert (len(one.levels), one.traps) == (4, ())


@pytest.mark.parametrize("count", [2, 3])
def test_levels_beside_a_slight_random_walk_are_found(count: int) -> None:
    """The walk is a process that is needed, and so was the Gauss-Markov noise that the jumps were taken for."""
    random = np.random.default_rng(2)
    found = told(
        white(random, 2 * N) + 3.0 * levels(random, 2 * N, 300.0, count) + 0.005 * walk(random, 2 * N), SLOW[0]
    )
    assert found is not None
    assert [level.height for level in found.levels] == pytest.approx(3.0 * np.arange(count), abs=0.15)


@pytest.mark.parametrize("seed", [1, 3])
def test_two_levels_beside_a_drift_as_large_as_the_jumps_are_not_five_levels(seed: int) -> None:
    random = np.random.default_rng(seed)
    drift = 3.0 * np.arange(2 * N) / (2 * N)
    assert told(white(random, 2 * N) + 3.0 * levels(random, 2 * N, 300.0, 2) + drift, SLOW[0], SLOW[2]) is None


@pytest.mark.parametrize(("count", "stay"), [(2, 10_000.0), (3, 10_000.0), (2, 160.0)])
def test_a_long_record_whose_means_lie_between_levels_has_no_more_levels(count: int, stay: float) -> None:
    """Means of 16 samples. The noise level does not change with time, though some parts have more jumps."""
    random = np.random.default_rng(1)
    path = levels(random, 1 << 20, stay, count)
    analysis = analyse(still(white(random, 1 << 20) + 4.0 * path))
    assert analysis.record.channels[0].size == 16
    (found,) = analysis.search.telegraphs
    assert [level.height for level in found.levels] == pytest.approx(4.0 * np.arange(count), abs=0.05)
    assert found.jumps == pytest.approx(np.count_nonzero(np.diff(path)), rel=0.15)
    assert len(analysis.disturbances) == 1


def test_several_levels_are_a_disturbance_with_their_values() -> None:
    random = np.random.default_rng(7)
    record = still(1e-3 * (white(random, 2 * N) + 4.0 * levels(random, 2 * N, 500.0, 3)))
    found = discover(record, read_model("still"))
    (entry,) = noise_document(analyse(record))["disturbances"]
    assert list(found.findings.disturbances) == [{name: entry[name] for name in entry if name != "spoils"}]
    assert (entry["kind"], entry["matters"], entry["traps"]) == (SEVERAL_LEVELS, False, [])
    assert [level["height"] for level in entry["levels"]] == pytest.approx([0.0, 4e-3, 8e-3], abs=5e-5)
    assert sum(level["share"] for level in entry["levels"]) == pytest.approx(1.0)
    assert sum(level["share"] / level["dwell_s"] for level in entry["levels"]) == pytest.approx(
        (entry["jumps"] + 1) * RATE_HZ / (2 * N)
    )
    assert (
        "x jumps between 3 levels, 37 times: the lowest, and 4.01 and 8.01 mV above it. In this order, "
        in entry["text"]
    )


def test_strong_popcorn_is_one_process_and_no_steps_and_nothing_taken_off_makes_it_worse() -> None:
    """Its jumps, of five times the white noise, were told as steps, and what was left was worse."""
    random = np.random.default_rng(7)
    record = still(1e-3 * (white(random, 4 * N) + 2.5 * telegraph(random, 4 * N, 2000.0)))
    asked, found = diagnose(record, read_model("still")), discover(record, read_model("still"))
    assert (asked.verdict, asked.missing, asked.residual_structure) == ("effect-missing", ("gauss-markov-noise",), None)
    assert (found.verdict, found.findings.baseline) == ("adequate", found.start)
    assert [each["kind"] for each in diagnosis_document(asked, "still")["disturbances"]] == [TWO_LEVELS]
    assert "x jumps between two levels 0.00499 V apart" in asked.judgement.text


def test_steps_of_a_process_that_jumps_are_taken_off_only_where_the_model_is_better_without() -> None:
    for seed in range(4):
        random = np.random.default_rng(seed)
        jumps = telegraph(random, N, 800.0) + telegraph(random, N, 800.0) + telegraph(random, N, 800.0)
        found = discover(still(0.2 * white(random, N) + jumps), read_model("still"))
        baseline = found.findings.baseline
        assert baseline is found.start or baseline.log_likelihood > found.start.log_likelihood


def test_two_levels_without_any_noise_are_no_fault() -> None:
    alternating = np.where(np.arange(N) % 2, 1.0, -1.0) * telegraph(np.random.default_rng(1), N, 300.0)
    assert told(alternating, SLOW[0]) is None


def test_two_levels_are_a_disturbance_beside_the_noise_coefficients() -> None:
    random = np.random.default_rng(7)
    x = white(random, 2 * N) + 2.5 * telegraph(random, 2 * N, 500.0)
    analysis = analyse(still(x))
    assert [(each.kind, each.matters) for each in analysis.disturbances] == [(TWO_LEVELS, False)]
    assert analysis.uncleaned is None
