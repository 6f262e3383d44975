"""Procedures that decide, heat or switch on their way: a run that was interrupted equals one that was not."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rig.record import Record
from tests.rig.rigging import in_own_process, signal_at

UNATTENDED = ("--dwell-s", "0.2", "--unattended", "--json")


@pytest.mark.sockets
@pytest.mark.parametrize(
    ("procedure", "at_pose"),
    [
        (("misalignment", "--most-rounds", "1"), 12),
        (("temperature-cycle", "--temperatures-c", "40,50", "--soak-s", "1200"), 11),
        (("repeat", "--times", "2"), 21),
    ],
)
def test_it_goes_on_sample_for_sample(procedure: tuple[str, ...], at_pose: int) -> None:
    whole = json.loads(in_own_process("run", *procedure, *UNATTENDED).stdout)["run"]
    in_own_process("run", *procedure, *UNATTENDED, harm=signal_at("poses", at_pose, "SIGTERM"))
    with Record() as record:
        stopped = record.runs()[0]
    assert (stopped.state, stopped.rows) == ("stopped", at_pose - 1)
    in_own_process("resume", stopped.run, "--unattended", "--json")
    with Record() as record:
        for a, b in zip(record.kept(whole), record.kept(stopped.run), strict=True):
            assert a.pose == b.pose
            np.testing.assert_array_equal(a.samples.volts, b.samples.volts)
        assert record.run(whole).results == record.run(stopped.run).results != {}
