"""What one sweep cannot tell apart, the proposed experiment tells, whichever of the two is the truth.

The rigs are mechanisms of `drivers.world`; the experiment is carried out on the same rig, which goes on in time.
"""

from __future__ import annotations

from typing import Any

import pytest

from calibrations.design.experiment import Experiment
from calibrations.effects.catalogue import catalogue
from calibrations.loop import discover
from calibrations.model.file import read_model
from drivers.world.config import WorldConfig
from rig.bench import read_bench
from rig.planning.next_experiment import with_next_experiment
from tests.hidden.defects import DEFECTS
from tests.hidden.quick_rig import QuickRig
from tests.slow import first_fast

IDEAL = WorldConfig.ideal()
WARMING: dict[str, Any] = {"heat": {"board_rise_k": 8.0, "board_rise_s": 900.0, "powered_for_s": 0.0}}
COARSE = Experiment("sweep", {"step_deg": 30.0, "inclinations_deg": [90.0, 30.0, 150.0]}, (), "")
LONG = Experiment("sweep", {"step_deg": 20.0}, (), "")
FLAT = Experiment("sweep", {"step_deg": 10.0, "inclinations_deg": [90.0]}, (), "")


def defect(name: str, size: float) -> WorldConfig:
    return IDEAL.changed(DEFECTS[name].settings(size, y_share=0.7))


# the truth, and the sweep that cannot tell it from a rival -> its name, and the procedure that can
CASES = {
    "a sensor that is turned": (
        IDEAL.changed({"sensor": {"package": {"turn_z_deg": 0.05}}}), COARSE, "axis-misalignment", "sweep",
    ),
    "a stage that is turned": (
        IDEAL.changed({"stages": {"beta": {"zero_offset_deg": 0.05}}}), COARSE, "stage-zero-offset", "sweep",
    ),
    "stress while it warms": (
        defect("package stress", 2.0).changed(WARMING), LONG, "temperature-bias", "temperature-cycle",
    ),
    "charge while it warms": (
        defect("creeping charge", 1.0).changed(WARMING), LONG, "warm-up-bias", "temperature-cycle",
    ),
    "load of the other axis on one circle": (
        defect("foreshortened beams", 0.5), FLAT, "cross-axis-bias", "sweep",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", first_fast(CASES))
def test_the_proposed_experiment_tells_which_it_is(case: str) -> None:
    config, first, truth, procedure = CASES[case]
    bench, effects = read_bench(None), catalogue()
    rig = QuickRig(config, 1, bench)
    before = with_next_experiment(discover(rig.measure(first)[1], read_model("linear")), effects, bench, None)
    assert before.verdict == "ambiguous"
    (cause,) = before.causes
    assert truth in {cause, *before.alternatives[cause]}
    e = before.next_experiment
    assert e is not None
    assert e.procedure == procedure
    assert e.expected is not None
    assert e.expected.probability > 0.95
    after = discover(rig.measure(e)[1], read_model("linear"))
    assert (after.verdict, after.causes) == ("adequate", (truth,))
