"""Wild samples and stuck stretches: found where they are, and nothing of the kind where noise only looks like it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from calibrations.noise.record import Reduction
from calibrations.noise.samples import Outliers, Run, Stuck, Wild
from calibrations.table import Array
from tests.calibrations.hidden_noise import counted, room, telegraph, traps, walk, white

Made = Callable[[np.random.Generator], Array]
HARMLESS: dict[str, Made] = {
    "white": white,
    "normal": lambda r: r.standard_normal(20_000),
    "Laplacian": lambda r: r.laplace(size=20_000),
    "traps": traps,
    "walk by jumps": walk,
    "two levels": telegraph,
    "two levels in noise": lambda r: telegraph(r, stay=30.0) + 1e-3 * white(r),
    "a counter": counted,
    "coarse steps": lambda r: np.round(0.6 * white(r)),
    "a slow sensor under coarse steps": lambda r: np.round(room(r), 1),
    "a step": lambda r: white(r) + 50.0 * (np.arange(20_000) > 7000),
    "a step that takes a sample": lambda r: white(r) + 50.0 * np.clip(np.arange(20_000) - 7000.0, -1, 1),
    "sawtooth": lambda r: white(r) + np.arange(20_000) % 500.0,
}


def wild(x: Array, blocks: int = 1) -> Wild:
    seen = Outliers()
    for part in np.array_split(x, blocks):
        seen.add(part)
    return seen.found()


def stuck(x: Array, blocks: int = 1) -> Run | None:
    seen = Stuck()
    for part in np.array_split(x, blocks):
        seen.add(part)
    return seen.found()


@pytest.mark.parametrize("name", HARMLESS)
def test_noise_has_no_wild_and_no_stuck_samples(name: str) -> None:
    for seed in range(5):
        x = HARMLESS[name](np.random.default_rng(seed))
        assert wild(x) == Wild()
        assert stuck(x) is None


@pytest.mark.parametrize("at", [0, 1, 2, 4090, 4095, 4096, 4101, 9999])
@pytest.mark.parametrize("blocks", [1, 7, 900])
def test_a_wild_sample_is_found_wherever_it_is(at: int, blocks: int) -> None:
    x = white(np.random.default_rng(1), 10_000)
    x[at] = -40.0
    found = wild(x, blocks)
    assert (found.count, found.first, found.wildest) == (1, at, at)
    assert found.deviations > 25
    assert found.power == pytest.approx(40**2, rel=0.15)


def test_odd_samples_count_neighbours_separately_and_name_the_largest() -> None:
    x = white(np.random.default_rng(1), 10_000)
    x[[300, 5000, 5001]] = 30.0, 90.0, 80.0
    found = wild(x, 3)
    assert (found.count, found.first, found.wildest) == (3, 300, 5000)


def test_many_large_samples_count_as_noise() -> None:
    x = white(np.random.default_rng(1), 10_000)
    x[::200] += 50.0
    assert wild(x) == Wild()


@pytest.mark.parametrize("start", [0, 3000, 9900])
@pytest.mark.parametrize("blocks", [1, 7, 900])
def test_a_stuck_stretch_is_found_wherever_it_is(start: int, blocks: int) -> None:
    x = white(np.random.default_rng(1), 10_000)
    x[start : start + 100] = x[start]
    assert stuck(x, blocks) == Run(start, 100)


def test_an_oddity_matters_where_it_moves_the_white_noise_beyond_its_uncertainty() -> None:
    def told(n: int) -> list[tuple[str, bool]]:
        x = white(np.random.default_rng(1), n)
        x[1000] = 20.0
        x[500:600] = x[500]
        seen = Reduction(10.0)
        assert sum(len(part) for part in seen.read([x], "made")) == n
        return [(each.kind, each.matters) for each in seen.oddities()]

    assert told(2000) == [("wild-samples", True), ("constant-stretch", True)]
    assert told(200_000) == [("wild-samples", False), ("constant-stretch", False)]
