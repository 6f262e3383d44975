"""A temperature ramp at rest: line, curve and branches over temperature are removed before noise is named."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.loop import discover
from calibrations.model.file import read_model
from calibrations.noise.record import Samples, reduce_record
from tests.calibrations.ramps import RATE_HZ, record

CASES = {  # what the sensor does, and words of the answer
    "line": ({"line": 5e-4}, ["follows temperature_c by"]),
    "line and bow": ({"line": 5e-4, "bow": 4e-3}, ["follows temperature_c by", "the square of temperature_c by"]),
    "line and glue": ({"line": 5e-4, "glue": 4e-3}, ["follows temperature_c by", "(hysteresis)"]),
    "line behind": ({"line": 5e-4, "delay_s": 300.0}, ["with a lag of"]),
}


@pytest.mark.parametrize("name", CASES)
def test_no_process_is_named_for_what_follows_the_temperature(name: str) -> None:
    form, words = CASES[name]
    for seed in range(3):
        volts, warm = record(np.random.default_rng(seed), **form)
        still = reduce_record([Samples("x", [volts], RATE_HZ, "V", logged={"temperature_c": [warm]})], "made")
        found = discover(still, read_model("still"))
        assert found.causes == ()
        assert all(each in str(found.residual_structure) for each in words)


def test_a_constant_temperature_is_no_cause() -> None:
    random = np.random.default_rng(0)
    volts, _ = record(random)
    still = reduce_record(
        [
            Samples(
                "x", [volts], RATE_HZ, "V", logged={"temperature_c": [20 + 0.01 * random.standard_normal(len(volts))]}
            )
        ],
        "made",
    )
    found = discover(still, read_model("still"))
    assert found.causes == ()
    assert found.residual_structure is None
