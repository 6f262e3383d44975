"""Transients of a record: over soon, settled, or not settled at its end."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.free_forms.transients import is_over_soon, is_unsettled
from calibrations.table import Array

SHARE = np.linspace(0.0, 1.0, 300)


def both(curve: Array) -> Array:
    """The curve of two axes, the second one smaller and of the other sign."""
    return np.stack([curve, -0.4 * curve])


@pytest.mark.parametrize(("part", "unsettled"), [(0.05, False), (0.3, False), (0.5, True), (2.0, True)])
def test_a_long_time_constant_is_not_settled(part: float, unsettled: bool) -> None:
    assert is_unsettled(both(np.exp(-SHARE / part)), SHARE) is unsettled


def test_ageing_with_the_logarithm_of_the_time_is_not_settled() -> None:
    assert is_unsettled(both(np.log1p(SHARE / 0.8)), SHARE)


@pytest.mark.parametrize(("part", "soon"), [(0.01, True), (0.2, False)])
def test_a_short_time_constant_is_over_within_the_first_poses(part: float, soon: bool) -> None:
    assert is_over_soon(both(np.exp(-SHARE / part)), SHARE) is soon
