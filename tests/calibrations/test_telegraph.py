"""Noise of two levels is told from noise of any level: of the same spectrum, and by no chance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from calibrations.documents import diagnosis_document
from calibrations.effects.catalogue import catalogue
from calibrations.loop import diagnose, discover
from calibrations.model.file import read_model
from calibrations.noise.analysis import analyse
from calibrations.noise.fit import fit_channel
from calibrations.noise.record import Samples, Still, reduce_record
from calibrations.noise.telegraph import TWO_LEVELS, Telegraph, telegraph_of
from calibrations.table import Array
from tests.calibrations.hidden_noise import RATE_HZ, _relaxing, telegraph, traps, walk, white

Random = np.random.Generator
SLOW = ("gauss-markov-noise", "flicker-noise", "rate-random-walk")
N = 10_000


def still(x: Array) -> Still:
    return reduce_record([Samples("x", [x], RATE_HZ, "V")], "made")


def told(x: Array, *slow: str) -> Telegraph | None:
    effects = [catalogue()[name] for name in ("white-noise", *slow)]
    return telegraph_of(fit_channel(still(x).channels[0], effects))


OF_ANY_LEVEL: dict[str, tuple[Callable[[Random], Array], str]] = {
    "relaxing": (lambda r: white(r, N) + 0.7 * _relaxing(r, N, 200.0), SLOW[0]),
    "relaxing, strong": (lambda r: 0.1 * white(r, N) + _relaxing(r, N, 200.0), SLOW[0]),
    "traps": (lambda r: 0.3 * white(r, N) + traps(r, N), SLOW[1]),
    "walk": (lambda r: 0.3 * white(r, N) + 0.02 * walk(r, N), SLOW[2]),
    "a step": (lambda r: white(r, N) + 0.3 * _relaxing(r, N, 100.0) + 3.0 * (np.arange(N) > 3000), SLOW[0]),
    "a lone step": (lambda r: white(r, N) + 3.0 * (np.arange(N) > 3000), SLOW[2]),
    "two traps": (lambda r: white(r, N) + telegraph(r, N) + telegraph(r, N), SLOW[0]),
}


@pytest.mark.parametrize("name", OF_ANY_LEVEL)
def test_noise_of_any_level_has_no_two(name: str) -> None:
    make, slow = OF_ANY_LEVEL[name]
    assert not [seed for seed in range(8) if told(make(np.random.default_rng(seed)), slow)]


@pytest.mark.parametrize(("apart", "stay"), [(0.7, 1000.0), (2.0, 100.0), (5.0, 30.0)])
def test_two_levels_are_found_with_how_far_they_are_apart_and_how_often_it_goes(apart: float, stay: float) -> None:
    for seed in range(5):
        random = np.random.default_rng(seed)
        trap = telegraph(random, 2 * N, stay)
        found = told(white(random, 2 * N) + apart / 2 * trap, SLOW[0])
        assert found is not None
        times = np.count_nonzero(np.diff(trap))
        assert found.apart == pytest.approx(apart, rel=0.1)
        assert found.times == pytest.approx(times, rel=0.3)
        assert found.upper_s + found.lower_s == pytest.approx(4 * N / RATE_HZ / times, rel=0.5)


def test_two_levels_are_found_beside_flicker() -> None:
    random = np.random.default_rng(1)
    x = white(random, 2 * N) + 1.5 * telegraph(random, 2 * N, 500.0) + 0.3 * traps(random, 2 * N)
    found = told(x, *SLOW[:2])
    assert found is not None
    assert found.apart == pytest.approx(3.0, rel=0.05)


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
