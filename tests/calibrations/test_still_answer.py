"""Diagnosis and discovery give one answer: its alternatives or its reason, and what to do next."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from calibrations.discovery.results import Diagnosis, Discovery
from calibrations.discovery.verdict import Residual
from calibrations.documents import diagnosis_document, discovery_document
from calibrations.effects.catalogue import catalogue
from calibrations.loop import dataset, diagnose, discover
from calibrations.model.file import read_model
from calibrations.noise.record import Samples, Still, reduce_record
from calibrations.table import Array
from tests.calibrations.hidden_noise import OTHERS, RATE_HZ, RECORDS, room, telegraph, traps, walk, white

N = 40_000


def still(x: Array, rate_hz: float = RATE_HZ, corner_hz: float = np.inf, **logged: Array) -> Still:
    given = {name: [values] for name, values in logged.items()}
    return reduce_record([Samples("x", [x], rate_hz, "V", corner_hz, given)], "made")


def both(record: Still) -> tuple[Diagnosis, Discovery]:
    return diagnose(record, read_model("still")), discover(record, read_model("still"))


def charged(random: np.random.Generator, ohm: float = 10e3, farad: float = 1e-6, rate_hz: float = 1000.0) -> Array:
    """White noise on a capacitor, integrated in ten steps to a sample."""
    step = 1 / (10 * rate_hz * ohm * farad)
    volts = lfilter([step], [1, step - 1], random.uniform(-1, 1, 10 * N))
    return np.asarray(volts[9::10])


CASES = {
    "few periods": lambda r: still(white(r, 6000) + 0.003 * np.cumsum(r.standard_normal(6000))),
    "behind a filter": lambda r: still(charged(r), 1000.0),
    "a step beside flicker": lambda r: still(white(r) + 0.4 * traps(r) + 3.0 * (np.arange(20_000) > 9000)),
    "wild": lambda r: still(np.where(np.arange(20_000) == 7000, 60.0, white(r))),
    "a trap of two levels": lambda r: still(white(r) + 0.7 * telegraph(r)),
    "louder": lambda r: still(OTHERS["louder"][0](r)),
    "resonance beside a walk": lambda r: still(0.6 * OTHERS["resonance"][0](r) + 0.01 * walk(r)),
    "warm": lambda r: (lambda c: still(white(r) + 0.5 * c, temperature_c=c))(room(r)),
    "white": lambda r: still(white(r, 5000)),
}


@pytest.mark.parametrize("name", CASES)
def test_diagnosis_and_discovery_say_the_same(name: str) -> None:
    asked, found = both(CASES[name](np.random.default_rng(0)))
    same = "adequate" if asked.verdict == "effect-missing" else asked.verdict
    if Residual.of(found.judgement) is Residual.CAUSE:  # the named effects are missing; with them, a cause still is
        same = "unexplained"
    assert (same, asked.missing) == (found.verdict, found.causes)
    one, other = diagnosis_document(asked, "still"), discovery_document(found, None)
    for key in ("alternatives", "reason", "residual_structure", "next_experiment", "disturbances"):
        assert one[key] == other[key]
    if asked.verdict == "ambiguous":
        assert asked.alternatives or asked.residual_structure
    if asked.verdict in ("ambiguous", "unexplained"):
        assert asked.reason
        assert asked.next_experiment is not None
        assert (asked.residual_structure or "cannot separate") in asked.judgement.text
        assert all(rival in asked.judgement.text for rivals in asked.alternatives.values() for rival in rivals)
    else:
        assert (asked.reason, asked.next_experiment, asked.alternatives) == (None, None, {})


def test_white_noise_behind_a_filter_is_told_from_its_own_process_by_shaking_or_by_stating_the_corner() -> None:
    x = charged(np.random.default_rng(1))
    asked, _ = both(still(x, 1000.0))
    assert (asked.verdict, asked.missing) == ("ambiguous", ("gauss-markov-noise",))
    assert asked.alternatives == {"gauss-markov-noise": ("output-filter",)}
    assert asked.candidates[0].indistinguishable_from == ("output-filter",)
    corner = float(str(asked.reason).split("low-pass of ")[1].split(" Hz")[0])
    assert corner == pytest.approx(1 / (2 * np.pi * 10e3 * 1e-6), rel=0.1)
    assert asked.next_experiment is not None
    assert asked.next_experiment.procedure == "motion"
    assert asked.next_experiment.separates == (("gauss-markov-noise", "output-filter"),)
    stated, _ = both(still(x, 1000.0, 1 / (2 * np.pi * 10e3 * 1e-6)))
    assert stated.verdict == "adequate"


def test_a_slow_process_over_white_noise_is_no_filter() -> None:
    asked, _ = both(CASES["a trap of two levels"](np.random.default_rng(0)))
    assert (asked.verdict, asked.missing) == ("effect-missing", ("gauss-markov-noise",))


def test_what_is_added_has_its_doubts_and_an_experiment_too() -> None:
    record = CASES["few periods"](np.random.default_rng(0))
    found = dataset(record).add(catalogue()["rate-random-walk"], read_model("still"), catalogue())
    assert (found.verdict, found.alternatives) == ("ambiguous", {"rate-random-walk": ("flicker-noise",)})
    assert "cannot separate rate-random-walk from flicker-noise" in str(found.reason)
    assert found.next_experiment is not None


@pytest.mark.parametrize("name", ["telegraph and walk", "telegraph and hum", "traps and walk"])
def test_gains_of_the_steps_add_up_and_fall(name: str) -> None:
    found = discover(still(RECORDS[name][0](np.random.default_rng(4))), read_model("still"))
    gained = [step.after.log_likelihood - step.before.log_likelihood for step in found.steps]
    assert len(gained) == 2
    assert gained == sorted(gained, reverse=True)
    assert sum(gained) == pytest.approx(found.end.log_likelihood - found.start.log_likelihood)
    assert found.steps[-1].alone == pytest.approx(gained[-1], rel=0.2)
