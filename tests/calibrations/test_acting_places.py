"""A place can explain a residual. These tests check its free forms, its size, and the noise that its curve follows."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from calibrations.discovery.findings import Findings
from calibrations.discovery.plausibility import _stuck
from calibrations.free_forms.acting_places import _size_of_unshared_part
from calibrations.free_forms.geometry import _fit_angles
from calibrations.free_forms.places import _stages
from calibrations.free_forms.structure import FloorSource, Structure


def test_angles_that_differ_by_readings_alone_show_no_eccentricity() -> None:
    beta = np.tile(0.1 + 0.7 * np.arange(5), 4) + np.repeat([-2e-4, -1e-4, 1e-4, 2e-4], 5)  # rad
    data = SimpleNamespace(beta=beta, alpha=np.zeros(20), sides={}, timed=False)
    assert _stages(data, None) == []


@pytest.mark.parametrize(("gain", "size"), [(0.25, 0.05), (-1.0, 0.0)])
def test_a_size_is_the_root_of_a_gain_a_row(gain: float, size: float) -> None:
    assert _size_of_unshared_part(SimpleNamespace(columns=np.ones((100, 3))), gain) == size


@pytest.mark.parametrize(
    ("flicker", "component", "follows"),
    [(True, "time-bias/curve", True), (False, "time-bias/walk-0", True), (False, "time-bias/curve", False)],
)
def test_flicker_or_a_walk_follows_noise(flicker: bool, component: str, follows: bool) -> None:
    result = SimpleNamespace(setting=SimpleNamespace(flicker=flicker), active=[component])
    assert Structure(result, (), None, np.zeros((1, 1)), FloorSource.SAMPLES).follows_noise == follows


def test_without_effects_the_angles_determine_nothing() -> None:
    values, remaining, rank = _fit_angles(lambda _: np.ones(3), {})
    assert (values, remaining.tolist(), rank) == ({}, [1.0] * 3, 0.0)


@pytest.mark.parametrize(
    ("name", "component", "follows"),
    [("history", "play", True), ("time-bias", "time-bias/walk-0", True), ("time-bias", "time-bias/curve", False)],
)
def test_a_history_or_a_walk_follows_many_things(name: str, component: str, follows: bool) -> None:
    none_acts = Structure(SimpleNamespace(), (), None, np.zeros((1, 1)), FloorSource.SAMPLES)
    assert none_acts._follows(SimpleNamespace(name=name, components=[component])) == follows


@pytest.mark.parametrize(("unknown", "missing"), [(True, ("scale-factor",)), (False, ("scale-factor", "free:own"))])
def test_a_curve_at_an_unknown_place_has_the_name_of_its_place(unknown: bool, missing: tuple[str, ...]) -> None:
    found = SimpleNamespace(places=[SimpleNamespace(unknown=unknown)], names=("scale-factor", "free:own"))
    assert vars(Findings)["_missing"].fget(found) == missing


def test_an_output_of_few_rows_is_not_called_stuck() -> None:
    assert _stuck(np.arange(5.0), np.eye(5, 3), "vx") is None
