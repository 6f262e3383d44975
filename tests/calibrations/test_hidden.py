"""Noise below a converter's step is said to be that, whatever the mean; noise of more than half a step never is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.documents import diagnosis_document
from calibrations.effects.catalogue import catalogue
from calibrations.loop import diagnose, discover
from calibrations.model.file import read_model
from calibrations.noise.analysis import analyse, noise_document
from calibrations.noise.fit import fit_channel
from calibrations.noise.patterns import pattern_of
from calibrations.noise.record import Reduction, Samples, reduce_record
from calibrations.noise.samples import COARSE, HiddenNoise, hidden_in, hidden_step
from calibrations.noise.telegraph import telegraph_of
from calibrations.table import Array
from tests.calibrations.hidden_noise import RECORDS, telegraph

RATE_HZ, N = 100.0, 20_000
STEP = 2e-3
MEANS = (0.0, 0.25, 0.5)  # of a step
Random = np.random.Generator


def hidden(x: Array, rate_hz: float = RATE_HZ, corner_hz: float = np.inf, blocks: int = 1) -> HiddenNoise | None:
    seen = Reduction(rate_hz, corner_hz)
    assert sum(len(part) for part in seen.read(np.array_split(x, blocks), "made")) == len(x)
    return hidden_in(seen.oddities())


def read(random: Random, steps: float, mean: float | Array, n: int = N) -> Array:
    """White noise of so many steps about a mean that may drift, (n,), as a converter reads it."""
    return np.asarray(np.round(mean + steps * random.standard_normal(n)) * STEP)


@pytest.mark.parametrize("mean", MEANS)
@pytest.mark.parametrize("steps", [0.2, 0.3, 0.4])
def test_noise_of_less_than_half_a_step_is_hidden_and_its_bound_holds(steps: float, mean: float) -> None:
    for seed in range(10):
        found = hidden(read(np.random.default_rng(seed), steps, mean), blocks=seed + 1)
        assert found is not None
        assert found.all
        assert found.step == pytest.approx(STEP)
        assert steps * STEP / np.sqrt(RATE_HZ) < found.white_below


@pytest.mark.parametrize("mean", MEANS)
@pytest.mark.parametrize("steps", [0.55, 0.7, 1.0, 5.0])
def test_noise_of_half_a_step_and_more_is_not(steps: float, mean: float) -> None:
    assert not any(hidden(read(np.random.default_rng(seed), steps, mean)) for seed in range(10))


def test_no_normal_record_is_hidden() -> None:
    for seed in range(12):
        random = np.random.default_rng(seed)
        x = 2.5 + 1e-3 * random.standard_normal(1000)
        for each in (x, x[:64], np.round(x / 1e-4) * 1e-4, np.round(x * 2**24 / 5) * 5 / 2**24, x.astype("f4") * 1.0):
            assert hidden(each) is None


@pytest.mark.parametrize("name", RECORDS)
def test_no_process_of_the_catalogue_is_hidden(name: str) -> None:
    assert not any(hidden(RECORDS[name][0](np.random.default_rng(seed))) for seed in range(2))


def test_noise_behind_a_low_pass_is_judged_by_what_reaches_the_converter() -> None:
    def behind(steps: float, corner_hz: float) -> HiddenNoise | None:
        random, kept = np.random.default_rng(1), np.exp(-2 * np.pi * 15 / 1000)
        from scipy.signal import lfilter

        x = lfilter([1 - kept], [1, -kept], random.standard_normal(4 * N))
        return hidden(np.round(0.3 + steps * x / x.std()), 1000.0, corner_hz)

    assert behind(0.3, 15.0)
    assert behind(0.8, np.inf)
    assert not behind(0.8, 15.0)
    assert not behind(1.0, 15.0)
    assert not behind(1.0, np.inf)


@pytest.mark.slow
def test_what_is_slow_is_told_where_only_the_fast_is_hidden() -> None:
    random = np.random.default_rng(2)
    walk = 10 / np.sqrt(N) * np.cumsum(random.standard_normal(N))
    x = np.round(0.1 * random.standard_normal(N) + walk)
    found = analyse(reduce_record([Samples("x", [x], RATE_HZ, "count")], "made")).channels["x"]
    seen = hidden_in(found.channel.oddities)
    assert seen is not None
    assert not seen.all
    said = found.coefficients
    assert said["rate-random-walk"].value == pytest.approx(10 / np.sqrt(N) * np.sqrt(RATE_HZ), rel=0.2)
    assert (said["rate-random-walk"].identified, said["white-noise"].identified) == (True, False)


def test_nothing_is_stated_of_hidden_noise() -> None:
    x = read(np.random.default_rng(3), 0.15, np.linspace(0.1, 0.5, 120_000), 120_000)
    x[0] = 3 * STEP
    analysis = analyse(reduce_record([Samples("x", [x], RATE_HZ, "V")], "made", every_deviation=True))
    assert [each.kind for each in analysis.disturbances] == [COARSE]
    assert "have 4 values in steps of 0.002" in analysis.disturbances[0].text
    coefficients = noise_document(analysis)["coefficients"]
    assert not any(each["identified"] for each in coefficients.values())
    assert 0.15 * STEP / 10 < coefficients["white-noise"]["upper"] < STEP / 10
    assert (coefficients["flicker-noise"]["upper"], coefficients["flicker-noise"]["std"]) == (None, None)


def test_the_loop_says_so_and_asks_for_no_second_record() -> None:
    record = reduce_record(
        [Samples("x", [read(np.random.default_rng(4), 0.15, np.linspace(0.1, 0.5, N))], RATE_HZ, "V")], "made"
    )
    asked, found = diagnose(record, read_model("still")), discover(record, read_model("still"))
    said = diagnosis_document(asked, "still")
    assert (asked.verdict, asked.missing, asked.next_experiment) == ("unexplained", (), None)
    assert (found.verdict, found.causes, found.reason) == ("unexplained", (), asked.reason)
    assert "dither" in str(asked.residual_structure)
    assert "changes with time" not in str(asked.residual_structure)
    assert [each["kind"] for each in said["disturbances"]] == [COARSE]
    assert str(asked.residual_structure)[1:] in asked.judgement.text
    assert not any(e.identified for term in found.end.model.terms for e in term.estimates)


def test_the_steps_of_rounding_are_no_steps_and_no_two_levels_of_the_sensor() -> None:
    random = np.random.default_rng(6)
    wave = 0.5 + 0.3 * telegraph(random, N, 300.0) + 0.3 * random.standard_normal(N)
    record = reduce_record([Samples("x", [np.round(wave)], RATE_HZ, "V")], "made")
    found = fit_channel(record.channels[0], [catalogue()[name] for name in ("white-noise", "gauss-markov-noise")])
    bare = replace(found, channel=replace(found.channel, oddities=()))
    assert (telegraph_of(found), telegraph_of(bare) is None) == (None, False)
    ramp = np.round(np.linspace(0, 1, N) + 0.02 * random.standard_normal(N))
    stepped = reduce_record([Samples("x", [ramp], RATE_HZ, "V")], "made")
    white = fit_channel(stepped.channels[0], [catalogue()["white-noise"]])
    plain = replace(white, channel=replace(white.channel, oddities=()))
    assert (pattern_of(white), pattern_of(plain) is None) == (None, False)


def test_a_step_between_blocks_is_one() -> None:
    assert hidden(np.repeat(np.arange(40) % 2, 500).astype(float), blocks=40) is not None


def test_a_hidden_step_is_found_in_few_readings() -> None:
    random = np.random.default_rng(5)
    assert hidden_step(read(random, 0.15, 0.4)) == pytest.approx(STEP)
    assert hidden_step(read(random, 1.0, 0.4)) is None
    assert hidden_step(np.full(100, 2.5)) is None
