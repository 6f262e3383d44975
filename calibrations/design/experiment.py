"""The experiment that separates two effects that the present data cannot separate.

`separating_experiment` chooses by the physics of the two alone. Where a bench is known, each experiment of MENU is
planned on it, and `calibrations/design/expected.py` computes how far apart the two will lie.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING

from calibrations.table import Table

if TYPE_CHECKING:
    from calibrations.design.expected import ExpectedResult

TEMPERATURE_EFFECTS = {"temperature-bias", "temperature-scale", "temperature-hysteresis"}
TIME_EFFECTS = {"warm-up-bias", "warm-up-scale", "bias-drift"}
WARM_C = 45.0  # above the temperature of a powered sensor in a room
LEVEL_EFFECTS = {"stage-zero-offset", "base-tilt"}
DELAY_EFFECTS = {"output-filter", "sampling-delay"}
TWO_HZ = [10.0, 4.0]  # the usual one, and one well below that is at the same stroke still above the noise
IRON_EFFECTS = {"field-strength", "hard-iron", "soft-iron"}
GYROSCOPE_EFFECTS = {"gyro-bias", "gyro-scale-factor", "gyro-misalignment", "gyro-g-sensitivity"}
SQUARE_EFFECTS = {"quadratic-nonlinearity", "cross-axis-bias", "z-axis-bias"}
FEW, MANY = [90.0, 30.0, 150.0], [90.0, 30.0, 150.0, 60.0, 120.0, 45.0, 135.0, 75.0, 105.0]  # out of order, deg
STAY_POWERED = 0.0  # s without power: the sensor stays on, and its warm-up goes on


@dataclass(frozen=True)
class Experiment:
    """A procedure with settings, the effects that it separates, and the reason.

    For a known bench also the command line, the duration, and the expected separation if its data can be predicted.
    """

    procedure: str
    settings: Mapping[str, object]
    separates: tuple[tuple[str, str], ...]
    why: str
    command: str = ""
    duration_s: float | None = None
    expected: ExpectedResult | None = None


def _experiment(procedure: str, reason: str, **settings: object) -> Experiment:
    return Experiment(procedure, settings, (), reason)


FINE = "full turns in both directions at many inclinations in mixed order excite each of these effects differently"
COARSE = (
    "inclinations in mixed order: the height does not follow time, and an effect of the angle repeats with the angle"
)
FACES = "with the sensor face down, an error of its axes turns with the sensor, but an error of the stage does not"
LONGER = "longer dwells: the noise of each mean is half as large"
LATER = "with fixed angles, all changes follow the time: an exponential settles, a drift continues"
HELD_TEMPERATURE = "the oven keeps the temperature constant, so all changes follow the time"
CYCLED_TEMPERATURE = (
    "the oven heats and cools: an effect with a lag differs between both directions, an effect of time does not"
)
TURNED_ROUND = "a level on the base shows only the tilt of the base; an offset of alpha moves only the table"
SHAKEN_SENSOR = "at rest the squares of the three axes add up to a constant; in a motion along one axis they do not"
RECORDED_TEMPERATURE = "this data has no temperature: a thermometer read at each pose separates temperature from time"
TWO_TONES = "a corner changes the size of an oscillation with its frequency, a delay only its phase"
ALL_ROUND = "full turns on each edge, upward and downward, show every side of the sphere of directions"
SIX_FACES = "turns about each edge in both directions and rests on six faces separate rate, specific force and time"

MENU = (
    _experiment("sweep", COARSE, step_deg=30.0, inclinations_deg=FEW),
    _experiment("sweep", COARSE, step_deg=20.0, inclinations_deg=MANY[:7]),
    _experiment("sweep", FINE, step_deg=10.0, inclinations_deg=MANY),
    _experiment("sweep", FACES, face="both", step_deg=45.0, inclinations_deg=FEW),
    _experiment("sweep", FACES, face="both", step_deg=30.0, inclinations_deg=MANY[:7]),
    _experiment("sweep", LONGER, step_deg=30.0, inclinations_deg=FEW, dwell_s=20.0),
    _experiment("soak", LATER, duration_s=1800.0, interval_s=300.0, off_s=STAY_POWERED),
    _experiment("soak", LATER, duration_s=7200.0, interval_s=600.0, off_s=STAY_POWERED),
    _experiment("soak", HELD_TEMPERATURE, duration_s=3600.0, interval_s=600.0, off_s=STAY_POWERED, oven_c=WARM_C),
    _experiment("temperature-cycle", CYCLED_TEMPERATURE, temperatures_c=[35.0, 50.0], soak_s=1200.0),
    _experiment("temperature-cycle", CYCLED_TEMPERATURE),
)
ADDITIONS = (  # not useful alone, but together with data taken face up
    _experiment("sweep", FACES, face="down", step_deg=90.0, inclinations_deg=[90.0, 45.0]),
    _experiment("sweep", FACES, face="down", step_deg=45.0, inclinations_deg=FEW),
)


LOGGED_SWEEP: tuple[str, dict[str, object], str] = (
    "sweep",
    {"step_deg": 30.0, "inclinations_deg": FEW},
    RECORDED_TEMPERATURE,
)


def separating_experiment(name: str, rivals: Sequence[str], table: Table) -> Experiment:
    """An experiment for an effect and the rivals that this data cannot separate from it."""
    unlogged = TEMPERATURE_EFFECTS & {name, *rivals} and "temperature_c" not in table
    procedure, settings, reason = LOGGED_SWEEP if unlogged else experiment_by_physics({name, *rivals})
    return Experiment(procedure, settings, tuple((name, rival) for rival in rivals), reason)


def experiment_by_physics(names: Set[str]) -> tuple[str, dict[str, object], str]:
    """Procedure, settings, and why they separate effects of these names."""
    if names >= SQUARE_EFFECTS:
        return "motion", {}, SHAKEN_SENSOR
    if names & IRON_EFFECTS:
        return "magnetometer-turn", {}, ALL_ROUND
    if names & GYROSCOPE_EFFECTS:
        return "rate-turn", {}, SIX_FACES
    if names <= DELAY_EFFECTS:
        return "motion", {"frequency_hz": TWO_HZ}, TWO_TONES
    if names <= TEMPERATURE_EFFECTS:
        return "temperature-cycle", {"temperatures_c": [35.0, 50.0], "soak_s": 1200.0}, CYCLED_TEMPERATURE
    if names <= TIME_EFFECTS:
        return "soak", {}, LATER
    if names <= TEMPERATURE_EFFECTS | TIME_EFFECTS:
        return "soak", {"oven_c": WARM_C}, HELD_TEMPERATURE
    if names <= LEVEL_EFFECTS:
        return "level-check", {"on": "base"}, TURNED_ROUND
    if names & {"axis-misalignment"} and names & LEVEL_EFFECTS:
        return "sweep", {"face": "both"}, FACES
    return "sweep", {"step_deg": 10.0, "inclinations_deg": MANY}, FINE
