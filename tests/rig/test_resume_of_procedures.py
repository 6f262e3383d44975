"""Procedures that decide, heat or switch on their way: a run that was interrupted equals one that was not."""

from __future__ import annotations

import numpy as np
import pytest

from rig.record import Record
from tests.rig.conftest import Rig
from tests.rig.rigging import sigterm_at
from tests.slow import first_fast

UNATTENDED = ("--dwell-s", "0.2", "--unattended", "--json")


@pytest.mark.sockets
@pytest.mark.parametrize(
    ("procedure", "at_pose"),
    first_fast(
        [
            (("misalignment", "--most-rounds", "1"), 12),
            (("temperature-cycle", "--temperatures-c", "40,50", "--soak-s", "1200"), 11),
            (("repeat", "--times", "2"), 21),
        ]
    ),
)
def test_a_resumed_run_equals_an_undisturbed_one_sample_for_sample(
    procedure: tuple[str, ...], at_pose: int, rig: Rig
) -> None:
    whole = rig("run", *procedure, *UNATTENDED).document["run"]
    with sigterm_at(at_pose):
        assert rig("run", *procedure, *UNATTENDED).status == 4
    with Record() as record:
        stopped = record.runs()[0]
    assert (stopped.state, stopped.rows) == ("stopped", at_pose - 1)
    rig("resume", stopped.run, "--unattended", "--json")
    with Record() as record:
        for a, b in zip(record.kept(whole), record.kept(stopped.run), strict=True):
            assert a.pose == b.pose
            np.testing.assert_array_equal(a.samples.volts, b.samples.volts)
        assert record.run(whole).results == record.run(stopped.run).results != {}
