"""Hidden causes of another generator, sample by sample: the right effect is named though its formula is not theirs."""

from __future__ import annotations

from itertools import product
from typing import Any

import pytest

from calibrations.loop import diagnose
from calibrations.model.file import read_model
from tests.hidden import sampled
from tests.slow import before_release, first_fast

# effect -> what makes it, weak to strong
CAUSES: dict[str, list[dict[str, Any]]] = {
    "quantisation": [
        {"converter": sampled.rounded(3e-3), "noise_v": 0.6e-3},
        {"converter": sampled.rounded(5e-3)},
        {"converter": sampled.rounded(20e-3), "noise_v": 1e-3},
    ],
    "saturation": [
        {"cause": sampled.clipped(3.49, 0.004)},
        {"cause": sampled.clipped(3.4, 0.01)},
        {"cause": sampled.clipped(3.3, 0.02)},
    ],
    "bias-drift": [
        {"cause": sampled.ramp(2e-4)},
        {"cause": sampled.ramp(1e-2)},
        {"cause": sampled.kicks(2e-3)},
        {"cause": sampled.kicks(1e-2)},
    ],
    "warm-up-scale": [{"cause": sampled.settling_gain(fraction)} for fraction in (5e-4, 2e-3, 1e-2)],
    "temperature-hysteresis": [{"cause": sampled.lagging_stress(slope)} for slope in (2e-4, 1e-3, 5e-3)],
    "dead-zone": [{"cause": sampled.threshold(width)} for width in (3e-4, 2e-3, 2e-2)],
}
FAST = ("warm-up-scale",)  # the others take longer, on the same way
LATE = [*product(("quantisation", "dead-zone"), (1, 2)), ("bias-drift", 3)]  # these take minutes
CASES = [
    case
    for name, causes in CAUSES.items()
    for case in first_fast(((name, k) for k in range(len(causes)) if (name, k) not in LATE), int(name in FAST))
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "k"), [*CASES, *before_release(LATE)])
def test_the_cause_is_named_from_sampled_records(name: str, k: int) -> None:
    for seed in (1, 2)[: 1 + (k == 0)]:  # chance matters where the cause is weak
        found = diagnose(sampled.measured(seed, **CAUSES[name][k]), read_model("linear"))
        told = f"{name} {k}, seed {seed}: {found.verdict}, {found.missing}"
        assert found.verdict in ("effect-missing", "ambiguous"), told
        named = found.candidates[0]
        assert name in (named.name, *named.indistinguishable_from), told


@pytest.mark.parametrize("seed", first_fast(range(10), 2))
def test_nothing_is_named_where_nothing_is_hidden(seed: int) -> None:
    found = diagnose(sampled.measured(seed), read_model("linear"))
    assert (found.verdict, found.missing) == ("adequate", ())
