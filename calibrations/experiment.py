"""The experiment that tells apart two effects that the data at hand cannot.

`separating` goes by the physics of the two alone. Where a bench is known, each experiment of MENU is planned on it, and
`calibrations/design/expected.py` computes how far apart the two will lie.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass

from calibrations.design.expected import Expected
from calibrations.search.candidates import Candidate
from calibrations.table import Table

TEMPERATURE = {"temperature-bias", "temperature-scale", "temperature-hysteresis"}
TIME = {"warm-up-bias", "warm-up-scale", "bias-drift"}
WARM_C = 45.0  # above what a powered sensor comes to in a room
LEVELS = {"stage-zero-offset", "base-tilt"}
DELAYS = {"output-filter", "sampling-delay"}
TWO_HZ = [10.0, 4.0]  # the usual one, and one well below that is at the same stroke still above the noise
IRON = {"field-strength", "hard-iron", "soft-iron"}
GYROSCOPE = {"gyro-bias", "gyro-scale-factor", "gyro-misalignment", "gyro-g-sensitivity"}
SQUARES = {"quadratic-nonlinearity", "cross-axis-bias", "z-axis-bias"}
FEW, MANY = [90.0, 30.0, 150.0], [90.0, 30.0, 150.0, 60.0, 120.0, 45.0, 135.0, 75.0, 105.0]  # out of order, deg
AS_IT_IS = 0.0  # s without power: the sensor stays on, and its warm-up goes on


@dataclass(frozen=True)
class Experiment:
    """A procedure with settings, what it separates, and why it can.

    Of a known bench also the command line, how long it takes, and what it is expected to tell, where its data can be
    foreseen.
    """

    procedure: str
    settings: Mapping[str, object]
    separates: tuple[tuple[str, str], ...]
    why: str
    command: str = ""
    duration_s: float | None = None
    expected: Expected | None = None


def _of(procedure: str, why: str, **settings: object) -> Experiment:
    return Experiment(procedure, settings, (), why)


FINE = "full turns both ways at finely spaced inclinations, out of order, excite each of them differently"
COARSE = "inclinations out of order: height does not follow time, and what depends on the angle returns with it"
FACES = "mounted face down, an error of the sensor's axes turns with the sensor and one of the stage does not"
LONGER = "longer dwells: the noise of each mean is half as large"
LATER = "with the angles held, what still changes follows the time: an exponential comes to rest, a drift goes on"
HELD = "in the oven the temperature is held, and what still changes follows the time"
CYCLED = "the oven goes up and down again: what lags behind the temperature comes back another way, and time does not"
TURNED_ROUND = "a level laid on the base shows the tilt of the base alone; an offset of alpha moves the table only"
SHAKEN = "in a field of 1 g the squares of the three axes add up to a constant; motion along one axis does not"
RECORDED = "these data have no temperature: with a thermometer read at each pose, they tell what follows it from time"
TWO_TONES = "a corner changes the size of an oscillation with its frequency, a delay only its phase"
ALL_ROUND = "full turns on each edge, upward and downward, show every side of the sphere of directions"
SIX_FACES = "turned about each edge both ways, and at rest on six faces, rate, specific force and time go separate ways"

MENU = (
    _of("sweep", COARSE, step_deg=30.0, inclinations_deg=FEW),
    _of("sweep", COARSE, step_deg=20.0, inclinations_deg=MANY[:7]),
    _of("sweep", FINE, step_deg=10.0, inclinations_deg=MANY),
    _of("sweep", FACES, face="both", step_deg=45.0, inclinations_deg=FEW),
    _of("sweep", FACES, face="both", step_deg=30.0, inclinations_deg=MANY[:7]),
    _of("sweep", LONGER, step_deg=30.0, inclinations_deg=FEW, dwell_s=20.0),
    _of("soak", LATER, duration_s=1800.0, interval_s=300.0, off_s=AS_IT_IS),
    _of("soak", LATER, duration_s=7200.0, interval_s=600.0, off_s=AS_IT_IS),
    _of("soak", HELD, duration_s=3600.0, interval_s=600.0, off_s=AS_IT_IS, oven_c=WARM_C),
    _of("temperature-cycle", CYCLED, temperatures_c=[35.0, 50.0], soak_s=1200.0),
    _of("temperature-cycle", CYCLED),
)
BESIDE = (  # what tells nothing by itself, but much beside data that were taken face up
    _of("sweep", FACES, face="down", step_deg=90.0, inclinations_deg=[90.0, 45.0]),
    _of("sweep", FACES, face="down", step_deg=45.0, inclinations_deg=FEW),
)


LOGGED: tuple[str, dict[str, object], str] = ("sweep", {"step_deg": 30.0, "inclinations_deg": FEW}, RECORDED)


def separating(best: Candidate, table: Table) -> Experiment | None:
    """An experiment for the best candidate and the rivals that this data cannot tell from it."""
    rivals = best.indistinguishable_from
    if not rivals:
        return None
    pairs = tuple((best.name, rival) for rival in rivals)
    unlogged = TEMPERATURE & {best.name, *rivals} and "temperature_c" not in table
    procedure, settings, why = LOGGED if unlogged else by_physics({best.name, *rivals})
    return Experiment(procedure, settings, pairs, why)


def by_physics(names: Set[str]) -> tuple[str, dict[str, object], str]:
    """Procedure, settings, and why they tell effects of these names apart."""
    if names >= SQUARES:
        return "motion", {}, SHAKEN
    if names & IRON:
        return "magnetometer-turn", {}, ALL_ROUND
    if names & GYROSCOPE:
        return "rate-turn", {}, SIX_FACES
    if names <= DELAYS:
        return "motion", {"frequency_hz": TWO_HZ}, TWO_TONES
    if names <= TEMPERATURE:
        return "temperature-cycle", {"temperatures_c": [35.0, 50.0], "soak_s": 1200.0}, CYCLED
    if names <= TIME:
        return "soak", {}, LATER
    if names <= TEMPERATURE | TIME:
        return "soak", {"oven_c": WARM_C}, HELD
    if names <= LEVELS:
        return "level-check", {"on": "base"}, TURNED_ROUND
    if names & {"axis-misalignment"} and names & LEVELS:
        return "sweep", {"face": "both"}, FACES
    return "sweep", {"step_deg": 10.0, "inclinations_deg": MANY}, FINE
