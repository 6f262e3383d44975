"""Effects beside each other, beside patterns, and beside rivals of another shape: on mechanisms of other forms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.loop import diagnose, discover
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.benchmark.discovery.cases import case
from tests.hidden import rigs
from tests.hidden.defects import DEFECTS
from tests.hidden.test_hidden_defects import table


@cache
def found_on(name: str, times_noise: float, seed: int) -> Discovery:
    return discover(case(name, times_noise, seed)[0], read_model("linear"))


@pytest.mark.slow
def test_an_effect_that_was_taken_from_a_bad_start_is_fitted_anew() -> None:
    """A dead band beside a turned package: the first is fitted while the second still moves every zero crossing."""
    config = rigs.IDEAL
    for defect in ("blind amplifier", "package turned"):
        config = rigs.scaled(DEFECTS[defect], config, 9, 10 * rigs.noise_floor_v())
    found = discover(table(rigs.swept(config, 9)), read_model("linear"))
    assert sorted(found.causes) == ["axis-misalignment", "dead-zone"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed", "cause"),
    [("own/stressed package", 6126, "temperature-bias"), ("own/ageing reference", 6166, "bias-drift")],
)
def test_a_pattern_that_holds_the_effect_is_its_form_and_no_other_cause(name: str, seed: int, cause: str) -> None:
    assert diagnose(case(name, 30, seed)[0], read_model("linear")).verdict != "unexplained"
    assert found_on(name, 30, seed).causes == (cause,)


@pytest.mark.slow
def test_a_step_in_time_still_is_another_cause_than_a_random_walk_that_follows_it() -> None:
    found = found_on("own/arrived charge", 10, 7001)
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert str(found.residual_structure).startswith("step at t =")


@pytest.mark.slow
def test_a_rival_is_judged_with_its_shape_fitted() -> None:
    """A drift over a short record may be the end of a long warming: no start of that has so long a time constant."""
    assert found_on("own/ageing reference", 30, 6166).alternatives == {"bias-drift": ("warm-up-bias",)}


@pytest.mark.slow
def test_a_cause_of_another_form_keeps_a_free_form_for_the_remainder() -> None:
    """Beams that warm as two masses do, where the catalogue has one time constant."""
    found = found_on("own/warming beams", 30, 6158)
    assert (found.causes, found.verdict) == (("warm-up-scale",), "adequate")
    assert [step.name for step in found.steps] == ["warm-up-scale", "free:time-scale"]
    assert found.steps[-1].held_out_after < 1.15 < found.steps[0].held_out_after


def cycled(lag_k: float) -> Table:
    """Two turns while an oven goes up by 30 K and down again; the bias follows it, behind a play of `lag_k`."""
    rng = np.random.default_rng(3)
    beta = np.tile(np.arange(0.0, 360.0, 10.0), 4)
    t = 30.0 * np.arange(len(beta))
    temperature = 25 + 30 * (1 - np.abs(2 * t / t[-1] - 1))
    behind = np.empty_like(temperature)
    held = temperature[0]
    for k, c in enumerate(temperature):
        held = behind[k] = min(max(held, c - lag_k), c + lag_k)
    volts = np.cos(np.radians([beta, beta - 90])).T + 2.5 + 1e-3 * behind[:, None]
    columns = {"alpha_deg": np.full(len(beta), 90.0), "beta_deg": beta, "t_s": t, "temperature_c": temperature}
    columns |= {f"v{a}_v": v + 5e-5 * rng.standard_normal(len(beta)) for a, v in zip("xy", volts.T, strict=True)}
    columns |= {"vx_std_v": np.full(len(beta), 5e-4), "vy_std_v": np.full(len(beta), 5e-4)}
    return Table.from_columns("poses", {**columns, "n": np.full(len(beta), 100.0)}, source="cycled")


@pytest.mark.slow
@pytest.mark.parametrize(("lag_k", "cause"), [(0.0, "temperature-bias"), (3.0, "temperature-hysteresis")])
def test_a_cycle_of_temperature_tells_whether_there_is_play(lag_k: float, cause: str) -> None:
    """Play of no width is no rival: no data could rule it out."""
    found = discover(cycled(lag_k), read_model("linear"))
    assert (found.verdict, found.causes, dict(found.alternatives)) == ("adequate", (cause,), {})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed", "rivals", "experiment"),
    [
        # a room that only becomes warmer, by a noisy thermometer: time is the better thermometer, and no proof
        ("rising room", 5020, {"bias-drift", "temperature-bias", "warm-up-bias"}, "soak"),
        # play that turns with the gear
        ("one way round", 5035, {"stage-zero-offset", "axis-misalignment", "stage-backlash"}, "sweep"),
        ("one inclination", 5030, {"cross-axis-bias", "quadratic-nonlinearity"}, "sweep"),
    ],
)
def test_an_effect_that_leaves_only_noise_is_a_rival_of_a_likelier_one(
    name: str, seed: int, rivals: set[str], experiment: str
) -> None:
    found = diagnose(case(f"inseparable/{name}", 10, seed)[0], read_model("linear"))
    assert found.verdict == "ambiguous"
    best = found.candidates[0]
    assert rivals <= {best.name, *best.indistinguishable_from}
    assert found.next_experiment is not None
    assert found.next_experiment.procedure == experiment


def test_what_took_anothers_place_has_it_as_its_rival() -> None:
    """The room settles as a sensor warms up."""
    found = found_on("inseparable/settling room, bias", 10, 5010)
    assert (found.verdict, found.causes) == ("ambiguous", ("temperature-bias",))
    assert "warm-up-bias" in found.alternatives["temperature-bias"]


@pytest.mark.release
def test_what_comes_before_a_coarse_converter_is_seen_through_its_stairs() -> None:
    """Edges that lie where another effect puts them tell nothing of it by their slope."""
    found = diagnose(case("triple", 10, 4010)[0], read_model("linear"))
    assert found.missing == ("odd-quadratic-nonlinearity", "quantisation", "temperature-bias")
