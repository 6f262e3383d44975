"""The noise in which the search for places looks again, and what it keeps of the search before."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibrations.criteria import MOST_UNSEEN
from calibrations.discovery import structural
from calibrations.effects.catalogue import catalogue
from calibrations.free_forms import search, structure
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.search_result import SearchResult
from calibrations.free_forms.structure import FloorSource
from calibrations.loop import discover
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations.synthetic import NOISE_V, components, turns

WHITE = np.ones((2, 60))


def result(ratio: float, acting: str = "curve", leaves_noise: bool = True) -> SimpleNamespace:
    def component(name: str) -> SimpleNamespace:
        return SimpleNamespace(general=name == "walk")

    return SimpleNamespace(ratio=ratio, leaves_noise=leaves_noise, active=[acting], component=component, white=WHITE)


def searches(monkeypatch: pytest.MonkeyPatch, ends: list[SimpleNamespace]) -> list[dict[str, Any]]:
    """The options of each search, where these are the ends and the residual always contradicts the noise."""
    calls: list[dict[str, Any]] = []

    def searched(*_: object, **options: Any) -> SimpleNamespace:
        calls.append(options)
        return ends[len(calls) - 1]

    monkeypatch.setattr(structure, "search", searched)
    monkeypatch.setattr(structure, "_scatter", lambda *_, **__: WHITE)
    structure._search_with_noise(SimpleNamespace(), WHITE, SimpleNamespace(), FloorSource.SAMPLES)
    return calls


@pytest.mark.parametrize(
    ("ratio", "acting", "kept"), [(0.5, "walk", True), (0.5, "curve", False), (1.3, "walk", False)]
)
def test_a_random_walk_that_acts_in_noise_that_is_too_large_is_tried_again(
    monkeypatch: pytest.MonkeyPatch, ratio: float, acting: str, kept: bool
) -> None:
    calls = searches(monkeypatch, [result(ratio, acting), result(1.0), result(1.0)])
    assert [call["general"] for call in calls[1:]] == [kept, kept]


@pytest.mark.parametrize("leaves_noise", [True, False])
def test_a_second_round_continues_from_a_first_one_that_leaves_noise(
    monkeypatch: pytest.MonkeyPatch, leaves_noise: bool
) -> None:
    first = result(1.0, leaves_noise=leaves_noise)
    calls = searches(monkeypatch, [result(0.5), first, result(1.0)])
    assert [call["origin"] for call in calls[1:]] == [None, first if leaves_noise else None]


def test_every_component_is_tried_where_slow_noise_takes_up_more_than_it_may(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = [result(0.5), result(1.0), result(1.0, leaves_noise=False), result(1.0)]
    assert "every component" in searches(monkeypatch, ends)[-1]["reason"]


@pytest.mark.parametrize(
    ("ratio", "slow", "flicker", "noise"),
    [(1.0, 0.5, False, True), (1.0, 1.5, False, False), (1.1, 0.5, False, False), (1.0, 1.5, True, True)],
)
def test_more_slow_noise_than_there_may_be_is_no_noise(ratio: float, slow: float, flicker: bool, noise: bool) -> None:
    end = SimpleNamespace(ratio=ratio, slow=np.full(120, slow), setting=SimpleNamespace(flicker=flicker))
    assert SearchResult.leaves_noise.fget(end) is noise  # type: ignore[attr-defined]


@pytest.mark.parametrize("general", [True, False])
def test_flicker_is_compared_only_where_random_walks_are_tried(monkeypatch: pytest.MonkeyPatch, general: bool) -> None:
    asked: list[object] = []
    monkeypatch.setattr(search, "_search_from_all", lambda *_: SimpleNamespace(ratio=1.5, criterion=0.0))
    monkeypatch.setattr(search, "_is_flicker", asked.append)
    model_effects: Any = SimpleNamespace(columns=np.zeros((2, 60, 0)))
    search.search(SimpleNamespace(), WHITE, model_effects, general=general)
    assert len(asked) == general


@pytest.mark.parametrize("source", [FloorSource.SAMPLES, FloorSource.CONTRADICTED, FloorSource.NEIGHBOURS])
def test_a_search_beside_the_causes_keeps_the_noise_that_was_found(
    monkeypatch: pytest.MonkeyPatch, source: FloorSource
) -> None:
    monkeypatch.setattr(structural, "_geometry_effects", lambda *_: None)
    monkeypatch.setattr(structural, "effects_beyond_base", lambda *_: None)
    monkeypatch.setattr(structural, "find_structure", lambda *given: given)
    start: Any = SimpleNamespace(table=None, problem=SimpleNamespace(white="stated"))
    before: Any = SimpleNamespace(floor_source=source, white="found")
    given: Any = structural.structure(start, {}, before)
    assert (given[1], given[-1]) == ("stated" if source is FloorSource.SAMPLES else "found", source)


@pytest.mark.parametrize("source", [FloorSource.SAMPLES, FloorSource.CONTRADICTED])
def test_noise_that_was_found_is_not_asked_again(monkeypatch: pytest.MonkeyPatch, source: FloorSource) -> None:
    class Asked(Exception):
        """The noise is asked."""

    class Known(Exception):
        """The search is in this noise."""

    def ends(error: type[Exception]) -> Any:
        def ended(*_: object, **__: object) -> None:
            raise error

        return ended

    monkeypatch.setattr(structure, "search", ends(Known))
    monkeypatch.setattr(structure, "_search_with_noise", ends(Asked))
    monkeypatch.setattr(PoseData, "of", lambda _: None)
    table: Any = SimpleNamespace(left_out=())
    with pytest.raises(Asked if source is FloorSource.SAMPLES else Known):
        structure.find_structure(table, WHITE, SimpleNamespace(), SimpleNamespace(), source)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_a_random_walk_is_found_where_the_samples_say_four_times_the_noise(seed: int) -> None:
    """Without the walk, its name was warm-up-bias, or nothing was named: 2.8 and 3.9 noise floors remained."""
    columns, random = turns(), np.random.default_rng(seed)
    ax, ay, _ = components(columns)
    walk = np.cumsum(random.standard_normal((2, len(ax))), axis=1)
    walk *= 15 * NOISE_V / walk.std(axis=1, keepdims=True)
    gap = 16 * NOISE_V * np.array([ay**2, -(ax**2)])
    outputs = 2.5 + np.array([ax, 1.02 * ay]) + gap + walk + NOISE_V * random.standard_normal(walk.shape)
    samples = {"vx_std_v": 4 * NOISE_V * np.sqrt(500), "vy_std_v": 4 * NOISE_V * np.sqrt(500), "n": 500.0}
    known = {name: np.full(len(ax), value) for name, value in samples.items()}
    table = Table.from_columns("poses", {**columns, "vx_v": outputs[0], "vy_v": outputs[1], **known}, source="made")
    found = discover(table, read_model("linear"), catalogue())
    assert set(found.causes) == {"bias-drift", "cross-axis-bias"}
    assert found.end.held_out_excess < MOST_UNSEEN
