"""What a verdict says of a candidate that chance alone would seldom show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.diagnose import Diagnosis, diagnose
from calibrations.model_file import read_model
from calibrations.reports.verdict import headline
from tests.calibrations import synthetic


@pytest.fixture(scope="module")
def clean() -> Diagnosis:
    return clean_of(4)


def clean_of(seed: int) -> Diagnosis:
    """Of a linear sensor at 70 poses."""
    columns = synthetic.turns((90, 30, 150, 60, 120), 60.0)
    ax, ay, _ = synthetic.components(columns)
    return diagnose(synthetic.poses(columns, 2.5 + 0.8 * ax, 2.5 + 0.8 * ay, seed=seed), read_model("linear"))


def test_a_clean_sensor_misses_nothing_and_that_is_likeliest(clean: Diagnosis) -> None:
    assert headline(clean) == "nothing is missing; what is left is noise."
    assert sum(c.probability for c in clean.candidates) < 0.5


def test_what_chance_would_seldom_show_is_said(clean: Diagnosis) -> None:
    best = replace(clean.candidates[0], p_value=0.009, held_out_after=0.9 * clean.held_out_before)
    found = replace(clean, candidates=(best, *clean.candidates[1:]))
    assert headline(found) == (
        f"nothing is missing beyond what chance may show, but {best.name} comes near: chance alone shows as much in "
        "0.9% of such searches, and an effect is named below 0.3%; measure once more to tell."
    )
    unseen = replace(best, held_out_after=1.1 * clean.held_out_before)
    assert headline(replace(clean, candidates=(unseen,))) == headline(clean)


def test_before_nothing_is_as_likely_as_anything() -> None:
    """Of 12 clean sensors none is likely to miss something, however many effects are tried."""
    likely = [sum(c.probability for c in clean_of(seed).candidates) for seed in range(12)]
    assert np.mean(likely) < 0.1
