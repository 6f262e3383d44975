"""The same calls give the same bytes, and a resumed run equals one that was never disturbed."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

ANGLES = [10.0, -35.0, 35.0, 120.0, 90.0, 0.0]


def prepare(bench: Any) -> None:
    bench.alpha.home()
    bench.oven.set_temperature(30.0)
    bench.oven.run(True)


def measure(bench: Any, angle: float) -> tuple[float, float, float, float, bytes]:
    bench.alpha.move_to(angle)
    samples = bench.adc.acquire(0.3)
    temperature = bench.oven.temperature_c()
    return bench.clock.now(), samples.start_s, bench.alpha.angle_deg(), temperature, samples.volts.tobytes()


def keep(bench: Any) -> str:
    servers = {name: server.state() for name, server in bench.servers.items()}
    return json.dumps({"clock": bench.clock.now(), "world": bench.world.state(), "servers": servers})


def restore(bench: Any, kept: str) -> None:
    state = json.loads(kept)
    bench.world.restore(state["world"])
    for name, server in bench.servers.items():
        server.restore(state["servers"][name])
    bench.clock.restore(state["clock"])


def test_the_same_seed_and_calls_give_the_same_bytes(make_bench: Callable[..., Any]) -> None:
    runs = []
    for _ in range(2):
        bench = make_bench(seed=5)
        prepare(bench)
        runs.append([measure(bench, angle) for angle in ANGLES])
    assert runs[0] == runs[1]


def test_another_seed_gives_other_noise(make_bench: Callable[..., Any]) -> None:
    one, other = (make_bench(seed).adc.acquire(0.1).volts[:, 1] for seed in (1, 2))
    assert not np.array_equal(one, other)


def test_a_resumed_run_equals_an_undisturbed_one(make_bench: Callable[..., Any]) -> None:
    whole = make_bench(seed=3)
    prepare(whole)
    expected = [measure(whole, angle) for angle in ANGLES]

    first = make_bench(seed=3)
    prepare(first)
    found = [measure(first, angle) for angle in ANGLES[:3]]
    kept = keep(first)
    measure(first, 77.0)  # the pose in flight is lost
    first.close()

    second = make_bench(seed=3)
    second.alpha.self_test()  # looking at the instruments takes time: it comes before
    restore(second, kept)
    found += [measure(second, angle) for angle in ANGLES[3:]]
    assert found == expected
