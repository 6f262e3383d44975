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


def bent(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    return v + VOLTS * poses.a**3 * np.array([1.0, 0.8])


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
def test_a_curve_that_no_line_follows_has_no_name() -> None:
    found = found_with(rippling)
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert [place.name for place in found.findings.places if place.unknown] == ["temperature-bias"]


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
