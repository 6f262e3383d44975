"""95 % intervals hold the truth as often as they say, with slow noise and without, and of an effect just added too.

The benchmark asks the same of 200 rigs and of every kind of slow noise.
"""

from __future__ import annotations

import pytest

from tests.hidden.intervals import of_rigs, share

pytestmark = pytest.mark.release

RIGS = 14  # some 100 intervals: chance alone moves their share by 2 %


@pytest.mark.parametrize(("noise", "times"), [("flicker", 0.0), ("flicker", 1.0), ("random walk", 1.0)])
def test_intervals_hold_the_truth_as_often_as_they_say(noise: str, times: float) -> None:
    found = of_rigs(RIGS, noise, times)
    assert len(found) > 6 * RIGS
    assert share(found) > 0.88
    assert share([interval for interval in found if interval.added]) > 0.8
