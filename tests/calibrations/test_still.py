"""Noise in the loop: hidden processes are found, clean records give no alarm, what is no noise is told as such."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.effects import Effect, Parameter
from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError, ModelError, TooFewRows
from calibrations.loop import compare, dataset, diagnose, discover
from calibrations.model import Model
from calibrations.model.file import dump_model, parse_model, read_model
from calibrations.noise.comparison import FREQUENCY, TIME, compare_deviations, deviation
from calibrations.noise.fit import fit, without_effects
from calibrations.noise.lines import SpectralLine
from calibrations.noise.mixtures import chance, least_gain
from calibrations.noise.patterns import pattern_of
from calibrations.noise.record import Samples, Still, reduce_record
from calibrations.table import Array
from tests.calibrations import noises
from tests.calibrations.hidden_noise import OTHERS, RATE_HZ, RECORDS, SAMPLES, telegraph, traps, walk, white


def still(**channels: Array) -> Still:
    return reduce_record([Samples(axis, [x], RATE_HZ, "V") for axis, x in channels.items()], "made")


def model(*names: str) -> Model:
    """White noise and more."""
    found = read_model("still")
    for name in names:
        found = found.with_effect(catalogue()[name])
    return found


def values(found: Model, axis: str = "x") -> dict[tuple[str, str], tuple[float, float | None]]:
    return {(term.name, e.name): (e.value, e.std) for term in found.terms for e in term.estimates if e.axis == axis}


def test_the_default_model_is_white_noise_alone() -> None:
    assert read_model("still").effects == ("white-noise",)


@pytest.mark.parametrize("name", RECORDS)
def test_hidden_processes_are_named_and_no_other(name: str) -> None:
    make, truth = RECORDS[name]
    found = discover(still(x=make(np.random.default_rng(4))), model())
    assert set(found.causes) == truth
    assert found.verdict in ("adequate", "ambiguous")
    assert found.end.pooled_excess == pytest.approx(1, abs=0.2)
    if truth:
        assert found.start.pooled_excess > 1.1 * found.end.pooled_excess
        assert found.end.log_likelihood > found.start.log_likelihood + 20
        last = found.steps[-1]
        assert last.held_out_after < found.steps[0].held_out_before


def test_clean_records_give_no_alarm() -> None:
    answers = [diagnose(still(x=white(np.random.default_rng(seed), 4000)), model()) for seed in range(20)]
    assert [a.verdict for a in answers].count("adequate") >= 19
    assert not any(a.missing for a in answers)


@pytest.mark.parametrize("name", OTHERS)
def test_what_no_mixture_of_noise_is_is_told_as_what_it_is(name: str) -> None:
    make, told = OTHERS[name]
    found = discover(still(x=make(np.random.default_rng(1))), model())
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert told in str(found.residual_structure)


def test_a_step_beside_flicker_leaves_the_flicker_named() -> None:
    random = np.random.default_rng(2)
    x = white(random) + 0.4 * traps(random) + 3.0 * (np.arange(SAMPLES) > 9000)
    found = discover(still(x=x), model())
    assert (found.verdict, found.causes) == ("unexplained", ("flicker-noise",))
    assert "a step of +" in str(found.residual_structure)
    assert float(str(found.residual_structure).split("t = ")[1].split()[0]) == pytest.approx(900, abs=1)


def test_axes_have_coefficients_of_their_own() -> None:
    random = np.random.default_rng(5)
    record = still(x=white(random) + 0.5 * traps(random), y=2 * white(random))
    found = discover(record, model())
    assert found.causes == ("flicker-noise",)
    x, y = values(found.end.model), values(found.end.model, "y")
    per_root_hz = 1 / np.sqrt(RATE_HZ)
    for (value, std), true in (
        (x["white-noise", "coefficient"], per_root_hz),
        (x["flicker-noise", "coefficient"], 0.5),
        (y["white-noise", "coefficient"], 2 * per_root_hz),
    ):
        assert std is not None
        assert value == pytest.approx(true, abs=4 * std)
        assert std < 0.1 * value
    nothing = next(e for e in found.end.model.terms[1].estimates if e.axis == "y")
    assert (nothing.identified, "below" in str(nothing.why)) == (False, True)


@pytest.mark.parametrize(
    ("names", "make"),
    [
        ((), lambda r, n: r.standard_normal(n)),
        (("rate-random-walk",), noises.random_walk),
        (("flicker-noise",), noises.flicker),
        (("quantisation-noise",), lambda r, n: 0.1 * r.standard_normal(n) + noises.quantisation(r, n)),
        (("gauss-markov-noise",), lambda r, n: noises.gauss_markov(r, n, 30.0)),
        (("sinusoidal-noise",), lambda r, n: 0.2 * r.standard_normal(n) + noises.sinusoid(n, 0.0123)),
    ],
)
def test_the_modelled_allan_deviation_is_right_at_every_time(names: tuple[str, ...], make) -> None:
    record = still(x=make(np.random.default_rng(2), 1 << 16))
    result = compare(record, model(*names))
    curve = compare_deviations(result.fit.channels[0], record.allan["x"])
    assert curve.tau_s[0] == 1 / RATE_HZ
    assert curve.ratio[:4] == pytest.approx(np.ones(4), abs=0.03)
    assert np.all(np.abs(curve.deviations) < 4)
    assert curve.mismatch < 4 * curve.by_chance
    assert result.adequate


def test_where_a_model_fails_is_a_stretch_of_times_and_one_of_frequencies() -> None:
    random = np.random.default_rng(3)
    record = still(x=white(random) + 0.7 * telegraph(random))
    result = compare(record, model())
    times = [place for place in result.fails if place.where == TIME]
    longer = max(times, key=lambda place: place.high)
    assert longer.low <= 50 <= longer.high  # the hump, at 1.9 time constants of 50 s
    assert "standard deviations off" in longer.text
    assert any(place.where == FREQUENCY and place.high < 0.1 for place in result.fails)


def test_a_model_with_values_is_compared_as_it_is() -> None:
    record = still(x=white(np.random.default_rng(1)))
    found = fit(model(), record).model
    assert compare(record, found).adequate
    assert parse_model(dump_model(found), "kept") == found
    (term,) = found.terms
    double = replace(found, terms=(replace(term, estimates=(replace(term.estimates[0], value=0.7),)),))
    worst = compare(record, double).fails[0]
    assert worst.excess > 10
    with pytest.raises(DataError, match="has values for the axes x, and none for y"):
        compare(still(y=white(np.random.default_rng(1))), found)


def test_a_given_line_is_taken_off_with_the_phase_that_it_has() -> None:
    x = white(np.random.default_rng(1)) + 0.3 * noises.sinusoid(SAMPLES, 0.0371)
    (channel,) = still(x=x).channels
    before, right, half = (
        without_effects(channel, lines)
        for lines in ((), (SpectralLine(0.371, 0.3, 0.0),), (SpectralLine(0.371, 0.15, 0.0),))
    )
    at = int(np.argmin(np.abs(before.frequency_hz - 0.371)))
    heights = [each.density[at] * RATE_HZ for each in (before, right, half)]
    assert heights[1] == pytest.approx(1, rel=0.4)
    assert (heights[2] - heights[1]) / (heights[0] - heights[1]) == pytest.approx(0.25, abs=0.05)


def test_hum_beyond_the_means_is_found_at_its_own_frequency() -> None:
    """A fast line folds into the means of a long record, far from where it is."""
    n, f_hz = 600_000, 50.0137
    x = white(np.random.default_rng(1), n) + 0.1 * noises.sinusoid(n, f_hz / 1000)
    found = discover(reduce_record([Samples("x", [x], 1000.0, "V")], "made"), model())
    assert found.causes == ("sinusoidal-noise",)
    known = values(found.end.model)
    value, std = known["sinusoidal-noise", "frequency_1"]
    assert value == pytest.approx(f_hz, abs=4 * float(std or 0))
    assert float(std or 0) < 1e-3
    assert known["sinusoidal-noise", "amplitude_1"][0] == pytest.approx(0.1, rel=0.05)
    assert ("sinusoidal-noise", "frequency_2") not in known


def test_the_mismatch_of_a_complete_model_is_that_of_chance() -> None:
    """Weighted by degrees of freedom: over many records its mean square is as computed."""
    records = [still(x=white(np.random.default_rng(seed), 4000)) for seed in range(25)]
    curves = [compare_deviations(fit(model(), each).channels[0], each.allan["x"]) for each in records]
    squares = np.array([curve.mismatch**2 for curve in curves])
    assert squares.mean() == pytest.approx(curves[0].by_chance ** 2, abs=3.5 * squares.std() / 5)
    worst = replace(curves[0], measured=curves[0].measured * np.where(curves[0].edf < 5, 3.0, 1.0))
    assert worst.mismatch < 3 * curves[0].mismatch + 0.05


def test_adding_what_is_not_enough_says_so() -> None:
    random = np.random.default_rng(7)
    record = still(x=white(random) + 0.5 * traps(random) + 0.4 * noises.sinusoid(SAMPLES, 0.05))
    found = dataset(record).add(catalogue()["flicker-noise"], model(), catalogue())
    assert found.verdict == "unexplained"
    assert "sinusoidal-noise" in str(found.residual_structure)
    whole = dataset(record).add(catalogue()["sinusoidal-noise"], found.end.model, catalogue())
    assert (whole.verdict, whole.residual_structure) == ("adequate", None)


def test_few_periods_of_what_is_slow_are_ambiguous_and_a_longer_record_tells() -> None:
    random = np.random.default_rng(0)
    found = diagnose(still(x=white(random, 6000) + 0.003 * np.cumsum(random.standard_normal(6000))), model())
    assert found.verdict == "ambiguous"
    assert found.candidates[0].indistinguishable_from == ("flicker-noise",)
    following = found.next_experiment
    assert following is not None
    assert following.expected is not None
    assert float(str(following.settings["duration_s"])) in (1200.0, 2400.0, 4800.0, 9600.0)
    assert following.expected.probability > 0.9


def test_a_constant_drift_is_no_walk_and_a_walk_is_no_drift() -> None:
    random = np.random.default_rng(4)
    wandering = fit(model("rate-random-walk"), still(x=white(random) + 0.005 * walk(random)))
    assert pattern_of(wandering.channels[0]) is None
    steady = fit(model(), still(x=white(random) + np.arange(SAMPLES) / SAMPLES))
    pattern = pattern_of(steady.channels[0])
    assert pattern is not None
    assert float(pattern.text.split(" by ")[1].split()[0]) == pytest.approx(3600 / (SAMPLES / RATE_HZ), rel=0.2)


def test_held_out_halves_punish_what_is_only_fitted() -> None:
    random = np.random.default_rng(6)
    record = still(x=white(random) + 0.5 * traps(random))
    assert fit(model("flicker-noise"), record).held_out_excess < 1.2
    assert fit(model(), record).held_out_excess > 2


def test_chances_are_those_of_a_bound_and_of_a_tube() -> None:
    assert chance(6.6349, [0.0]) == pytest.approx(0.005, rel=1e-3)  # half of chi-square's 0.01
    assert chance(6.6349, [1.0]) == pytest.approx(0.005 + np.exp(-6.6349 / 2), rel=1e-3)
    assert chance(6.6349, [0.0, 0.0]) == pytest.approx(0.5 * 0.01 + 0.25 * np.exp(-6.6349 / 2), rel=1e-3)
    assert chance(0.0, [0.0]) == 1.0
    assert chance(
        least_gain(
            1e-4,
            (
                0.5,
                0.5,
            ),
        ),
        [0.5, 0.5],
    ) == pytest.approx(1e-4)


def test_an_effect_of_ones_own_is_one_more_process() -> None:
    class BlueNoise(Effect):
        kinds = ("still",)
        level = Parameter("{out}", typical=1.0, low=0.0)

        def spectrum(self, at, p):
            return p.level**2 * at.frequency_hz

    own = BlueNoise()
    random = np.random.default_rng(1)
    spectrum = np.fft.rfft(random.standard_normal(SAMPLES)) * np.sqrt(np.arange(SAMPLES // 2 + 1) / SAMPLES)
    found = discover(still(x=white(random) + 2 * np.fft.irfft(spectrum)), model(), {**catalogue(), own.name: own})
    assert found.causes == ("blue-noise",)


def test_what_cannot_be_asked_is_refused() -> None:
    with pytest.raises(ModelError, match="none of its effects is noise"):
        fit(read_model("linear"), still(x=white(np.random.default_rng(1), 1000)))
    with pytest.raises(TooFewRows, match="channel x: 20 samples"):
        still(x=white(np.random.default_rng(1), 20))
    with pytest.raises(DataError, match="sample 3 is inf"):
        still(x=np.array([0.0, 1.0, np.inf] * 100))


def test_a_record_in_blocks_is_that_record() -> None:
    x = white(np.random.default_rng(1), 30_000)
    whole = still(x=x)
    parts = reduce_record([Samples("x", np.split(x, [5, 9000, 20_001]), RATE_HZ, "V")], "made")
    assert parts.digest == whole.digest
    ours, theirs = (compare_deviations(fit(model(), each).channels[0], each.allan["x"]) for each in (whole, parts))
    assert ours.measured == pytest.approx(theirs.measured)
    assert deviation(fit(model(), parts).channels[0], ours.tau_s) == pytest.approx(ours.modelled)
