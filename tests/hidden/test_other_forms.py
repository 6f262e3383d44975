"""Sensors whose cause has another form than the catalogue's, and whose noise is not what their columns say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.loop import compare, discover
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.hidden import sampled

VOLTS = 1e-3


def heated(poses: sampled.Sweep) -> Array:
    """The temperature from its mean, 1 at one and a half standard deviations, (n, 1)."""
    t = poses.temperature_c
    return np.asarray((t - t.mean()) / (1.5 * t.std()))[:, None]


def leaking(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A leakage current that grows exponentially with the temperature."""
    return v + VOLTS * np.expm1(1.5 * heated(poses)) * np.array([1.0, -0.6])


def rippling(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A bias that grows with the temperature, and goes up and down three times as much meanwhile."""
    q = heated(poses)
    return v + VOLTS * (np.cos(6.0 * q) + 1.2 * q) * np.array([1.0, -0.6])


def magnetised(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A magnetic field of the room, in which the stage beta turns the sensor."""
    heading = np.radians(poses.beta_deg)[:, None]
    return v + VOLTS * np.cos(heading - np.array([0.7, 1.2]))


def wound(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A cable that winds up with beta: 0 and 360 deg differ."""
    turns = poses.beta_deg[:, None] / 180 - 1
    return v + VOLTS * (turns + 0.6 * turns**3) * np.array([1.0, 0.5])


def sagging(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A floor that tilts in the course of the day, and turns the base by 0.1 deg about its x axis."""
    tilt = np.radians(0.1) * np.sin(2 * np.pi * poses.t_s / poses.t_s.max() + 0.4)
    heading = np.radians(poses.beta_deg)
    return v + tilt[:, None] * np.column_stack([np.sin(heading), -np.cos(heading)])


def leaning(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A sensor whose case leans on its adhesive as it warms up, by 0.1 deg."""
    lean = np.radians(0.1) * heated(poses) * np.array([0.6, 0.8])
    return v + lean * np.cos(np.radians(poses.alpha_deg))[:, None]


def relaxing(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A stress that relaxes in twelve small steps of one sign."""
    share = poses.t_s / poses.t_s.max()
    at, height = random.uniform(0.02, 0.98, 12), random.lognormal(0.0, 0.6, 12)
    fallen = (1 + np.tanh((share[:, None] - at) / 0.05)) / 2 @ height / height.sum()
    return v + 4 * VOLTS * np.outer(fallen, [1.0, 1.2])


def ageing(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A bias that ages with the logarithm of the time, and has not settled at the end."""
    return v + 5 * VOLTS * np.outer(np.log1p(poses.t_s / (0.8 * poses.t_s.max())), [1.0, -0.6])


def softened(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A suspension that becomes softer towards one face, about a zero of its own at 50 mg."""
    z = np.cos(np.radians(poses.alpha_deg))[:, None]
    return v + 4 * VOLTS * (poses.a - 0.05) * z * np.array([1.0, -0.8])


def bowed(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A tether that stretches sideways."""
    return v + 20 * VOLTS * (np.hypot(1.3, poses.a) - 1.3) * np.array([1.0, 0.7])


def hummed(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """Mains, as the pace of the poses shows them: a wave in 7.3 poses."""
    phase = 2 * np.pi * poses.t_s[:, None] / (7.3 * sampled.PERIOD_S)
    return v + VOLTS * np.sin(phase + np.array([0.0, 1.0]))


def draughty(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A fan that switches in the room, fourteen times in the record: a random walk follows its wave."""
    phase = 2 * np.pi * 14.3 * poses.t_s[:, None] / poses.t_s.max()
    return v + VOLTS * np.sin(phase + np.array([0.0, 1.0]))


def beating(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """Mains, as the pace of the poses shows them: a wave in 2.7 poses differs from pose to pose as noise does."""
    return v + VOLTS * np.sin(2 * np.pi * poses.t_s[:, None] / (2.7 * sampled.PERIOD_S) + np.array([0.0, 1.0]))


def folding(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A folding converter: its error has several waves over the range of the outputs."""
    return v + VOLTS * np.sin(2 * np.pi * v / 0.55)


def truncated(means: Array) -> Array:
    """The means as a logger writes them that cuts their digits off."""
    step_v = 0.0126
    return np.asarray(np.floor(means / step_v) * step_v)


NAMELESS: dict[sampled.Cause, str] = {
    rippling: "temperature-bias",
    magnetised: "beta-bias",
    wound: "beta-bias",
    sagging: "tilt-over-time",
    leaning: "temperature-axes",
}  # causes that no effect of the catalogue describes, and the places where they act


def bent(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    return v + VOLTS * poses.a**3 * np.array([1.0, 0.8])


def limited(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """A servo loop whose force ends gradually at 0.96 g, as the 25-norm of the demand and the limit."""
    limit_v = 0.96
    demand = v - 2.5
    return 2.5 + demand / (1 + np.abs(demand / limit_v) ** 25) ** (1 / 25)


def found_with(cause: sampled.Cause) -> Discovery:
    return discover(sampled.measured(4, cause), read_model("linear"))


def sampled_fast(filter_stated: bool) -> Table:
    """A bent sensor, as ten times more samples of the same dwells behind the same filter give it."""
    table = sampled.measured(4, bent)
    rates = {**table.constants, "sample_rate_hz": 10 * sampled.RATE_HZ}
    columns = {**table.columns, "n": 10 * table.column("n")}
    return replace(table, columns=columns, constants=rates if filter_stated else {})


@pytest.mark.slow
def test_a_place_of_one_effect_names_it_in_another_form() -> None:
    found = found_with(leaking)
    assert found.causes == ("temperature-bias",)
    assert found.steps[-1].name == "free:temperature-bias"
    assert found.steps[-1].held_out_after < 1.15


@pytest.mark.slow
def test_a_limit_that_is_reached_gradually_is_a_saturation_with_a_wide_bend() -> None:
    found = found_with(limited)
    assert found.causes == ("saturation",)
    assert found.steps[-1].held_out_after < 1.15
    assert found.model.value("saturation.knee") > 0.005


def test_a_supply_that_changes_bias_and_scale_factor_apart_has_one_name() -> None:
    table = sampled.measured(6)
    supply = 5 + 0.02 * np.sin(np.linspace(0, 9, table.n)) + 0.01 * np.cos(np.linspace(0, 31, table.n))
    forces = (table.outputs - 2.5) / table.outputs.std(axis=0)
    added = (supply - 5)[:, None] * (np.array([0.1, -0.06]) + 0.04 * forces)
    found = discover(
        replace(table, columns={**table.columns, "supply_v": supply}).with_outputs(table.outputs + added),
        read_model("linear"),
    )
    assert found.causes == ("supply-sensitivity",)
    assert found.steps[-1].held_out_after < 1.15


@pytest.mark.slow
def test_a_curve_over_the_temperature_is_no_hysteresis() -> None:
    """A play resembles a curve where the temperature hardly falls; the search tries both, and the curve is likelier."""
    table = sampled.measured(5)
    share = np.linspace(0.0, 1.0, table.n)
    q = 2 * share - 1 + 0.1 * np.sin(40 * share)
    outputs = table.outputs + VOLTS * np.outer(q + 0.4 * q**2, [1.0, -0.6])
    warming = replace(table, columns={**table.columns, "temperature_c": 24 + 4 * q}).with_outputs(outputs)
    found = discover(warming, read_model("linear"))
    assert found.causes == ("temperature-bias",)
    assert found.steps[-1].held_out_after < 1.15


@pytest.mark.slow
@pytest.mark.parametrize("cause", NAMELESS)
def test_what_no_effect_describes_has_a_place_and_no_name(cause: sampled.Cause) -> None:
    found = found_with(cause)
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert [place.name for place in found.findings.places if place.unknown] == [NAMELESS[cause]]
    assert found.steps[-1].held_out_after < 1.15


@pytest.mark.release
def test_a_wave_that_a_random_walk_follows_is_no_drift() -> None:
    found = found_with(draughty)
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert [place.name for place in found.findings.places if place.unknown] == ["time-bias"]


@pytest.mark.release
def test_a_fast_wave_in_time_is_no_drift() -> None:
    """A random walk follows a wave of 7 poses; the wave itself describes the residual better."""
    found = found_with(hummed)
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert "oscillation in time, period 51" in found.judgement.text


@pytest.mark.slow
def test_a_wave_of_few_poses_is_no_noise() -> None:
    """Without a filter the samples of a mean may be correlated, so that scatter of the poses may be noise."""
    found = discover(replace(sampled.measured(4, beating), constants={}), read_model("linear"))
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert "oscillation in time, period 18.9" in found.judgement.text


@pytest.mark.slow
def test_any_curve_of_the_converter_is_its_nonlinearity() -> None:
    """Integral nonlinearity is every deviation of the characteristic from a line, the same for all channels."""
    found = found_with(folding)
    assert found.causes == ("adc-nonlinearity",)
    assert found.alternatives == {}, "what resembles the effect's own formula is no alternative to another form"
    assert found.steps[-1].name == "free:output"
    assert found.steps[-1].held_out_after < 1.15


@pytest.mark.release
def test_means_whose_digits_are_cut_off_need_one_effect() -> None:
    """What the search finds in front of large steps may be their remainder: it does not lower the unseen error."""
    rounded = replace(sampled.measured(4), constants={})
    cut = rounded.with_outputs(truncated(rounded.outputs))
    assert [step.name for step in discover(cut, read_model("linear")).steps] == ["quantisation"]


@pytest.mark.slow
def test_a_logger_rounds_each_output_about_an_offset_of_its_own() -> None:
    means = sampled.measured(4, bowed)
    step_v, offset_v = 0.0012, np.array([0.0002, 0.0009])
    logged = means.with_outputs(offset_v + step_v * np.round((means.outputs - offset_v) / step_v))
    found = discover(logged, read_model("linear"))
    assert set(found.causes) == {"quadratic-nonlinearity", "quantisation"}
    assert found.steps[-1].held_out_after < 1.3


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "seed"), [(relaxing, 2), (ageing, 1)])
def test_what_does_not_settle_is_a_drift(cause: sampled.Cause, seed: int) -> None:
    found = discover(sampled.measured(seed, cause), read_model("linear"))
    named = {name: {name, *found.alternatives.get(name, ())} for name in found.causes}
    assert [("bias-drift" in names) for names in named.values()] == [True]


@pytest.mark.slow
def test_a_scale_factor_about_a_zero_of_its_own_is_no_misalignment() -> None:
    assert found_with(softened).causes == ("z-axis-scale",)


@pytest.mark.slow
def test_means_of_correlated_samples_have_the_scatter_of_the_poses_as_noise_floor() -> None:
    """Without the filter the means seem to have a fifth of their noise."""
    stated, found = (discover(sampled_fast(known), read_model("linear")) for known in (True, False))
    assert found.causes == stated.causes == ("cubic-nonlinearity",)
    assert found.steps[-1].held_out_after == pytest.approx(stated.steps[-1].held_out_after, rel=0.1)
    assert "The noise floor is the scatter of the poses." in found.judgement.text
    compared = compare(sampled_fast(filter_stated=False), found.model)
    assert compared.fit.pooled_excess > 4
    assert not compared.fails
