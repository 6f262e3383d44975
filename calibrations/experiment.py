"""The experiment that tells apart two effects that the data at hand cannot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from calibrations.candidates import Candidate

TEMPERATURE = {"temperature-bias", "temperature-scale", "temperature-hysteresis"}
TIME = {"warm-up-bias", "warm-up-scale", "bias-drift"}
WARM_C = 45.0  # above what a powered sensor comes to in a room
LEVELS = {"stage-zero-offset", "base-tilt"}
DELAYS = {"output-filter", "sampling-delay"}
TWO_HZ = "10,4"  # the usual one, and one well below that is at the same stroke still above the noise
SQUARES = {"bias", "quadratic-nonlinearity", "cross-axis-bias", "z-axis-bias"}


@dataclass(frozen=True)
class Experiment:
    """A procedure with settings, what it separates, and why it can."""

    procedure: str
    settings: Mapping[str, object]
    separates: tuple[tuple[str, str], ...]
    why: str


def separating(best: Candidate) -> Experiment | None:
    """An experiment for the best candidate and the rivals that this data cannot tell from it."""
    rivals = best.indistinguishable_from
    if not rivals:
        return None
    pairs = tuple((best.name, rival) for rival in rivals)
    names = {best.name, *rivals}
    if names <= SQUARES:
        why = "in a field of 1 g the squares of the three axes add up to a constant; motion along one axis does not"
        return Experiment("motion", {}, pairs, why)
    if names <= DELAYS:
        why = "a corner changes the size of an oscillation with its frequency, a delay only its phase"
        return Experiment("motion", {"frequency_hz": TWO_HZ}, pairs, why)
    if names <= TEMPERATURE:
        why = "the oven goes up and down again: what lags behind the temperature comes back another way"
        return Experiment("temperature-cycle", {}, pairs, why)
    if names <= TIME:
        why = "over hours an exponential comes to rest, and a drift goes on"
        return Experiment("soak", {}, pairs, why)
    if names <= TEMPERATURE | TIME:
        why = "in the oven the temperature is held, and what still changes follows the time"
        return Experiment("soak", {"oven_c": WARM_C}, pairs, why)
    if names <= LEVELS:
        why = "an offset of alpha and a tilt of the base turn gravity alike at every pose; a digital level tells them"
        return Experiment("level-check", {}, pairs, why)
    if names & {"axis-misalignment"} and names & {"stage-zero-offset", "base-tilt"}:
        why = "mounted face down, an error of the sensor's axes turns with the sensor and one of the stage does not"
        return Experiment("sweep", {"face": "both"}, pairs, why)
    why = "full turns both ways at finely spaced inclinations, out of order, excite each of them differently"
    return Experiment(
        "sweep", {"step_deg": 10.0, "inclinations_deg": [90, 30, 150, 60, 120, 45, 135, 75, 105]}, pairs, why
    )
